//! Runs a problem on an engine from the first frame to the last, and writes its results.

mod keeper;

use std::panic::resume_unwind;
use std::path::{Path, PathBuf};
use std::sync::mpsc;
use std::thread;

use crate::appearance::Appearance;
use keeper::Keeper;

use crate::checkpoint::{self, Checkpoint, Draft};
use crate::files::RecordingError;
use crate::picture::thumbnail_selection;
use crate::state;
use gridfall_core::sim::diagnostics::Row;
use gridfall_core::sim::excerpt::Choice;
use gridfall_core::sim::inlet::Inlets;
use gridfall_core::sim::setup::Setup;
use gridfall_engine::{Control, Engine, EngineError, FrameStats, Pending, StateError};

/// Where a run's results go.
#[derive(Clone, Debug)]
pub struct Outputs {
    /// The recording (MCAP).
    pub recording: PathBuf,
    /// A picture of the last frame (PNG).
    pub thumbnail: Option<PathBuf>,
    /// The diagnostics (CSV); each line is written as soon as its frame is done.
    pub diagnostics: Option<PathBuf>,
    /// The steps of the implicit integrator (CSV), written with their frame. An explicit run leaves
    /// only the header.
    pub solver: Option<PathBuf>,
    /// The last state (npz) of a run that keeps it ([`Setup::keep_state`]).
    pub state: Option<PathBuf>,
    /// A folder for checkpoints, which [`Observer::checkpoint_due`] asks for.
    pub checkpoints: Option<PathBuf>,
}

/// A frame that was just written.
#[derive(Clone, Copy, Debug)]
pub struct FrameReport<'a> {
    /// Number of this frame and of the last one; frame 0 is the initial state.
    pub frame: u64,
    pub frames: u64,
    /// Simulated time now and at the end (s).
    pub time_s: f64,
    pub end_s: f64,
    /// Sub-steps done so far in the whole run.
    pub steps: u64,
    pub row: &'a Row,
}

/// Follows a run, and may stop it through [`Control::canceled`].
pub trait Observer: Control {
    /// Called after each frame, frame 0 included, once it is in the recording. The calling thread
    /// is not the one that started the run.
    fn frame(&self, _report: &FrameReport) {}

    /// Asked at each frame boundary but the first and the last: whether to save the run there.
    fn checkpoint_due(&self) -> bool {
        false
    }

    /// Called once a checkpoint of a frame is on the disk, on the thread that calls [`Self::frame`].
    fn checkpointed(&self, _frame: u64) {}

    /// A checkpoint could not be written, and why. The run goes on.
    fn checkpoint_failed(&self, _reason: &str) {}

    /// Asked at each frame boundary but the first and the last: whether the run is saved there, and ends as if
    /// canceled.
    fn pauses(&self) -> bool {
        false
    }
}

/// What is run.
#[derive(Clone, Copy)]
pub struct Subject<'a> {
    /// The scene's document, which goes into the recording.
    pub scene_json: &'a str,
    pub setup: &'a Setup,
    pub appearance: &'a Appearance,
}

/// What an earlier run of the same subject left.
#[derive(Clone, Debug)]
pub struct Earlier {
    pub checkpoint: Checkpoint,
    pub outputs: Outputs,
}

/// The result of a run.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Summary {
    /// Frames in the recording, frame 0 included.
    pub frames_written: u64,
    pub steps: u64,
    /// Simulated time reached (s).
    pub time_s: f64,
}

/// Why a run ended early.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    #[error(transparent)]
    Engine(#[from] EngineError),
    #[error(transparent)]
    Output(#[from] RecordingError),
}

/// Why a run does not go on from a checkpoint.
#[derive(Debug, thiserror::Error)]
pub enum ResumeError {
    /// It is of another scene, build or device.
    #[error("{0}")]
    Foreign(String),
    #[error(transparent)]
    State(#[from] StateError),
    #[error(transparent)]
    Output(#[from] RecordingError),
}

impl From<EngineError> for ResumeError {
    fn from(error: EngineError) -> Self {
        Self::State(error.into())
    }
}

impl RunError {
    /// Stable code for APIs.
    pub fn code(&self) -> &'static str {
        match self {
            Self::Engine(error) => error.code(),
            Self::Output(_) => "output",
        }
    }
}

/// A run that has its files, and its engine at the last frame that is in them.
pub struct Run<'a> {
    subject: Subject<'a>,
    outputs: &'a Outputs,
    keeper: Keeper<'a>,
    /// The first frame that is to be computed.
    next: u64,
}

impl<'a> Run<'a> {
    /// A run from the start, whose problem `engine` has loaded.
    ///
    /// # Errors
    /// When a file cannot be written.
    pub fn start(subject: Subject<'a>, engine: &dyn Engine, outputs: &'a Outputs) -> Result<Self, RunError> {
        let keeper = Keeper::create(subject, engine.backend(), outputs)?;
        Ok(Self { subject, outputs, keeper, next: 0 })
    }

    /// A run that goes on from a checkpoint. Its files will be those of a run that was never interrupted. `engine` has
    /// loaded the problem, and must not be used if this fails.
    ///
    /// # Errors
    /// When what the earlier run left is not whole, or not of this subject; when a file cannot be written.
    pub fn resume(
        subject: Subject<'a>,
        engine: &mut dyn Engine,
        outputs: &'a Outputs,
        earlier: &Earlier,
    ) -> Result<Self, ResumeError> {
        let key = checkpoint::key(subject.scene_json, engine.backend());
        earlier.checkpoint.agrees(&key).map_err(ResumeError::Foreign)?;
        let reached = &earlier.checkpoint.reached;
        earlier.checkpoint.restore(engine)?;
        let mut keeper = Keeper::resume(subject, engine.backend(), outputs, earlier)?;
        // For the picture, if no frame follows.
        keeper.show(engine.view(subject.setup, &[keeper.wanted()])?.arrive()?);
        Ok(Self { subject, outputs, keeper, next: reached.frame + 1 })
    }

    /// Simulates the frames that are left, and records each.
    ///
    /// The recording is valid whatever happens. A run that fails or is canceled keeps the frames it
    /// has, and its recording and picture get their final names as those of a complete run do.
    ///
    /// # Errors
    /// The engine's error (cancellation among them), or that of a file that cannot be written.
    pub fn execute(self, engine: &mut dyn Engine, observer: &dyn Observer) -> Result<Summary, RunError> {
        let Self { subject, outputs, mut keeper, next } = self;
        // Positions and velocities do for pictures.
        let picture = |ids: Vec<u32>| Choice { ids: ids.into(), deformation: false };
        let still = outputs.thumbnail.as_ref().map(|_| picture(thumbnail_selection(subject.setup)));
        let wanted = Wanted { recorded: keeper.wanted(), still };
        let outcome = simulate(&mut keeper, engine, outputs, &wanted, next, observer).and_then(|summary| {
            if let Some(path) = outputs.state.as_ref().filter(|_| subject.setup.keep_state) {
                state::write(path, subject.setup.dimension, &engine.snapshot()?)?;
            }
            Ok(summary)
        });
        let kept = keeper.finish(outputs, outcome.as_ref().err());
        outcome.and(kept)
    }
}

/// Simulates all frames of a problem, which `engine` has loaded, and records each: see [`Run::execute`].
pub fn run(
    subject: Subject,
    engine: &mut dyn Engine,
    outputs: &Outputs,
    observer: &dyn Observer,
) -> Result<Summary, RunError> {
    Run::start(subject, engine, outputs)?.execute(engine, observer)
}

/// Steps and measures on this thread. Each frame is recorded on another thread while the next one is computed.
fn simulate(
    keeper: &mut Keeper,
    engine: &mut dyn Engine,
    outputs: &Outputs,
    wanted: &Wanted,
    next: u64,
    observer: &dyn Observer,
) -> Result<Summary, RunError> {
    let setup = keeper.setup();
    // Unbuffered, so that views of at most two frames are in memory.
    let (sender, receiver) = mpsc::sync_channel(0);
    let (stepped, kept) = thread::scope(|scope| {
        let keeping = scope.spawn(|| -> Result<(), RunError> {
            receiver.into_iter().try_for_each(|frame| keeper.keep(frame, observer))?;
            Ok(())
        });
        let checkpoints = outputs.checkpoints.as_deref();
        let stepped = step(setup, engine, wanted, checkpoints, next, observer, |frame| sender.send(frame).is_ok());
        drop(sender);
        (stepped, keeping.join().unwrap_or_else(|panic| resume_unwind(panic)))
    });
    kept?;
    stepped?;
    Ok(keeper.summary())
}

/// Simulates the frame after frame boundary `frame`: what sources emit then, and the motion of all
/// particles.
pub fn advance(
    setup: &Setup,
    engine: &mut dyn Engine,
    frame: u32,
    control: &dyn Control,
) -> Result<FrameStats, EngineError> {
    let emission = setup.emission(frame);
    if !emission.is_empty() {
        engine.append(emission)?;
    }
    engine.advance_frame(setup.frame_s, control)
}

/// What is kept of a frame. Nothing else leaves the engine's thread.
struct Frame {
    number: u64,
    stats: FrameStats,
    /// Totals, the excerpt of the writer's choice and, in the last frame, that of the picture's.
    view: Pending,
    /// The state at its end, where a checkpoint was due.
    draft: Option<Draft>,
}

/// Choices of particles.
struct Wanted {
    recorded: Choice,
    /// Of the picture of the last frame.
    still: Option<Choice>,
}

impl Frame {
    /// Asks for what is wanted of the engine's current frame, but does not wait for it.
    fn take(
        setup: &Setup,
        engine: &mut dyn Engine,
        wanted: &Wanted,
        number: u64,
        stats: FrameStats,
    ) -> Result<Self, EngineError> {
        let last = number == u64::from(setup.frames);
        let still = wanted.still.iter().filter(|_| last);
        let choices: Vec<Choice> = std::iter::once(&wanted.recorded).chain(still).cloned().collect();
        Ok(Self { number, stats, view: engine.view(setup, &choices)?, draft: None })
    }
}

/// Fails if a source is to emit into a vessel that is full, at the start of `frame`.
fn refuse_full(setup: &Setup, engine: &mut dyn Engine, inlets: &mut Inlets, frame: u32) -> Result<(), EngineError> {
    if !inlets.awaited(frame) {
        return Ok(());
    }
    inlets.clear();
    engine.positions(setup, &mut |x, body| inlets.add(x, body))?;
    let Some((source, fill)) = inlets.full(frame) else { return Ok(()) };
    let name = &setup.bodies[setup.sources[source].body].name;
    let time_s = f64::from(frame) * setup.frame_s;
    let what = format!(
        "the source \"{name}\" has {fill:.2} times the material at its shape that fits there; end it earlier \
         (`until`), make it slower, or give what it fills more room or a way out"
    );
    Err(EngineError::VesselFull { time_s, what })
}

/// Computes the frames from `next` on and passes each to `take`, until it refuses one.
fn step(
    setup: &Setup,
    engine: &mut dyn Engine,
    wanted: &Wanted,
    checkpoints: Option<&Path>,
    next: u64,
    observer: &dyn Observer,
    take: impl Fn(Frame) -> bool,
) -> Result<(), EngineError> {
    let mut inlets = Inlets::new(setup);
    for frame in next..=u64::from(setup.frames) {
        let mut stats = FrameStats::default();
        if frame > 0 {
            if observer.canceled() {
                return Err(EngineError::Canceled);
            }
            refuse_full(setup, engine, &mut inlets, frame as u32 - 1)?;
            stats = advance(setup, engine, frame as u32 - 1, observer)?;
        }
        let mut taken = Frame::take(setup, engine, wanted, frame, stats)?;
        let between = frame > 0 && frame < u64::from(setup.frames);
        // Asked once: a run that ends here has its state saved here.
        let pauses = between && observer.pauses();
        if let Some(dir) = checkpoints.filter(|_| pauses || between && observer.checkpoint_due()) {
            match Draft::write(dir, frame, engine) {
                Ok(draft) => taken.draft = Some(draft),
                Err(StateError::Engine(error)) => return Err(error),
                Err(StateError::Io(error)) => {
                    observer.checkpoint_failed(&format!("cannot write to {}: {error}", dir.display()));
                }
            }
        }
        if !take(taken) {
            break;
        }
        if pauses {
            return Err(EngineError::Canceled);
        }
    }
    Ok(())
}
