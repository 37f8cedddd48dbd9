//! `gridfall worker`: one attempt at a job of a server, in a process of its own.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use clap::Args;
use uuid::Uuid;

use super::device::DeviceArguments;
use super::logs::LogArguments;
use super::serve::{opener, positive, runtime};
use super::{CliError, interrupt};
use gridfall_service::jobs::{Order, ProcessError, Settings, work_off};
use gridfall_service::store::{DataDir, JobStore, Objects, ObjectsError, Status, StoreError};

/// How often progress is written. There may be many such processes.
const HEARTBEAT: Duration = Duration::from_secs(1);
/// How long to wait for the database and the object storage at the start.
const PATIENCE: Duration = Duration::from_secs(300);
/// How long a frame may take to end when the process is to stop. Schedulers kill after 30 s.
const GRACE: Duration = Duration::from_secs(25);

/// Run one attempt at a job of a server: what a server with another --executor than local has its cluster start. On
/// SIGTERM the state is saved, and the job goes back into the queue.
#[derive(Debug, Args)]
pub struct Arguments {
    /// The job.
    #[arg(long, value_name = "ID")]
    job: Uuid,
    /// The number of the attempt. Only one process can run it, and only if the attempt before it is over.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(i64).range(1..))]
    attempt: i64,
    /// What the scheduler calls this process.
    #[arg(long, value_name = "NAME")]
    cluster_job: String,
    /// The server's data directory; with --files, a folder of this machine for what is not there yet.
    #[arg(long, value_name = "DIR", env = "GRIDFALL_DATA_DIR")]
    data_dir: PathBuf,
    /// Where the server keeps its files, if that is not its data directory. See gridfall serve --help.
    #[arg(long, value_name = "URL", env = "GRIDFALL_FILES")]
    files: Option<String>,
    /// The server's database: postgres://USER:PASSWORD@HOST/NAME. Other users of the machine can read command lines:
    /// pass it by the environment.
    #[arg(long, value_name = "URL", env = "GRIDFALL_DATABASE", hide_env_values = true)]
    database: String,
    /// Save the state this often (s).
    #[arg(long, default_value_t = 30.0, value_name = "SECONDS", value_parser = positive)]
    checkpoint_seconds: f64,
    /// End with this code if told to stop, once the job is back in the queue: what it has the scheduler's record say.
    #[arg(long, default_value_t = 0, value_name = "N")]
    stopped_code: u8,
    #[command(flatten)]
    devices: DeviceArguments,
    #[command(flatten)]
    logs: LogArguments,
}

pub fn execute(arguments: Arguments) -> Result<(), CliError> {
    arguments.logs.start()?;
    let runtime = runtime()?;
    let failed = |error: &dyn std::fmt::Display| CliError::Failed(error.to_string());
    let (status, told) = runtime.block_on(async {
        let requested = interrupt::requested().map_err(|error| failed(&error))?;
        let told = Arc::new(AtomicBool::new(false));
        let noted = told.clone();
        let stop = async move {
            requested.await;
            noted.store(true, Ordering::Relaxed);
        };
        let data = match &arguments.files {
            Some(files) => {
                let objects =
                    patiently(|| Objects::open(files), |error| matches!(error, ObjectsError::Unusable { .. }));
                DataDir::scratch(&arguments.data_dir, objects.await.map_err(|error| failed(&error))?)
            }
            None => DataDir::join(&arguments.data_dir),
        };
        let data = data.map_err(|error| failed(&error))?;
        let folder = data.root().to_owned();
        let away = |error: &StoreError| matches!(error, StoreError::Unreachable { .. } | StoreError::Database(_));
        let store = patiently(|| JobStore::connect_sparingly(&arguments.database), away);
        let store = store.await.map_err(|error| failed(&error))?;
        let order = Order {
            store,
            data: Arc::new(data),
            settings: Settings {
                checkpoint_every: Duration::from_secs_f64(arguments.checkpoint_seconds),
                heartbeat_every: HEARTBEAT,
                grace: GRACE,
                ..Settings::default()
            },
            devices: opener(arguments.devices),
            job: arguments.job,
            attempt: arguments.attempt,
            cluster_job: arguments.cluster_job,
        };
        let ended = work_off(order, stop).await;
        if arguments.files.is_some()
            && let Err(error) = std::fs::remove_dir_all(&folder)
        {
            tracing::warn!(%error, folder = %folder.display(), "cannot remove the files of an attempt");
        }
        let status = ended.map(Some).or_else(|error| match error {
            // Another process has it, or nobody wants it any more.
            ProcessError::NotNeeded(_) => {
                tracing::warn!("{error}");
                Ok(None)
            }
            error => Err(failed(&error)),
        })?;
        Ok((status, told.load(Ordering::Relaxed)))
    })?;
    match status {
        None | Some(Status::Queued) if told && arguments.stopped_code > 0 => {
            Err(CliError::Stopped(arguments.stopped_code))
        }
        // So that the scheduler's record says so, too.
        Some(Status::Failed) => Err(CliError::Failed(format!("job {} failed; see its log", arguments.job))),
        _ => Ok(()),
    }
}

/// Tries again while what is needed is away: a database, which may also have no connection left, or the object storage.
async fn patiently<T, E: std::fmt::Display, F: Future<Output = Result<T, E>>>(
    open: impl Fn() -> F,
    is_away: impl Fn(&E) -> bool,
) -> Result<T, E> {
    let started = Instant::now();
    loop {
        match open().await {
            Err(error) if is_away(&error) && started.elapsed() < PATIENCE => {
                tracing::warn!("{error}; it is tried again");
                tokio::time::sleep(HEARTBEAT).await;
            }
            ended => return ended,
        }
    }
}
