//! One attempt in a process of its own, as a cluster's scheduler starts it.

use std::sync::Arc;
use std::time::{Duration, Instant};

use tokio::runtime::Handle;
use tokio::time::sleep;
use uuid::Uuid;

use super::worker::{Afterwards, Context};
use super::{OpenDevices, Settings, Shared};
use crate::store::{Claim, DataDir, JobStore, LEASE, Status, StoreError, Taken, owner};
use gridfall_engine::EngineError;

/// How long to wait for the attempt before this one: for its lease to be over, by whatever clock.
const PATIENCE: Duration = Duration::from_secs(3 * LEASE.as_secs());
/// How long to wait before it is looked again.
const RETRY: Duration = Duration::from_secs(1);

/// What a process is to run.
pub struct Order {
    pub store: JobStore,
    pub data: Arc<DataDir>,
    pub settings: Settings,
    pub devices: OpenDevices,
    pub job: Uuid,
    pub attempt: i64,
    /// The scheduler's name of this process.
    pub cluster_job: String,
}

#[derive(Debug, thiserror::Error)]
pub enum ProcessError {
    #[error("no device can be opened: {0}")]
    Device(#[from] EngineError),
    #[error(transparent)]
    Store(#[from] StoreError),
    #[error("there is nothing to run: {0}")]
    NotNeeded(String),
    #[error("the device was lost; see the job's log")]
    Lost,
    #[error("the process's own thread died")]
    Thread,
}

/// Runs an attempt to its end, or until `stop` resolves: then its state is saved, and the job goes back into the queue.
/// Returns the job's status.
pub async fn work_off(order: Order, stop: impl Future<Output = ()> + Send + 'static) -> Result<Status, ProcessError> {
    let Order { store, data, settings, devices, job, attempt, cluster_job } = order;
    let shared = Arc::new(Shared::new(1, settings.grace));
    let stopping = shared.clone();
    tokio::spawn(async move {
        stop.await;
        stopping.stop();
    });
    let owner = owner(&cluster_job);
    let take = (store.clone(), shared.clone());
    let context = Context { store, data, owner, settings, shared, runtime: Handle::current() };
    let runtime = Handle::current();
    // Devices are used on the thread that opens them. They come first: where there is none, no attempt is lost.
    let run = move || {
        let source = devices()?;
        let (store, shared) = take;
        let claim = runtime.block_on(claim(&store, &shared, job, attempt, &cluster_job))?;
        let afterwards = context.run(&claim, source.as_ref());
        if afterwards == Afterwards::ReopenDevices {
            return Err(ProcessError::Lost);
        }
        let job = runtime.block_on(store.get(job))?;
        job.map(|job| job.status).ok_or_else(|| ProcessError::NotNeeded("the job was deleted".into()))
    };
    tokio::task::spawn_blocking(run).await.map_err(|_| ProcessError::Thread)?
}

/// Claims the job, once the attempt before this one is known to be over.
async fn claim(
    store: &JobStore,
    shared: &Shared,
    job: Uuid,
    attempt: i64,
    cluster_job: &str,
) -> Result<Claim, ProcessError> {
    let started = Instant::now();
    loop {
        let late = started.elapsed() > PATIENCE;
        match store.take(job, attempt, cluster_job).await {
            Ok(Taken::Claimed(claim)) => return Ok(claim),
            Ok(Taken::Never(why)) => return Err(ProcessError::NotNeeded(why)),
            Ok(Taken::NotYet) if late => return Err(ProcessError::NotNeeded("the attempt before lives".into())),
            Err(error) if late || !JobStore::is_away(&error) => return Err(error.into()),
            Ok(Taken::NotYet) | Err(_) => sleep(RETRY).await,
        }
        if shared.stopping() {
            return Err(ProcessError::NotNeeded("it was asked to stop before it had begun".into()));
        }
    }
}
