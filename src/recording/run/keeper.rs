//! The files of a run: its recording, diagnostics, picture and checkpoints.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};

use super::{Earlier, Frame, FrameReport, Observer, Outputs, RunError, Subject, Summary};
use crate::checkpoint::{self, Draft, Reached};
use crate::files::{RecordingError, partial_path, sync, write_file};
use crate::picture::thumbnail;
use crate::writer::{Header, Severity, Writer};
use gridfall_core::sim::diagnostics::{Row, SolverRow};
use gridfall_core::sim::excerpt::{Choice, Excerpt};
use gridfall_core::sim::setup::Setup;
use gridfall_engine::{Backend, EngineError, Solve, View};

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

    /// One that begins with the first `length` bytes of another.
    fn resume(path: &Path, earlier: &Path, length: u64) -> Result<Self, RecordingError> {
        let mut from = File::open(earlier).map_err(RecordingError::io("open", earlier))?.take(length);
        let mut file = File::create(path).map_err(RecordingError::io("create", path))?;
        let copied = io::copy(&mut from, &mut file).map_err(RecordingError::io("copy", earlier))?;
        if copied < length {
            let reason = format!("it has {copied} bytes, of {length} that it should have");
            let source = io::Error::new(io::ErrorKind::UnexpectedEof, reason);
            return Err(RecordingError::Io { action: "copy", path: earlier.to_owned(), source });
        }
        Ok(Self { file, path: path.to_owned() })
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
pub struct Keeper<'a> {
    subject: Subject<'a>,
    /// What checkpoints of the run agree with.
    key: String,
    writer: Writer,
    csv: Option<Table>,
    solver: Option<Table>,
    summary: Summary,
    /// Used for the picture.
    last: Option<Excerpt>,
}

impl<'a> Keeper<'a> {
    pub fn create(subject: Subject<'a>, backend: &Backend, out: &Outputs) -> Result<Self, RunError> {
        let Subject { scene_json, setup, appearance } = subject;
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
        let key = checkpoint::key(scene_json, backend);
        Ok(Self { subject, key, writer, csv, solver, summary: Summary::default(), last: None })
    }

    /// The files of an earlier run, as they were at its checkpoint.
    pub fn resume(
        subject: Subject<'a>,
        backend: &Backend,
        out: &Outputs,
        earlier: &Earlier,
    ) -> Result<Self, RecordingError> {
        let Subject { scene_json, setup, appearance } = subject;
        let Reached { frame, steps, lengths: [recording, diagnostics, solver] } = earlier.checkpoint.reached;
        let time_s = frame as f64 * setup.frame_s;
        let header = Header { setup, appearance, scene_json, backend };
        let finished = &earlier.outputs.recording;
        let unfinished = partial_path(finished);
        let source = if unfinished.exists() { &unfinished } else { finished };
        let writer = Writer::resume(&out.recording, &header, source, recording, (frame, time_s))?;
        let table = |to: &Option<PathBuf>, from: &Option<PathBuf>, length: u64| match (to, from) {
            (Some(to), Some(from)) => Table::resume(to, from, length).map(Some),
            _ => Ok(None),
        };
        let csv = table(&out.diagnostics, &earlier.outputs.diagnostics, diagnostics)?;
        let solver = table(&out.solver, &earlier.outputs.solver, solver)?;
        let key = checkpoint::key(scene_json, backend);
        let summary = Summary { frames_written: frame + 1, steps, time_s };
        Ok(Self { subject, key, writer, csv, solver, summary, last: None })
    }

    pub fn setup(&self) -> &'a Setup {
        self.subject.setup
    }

    pub fn summary(&self) -> Summary {
        self.summary
    }

    /// The particles whose excerpts [`Self::keep`] takes.
    pub fn wanted(&self) -> Choice {
        let deformation = self.subject.setup.fields.iter().any(|field| field.of_deformation());
        Choice { ids: self.writer.wanted().into(), deformation }
    }

    /// Makes the particles of this view those of the picture, unless a frame follows.
    pub fn show(&mut self, view: View) {
        self.last = view.excerpts.into_iter().last();
    }

    /// Records a frame.
    pub fn keep(&mut self, frame: Frame, observer: &dyn Observer) -> Result<(), RunError> {
        self.last = None;
        let Frame { number, stats, view, draft } = frame;
        let setup = self.subject.setup;
        let view = view.arrive()?;
        let row = view.totals.row(setup, number, number as f64 * setup.frame_s, &stats);
        if row.isolated_reset > 0 {
            let message = format!("{} particles were alone on their nodes and were reset", row.isolated_reset);
            self.writer.log(Severity::Warning, message);
        }
        if let Some(message) = unconverged(&stats.solves, setup.implicit.tolerance()) {
            self.writer.log(Severity::Warning, message);
        }
        let steps = SolverRow::of_frame(row.frame, self.summary.steps, &stats.solves);
        self.writer.frame(setup, &view.excerpts[0], &row, &steps)?;
        if let Some(table) = &mut self.csv {
            table.line(&row.csv())?;
        }
        if let Some(table) = &mut self.solver {
            steps.iter().try_for_each(|step| table.line(&step.csv()))?;
        }
        self.show(view);
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
        if let Some(draft) = draft {
            let frame = draft.frame();
            match self.complete(draft) {
                Ok(()) => observer.checkpointed(frame),
                Err(error) => observer.checkpoint_failed(&error.to_string()),
            }
        }
        Ok(())
    }

    /// Completes a checkpoint of the frame that was just recorded.
    fn complete(&self, draft: Draft) -> Result<(), RecordingError> {
        let length = |table: &Option<Table>| table.as_ref().map_or(Ok(0), |table| sync(&table.path));
        let lengths = [self.writer.sync()?, length(&self.csv)?, length(&self.solver)?];
        let reached = Reached { frame: draft.frame(), steps: self.summary.steps, lengths };
        draft.complete(&self.key, &reached)
    }

    /// Completes all files, whether or not the run was complete.
    pub fn finish(mut self, out: &Outputs, failure: Option<&RunError>) -> Result<Summary, RunError> {
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
            let Subject { setup, appearance, .. } = self.subject;
            write_file(path, &thumbnail(setup, appearance, particles, time_s))?;
        }
        Ok(self.summary)
    }
}
