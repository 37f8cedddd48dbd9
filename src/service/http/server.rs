//! A server: store, worker and API together, from start to graceful shutdown.

use std::future::Future;
use std::io;
use std::net::SocketAddr;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use tokio::net::TcpListener;
use tokio::sync::oneshot;

use super::connections;
use super::router::router;
use super::state::{Api, Config};
use super::tls::{Certificate, Tls, TlsError};
use crate::jobs::retention::{self, Keep};
use crate::jobs::{Executor, Settings, Workers};
use crate::store::{DataDir, JobStore, Objects, StoreError};

/// How long open connections may continue after shutdown was requested. Downloads are then cut off.
const DRAIN: Duration = Duration::from_secs(2);
/// How long the worker may take to put its job back.
const WORKER_PATIENCE: Duration = Duration::from_secs(5);
/// How often to look for jobs that are past their deadline, and for how many such looks nothing is removed.
const HOUSEKEEPING: Duration = Duration::from_secs(2);
const ROUNDS_BETWEEN_TIDYING: u32 = 15;

/// Configuration of a server.
pub struct Options {
    pub listen: SocketAddr,
    pub data_dir: PathBuf,
    /// URL of the job database; a file in the data directory by default.
    pub database: Option<String>,
    /// The object storage for the files of jobs and uploads, and how much room large copies of these may take here
    /// (bytes).
    pub files: Option<(String, u64)>,
    /// Accept a `listen` address that other machines can reach, although there are no keys.
    pub insecure_no_auth: bool,
    /// Speak TLS, by this certificate.
    pub certificate: Option<Certificate>,
    /// How much of what has ended is kept.
    pub keep: Keep,
    pub config: Config,
    /// Wall time between checkpoints.
    pub checkpoint_every: Duration,
    /// Jobs that a device may run beside another one, and the most particles that they may have.
    pub small_jobs: (usize, u64),
    pub executor: Executor,
}

#[derive(Debug, thiserror::Error)]
pub enum ServeError {
    #[error(
        "--listen {0} is open to other machines, and there are no keys: anyone who can reach it could run and delete \
         jobs. Make a key first, for the same --data-dir or --database (`gridfall keys create NAME`), listen on a \
         loopback address (127.0.0.1), or, where the network itself keeps strangers out, pass --insecure-no-auth"
    )]
    OpenToStrangers(SocketAddr),
    #[error(transparent)]
    Tls(#[from] TlsError),
    #[error("cannot listen on {address}: {error}; choose another --listen address")]
    Listen { address: SocketAddr, error: io::Error },
    #[error(transparent)]
    Store(#[from] StoreError),
    #[error("serving failed: {0}")]
    Serve(io::Error),
}

impl ServeError {
    /// True if other options would help.
    pub fn is_bad_input(&self) -> bool {
        match self {
            Self::OpenToStrangers(_) | Self::Listen { .. } | Self::Tls(_) => true,
            Self::Store(error) => {
                matches!(
                    error,
                    StoreError::Locked { .. }
                        | StoreError::Url { .. }
                        | StoreError::Unreachable { .. }
                        | StoreError::Objects(_)
                )
            }
            Self::Serve(_) => false,
        }
    }
}

/// Does what is due without a request, for ever.
async fn keep_house(store: JobStore, data: Arc<DataDir>, keep: Keep, room: u64) {
    let owner = data.owner().unwrap_or_default();
    let mut rounds = (0..ROUNDS_BETWEEN_TIDYING).cycle();
    loop {
        if let Err(error) = store.fail_overdue().await {
            tracing::warn!(%error, "cannot fail jobs that are past their deadline");
        }
        if let Err(error) = retention::measure(&store, &data, &owner).await {
            tracing::warn!(%error, "cannot measure what jobs have left");
        }
        let tidies = rounds.next() == Some(0);
        if tidies && keep != Keep::default() {
            match retention::tidy(&store, &data, keep).await {
                Ok(0) => {}
                Ok(jobs) => tracing::info!(jobs, "removed jobs that are not to be kept any longer"),
                Err(error) => tracing::warn!(%error, "cannot remove jobs that are not to be kept any longer"),
            }
        }
        if tidies {
            // It looks at the folders of all jobs.
            let copies = data.clone();
            if let Ok(Err(error)) = tokio::task::spawn_blocking(move || copies.make_room(room)).await {
                tracing::warn!(%error, "cannot remove copies of what the object storage has");
            }
        }
        tokio::time::sleep(HOUSEKEEPING).await;
    }
}

/// Serves until `shutdown` resolves, then ends gracefully: no new connections, and the running job
/// goes back into the queue. `listening` is called with the address once requests are accepted.
pub async fn serve(
    options: Options,
    listening: impl FnOnce(SocketAddr),
    shutdown: impl Future<Output = ()> + Send + 'static,
) -> Result<(), ServeError> {
    let tls = options.certificate.map(Tls::open).transpose()?.map(Arc::new);
    let Options {
        listen,
        data_dir,
        database,
        files,
        insecure_no_auth,
        keep,
        config,
        checkpoint_every,
        small_jobs,
        executor,
        ..
    } = options;
    let mut data = DataDir::open(&data_dir)?;
    let store = match &database {
        Some(url) => JobStore::connect(url).await?,
        None => JobStore::open(&data.database()).await?,
    };
    if let Some((url, _)) = &files {
        let objects = Objects::open(url).await.map_err(StoreError::from)?;
        objects.belong_to(&store.identity().await?).await.map_err(StoreError::from)?;
        data = data.with_objects(objects);
        let assets = data.assets();
        tokio::task::spawn_blocking(move || {
            if let Err(error) = assets.share_all() {
                tracing::warn!(%error, "cannot take all uploads to the object storage; the next start tries again");
            }
        });
    }
    let (data, room) = (Arc::new(data), files.map_or(u64::MAX, |(_, room)| room));
    let asks = config.require_keys || store.has_keys().await?;
    if !listen.ip().is_loopback() && !asks {
        if !insecure_no_auth {
            return Err(ServeError::OpenToStrangers(listen));
        }
        tracing::warn!("{listen} is open to other machines and nobody is asked for a key (--insecure-no-auth)");
    }
    if !listen.ip().is_loopback() && asks && tls.is_none() {
        tracing::warn!("{listen} is open to other machines without TLS: whoever is on their way can read keys");
    }
    let listener = TcpListener::bind(listen).await.map_err(|error| ServeError::Listen { address: listen, error })?;
    let address = listener.local_addr().map_err(ServeError::Serve)?;
    let (small_jobs, small_particles) = small_jobs;
    let settings =
        Settings { limits: config.limits, checkpoint_every, small_jobs, small_particles, ..Settings::default() };
    let workers = Workers::start(store.clone(), data.clone(), settings, executor).await?;
    let housekeeper = tokio::spawn(keep_house(store.clone(), data.clone(), keep, room));
    let follower = tls.clone().map(|tls| tokio::spawn(tls.follow()));
    let api = Api::new(store.clone(), data, workers.shared(), config);
    let deliverer = tokio::spawn(api.deliverer().run());
    let (config, app) = (api.config.clone(), router(api));

    let (asked, end) = oneshot::channel();
    let mut server = tokio::spawn(async move {
        let stop = async {
            shutdown.await;
            tracing::info!("shutting down");
            // Whoever waits for this may be gone.
            let _ = asked.send(());
        };
        connections::serve(listener, tls, app, &config, stop).await;
    });
    listening(address);
    // An error means that the server's task has died, which ends the server, too.
    let _ = end.await;
    workers.shared().stop();
    if tokio::time::timeout(DRAIN, &mut server).await.is_err() {
        server.abort();
    }
    housekeeper.abort();
    if let Some(follower) = follower {
        follower.abort();
    }
    // What is being sent is sent again later.
    deliverer.abort();
    workers.stop(WORKER_PATIENCE).await;
    store.close().await;
    Ok(())
}
