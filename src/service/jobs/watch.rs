//! What follows an attempt: progress, requests to stop, checkpoints.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, OnceLock};
use std::time::{Duration, Instant};

use tokio::sync::Notify;
use tokio::time::timeout;

use super::worker::Context;
use super::{Shared, log};
use crate::store::{Claim, JobFiles, JobStore, Progress, Saver};
use gridfall_core::sim::setup::Setup;
use gridfall_engine::Control;
use gridfall_recording::checkpoint::{self, Checkpoint, Reached};
use gridfall_recording::run::{FrameReport, Observer};

/// Checkpoints take at most one part in so many of an attempt's time.
const SPARING: u32 = 20;

/// Writes progress and passes on requests to cancel, until the attempt has ended.
pub(super) async fn heartbeat(store: JobStore, claim: Claim, watch: Arc<Watch>, every: Duration) {
    loop {
        let ended = timeout(every, watch.ended.notified()).await.is_ok();
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
pub(super) struct Watch {
    shared: Arc<Shared>,
    pub canceled: AtomicBool,
    pub ended: Notify,
    /// Number of particles, and when they were loaded.
    loaded: OnceLock<(u64, Instant)>,
    /// Frames of the run, and tenths of them that were told of.
    frames: AtomicU64,
    tenths: AtomicU64,
    step: AtomicU64,
    /// Bits of an f64.
    sim_time_s: AtomicU64,
    frames_written: AtomicU64,
}

impl Watch {
    pub fn new(shared: Arc<Shared>) -> Self {
        Self {
            shared,
            canceled: AtomicBool::new(false),
            ended: Notify::new(),
            loaded: OnceLock::new(),
            frames: AtomicU64::new(0),
            tenths: AtomicU64::new(0),
            step: AtomicU64::new(0),
            sim_time_s: AtomicU64::new(0),
            frames_written: AtomicU64::new(0),
        }
    }

    pub fn loaded(&self, particles: u64, frames: u64) {
        self.frames.store(frames, Ordering::Relaxed);
        // The first time counts.
        let _ = self.loaded.set((particles, Instant::now()));
    }

    /// The attempt goes on from here, or from the start.
    pub fn reached(&self, setup: &Setup, from: Option<&Reached>) {
        let Some(from) = from else { return };
        self.step.store(from.steps, Ordering::Relaxed);
        self.sim_time_s.store((from.frame as f64 * setup.frame_s).to_bits(), Ordering::Relaxed);
        self.frames_written.store(from.frame + 1, Ordering::Relaxed);
    }

    fn progress_to(&self, step: u64, time_s: f64) {
        let done = step.saturating_sub(self.step.swap(step, Ordering::Relaxed));
        self.sim_time_s.store(time_s.to_bits(), Ordering::Relaxed);
        let particles = self.loaded.get().map_or(0, |(particles, _)| *particles);
        self.shared.counters.steps.inc_by(done);
        self.shared.counters.particle_steps.inc_by(done * particles);
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

/// What a run asks and tells.
pub(super) struct Follower<'a> {
    context: &'a Context,
    claim: &'a Claim,
    files: &'a JobFiles,
    watch: &'a Watch,
    /// How long after a checkpoint the next one is due.
    every: Duration,
    pace: Mutex<Pace>,
    /// Takes checkpoints to where other machines find them.
    saver: Option<Mutex<Saver>>,
}

/// When checkpoints are due.
struct Pace {
    /// When the last one was done, or the run began.
    last: Instant,
    /// When the one that is being written was asked for.
    asked: Option<Instant>,
    /// What the last one took.
    cost: Duration,
}

impl<'a> Follower<'a> {
    pub fn new(context: &'a Context, claim: &'a Claim, files: &'a JobFiles, watch: &'a Watch) -> Self {
        // An attempt after a death that lost everything saves sooner: it may not live long either.
        let every = context.settings.checkpoint_every / 4u32.saturating_pow(claim.deaths.clamp(0, 8) as u32);
        let pace = Pace { last: Instant::now(), asked: None, cost: Duration::ZERO };
        let saver = context.data.objects().map(|objects| Mutex::new(Saver::new(objects, files, claim.attempt)));
        Self { context, claim, files, watch, every, pace: Mutex::new(pace), saver }
    }

    /// Takes the newest checkpoint to where other machines find it.
    fn save(&self) -> Result<(), String> {
        let Some(saver) = &self.saver else { return Ok(()) };
        let dir = self.files.attempt(self.claim.attempt).checkpoints();
        let newest = checkpoint::list(&dir).map_err(|error| error.to_string())?.into_iter().next();
        let path = newest.ok_or_else(|| format!("there is none in {}", dir.display()))?;
        let reached = Checkpoint::open(&path).map_err(|error| error.to_string())?.reached;
        let mut saver = saver.lock().expect("no code panics while it holds this lock");
        let saved = self.context.runtime.block_on(saver.save(&path, reached.lengths));
        saved.map_err(|error| {
            tracing::warn!(job = %self.claim.id, %error, "a checkpoint is on this machine only");
            error.brief()
        })
    }

    fn pace(&self) -> std::sync::MutexGuard<'_, Pace> {
        self.pace.lock().expect("no code panics while it holds this lock")
    }

    /// The run is told: it may go on.
    fn settle(&self) {
        let mut pace = self.pace();
        pace.cost = pace.asked.take().map_or(Duration::ZERO, |asked| asked.elapsed());
        pace.last = Instant::now();
    }
}

impl Control for Follower<'_> {
    fn canceled(&self) -> bool {
        self.watch.canceled.load(Ordering::Relaxed) || self.context.shared.must_stop()
    }

    fn progress(&self, step: u64, time_s: f64) {
        self.watch.progress_to(step, time_s);
    }
}

impl Observer for Follower<'_> {
    fn frame(&self, report: &FrameReport) {
        self.watch.progress_to(report.steps, report.time_s);
        self.watch.frames_written.store(report.frame + 1, Ordering::Relaxed);
        self.context.shared.counters.frames.inc();
        // Ten times in a run.
        let frames = self.watch.frames.load(Ordering::Relaxed);
        let tenths = 10 * report.frame / frames.max(1);
        if self.watch.tenths.swap(tenths, Ordering::Relaxed) < tenths {
            log::note(self.files, &format!("frame {} of {frames}, at {:.6} s", report.frame, report.time_s));
        }
    }

    fn checkpoint_due(&self) -> bool {
        let mut pace = self.pace();
        let due = pace.asked.is_none() && pace.last.elapsed() >= self.every.max(SPARING * pace.cost);
        if due {
            pace.asked = Some(Instant::now());
        }
        due
    }

    fn checkpointed(&self, frame: u64) {
        let saved = self.save();
        self.settle();
        if let Err(reason) = saved {
            // This machine can go on from it, and others from the one before.
            return log::note(
                self.files,
                &format!("the checkpoint of frame {frame} is on this machine only: {reason}"),
            );
        }
        self.context.shared.counters.checkpointed();
        let Claim { id, attempt, .. } = *self.claim;
        match self.context.runtime.block_on(self.context.store.checkpointed(id, attempt, frame)) {
            Ok(true) => {}
            // The heartbeat will find out, too, and end the attempt.
            Ok(false) => return,
            // Somebody else may have the job by now, and need what came before.
            Err(error) => return tracing::warn!(job = %id, %error, "cannot note a checkpoint"),
        }
        if let Err(error) = self.files.forget_before(attempt) {
            tracing::warn!(job = %id, %error, "cannot remove what earlier attempts left");
        }
        if let Some(objects) = self.context.data.objects()
            && let Err(error) = self.context.runtime.block_on(objects.forget_before(id, attempt))
        {
            tracing::warn!(job = %id, %error, "cannot remove what earlier attempts left in the object storage");
        }
    }

    fn checkpoint_failed(&self, reason: &str) {
        self.settle();
        tracing::warn!(job = %self.claim.id, reason, "no checkpoint");
        log::note(self.files, &format!("no checkpoint: {reason}"));
    }

    fn pauses(&self) -> bool {
        self.context.shared.stopping()
    }
}
