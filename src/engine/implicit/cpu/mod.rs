//! The implicit step on the CPU, in f64.

mod stepper;

use self::stepper::CpuStepper;
use super::engine::{ImplicitEngine, Stepper};
use super::step::max_speed_m_s;
use crate::contract::{Backend, EngineError};
use gridfall_core::sim::particles::Particles;
use gridfall_core::sim::settings::Method;
use gridfall_core::sim::setup::Setup;
use gridfall_core::sim::touch;

impl ImplicitEngine {
    /// Loads a problem at time 0 on the CPU.
    ///
    /// Errors: [`EngineError::Capacity`] beyond 2³² places of nodes, [`EngineError::Unsupported`]
    /// for fluids, damping, and colliders that act on particles with ADMM.
    pub fn new(setup: &Setup, particles: Particles) -> Result<Self, EngineError> {
        let total = setup.total_particles();
        if total > (u32::MAX / 64) as usize {
            return Err(EngineError::Capacity(format!("{total} particles; the implicit engine counts to 2^26")));
        }
        if setup.bodies.iter().any(|body| setup.materials[body.material].is_fluid()) {
            return Err(EngineError::Unsupported("fluids are integrated explicitly".into()));
        }
        if setup.bodies.iter().any(|body| setup.materials[body.material].damping() > 0.0) {
            return Err(EngineError::Unsupported("damping is integrated explicitly".into()));
        }
        if setup.implicit.method == Method::Admm && touch::acts(setup) {
            return Err(EngineError::Unsupported(
                "admm has colliders act on nodes only; use \"contact\": \"nodes\" or another method".into(),
            ));
        }
        let backend = Backend::this_cpu("the implicit solver runs every scene on the CPU");
        let fastest = max_speed_m_s(&particles);
        let stepper: Box<dyn Stepper> = match setup.dimension {
            2 => Box::new(CpuStepper::<2>::new(setup, particles)),
            _ => Box::new(CpuStepper::<3>::new(setup, particles)),
        };
        Ok(Self::of(stepper, backend, fastest))
    }
}
