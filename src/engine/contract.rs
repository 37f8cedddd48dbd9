//! What an engine does, whichever device it runs on: the trait, its errors and its controls.

use std::io::{self, Read, Write};

use serde::{Deserialize, Serialize};

use gridfall_core::sim::diagnostics::Totals;
use gridfall_core::sim::excerpt::{Choice, Excerpt};
use gridfall_core::sim::particles::Particles;
use gridfall_core::sim::setup::Setup;
pub use gridfall_core::sim::stats::{FrameStats, Solve};

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
    #[error("no room left for a source at t = {time_s:.6} s: {what}")]
    VesselFull { time_s: f64, what: String },
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
            Self::VesselFull { .. } => "vessel_full",
            Self::Unsupported(_) => "unsupported",
            Self::DeviceLost(_) => "device_lost",
            Self::NoDevice(_) => "no_device",
        }
    }
}

/// Why a state was not saved, or not restored.
#[derive(Debug, thiserror::Error)]
pub enum StateError {
    #[error(transparent)]
    Engine(#[from] EngineError),
    #[error("{0}")]
    Io(#[from] io::Error),
}

/// What is recorded of a frame boundary.
pub struct View {
    /// Sums over all particles.
    pub totals: Totals,
    /// One a choice.
    pub excerpts: Vec<Excerpt>,
}

/// A view that may still be on its way from a device. It does not change with what the engine does next.
pub struct Pending(Box<dyn FnOnce() -> Result<View, EngineError> + Send>);

impl Pending {
    /// One that `arrive` waits for, on whatever thread.
    pub fn new(arrive: impl FnOnce() -> Result<View, EngineError> + Send + 'static) -> Self {
        Self(Box::new(arrive))
    }

    /// Waits for it.
    pub fn arrive(self) -> Result<View, EngineError> {
        self.0()
    }
}

/// Takes positions (m) and bodies of some particles.
pub type TakePlaces<'a> = dyn FnMut(&[[f64; 3]], &[u32]) + 'a;

/// Number of parts in which a frame's particles leave an engine.
const PARTS: usize = 16;

/// Particles of one such part, for [`Engine::visit`].
fn part(setup: &Setup) -> usize {
    (setup.total_particles() / PARTS).max(1 << 16).next_multiple_of(Totals::PART)
}

/// A loaded simulation on one device. Construction loads the problem at time 0.
pub trait Engine {
    fn backend(&self) -> &Backend;

    /// Simulates one frame of `frame_s` seconds, in equal steps.
    fn advance_frame(&mut self, frame_s: f64, control: &dyn Control) -> Result<FrameStats, EngineError>;

    /// Adds particles at a frame boundary; their ids follow those that are there. In all there may be as many as
    /// [`gridfall_core::sim::setup::Setup::total_particles`] of the problem that was loaded.
    fn append(&mut self, particles: Particles) -> Result<(), EngineError>;

    /// Particle states at the last frame boundary, in sampling order.
    fn snapshot(&mut self) -> Result<Particles, EngineError>;

    /// Writes everything that the coming frames depend on, as it is at the last frame boundary. The engine is as it
    /// was. The bytes are for [`Self::restore`] of the same build on the same kind of device.
    fn save(&mut self, to: &mut dyn Write) -> Result<(), StateError>;

    /// Takes over a saved state. This engine has loaded the same problem; what it did since is forgotten. The run goes
    /// on as the one that was saved would have, to the bit.
    ///
    /// Errors: those of `from`, a state of another problem, a lost device. The engine is then not to be used.
    fn restore(&mut self, from: &mut dyn Read) -> Result<(), StateError>;

    /// Hands over the particle states at the last frame boundary in sampling order, in parts of
    /// about `part` particles, so that not all of them have to be in memory beside the engine's
    /// own, each with the index of its first. An engine that has them all at hand anyway hands them
    /// over in one.
    fn visit(&mut self, _part: usize, take: &mut dyn FnMut(usize, Particles)) -> Result<(), EngineError> {
        take(0, self.snapshot()?);
        Ok(())
    }

    /// The last frame boundary, as far as it is recorded: totals, and the states of chosen particles. `setup` is that
    /// of the problem that was loaded. An engine whose particles are on a device only asks for it here; who needs the
    /// view waits, which may be another thread while the next frame is computed.
    fn view(&mut self, setup: &Setup, choices: &[Choice]) -> Result<Pending, EngineError> {
        let mut totals = Totals::default();
        let mut excerpts: Vec<Excerpt> = choices.iter().map(Excerpt::of).collect();
        self.visit(part(setup), &mut |first, particles| {
            totals.add(setup, &particles);
            excerpts.iter_mut().zip(choices).for_each(|(excerpt, choice)| excerpt.take(choice, first, &particles));
        })?;
        Ok(Pending::new(move || Ok(View { totals, excerpts })))
    }

    /// Hands over positions (m) and bodies at the last frame boundary, in parts and in sampling order.
    fn positions(&mut self, setup: &Setup, take: &mut TakePlaces) -> Result<(), EngineError> {
        self.visit(part(setup), &mut |_, particles| take(&particles.x, &particles.body))
    }
}
