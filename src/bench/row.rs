//! A measurement as the JSON document of `gridfall bench` has it.

use serde::{Deserialize, Serialize};

use super::compare::Compared;
use gridfall_core::sim::setup::{Kernel, Precision};
use gridfall_engine::Backend;

/// Median, minimum and maximum over the rounds.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Spread {
    pub median: f64,
    pub min: f64,
    pub max: f64,
}

impl Spread {
    /// Of at least one value.
    pub fn of(mut values: Vec<f64>) -> Self {
        values.sort_by(f64::total_cmp);
        Self { median: values[values.len() / 2], min: values[0], max: values[values.len() - 1] }
    }
}

/// A stage of the GPU's steps.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Stage {
    pub stage: String,
    /// GPU time (µs a step); none without timestamps.
    #[serde(default)]
    pub time_us: Option<Spread>,
    /// Bytes a particle-step that it must read; none of stages that run once a frame.
    #[serde(default)]
    pub read_bytes: Option<f64>,
    #[serde(default)]
    pub written_bytes: Option<f64>,
}

/// One measured case. What has a default was not always there.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Row {
    pub case: String,
    pub particles: usize,
    pub kernel: Kernel,
    pub precision: Precision,
    /// Mean step of the measured rounds (s).
    pub dt_s: f64,
    pub backend: Backend,
    /// Rounds, and the steps of each; all start from the same state.
    #[serde(default)]
    pub rounds: usize,
    #[serde(default)]
    pub steps: u64,
    pub particle_steps_per_s: Spread,
    /// Wall time for a second of simulated time; this includes the effect of the kernel's step.
    pub wall_s_per_simulated_s: f64,
    /// Minimum memory traffic per particle and step (bytes).
    pub floor_bytes: f64,
    /// Bytes read and written per second by a plain copy.
    pub copy_bandwidth_b_s: f64,
    /// Share of that bandwidth that the minimum traffic needs at this speed.
    pub floor_share: f64,
    /// Host memory that came with the case, programs of a software GPU included (bytes), where the system says.
    #[serde(default)]
    pub host_bytes: Option<u64>,
    /// All buffers of the simulation on the GPU (bytes).
    #[serde(default)]
    pub device_bytes: Option<u64>,
    /// Active blocks of the GPU's grid.
    #[serde(default)]
    pub blocks: Option<usize>,
    /// Dispatches of a step on the GPU.
    #[serde(default)]
    pub dispatches: Option<usize>,
    /// In the order of a step; empty on the CPU.
    #[serde(default)]
    pub stages: Vec<Stage>,
    pub version: String,
    pub commit: String,
    /// What an earlier measurement has to say.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub compared: Option<Compared>,
}

impl Row {
    /// Bytes a particle-step that all stages of a step must move; none on the CPU.
    pub fn bytes(&self) -> Option<f64> {
        let bytes = |stage: &Stage| Some(stage.read_bytes? + stage.written_bytes?);
        self.stages.iter().filter_map(bytes).fold(None, |sum, bytes| Some(sum.unwrap_or(0.0) + bytes))
    }
}
