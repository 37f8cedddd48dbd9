//! Which engine runs a problem, and why.

use std::sync::Arc;

use super::contract::{Engine, EngineError};
use crate::explicit::cpu::CpuEngine;
use crate::explicit::gpu::{GpuEngine, supports};
use crate::gpu::Gpu;
use crate::implicit::engine::ImplicitEngine;
use crate::implicit::gpu as implicit;
use gridfall_core::sim::particles::Particles;
use gridfall_core::sim::setup::{Integrator, Setup};

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
pub struct Devices {
    choice: Choice,
    gpu: Option<Arc<Gpu>>,
    /// Why the GPU was or was not opened.
    reason: String,
}

impl Devices {
    /// Opens what `choice` needs. `adapter` is part of an adapter's name; naming one is the only
    /// way to a software Vulkan driver.
    ///
    /// Errors: [`EngineError::NoDevice`] when a GPU was asked for, by choice or by name, and there is none.
    pub fn open(choice: Choice, adapter: Option<&str>) -> Result<Self, EngineError> {
        if choice == Choice::Cpu {
            return Ok(Self { choice, gpu: None, reason: "the CPU was asked for".into() });
        }
        match (Gpu::open(adapter), adapter) {
            (Ok(gpu), Some(name)) => {
                Ok(Self { choice, gpu: Some(Arc::new(gpu)), reason: format!("adapter \"{name}\" was asked for") })
            }
            (Ok(gpu), None) => {
                Ok(Self { choice, gpu: Some(Arc::new(gpu)), reason: "the first GPU of this machine".into() })
            }
            (Err(e), None) if choice == Choice::Auto => Ok(Self { choice, gpu: None, reason: e.to_string() }),
            (Err(e), _) => Err(e),
        }
    }

    /// Loads a problem on the device that suits it.
    ///
    /// Errors: the scene is not for the GPU though the GPU was asked for, or does not fit.
    pub fn engine(&self, setup: &Setup, particles: Particles) -> Result<Box<dyn Engine>, EngineError> {
        let Some(gpu) = &self.gpu else {
            return on_cpu(setup, particles, &self.reason);
        };
        let fits = if setup.integrator == Integrator::Implicit { implicit::supports } else { supports };
        match fits(setup) {
            Ok(()) => on_gpu(gpu.clone(), setup, particles, &self.reason),
            Err(why) if self.choice == Choice::Auto => on_cpu(setup, particles, &why),
            Err(why) => Err(EngineError::Unsupported(format!("{why}; use --backend cpu or auto"))),
        }
    }

    /// Why the GPU was or was not opened.
    pub fn reason(&self) -> &str {
        &self.reason
    }

    /// The GPU that was opened, if one was.
    pub fn gpu(&self) -> Option<&Arc<Gpu>> {
        self.gpu.as_ref()
    }
}

fn on_cpu(setup: &Setup, particles: Particles, reason: &str) -> Result<Box<dyn Engine>, EngineError> {
    Ok(match setup.integrator {
        Integrator::Implicit => Box::new(ImplicitEngine::new(setup, particles)?.because(reason)),
        _ => Box::new(CpuEngine::new(setup, particles)?.because(reason)),
    })
}

fn on_gpu(gpu: Arc<Gpu>, setup: &Setup, particles: Particles, reason: &str) -> Result<Box<dyn Engine>, EngineError> {
    Ok(match setup.integrator {
        Integrator::Implicit => Box::new(ImplicitEngine::on_gpu(gpu, setup, particles, reason)?),
        _ => Box::new(GpuEngine::new(gpu, setup, particles, reason)?),
    })
}
