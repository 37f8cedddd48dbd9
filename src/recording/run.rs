//! Runs a problem on an engine from the first frame to the last, and writes its results.

mod keeper;

use std::panic::resume_unwind;
use std::path::{Path, PathBuf};
use std::sync::mpsc;
use std::thread;

use crate::appearance::Appearance;
use keeper::Keeper;

use crate::checkpoint::{self, Checkpoint, Draft};
use crate::excerpt::Excerpt;
use crate::files::RecordingError;
use crate::picture::thumbnail_selection;
use crate::state;
use gridfall_core::sim::diagnostics::{Row, Totals};
use gridfall_core::sim::inlet::Inlets;
use gridfall_core::sim::setup::Setup;
use gridfall_engine::{Control, Engine, EngineError, FrameStats, Solve, StateError};

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
        let wanted = Wanted { recorded: keeper.wanted(), still: Vec::new() };
        let mut inlets = Inlets::new(subject.setup);
        let stats = FrameStats::default();
        let frame = Frame::take(subject.setup, engine, &wanted, &mut inlets, reached.frame, stats)?;
        keeper.show(frame.excerpt);
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
        let still = if outputs.thumbnail.is_some() { thumbnail_selection(subject.setup) } else { Vec::new() };
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
    // Unbuffered, so that excerpts of at most two frames are in memory.
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
    row: Row,
    solves: Vec<Solve>,
    /// Excerpt of the writer's selection.
    excerpt: Excerpt,
    /// Excerpt of the picture's selection, in the last frame.
    still: Option<Excerpt>,
    /// The state at its end, where a checkpoint was due.
    draft: Option<Draft>,
}

/// Selections of particles, by index in sampling order.
struct Wanted {
    recorded: Vec<u32>,
    /// Used in the last frame; empty without a picture.
    still: Vec<u32>,
}

/// Number of parts in which a frame's particles leave the engine.
const PARTS: usize = 16;

/// Particles of one such part.
fn part(setup: &Setup) -> usize {
    (setup.total_particles() / PARTS).max(1 << 16).next_multiple_of(Totals::PART)
}

impl Frame {
    /// Measures the engine's current frame and takes the excerpts that are wanted.
    fn take(
        setup: &Setup,
        engine: &mut dyn Engine,
        wanted: &Wanted,
        inlets: &mut Inlets,
        frame: u64,
        stats: FrameStats,
    ) -> Result<Self, EngineError> {
        inlets.clear();
        let mut totals = Totals::default();
        // Positions and velocities do for pictures.
        let deformation = setup.fields.iter().any(|field| field.of_deformation());
        let mut excerpt = Excerpt::of(&wanted.recorded, deformation);
        let last = frame == u64::from(setup.frames) && !wanted.still.is_empty();
        let mut still = last.then(|| Excerpt::of(&wanted.still, false));
        engine.visit(part(setup), &mut |first, particles| {
            totals.add(setup, &particles);
            inlets.add(&particles.x, &particles.body);
            excerpt.take(&wanted.recorded, first, &particles);
            if let Some(still) = &mut still {
                still.take(&wanted.still, first, &particles);
            }
        })?;
        let row = totals.row(setup, frame, frame as f64 * setup.frame_s, &stats);
        Ok(Self { row, solves: stats.solves, excerpt, still, draft: None })
    }
}

/// Fails if a source is to emit into a vessel that is full.
fn refuse_full(setup: &Setup, inlets: &Inlets, frame: u32) -> Result<(), EngineError> {
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
    if next > 0 {
        // What the frame before, which this engine has not computed, says of them.
        engine.visit(part(setup), &mut |_, particles| inlets.add(&particles.x, &particles.body))?;
    }
    for frame in next..=u64::from(setup.frames) {
        let mut stats = FrameStats::default();
        if frame > 0 {
            if observer.canceled() {
                return Err(EngineError::Canceled);
            }
            refuse_full(setup, &inlets, frame as u32 - 1)?;
            stats = advance(setup, engine, frame as u32 - 1, observer)?;
        }
        let mut taken = Frame::take(setup, engine, wanted, &mut inlets, frame, stats)?;
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
