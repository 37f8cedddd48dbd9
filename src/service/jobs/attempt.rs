//! One attempt at a job, from its scene to its outputs.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};

use tokio::sync::Notify;
use tokio::time::timeout;

use super::worker::Context;
use super::{EngineSource, Shared};
use crate::store::{Claim, Failure, JobFiles, JobStore, Outcome, Progress};
use gridfall_core::sim::setup::Problem;
use gridfall_engine::{Control, EngineError};
use gridfall_recording::Appearance;
use gridfall_recording::run::{self, FrameReport, Observer, Outputs, RunError};
use gridfall_scene::{self as scene, Fault};

/// How often progress is written and cancellation is checked.
const HEARTBEAT: Duration = Duration::from_millis(250);

/// How an attempt ended.
#[derive(Debug)]
pub(super) enum Ending {
    /// The job ended too. After a panic the state of the devices is unknown.
    Finished { outcome: Outcome, devices_suspect: bool },
    /// The device was lost; the job may be tried again.
    Lost(Failure),
    /// The server is stopping.
    Stopped,
}

impl From<Outcome> for Ending {
    fn from(outcome: Outcome) -> Self {
        Self::Finished { outcome, devices_suspect: false }
    }
}

/// Runs a claimed job. A panic of the engine becomes a failure.
pub(super) fn run(context: &Context, claim: &Claim, files: &JobFiles, source: &dyn EngineSource) -> Ending {
    let watch = Arc::new(Watch::new(context.shared.clone()));
    let beating = context.runtime.spawn(heartbeat(context.store.clone(), claim.clone(), watch.clone()));
    let ran = catch_unwind(AssertUnwindSafe(|| execute(context, claim, files, source, &watch)));
    watch.ended.notify_one();
    if let Err(error) = context.runtime.block_on(beating) {
        tracing::error!(job = %claim.id, %error, "the heartbeat ended early");
    }
    match ran {
        Ok(Ok(())) => Outcome::Succeeded.into(),
        Ok(Err(Stop::Failed(failure))) => Outcome::Failed(failure).into(),
        Ok(Err(Stop::Engine(error))) => {
            let failure = Failure::new(error.code(), error.to_string());
            match error {
                EngineError::Canceled if watch.canceled.load(Ordering::Relaxed) => Outcome::Canceled.into(),
                EngineError::Canceled => Ending::Stopped,
                EngineError::DeviceLost(_) | EngineError::NoDevice(_) => Ending::Lost(failure),
                _ => Outcome::Failed(failure).into(),
            }
        }
        Err(panic) => {
            let failure = Failure::new("internal", format!("a fault in gridfall: {}", panic_message(panic.as_ref())));
            Ending::Finished { outcome: Outcome::Failed(failure), devices_suspect: true }
        }
    }
}

/// Why an attempt did not finish.
enum Stop {
    Engine(EngineError),
    Failed(Failure),
}

impl From<EngineError> for Stop {
    fn from(error: EngineError) -> Self {
        Self::Engine(error)
    }
}

impl From<RunError> for Stop {
    fn from(error: RunError) -> Self {
        match error {
            RunError::Engine(error) => Self::Engine(error),
            other => Self::Failed(Failure::new(other.code(), other.to_string())),
        }
    }
}

/// The scene was valid when it was accepted, but is not for this version or on this machine.
impl From<Vec<Fault>> for Stop {
    fn from(faults: Vec<Fault>) -> Self {
        let faults: Vec<String> = faults.iter().map(Fault::to_string).collect();
        Self::Failed(Failure::new("invalid_scene", faults.join("; ")))
    }
}

fn execute(
    context: &Context,
    claim: &Claim,
    files: &JobFiles,
    source: &dyn EngineSource,
    watch: &Watch,
) -> Result<(), Stop> {
    files.reset().map_err(|error| Stop::Failed(Failure::new("output", format!("no room for outputs: {error}"))))?;
    let scene = scene::parse(&claim.scene)?;
    let Problem { setup, particles } = scene::problem_with(&scene, &context.limits, &context.data.assets())?;
    let appearance = Appearance::new(&setup, &particles);
    let mut engine = source.engine(&setup, particles)?;
    let noted = context.store.set_backend(claim.id, claim.attempt, engine.backend());
    if let Err(error) = context.runtime.block_on(noted) {
        tracing::warn!(job = %claim.id, %error, "cannot note the device");
    }
    watch.loaded(setup.total_particles() as u64);
    let outputs = Outputs {
        recording: files.recording(),
        thumbnail: Some(files.thumbnail()),
        diagnostics: Some(files.diagnostics()),
        solver: Some(files.solver()),
    };
    run::run(&scene.to_json(), &setup, &appearance, engine.as_mut(), &outputs, watch)?;
    Ok(())
}

/// Writes progress and passes on requests to cancel, until the attempt has ended.
async fn heartbeat(store: JobStore, claim: Claim, watch: Arc<Watch>) {
    loop {
        let ended = timeout(HEARTBEAT, watch.ended.notified()).await.is_ok();
        match store.heartbeat(claim.id, claim.attempt, &watch.progress()).await {
            Ok(true) => {}
            Ok(false) => watch.canceled.store(true, Ordering::Relaxed),
            Err(error) => tracing::warn!(job = %claim.id, %error, "cannot write progress"),
        }
        if ended {
            return;
        }
    }
}

/// What the engine's thread and the heartbeat share.
struct Watch {
    shared: Arc<Shared>,
    canceled: AtomicBool,
    ended: Notify,
    /// Number of particles, and when they were loaded.
    loaded: OnceLock<(u64, Instant)>,
    step: AtomicU64,
    /// Bits of an f64.
    sim_time_s: AtomicU64,
    frames_written: AtomicU64,
}

impl Watch {
    fn new(shared: Arc<Shared>) -> Self {
        Self {
            shared,
            canceled: AtomicBool::new(false),
            ended: Notify::new(),
            loaded: OnceLock::new(),
            step: AtomicU64::new(0),
            sim_time_s: AtomicU64::new(0),
            frames_written: AtomicU64::new(0),
        }
    }

    fn loaded(&self, particles: u64) {
        // An attempt loads its problem once.
        let _ = self.loaded.set((particles, Instant::now()));
    }

    fn progress(&self) -> Progress {
        Progress {
            sim_time_s: f64::from_bits(self.sim_time_s.load(Ordering::Relaxed)),
            step: self.step.load(Ordering::Relaxed),
            frames_written: self.frames_written.load(Ordering::Relaxed),
            run_s: self.loaded.get().map_or(0.0, |(_, since)| since.elapsed().as_secs_f64()),
        }
    }
}

impl Control for Watch {
    fn canceled(&self) -> bool {
        self.canceled.load(Ordering::Relaxed) || self.shared.stopping()
    }

    fn progress(&self, step: u64, time_s: f64) {
        let done = step.saturating_sub(self.step.swap(step, Ordering::Relaxed));
        self.sim_time_s.store(time_s.to_bits(), Ordering::Relaxed);
        let particles = self.loaded.get().map_or(0, |(particles, _)| *particles);
        self.shared.counters.steps.inc_by(done);
        self.shared.counters.particle_steps.inc_by(done * particles);
    }
}

impl Observer for Watch {
    fn frame(&self, report: &FrameReport) {
        Control::progress(self, report.steps, report.time_s);
        self.frames_written.store(report.frame + 1, Ordering::Relaxed);
        self.shared.counters.frames.inc();
    }
}

/// The message of a panic.
pub fn panic_message(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().copied().or_else(|| panic.downcast_ref::<String>().map(String::as_str));
    text.unwrap_or("a panic without a message").to_owned()
}
