//! What an engine does, whichever device it runs on, and how one is chosen.

use serde::{Deserialize, Serialize};

use crate::sim::particles::Particles;
use crate::sim::reaction::Reaction;

/// Where and how an engine runs; goes into job records, recordings and messages.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Backend {
    /// `cpu` or `gpu`.
    pub kind: String,
    /// Processor or adapter name.
    pub device: String,
    /// Driver name and version; empty on the CPU.
    pub driver: String,
    /// True for a Vulkan driver that runs on the CPU.
    pub software: bool,
    /// Why this one was chosen, in a sentence.
    pub reason: String,
}

impl Backend {
    /// The processor of this machine, chosen for `reason`.
    pub fn this_cpu(reason: &str) -> Self {
        Self {
            kind: "cpu".into(),
            device: format!("{} ({} threads)", processor(), rayon::current_num_threads()),
            driver: String::new(),
            software: false,
            reason: reason.into(),
        }
    }
}

/// The processor's name as the system knows it.
fn processor() -> String {
    let info = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let name =
        info.lines().find_map(|line| line.strip_prefix("model name")?.split_once(':').map(|(_, name)| name.trim()));
    name.unwrap_or(std::env::consts::ARCH).to_string()
}

/// What happened in one frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FrameStats {
    pub steps: u64,
    /// Mean step (s); 0 for frame 0.
    pub dt_s: f64,
    /// Particles that were alone on their nodes and were reset.
    pub isolated_reset: u64,
    /// Mean force and torque on every surface, in the order of [`crate::sim::reaction`]; empty for frame 0.
    pub reactions: Vec<Reaction>,
    /// The steps of an implicit engine, in order; empty for an explicit one.
    pub solves: Vec<Solve>,
}

/// How the minimisation of one implicit step went.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Solve {
    /// Time at the step's end (s).
    pub time_s: f64,
    pub dt_s: f64,
    /// Outer iterations: Newton or quasi-Newton steps.
    pub iterations: u32,
    /// Iterations of the linear solvers inside these; a V-cycle counts as one.
    pub inner_iterations: u32,
    /// ε sqrt(Σ |r_i|² / tol_i² / n), the residual in the characteristic norm (HOT §5.2): at most ε when converged.
    pub residual: f64,
    /// Halvings of the line search.
    pub halvings: u32,
    /// Levels of the hierarchy; 1 without one.
    pub levels: u32,
    /// Non-zero blocks of the finest matrix; 0 without a matrix.
    pub nonzeros: u64,
    pub converged: bool,
}

/// Asked by engines between batches of steps.
pub trait Control: Sync {
    /// True once the job shall stop; the engine returns [`EngineError::Canceled`] within a fraction of a second.
    fn canceled(&self) -> bool {
        false
    }
    /// Steps done so far in the whole run, and simulated time (s).
    fn progress(&self, _step: u64, _time_s: f64) {}
}

/// No cancellation, no progress.
pub struct NoControl;
impl Control for NoControl {}

/// Failures of a run. `code` is stable: it is what API users see as `failure.code`.
#[derive(Debug, thiserror::Error)]
pub enum EngineError {
    #[error("canceled")]
    Canceled,
    #[error("the device cannot hold the scene: {0}")]
    Capacity(String),
    #[error("the simulation diverged at step {step} (t = {time_s:.6} s): {what}")]
    Diverged { step: u64, time_s: f64, what: String },
    #[error("a particle left the domain at step {step} (t = {time_s:.6} s): {what}")]
    LeftDomain { step: u64, time_s: f64, what: String },
    #[error("this engine cannot run the scene: {0}")]
    Unsupported(String),
    #[error("the device was lost: {0}")]
    DeviceLost(String),
    #[error("no usable device: {0}")]
    NoDevice(String),
}

impl EngineError {
    /// Stable code for APIs.
    pub fn code(&self) -> &'static str {
        match self {
            Self::Canceled => "canceled",
            Self::Capacity(_) => "capacity",
            Self::Diverged { .. } => "diverged",
            Self::LeftDomain { .. } => "left_domain",
            Self::Unsupported(_) => "unsupported",
            Self::DeviceLost(_) => "device_lost",
            Self::NoDevice(_) => "no_device",
        }
    }
}

/// A loaded simulation on one device. Construction loads the problem at time 0.
pub trait Engine {
    fn backend(&self) -> &Backend;

    /// Simulates one frame of `frame_s` seconds, in equal steps.
    fn advance_frame(&mut self, frame_s: f64, control: &dyn Control) -> Result<FrameStats, EngineError>;

    /// Adds particles at a frame boundary; their ids follow those that are there. In all there may be as many as
    /// [`crate::sim::problem::Problem::total_particles`] of the problem that was loaded.
    fn append(&mut self, particles: &Particles) -> Result<(), EngineError>;

    /// Particle states at the last frame boundary, in sampling order.
    fn snapshot(&mut self) -> Result<Particles, EngineError>;
}
