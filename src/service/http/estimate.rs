//! What a scene will cost, as answers have it.

use serde::Serialize;
use utoipa::ToSchema;

use super::dto::Notice;
use gridfall_scene as scene;

/// A scene found valid, and what it costs.
#[derive(Debug, Serialize, ToSchema)]
pub struct ValidScene {
    pub valid: bool,
    /// What was mended in it, and what may not be what was meant.
    pub notices: Vec<Notice>,
    pub estimate: Estimate,
}

/// What a run will cost, from its state at time 0.
#[derive(Debug, Serialize, ToSchema)]
pub struct Estimate {
    pub particles: u64,
    /// Cells of the domain on each axis.
    pub cells: [usize; 3],
    /// Active blocks of 4³ cells (2D: 4²).
    pub blocks: u64,
    /// Host memory of a run on the CPU.
    pub host_memory_bytes: u64,
    /// Device memory of a run on a GPU; null when GPUs cannot run the scene.
    #[schema(required)]
    pub device_memory_bytes: Option<u64>,
    /// How the run is integrated: `explicit` or `implicit`.
    pub integrator: String,
    /// Why, in a sentence.
    pub integrator_reason: String,
    /// What explicit integration is predicted to cost.
    pub explicit: Integration,
    /// What implicit integration is predicted to cost; null where a material has none.
    #[schema(required)]
    pub implicit: Option<Integration>,
    /// Step at time 0 (s).
    pub dt_s: f64,
    /// Stable name of the rule that set the step.
    pub dt_bound: &'static str,
    /// The same in words, and what would lengthen the step.
    pub dt_reason: String,
    /// All rules and the step that each allows, the ruling one first.
    pub dt_limits: Vec<Limit>,
    pub steps_per_frame: u64,
    /// Frames in the recording, frame 0 included.
    pub frames: u64,
    /// Steps of the whole run, if the step stays as it is.
    pub steps: u64,
    /// Particles times steps, which run time is proportional to.
    pub particle_steps: f64,
    /// Simulated time at the end (s).
    pub end_time: f64,
}

/// One way to integrate a run, and its predicted cost.
#[derive(Debug, Serialize, ToSchema)]
pub struct Integration {
    /// Step at time 0 (s).
    pub dt_s: f64,
    /// Steps of the whole run, if the step stays as it is.
    pub steps: u64,
    /// Wall time that is typical of two cores of a server; the ratio of both ways holds for other devices.
    pub two_cores_s: f64,
}

impl From<scene::estimate::Integration> for Integration {
    fn from(integration: scene::estimate::Integration) -> Self {
        let scene::estimate::Integration { dt_s, steps, two_cores_s } = integration;
        Self { dt_s, steps, two_cores_s }
    }
}

/// A rule of the step, and what it allows.
#[derive(Debug, Serialize, ToSchema)]
pub struct Limit {
    /// Stable name.
    pub rule: &'static str,
    /// The body that it is about; null for rules about the whole scene.
    #[schema(required)]
    pub body: Option<String>,
    /// s.
    pub dt_s: f64,
}

impl From<scene::estimate::Limit> for Limit {
    fn from(limit: scene::estimate::Limit) -> Self {
        Self { rule: limit.rule, body: limit.body, dt_s: limit.dt_s }
    }
}

impl From<scene::estimate::Estimate> for Estimate {
    fn from(estimate: scene::estimate::Estimate) -> Self {
        Self {
            particles: estimate.particles,
            cells: estimate.cells,
            blocks: estimate.blocks,
            host_memory_bytes: estimate.host_memory_bytes,
            device_memory_bytes: estimate.device_memory_bytes,
            integrator: estimate.integrator.name().into(),
            integrator_reason: estimate.integrator_reason,
            explicit: estimate.explicit.into(),
            implicit: estimate.implicit.map(Into::into),
            dt_s: estimate.dt_s,
            dt_bound: estimate.dt_bound,
            dt_reason: estimate.dt_reason,
            dt_limits: estimate.dt_limits.into_iter().map(Limit::from).collect(),
            steps_per_frame: estimate.steps_per_frame,
            frames: u64::from(estimate.frames) + 1,
            steps: estimate.steps,
            particle_steps: estimate.particle_steps,
            end_time: estimate.simulated_s,
        }
    }
}
