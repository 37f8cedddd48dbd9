//! Runs a problem on an engine from the first frame to the last, and writes its results.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::Write;
use std::panic::resume_unwind;
use std::path::{Path, PathBuf};
use std::sync::mpsc;
use std::thread;

use crate::appearance::Appearance;
use crate::excerpt::Excerpt;
use crate::files::{RecordingError, write_file};
use crate::picture::thumbnail;
use crate::picture::thumbnail_selection;
use crate::writer::{Header, Severity, Writer};
use gridfall_core::sim::diagnostics::{Row, SolverRow, Totals};
use gridfall_core::sim::inlet::Inlets;
use gridfall_core::sim::setup::{OutputField, Setup};
use gridfall_engine::{Control, Engine, EngineError, FrameStats, Solve};

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

impl RunError {
    /// Stable code for APIs.
    pub fn code(&self) -> &'static str {
        match self {
            Self::Engine(error) => error.code(),
            Self::Output(_) => "output",
        }
    }
}

/// Simulates all frames of `problem`, which `engine` has loaded, and records each. `scene_json` is
/// the scene's document, which goes into the recording.
///
/// The recording is valid whatever happens. A run that fails or is canceled keeps the frames it
/// has, and its recording and picture get their final names as those of a complete run do.
///
/// # Errors
/// The engine's error (cancellation among them), or that of a file that cannot be written.
pub fn run(
    scene_json: &str,
    setup: &Setup,
    appearance: &Appearance,
    engine: &mut dyn Engine,
    out: &Outputs,
    observer: &dyn Observer,
) -> Result<Summary, RunError> {
    let mut keeper = Keeper::create(setup, appearance, engine, out, scene_json)?;
    let outcome = keeper.simulate(engine, out, observer);
    let kept = keeper.finish(out, outcome.as_ref().err());
    outcome.and(kept)
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
}

/// Selections of particles, by index in sampling order.
struct Wanted {
    recorded: Vec<u32>,
    /// Used in the last frame; empty without a picture.
    still: Vec<u32>,
}

/// Number of parts in which a frame's particles leave the engine.
const PARTS: usize = 16;

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
        // Positions and velocities do for pictures; all other fields are functions of the deformation.
        let deformation = setup.fields.iter().any(|field| *field != OutputField::Velocity);
        let mut excerpt = Excerpt::of(&wanted.recorded, deformation);
        let last = frame == u64::from(setup.frames) && !wanted.still.is_empty();
        let mut still = last.then(|| Excerpt::of(&wanted.still, false));
        let part = (setup.total_particles() / PARTS).max(1 << 16).next_multiple_of(Totals::PART);
        engine.visit(part, &mut |first, particles| {
            totals.add(setup, &particles);
            inlets.add(&particles.x, &particles.body);
            excerpt.take(&wanted.recorded, first, &particles);
            if let Some(still) = &mut still {
                still.take(&wanted.still, first, &particles);
            }
        })?;
        let row = totals.row(setup, frame, frame as f64 * setup.frame_s, &stats);
        Ok(Self { row, solves: stats.solves, excerpt, still })
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

/// Computes all frames and passes each to `take`, until it refuses one.
fn step(
    setup: &Setup,
    engine: &mut dyn Engine,
    wanted: &Wanted,
    observer: &dyn Observer,
    take: impl Fn(Frame) -> bool,
) -> Result<(), EngineError> {
    let mut stats = FrameStats::default();
    let mut inlets = Inlets::new(setup);
    for frame in 0..=u64::from(setup.frames) {
        if frame > 0 {
            if observer.canceled() {
                return Err(EngineError::Canceled);
            }
            refuse_full(setup, &inlets, frame as u32 - 1)?;
            stats = advance(setup, engine, frame as u32 - 1, observer)?;
        }
        if !take(Frame::take(setup, engine, wanted, &mut inlets, frame, std::mem::take(&mut stats))?) {
            break;
        }
    }
    Ok(())
}

/// A CSV that grows by whole lines.
struct Table {
    file: File,
    path: PathBuf,
}

impl Table {
    fn create(path: &Path, header: String) -> Result<Self, RecordingError> {
        let file = File::create(path).map_err(RecordingError::io("create", path))?;
        let mut table = Self { file, path: path.to_owned() };
        table.line(&header)?;
        Ok(table)
    }

    fn line(&mut self, line: &str) -> Result<(), RecordingError> {
        self.file.write_all(format!("{line}\n").as_bytes()).map_err(RecordingError::io("write", &self.path))
    }
}

/// The warning about a frame with implicit steps that did not converge to the tolerance.
fn unconverged(solves: &[Solve], tolerance: f64) -> Option<String> {
    let failed = || solves.iter().filter(|solve| !solve.converged);
    let worst = failed().max_by(|a, b| a.residual.total_cmp(&b.residual))?;
    Some(format!(
        "{} of {} implicit steps did not converge to {tolerance:e}: at worst the step to t = {:.6} s, \
         with a residual of {:.1e} after {} iterations",
        failed().count(),
        solves.len(),
        worst.time_s,
        worst.residual,
        worst.iterations
    ))
}

/// The files of a run.
struct Keeper<'a> {
    setup: &'a Setup,
    appearance: &'a Appearance,
    writer: Writer,
    csv: Option<Table>,
    solver: Option<Table>,
    summary: Summary,
    /// Used for the picture.
    last: Option<Excerpt>,
}

impl<'a> Keeper<'a> {
    fn create(
        setup: &'a Setup,
        appearance: &'a Appearance,
        engine: &dyn Engine,
        out: &Outputs,
        scene_json: &str,
    ) -> Result<Self, RunError> {
        let backend = engine.backend();
        let mut writer = Writer::create(&out.recording, &Header { setup, appearance, scene_json, backend })?;
        let (name, particles) = (&setup.name, setup.total_particles());
        let device = &backend.device;
        writer.log(Severity::Info, format!("{name}: {particles} particles on {device} ({})", backend.reason));
        let integrator = setup.integrator.name();
        writer.log(Severity::Info, format!("{integrator} integration: {}", setup.integrator_reason));
        for notice in &setup.notices {
            writer.log(Severity::Warning, notice.to_string());
        }
        let table =
            |path: &Option<PathBuf>, header: String| path.as_ref().map(|p| Table::create(p, header)).transpose();
        let csv = table(&out.diagnostics, Row::csv_header(setup))?;
        let solver = table(&out.solver, SolverRow::csv_header())?;
        Ok(Self { setup, appearance, writer, csv, solver, summary: Summary::default(), last: None })
    }

    /// Steps and measures on this thread. Each frame is recorded on another thread while the next
    /// one is computed.
    fn simulate(
        &mut self,
        engine: &mut dyn Engine,
        out: &Outputs,
        observer: &dyn Observer,
    ) -> Result<Summary, RunError> {
        let setup = self.setup;
        let still = if out.thumbnail.is_some() { thumbnail_selection(setup) } else { Vec::new() };
        let wanted = Wanted { recorded: self.writer.wanted().to_vec(), still };
        // Unbuffered, so that excerpts of at most two frames are in memory.
        let (sender, receiver) = mpsc::sync_channel(0);
        let keeper = &mut *self;
        let (stepped, kept) = thread::scope(|scope| {
            let keeping = scope.spawn(move || -> Result<(), RunError> {
                receiver.into_iter().try_for_each(|frame| keeper.keep(frame, observer))
            });
            let stepped = step(setup, engine, &wanted, observer, |frame| sender.send(frame).is_ok());
            drop(sender);
            (stepped, keeping.join().unwrap_or_else(|panic| resume_unwind(panic)))
        });
        kept?;
        stepped?;
        Ok(self.summary)
    }

    /// Records a frame.
    fn keep(&mut self, frame: Frame, observer: &dyn Observer) -> Result<(), RunError> {
        self.last = None;
        let Frame { row, solves, excerpt, still } = frame;
        let setup = self.setup;
        if row.isolated_reset > 0 {
            let message = format!("{} particles were alone on their nodes and were reset", row.isolated_reset);
            self.writer.log(Severity::Warning, message);
        }
        if let Some(message) = unconverged(&solves, setup.implicit.tolerance()) {
            self.writer.log(Severity::Warning, message);
        }
        let steps = SolverRow::of_frame(row.frame, self.summary.steps, &solves);
        self.writer.frame(setup, &excerpt, &row, &steps)?;
        if let Some(table) = &mut self.csv {
            table.line(&row.csv())?;
        }
        if let Some(table) = &mut self.solver {
            steps.iter().try_for_each(|step| table.line(&step.csv()))?;
        }
        self.last = still.or(Some(excerpt));
        let steps = self.summary.steps + row.steps;
        self.summary = Summary { frames_written: row.frame + 1, steps, time_s: row.time_s };
        observer.frame(&FrameReport {
            frame: row.frame,
            frames: setup.frames.into(),
            time_s: row.time_s,
            end_s: f64::from(setup.frames) * setup.frame_s,
            steps,
            row: &row,
        });
        Ok(())
    }

    /// Completes all files, whether or not the run was complete.
    fn finish(mut self, out: &Outputs, failure: Option<&RunError>) -> Result<Summary, RunError> {
        let Summary { frames_written, steps, time_s } = self.summary;
        let (status, severity, message) = match failure {
            None => ("complete", Severity::Info, format!("complete: {frames_written} frames, {steps} steps")),
            Some(RunError::Engine(EngineError::Canceled)) => ("canceled", Severity::Warning, "canceled".into()),
            Some(error) => ("failed", Severity::Error, error.to_string()),
        };
        self.writer.log(severity, message.clone());
        let entries = [
            ("status", status.to_owned()),
            ("message", message),
            ("frames", frames_written.to_string()),
            ("steps", steps.to_string()),
            ("time_s", time_s.to_string()),
            ("dt_s", if steps > 0 { time_s / steps as f64 } else { 0.0 }.to_string()),
        ];
        let result = BTreeMap::from(entries.map(|(key, value)| (key.to_owned(), value)));
        self.writer.finish(result)?;
        if let (Some(path), Some(particles)) = (&out.thumbnail, &self.last) {
            write_file(path, &thumbnail(self.setup, self.appearance, particles, time_s))?;
        }
        Ok(self.summary)
    }
}
