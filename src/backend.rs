//! Which engine runs a problem, and why.

use crate::engine::{Engine, EngineError};
use crate::sim::problem::Problem;

/// What the user asked for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Choice {
    /// A real GPU if there is one that can run the scene, else the CPU.
    #[default]
    Auto,
    Gpu,
    Cpu,
}

/// The devices of this process, opened once and shared by all its runs.
pub struct Devices {}

impl Devices {
    /// Opens what `choice` needs. `adapter` is part of an adapter's name; naming one is the only way to a software Vulkan driver.
    pub fn open(_choice: Choice, _adapter: Option<&str>) -> Result<Self, EngineError> {
        Ok(Self {})
    }

    /// Loads a problem on the device that suits it.
    pub fn engine(&self, _problem: &Problem) -> Result<Box<dyn Engine>, EngineError> {
        Err(EngineError::NoDevice("not wired yet".into()))
    }
}
