//! The workers: threads that own devices, and run one job after the other.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use tokio::runtime::Handle;
use tokio::sync::Notify;
use tokio::time::timeout;
use uuid::Uuid;

use super::attempt::{self, Ending, keep_partial_recording};
use super::cluster::{Cluster, Dispatcher};
use super::{DeviceState, EngineSource, OpenDevices, Shared, StatusLabel, log};
use crate::store::{Claim, DataDir, Job, JobFiles, JobStore, ObjectsError, Outcome, Publisher, Status, StoreError};
use gridfall_scene::Limits;

/// How long to wait before retrying a failed device or store.
const RETRY: Duration = Duration::from_secs(2);
/// How long an idle worker sleeps before it looks for jobs whose workers are gone.
const IDLE: Duration = Duration::from_secs(3);

/// How a worker runs jobs.
#[derive(Clone, Copy, Debug)]
pub struct Settings {
    pub limits: Limits,
    /// Wall time between checkpoints.
    pub checkpoint_every: Duration,
    /// How often progress is written and cancellation is checked.
    pub heartbeat_every: Duration,
    /// How long a run may take to reach the end of its frame, where it saves its state, when it is to stop.
    pub grace: Duration,
    /// Jobs that a device may run beside another one, and the most particles that they may have.
    pub small_jobs: usize,
    pub small_particles: u64,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            limits: Limits::default(),
            checkpoint_every: Duration::from_secs(30),
            heartbeat_every: Duration::from_millis(250),
            grace: Duration::from_secs(3),
            small_jobs: 0,
            small_particles: 20_000,
        }
    }
}

/// What runs the jobs of a server.
pub enum Executor {
    /// Threads of the server, with these devices.
    Local(Vec<OpenDevices>),
    /// A cluster's scheduler.
    Cluster {
        cluster: Arc<dyn Cluster>,
        /// How often it is looked at.
        every: Duration,
        /// Jobs that it may hold at a time.
        most: usize,
    },
}

/// The running workers of a server, or what hands its jobs to a cluster.
#[derive(Debug)]
pub struct Workers {
    shared: Arc<Shared>,
    threads: Vec<JoinHandle<()>>,
    dispatcher: Option<tokio::task::JoinHandle<()>>,
}

impl Workers {
    /// Cleans up what the previous server left behind, then starts taking jobs. Call inside a tokio runtime.
    pub async fn start(
        store: JobStore,
        data: Arc<DataDir>,
        settings: Settings,
        executor: Executor,
    ) -> Result<Self, StoreError> {
        let owner = data.owner()?;
        recover(&store, &data, &owner).await?;
        let open = match executor {
            Executor::Local(open) => open,
            Executor::Cluster { cluster, every, most } => {
                let shared = Arc::new(Shared::new(1, settings.grace));
                let dispatcher = Dispatcher::new(store, data, shared.clone(), cluster, every, most);
                let dispatcher = Some(tokio::spawn(dispatcher.run()));
                return Ok(Self { shared, threads: Vec::new(), dispatcher });
            }
        };
        let shared = Arc::new(Shared::new(open.len(), settings.grace));
        let context = Context { store, data, owner, settings, shared: shared.clone(), runtime: Handle::current() };
        let start = |(worker, open): (usize, OpenDevices)| {
            let context = context.clone();
            let thread = std::thread::Builder::new().name(format!("worker {worker}"));
            let work = move || {
                super::yield_to_requests();
                context.work(worker, open);
            };
            thread.spawn(work).expect("the system has room for one more thread")
        };
        let threads = open.into_iter().enumerate().map(start).collect();
        Ok(Self { shared, threads, dispatcher: None })
    }

    pub fn shared(&self) -> Arc<Shared> {
        self.shared.clone()
    }

    /// Makes the workers put back their jobs, and waits at most `patience` for them to end.
    pub async fn stop(self, patience: Duration) {
        self.shared.stop();
        if let Some(dispatcher) = self.dispatcher {
            // An offer that is not noted is made again, and one of both is taken.
            dispatcher.abort();
        }
        let join = || self.threads.into_iter().map(JoinHandle::join).filter(Result::is_err).count();
        match timeout(patience, tokio::task::spawn_blocking(join)).await {
            Ok(Ok(0)) => {}
            Ok(_) => tracing::error!("a worker panicked"),
            Err(_) => tracing::warn!("a worker did not stop in time; its job counts as interrupted by a crash"),
        }
    }
}

/// Handles the jobs that were running when the previous server died, and files that belong to no
/// job.
async fn recover(store: &JobStore, data: &Arc<DataDir>, owner: &str) -> Result<(), StoreError> {
    for job in store.recover(owner, |id| log::tail(&data.job(id))).await? {
        tracing::warn!(job = %job.id, status = %job.status, "found running after a crash");
        let files = data.job(job.id);
        log::note(&files, &format!("the server died; the job is {}", job.status));
        if job.status.is_terminal() {
            put_in_order(store, data, job.id).await;
        }
    }
    // What is there is looked at first: what is added meanwhile is of jobs that the database knows.
    let left = data.left().await?;
    match data.sweep(&left, &store.ids().await?).await {
        Ok(false) => {}
        Ok(true) => tracing::warn!(
            "the job database knows none of the jobs whose files are in the data directory; if it is the wrong one, \
             restart with --database; if not, remove the folders in jobs/"
        ),
        Err(error) => tracing::warn!(%error, "cannot remove the files of deleted jobs"),
    }
    Ok(())
}

/// Does for a job that has ended without its last attempt what that had been to do. Where files are in an object
/// storage, that may take long: it is done aside, and by [`complete`] on request if it fails.
pub(super) async fn put_in_order(store: &JobStore, data: &Arc<DataDir>, id: Uuid) {
    let Ok(Some(job)) = store.get(id).await else { return };
    let own = data.clone();
    let done = tokio::spawn(async move {
        if let Err(error) = complete(&own, &job).await {
            tracing::warn!(job = %id, %error, "cannot complete what a job has left; it is tried again on request");
        }
    });
    if data.objects().is_none() {
        let _ = done.await;
    }
}

/// Completes the outputs of a job that has ended, if its last attempt has not.
pub async fn complete(data: &DataDir, job: &Job) -> Result<(), ObjectsError> {
    let files = data.job(job.id);
    let turn = data.completing();
    let _turn = turn.lock().await;
    if let Some(objects) = data.objects()
        && !objects.fetch_rest(&files, job.attempt).await?
    {
        return Ok(());
    }
    let at = |error| ObjectsError::Io { path: files.folder(), error };
    let attempts = files.attempts().map_err(at)?;
    let Some(&last) = attempts.iter().find(|&&attempt| attempt <= job.attempt) else { return Ok(()) };
    if last < job.attempt {
        // One that left nothing: what was before it is what the job comes to.
        std::fs::rename(files.attempt(last).folder(), files.folder().join(job.attempt.to_string())).map_err(at)?;
    }
    let own = files.attempt(job.attempt);
    let kept = tokio::task::spawn_blocking(move || keep_partial_recording(&own)).await;
    kept.map_err(|error| at(std::io::Error::other(error)))?;
    if let Some(objects) = data.objects() {
        Publisher::new(objects, &files, job.attempt).publish().await?;
        objects.tidy(job.id, job.attempt).await?;
    }
    tidy(&files, job.attempt);
    Ok(())
}

/// Removes what only a job that goes on needs.
fn tidy(files: &JobFiles, attempt: i64) {
    let checkpoints = files.attempt(attempt).checkpoints();
    let removed = if checkpoints.exists() { std::fs::remove_dir_all(checkpoints) } else { Ok(()) };
    if let Err(error) = removed.and_then(|()| files.forget_before(attempt)) {
        tracing::warn!(job = %files.folder().display(), %error, "cannot remove what a job no longer needs");
    }
}

/// Everything that a worker's thread needs.
#[derive(Clone)]
pub(super) struct Context {
    pub store: JobStore,
    pub data: Arc<DataDir>,
    /// The name of this server in leases.
    pub owner: String,
    pub settings: Settings,
    pub shared: Arc<Shared>,
    pub runtime: Handle,
}

impl Context {
    pub fn limits(&self) -> Limits {
        self.settings.limits
    }

    fn work(self, worker: usize, open: OpenDevices) {
        while !self.shared.stopping() {
            let Some(source) = self.open_devices(worker, &open) else { continue };
            let lost = AtomicBool::new(false);
            // Small jobs leave most of a device idle: others run on it beside them.
            std::thread::scope(|scope| {
                for _ in 0..self.settings.small_jobs {
                    scope.spawn(|| {
                        super::yield_to_requests();
                        let wake = &self.shared.wake_small;
                        self.work_off(source.as_ref(), self.settings.small_particles, wake, &lost);
                    });
                }
                self.work_off(source.as_ref(), u64::MAX, &self.shared.wake, &lost);
            });
        }
        self.shared.set_device(worker, DeviceState::Stopped);
        self.shared.wake();
    }

    /// Runs jobs of no more than so many particles, one after the other, until the device is lost or the server stops.
    fn work_off(&self, source: &dyn EngineSource, most_particles: u64, wake: &Notify, lost: &AtomicBool) {
        while !self.shared.stopping() && !lost.load(Ordering::Relaxed) {
            match self.runtime.block_on(self.store.claim_up_to(&self.owner, most_particles)) {
                Ok(Some(claim)) => {
                    // There may be a job for another worker, too.
                    self.shared.wake();
                    if self.run(&claim, source) == Afterwards::ReopenDevices {
                        lost.store(true, Ordering::Relaxed);
                    }
                }
                Ok(None) => {
                    // Leases run out without a wake-up call.
                    let _ = self.runtime.block_on(async { timeout(IDLE, wake.notified()).await });
                }
                Err(error) => {
                    tracing::error!(%error, "cannot claim a job");
                    self.pause();
                }
            }
        }
        // One that is about to wait is woken by the next one's end.
        self.shared.wake();
    }

    fn open_devices(&self, worker: usize, open: &OpenDevices) -> Option<Box<dyn EngineSource>> {
        self.shared.set_device(worker, DeviceState::Opening);
        let reason = match catch_unwind(AssertUnwindSafe(open)) {
            Ok(Ok(source)) => {
                self.shared.set_devices(worker, source.devices());
                self.shared.set_device(worker, DeviceState::Ready(source.describe()));
                return Some(source);
            }
            Ok(Err(error)) => error.to_string(),
            Err(panic) => attempt::panic_message(panic.as_ref()),
        };
        tracing::error!(reason, "no device can be opened; jobs wait");
        self.shared.set_device(worker, DeviceState::Unusable(reason));
        self.pause();
        None
    }

    /// Runs a claimed job and records how it ended.
    pub fn run(&self, claim: &Claim, source: &dyn EngineSource) -> Afterwards {
        let _span = tracing::info_span!("attempt", job = %claim.id, attempt = claim.attempt).entered();
        tracing::info!("started");
        let started = Instant::now();
        self.count_wait(claim);
        let files = self.data.job(claim.id);
        let ending = attempt::run(self, claim, &files, source);
        let status = self.note(claim, &ending);
        tracing::info!(?ending, "ended");
        match status {
            Some(status) => self.shared.counters.attempted(status, started.elapsed()),
            None => drop(self.shared.counters.leases_lost.inc()),
        }
        if let Some(status) = status.filter(|status| status.is_terminal()) {
            self.shared.counters.finished.get_or_create(&StatusLabel { status }).inc();
            if matches!(ending, Ending::Stopped) {
                // It was canceled while it was to stop.
                self.runtime.block_on(put_in_order(&self.store, &self.data, claim.id));
            }
            tidy(&files, claim.attempt);
            if let Some(objects) = self.data.objects()
                && let Err(error) = self.runtime.block_on(objects.tidy(claim.id, claim.attempt))
            {
                tracing::warn!(%error, "cannot remove objects that a job no longer needs");
            }
        }
        match ending {
            Ending::Lost(_) | Ending::Finished { devices_suspect: true, .. } => Afterwards::ReopenDevices,
            _ => Afterwards::GoOn,
        }
    }

    /// Whether the job is still this attempt's, as far as that can be known.
    pub fn holds(&self, claim: &Claim) -> bool {
        match self.runtime.block_on(self.store.get(claim.id)) {
            Ok(job) => job.is_some_and(|job| job.status == Status::Running && job.attempt == claim.attempt),
            Err(_) => true,
        }
    }

    /// How long a job that runs for the first time has waited.
    fn count_wait(&self, claim: &Claim) {
        if claim.attempt == 1
            && let Ok(Some(job)) = self.runtime.block_on(self.store.get(claim.id))
            && let Ok(wait) = Duration::try_from(jiff::Timestamp::now().duration_since(job.created_at))
        {
            self.shared.counters.waited(wait);
        }
    }

    /// Writes an attempt's ending to the store and retries until that succeeds: a job must not stay
    /// `running`.
    fn note(&self, claim: &Claim, ending: &Ending) -> Option<Status> {
        let Claim { id, attempt, .. } = *claim;
        loop {
            let noted = self.runtime.block_on(async {
                match ending {
                    Ending::Finished { outcome, .. } => self.store.finish(id, attempt, outcome).await.map(|mine| {
                        mine.then_some(match outcome {
                            Outcome::Succeeded => Status::Succeeded,
                            Outcome::Failed(_) => Status::Failed,
                            Outcome::Canceled => Status::Canceled,
                        })
                    }),
                    Ending::Lost(failure) => self.store.lose(id, attempt, failure).await,
                    Ending::Stopped => self.store.put_back(id, attempt).await,
                }
            });
            match noted {
                Ok(status) => return status,
                Err(error) => tracing::error!(job = %id, %error, "cannot note how a job ended"),
            }
            if self.shared.stopping() {
                return None;
            }
            self.pause();
        }
    }

    /// Waits before a retry, or until the server stops.
    fn pause(&self) {
        let until = std::time::Instant::now() + RETRY;
        while !self.shared.stopping() && std::time::Instant::now() < until {
            std::thread::sleep(Duration::from_millis(50));
        }
    }
}

/// What remains to be done after an attempt.
#[derive(PartialEq, Eq)]
pub(super) enum Afterwards {
    GoOn,
    ReopenDevices,
}
