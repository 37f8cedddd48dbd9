//! The implicit engine on the device: what it can run, and its stages as the frame loop calls them.

use std::borrow::Cow;
use std::io::{Read, Write};
use std::sync::Arc;

use super::linear::Minimiser;
use super::step::DeviceStep;
use crate::contract::{Control, EngineError, Solve, StateError};
use crate::gpu::device::Gpu;
use crate::implicit::engine::{ImplicitEngine, Moved, Stepper};
use crate::implicit::step::max_speed_m_s;
use gridfall_core::material::Law;
use gridfall_core::sim::particles::Particles;
use gridfall_core::sim::settings::{CoarseSolve, Method};
use gridfall_core::sim::setup::{Axis, Body, Setup};
use gridfall_core::sim::touch;

/// Fewest cells along a periodic axis: no node may be its own neighbour's neighbour from both
/// sides.
const LEAST_PERIOD: usize = 8;

/// Part of a body's inertia that rounding of its stiffness may be.
const ROUNDING_SHARE: f64 = 0.2;

/// Whether the engine can run a problem at all; the reason if not.
pub fn supports(setup: &Setup) -> Result<(), String> {
    crate::explicit::gpu::supports(setup)?;
    if !matches!(setup.implicit.method, Method::Newton | Method::Hot) {
        return Err("the GPU engine has the implicit methods newton and hot".into());
    }
    if setup.implicit.coarse_solve != CoarseSolve::Fixed {
        return Err("the GPU engine has the coarse solve fixed".into());
    }
    if touch::acts(setup) && setup.implicit.method != Method::Newton {
        return Err("on the GPU, colliders act on particles with the method newton only".into());
    }
    if setup.materials.iter().any(|material| material.is_fluid()) {
        return Err("fluids are integrated explicitly".into());
    }
    if setup.materials.iter().any(|material| material.damping() > 0.0) {
        return Err("damping is integrated explicitly".into());
    }
    let short = |a: usize| setup.axes[a] == Axis::Periodic && setup.cells[a] < LEAST_PERIOD;
    if (0..3).any(short) {
        return Err(format!("the GPU's implicit engine needs {LEAST_PERIOD} cells along a periodic axis"));
    }
    Ok(())
}

/// The longest step (s) of Newton's method in f32. Rounding of the Hessian resists or feeds what a body
/// does as a whole with a share ε ξ dt²/(ρ dx²) of its inertia, ξ the characteristic stiffness.
fn longest_s(setup: &Setup) -> f64 {
    let of_body = |body: &Body| {
        let stiffness = Law::<f64>::new(&setup.materials[body.material]).characteristic::<3>();
        setup.dx * (ROUNDING_SHARE / f64::from(f32::EPSILON) * body.mass / body.volume0 / stiffness).sqrt()
    };
    setup.bodies.iter().map(of_body).fold(f64::INFINITY, f64::min)
}

impl ImplicitEngine {
    /// Loads a problem at time 0 on a GPU. `reason` says why this device was chosen.
    ///
    /// Errors: unsupported scenes, capacity, a lost device.
    pub fn on_gpu(gpu: Arc<Gpu>, setup: &Setup, particles: Particles, reason: &str) -> Result<Self, EngineError> {
        supports(setup).map_err(EngineError::Unsupported)?;
        let backend = gpu.backend(reason);
        let stepper = GpuStepper {
            step: DeviceStep::new(gpu.clone(), setup, &particles)?,
            minimiser: Minimiser::new(setup.kernel, setup.implicit),
            gpu,
        };
        Ok(Self::of(Box::new(stepper), backend, max_speed_m_s(&particles)))
    }
}

/// The device's stages with the device's minimiser.
struct GpuStepper {
    gpu: Arc<Gpu>,
    step: DeviceStep,
    minimiser: Minimiser,
}

impl Stepper for GpuStepper {
    fn setup(&self) -> &Setup {
        &self.step.setup
    }

    fn live(&self) -> usize {
        self.step.live()
    }

    fn longest_s(&self) -> f64 {
        if self.step.setup.implicit.method == Method::Newton { longest_s(&self.step.setup) } else { f64::INFINITY }
    }

    fn begin(&mut self, time_s: f64, dt_s: f64, again: bool) -> Result<(), EngineError> {
        self.step.begin(time_s, dt_s, again)?;
        self.step.avoid_forbidden_start()
    }

    fn minimise(&mut self, _control: &dyn Control) -> Result<Solve, EngineError> {
        self.minimiser.minimise(&self.gpu, self.step.equations(), &self.step)
    }

    fn revise(&mut self) -> Result<bool, EngineError> {
        self.step.revise()
    }

    fn finish(&mut self) -> Result<Moved, EngineError> {
        self.step.finish()
    }

    /// Nothing: [`DeviceStep::begin`] takes the particles where they are, unless `again`.
    fn keep(&mut self) {}

    fn before(&self) -> Result<Cow<'_, Particles>, EngineError> {
        self.step.before().map(Cow::Owned)
    }

    fn append(&mut self, particles: Particles) -> Result<(), EngineError> {
        self.step.append(&particles)
    }

    fn snapshot(&self) -> Result<Particles, EngineError> {
        self.step.snapshot()
    }

    fn save(&self, to: &mut dyn Write) -> Result<(), StateError> {
        self.step.save(to)
    }

    fn restore(&mut self, from: &mut dyn Read) -> Result<(), StateError> {
        self.step.restore(from)
    }
}
