//! What the worker has done since the server started, for operators.

use std::sync::atomic::AtomicU64;
use std::time::{Duration, SystemTime};

use prometheus_client::encoding::{EncodeLabelSet, EncodeLabelValue, LabelValueEncoder};
use prometheus_client::metrics::counter::Counter;
use prometheus_client::metrics::family::Family;
use prometheus_client::metrics::gauge::Gauge;
use prometheus_client::metrics::histogram::Histogram;
use prometheus_client::registry::{Registry, Unit};

use crate::store::Status;

/// Bounds of histograms of what may take long (s).
const BOUNDS_S: [f64; 12] = [0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0, 300.0, 1000.0, 3000.0, 10_000.0, 100_000.0];

/// Work done since the server started.
#[derive(Clone, Debug)]
pub struct Counters {
    /// Number of jobs by the terminal state that the worker brought them to.
    pub finished: Family<StatusLabel, Counter>,
    pub frames: Counter,
    pub steps: Counter,
    pub particle_steps: Counter,
    /// Attempts whose job was taken from them.
    pub leases_lost: Counter,
    /// When the last checkpoint was written (s since 1970).
    checkpoint: Gauge<f64, AtomicU64>,
    device_memory: Family<DeviceLabel, Gauge>,
    queue_wait: Histogram,
    attempts: Family<StatusLabel, Histogram, fn() -> Histogram>,
    stages: Family<StageLabel, Counter<f64, AtomicU64>>,
}

#[derive(Clone, Debug, PartialEq, Eq, Hash, EncodeLabelSet)]
pub struct StatusLabel {
    pub status: Status,
}

#[derive(Clone, Debug, PartialEq, Eq, Hash, EncodeLabelSet)]
struct DeviceLabel {
    device: String,
}

#[derive(Clone, Debug, PartialEq, Eq, Hash, EncodeLabelSet)]
struct StageLabel {
    stage: &'static str,
}

impl EncodeLabelValue for Status {
    fn encode(&self, encoder: &mut LabelValueEncoder) -> std::fmt::Result {
        EncodeLabelValue::encode(&self.as_str(), encoder)
    }
}

impl Default for Counters {
    fn default() -> Self {
        Self {
            finished: Family::default(),
            frames: Counter::default(),
            steps: Counter::default(),
            particle_steps: Counter::default(),
            leases_lost: Counter::default(),
            checkpoint: Gauge::default(),
            device_memory: Family::default(),
            queue_wait: Histogram::new(BOUNDS_S),
            attempts: Family::new_with_constructor(|| Histogram::new(BOUNDS_S)),
            stages: Family::default(),
        }
    }
}

impl Counters {
    /// Adds all of them to a registry.
    pub fn register(&self, registry: &mut Registry) {
        registry.register("jobs_ended", "Jobs that the worker brought to an end, by status", self.finished.clone());
        registry.register("frames", "Frames recorded", self.frames.clone());
        registry.register("steps", "Sub-steps done", self.steps.clone());
        registry.register("particle_steps", "Particles times sub-steps done", self.particle_steps.clone());
        registry.register("leases_lost", "Attempts whose job was taken from them", self.leases_lost.clone());
        let checkpoint = "When the last checkpoint was written, since 1970; 0 before the first";
        registry.register_with_unit("last_checkpoint_timestamp", checkpoint, Unit::Seconds, self.checkpoint.clone());
        let memory = "Memory taken of a GPU, when a job was last loaded or ended there";
        registry.register_with_unit("device_memory", memory, Unit::Bytes, self.device_memory.clone());
        let wait = "Time from a job's acceptance to its first attempt";
        registry.register_with_unit("queue_wait", wait, Unit::Seconds, self.queue_wait.clone());
        let length = "Wall time of attempts, by the status in which they left the job";
        registry.register_with_unit("attempt_duration", length, Unit::Seconds, self.attempts.clone());
        let stages = "Wall time by stage: validate (in requests), load, simulate (with recording)";
        registry.register_with_unit("stage", stages, Unit::Seconds, self.stages.clone());
    }

    /// A checkpoint was written now.
    pub fn checkpointed(&self) {
        let since = SystemTime::UNIX_EPOCH.elapsed().unwrap_or_default();
        self.checkpoint.set(since.as_secs_f64());
    }

    /// Notes how much of a device's memory is taken (bytes).
    pub fn memory(&self, device: String, bytes: u64) {
        let bytes = i64::try_from(bytes).unwrap_or(i64::MAX);
        self.device_memory.get_or_create(&DeviceLabel { device }).set(bytes);
    }

    pub fn waited(&self, wait: Duration) {
        self.queue_wait.observe(wait.as_secs_f64());
    }

    pub fn attempted(&self, status: Status, length: Duration) {
        self.attempts.get_or_create(&StatusLabel { status }).observe(length.as_secs_f64());
    }

    /// Time spent in a stage.
    pub fn stage(&self, stage: &'static str, time: Duration) {
        self.stages.get_or_create(&StageLabel { stage }).inc_by(time.as_secs_f64());
    }
}
