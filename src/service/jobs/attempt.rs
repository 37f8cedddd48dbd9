//! One attempt at a job, from its scene to its outputs.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use super::watch::{Follower, Watch, heartbeat};
use super::worker::Context;
use super::{EngineSource, log, resume};
use crate::store::{AttemptFiles, Claim, Failure, JobFiles, Objects, ObjectsError, Outcome, Publisher};
use gridfall_core::sim::notice::Notice;
use gridfall_core::sim::setup::Problem;
use gridfall_engine::{EngineError, StateError};
use gridfall_recording::run::{Outputs, ResumeError, Run, RunError, Subject};
use gridfall_recording::{self as recording, Appearance};
use gridfall_scene::{self as scene, Fault};

/// How long after the object storage failed it is tried again.
const RETRY: Duration = Duration::from_secs(2);

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

impl Ending {
    /// In a sentence.
    pub fn describe(&self) -> String {
        match self {
            Self::Finished { outcome: Outcome::Succeeded, .. } => "succeeded".into(),
            Self::Finished { outcome: Outcome::Canceled, .. } => "canceled".into(),
            Self::Finished { outcome: Outcome::Failed(failure), .. } => format!("failed: {}", failure.message),
            Self::Lost(failure) => format!("lost its device: {}", failure.message),
            Self::Stopped => "stopped with the server".into(),
        }
    }
}

impl From<Outcome> for Ending {
    fn from(outcome: Outcome) -> Self {
        Self::Finished { outcome, devices_suspect: false }
    }
}

/// Runs a claimed job. A panic of the engine becomes a failure.
pub(super) fn run(context: &Context, claim: &Claim, files: &JobFiles, source: &dyn EngineSource) -> Ending {
    let watch = Arc::new(Watch::new(context.shared.clone()));
    let every = context.settings.heartbeat_every;
    let beating = context.runtime.spawn(heartbeat(context.store.clone(), claim.clone(), watch.clone(), every));
    let ran = catch_unwind(AssertUnwindSafe(|| execute(context, claim, files, source, &watch)));
    let mut ending = ending(ran, &watch);
    // Before the end is known, so that whoever then reads the log finds it there.
    let holds = context.holds(claim);
    let told = if holds { ending.describe() } else { "ended after the job was taken from it".into() };
    log::note(files, &format!("attempt {}: {told}", claim.attempt));
    if matches!(ending, Ending::Finished { .. }) {
        keep_partial_recording(&files.attempt(claim.attempt));
        // Under the lease: it may take long, and the job is this attempt's as long as it does.
        if let Some(objects) = context.data.objects().filter(|_| holds) {
            ending = publish(context, claim, files, objects, &watch, ending);
        }
    }
    watch.ended.notify_one();
    if let Err(error) = context.runtime.block_on(beating) {
        tracing::error!(job = %claim.id, %error, "the heartbeat ended early");
    }
    ending
}

/// How it ended, by what the run came to.
fn ending(ran: std::thread::Result<Result<(), Stop>>, watch: &Watch) -> Ending {
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

/// Brings here what may be gone on from, however often that must be tried: without it, the work would begin anew.
fn fetch_checkpoints(
    context: &Context,
    claim: &Claim,
    files: &JobFiles,
    objects: &Objects,
    watch: &Watch,
) -> Result<(), Stop> {
    if claim.attempt == 1 {
        return Ok(());
    }
    let mut told = false;
    loop {
        let Err(error) = context.runtime.block_on(objects.fetch_checkpoints(files, claim.attempt)) else {
            return Ok(());
        };
        tracing::warn!(job = %claim.id, %error, "cannot fetch checkpoints; it is tried again");
        if !told {
            log::note(files, &format!("waits for what earlier attempts have left: {}", error.brief()));
        }
        told = true;
        if watch.canceled.load(Ordering::Relaxed) || context.shared.must_stop() {
            return Err(EngineError::Canceled.into());
        }
        std::thread::sleep(RETRY);
    }
}

/// Takes the outputs to the object storage, however often that must be tried. What has ended another way by then is
/// returned.
fn publish(
    context: &Context,
    claim: &Claim,
    files: &JobFiles,
    objects: &Objects,
    watch: &Watch,
    ending: Ending,
) -> Ending {
    let mut told = false;
    let mut publisher = Publisher::new(objects, files, claim.attempt);
    loop {
        match context.runtime.block_on(publisher.publish()) {
            Ok(()) => return ending,
            Err(error @ (ObjectsError::Taken(_) | ObjectsError::Io { .. })) => {
                log::note(files, &format!("attempt {}: failed: {}", claim.attempt, error.brief()));
                return Outcome::Failed(Failure::new("output", error.brief())).into();
            }
            Err(error) => {
                tracing::warn!(job = %claim.id, %error, "cannot publish; it is tried again");
                if !told {
                    log::note(files, &format!("the outputs are kept here for now: {}", error.brief()));
                }
                told = true;
            }
        }
        // It ends at last as it does, with what is here, or begins again where its last checkpoint was.
        if watch.canceled.load(Ordering::Relaxed) {
            return Outcome::Canceled.into();
        }
        if context.shared.must_stop() {
            return Ending::Stopped;
        }
        std::thread::sleep(RETRY);
    }
}

/// Completes the recording of a canceled or failed attempt.
pub(super) fn keep_partial_recording(files: &AttemptFiles) {
    let partial = files.partial_recording();
    if partial.exists()
        && let Err(error) = recording::recover(&partial, &files.recording())
    {
        tracing::warn!(path = %partial.display(), %error, "cannot recover a partial recording");
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
    let own = files.attempt(claim.attempt);
    own.create().map_err(|error| Stop::Failed(Failure::new("output", format!("no room for outputs: {error}"))))?;
    let scene = scene::parse(&claim.scene)?;
    let scene_json = scene.to_json();
    let outputs = outputs(&own);
    if let Some(objects) = context.data.objects() {
        fetch_checkpoints(context, claim, files, objects, watch)?;
    }
    let mut earlier = resume::candidates(files, claim.attempt).into_iter();
    loop {
        let earlier = earlier.next();
        // Anew for each: what a state that cannot be restored leaves is not to be used.
        let loading = Instant::now();
        let Problem { setup, particles } = scene::problem_with(&scene, &context.limits(), &context.data.assets())?;
        let appearance = Appearance::new(&setup, &particles);
        let mut engine = source.engine(&setup, particles)?;
        let noted = context.store.set_backend(claim.id, claim.attempt, engine.backend());
        if let Err(error) = context.runtime.block_on(noted) {
            tracing::warn!(job = %claim.id, %error, "cannot note the device");
        }
        let device = engine.backend().device.clone();
        note_memory(context, source);
        watch.loaded(setup.total_particles() as u64, u64::from(setup.frames));
        let subject = Subject { scene_json: &scene_json, setup: &setup, appearance: &appearance };
        let run = match &earlier {
            None => Run::start(subject, engine.as_ref(), &outputs)?,
            Some(earlier) => match Run::resume(subject, engine.as_mut(), &outputs, earlier) {
                Ok(run) => run,
                Err(ResumeError::State(StateError::Engine(error))) => return Err(error.into()),
                Err(error) => {
                    let frame = earlier.checkpoint.reached.frame;
                    log::note(files, &format!("the checkpoint of frame {frame} is not used: {error}"));
                    continue;
                }
            },
        };
        let from = earlier.map(|earlier| earlier.checkpoint.reached);
        let start = from.as_ref().map_or("from the start".into(), |from| format!("after frame {}", from.frame));
        log::note(files, &format!("attempt {} runs {start} on {device}", claim.attempt));
        log::note(files, &format!("it is integrated {}ly: {}", setup.integrator.name(), setup.integrator_reason));
        for Notice { pointer, reason, remedy, .. } in &setup.notices {
            log::note(files, &format!("{pointer}: {reason}; {remedy}"));
        }
        watch.reached(&setup, from.as_ref());
        let (counters, running) = (&context.shared.counters, Instant::now());
        counters.stage("load", running.duration_since(loading));
        let follower = Follower::new(context, claim, files, watch);
        let ran = run.execute(engine.as_mut(), &follower);
        counters.stage("simulate", running.elapsed());
        note_memory(context, source);
        ran?;
        return Ok(());
    }
}

/// Shows operators what is taken of the GPU.
fn note_memory(context: &Context, source: &dyn EngineSource) {
    if let (Some(bytes), Some(gpu)) = (source.memory_bytes(), source.devices().first()) {
        context.shared.counters.memory(gpu.device.clone(), bytes);
    }
}

/// Where the results of an attempt go.
pub(super) fn outputs(files: &AttemptFiles) -> Outputs {
    Outputs {
        recording: files.recording(),
        thumbnail: Some(files.thumbnail()),
        diagnostics: Some(files.diagnostics()),
        solver: Some(files.solver()),
        state: Some(files.state()),
        checkpoints: Some(files.checkpoints()),
    }
}

/// The message of a panic.
pub fn panic_message(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().copied().or_else(|| panic.downcast_ref::<String>().map(String::as_str));
    text.unwrap_or("a panic without a message").to_owned()
}
