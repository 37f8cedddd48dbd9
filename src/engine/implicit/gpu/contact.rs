//! Contact at the particles within a step on the device; twin of `crate::implicit::physics::contact`.

use std::cell::Cell;

use super::layout::{APPEARS, HOLDING_BODIES, HOLDING_GRIPS, HOLDING_LIMITS, HOLDING_MASS};
use super::step::DeviceStep;
use crate::contract::EngineError;
use crate::explicit::gpu::layout::Pose;
use crate::explicit::gpu::scene;
use crate::implicit::solver::objective::Renewed;
use gridfall_core::sim::touch::Springs;

/// Units of mass that all particles together have.
const MASS_UNITS: f64 = (1u32 << 30) as f64;

/// What the host knows of a step's contact.
#[derive(Debug, Default)]
pub struct Contact {
    /// Of all particles (kg).
    pub total: f64,
    /// When particles last met faces that appear (s).
    pub(super) met_s: Option<f64>,
    /// Of the step (s).
    dt_s: f64,
    /// Of the nodes that are solved for (kg).
    mass: f64,
    /// The stiffness (N/m) of all springs that hold or press, since they were renewed.
    holding: Cell<f64>,
}

impl DeviceStep {
    /// All colliders at a step's start, and after it.
    pub(super) fn poses(&self, time_s: f64, dt: f64) -> Vec<Pose> {
        let (colliders, origin) = (&self.setup.colliders, self.setup.origin);
        let before = colliders.iter().map(|c| {
            let mut pose = scene::pose(c, origin, time_s, dt);
            if self.contact.met_s.is_some_and(|met_s| c.is_present(time_s) && !c.is_present(met_s)) {
                pose.linear[3] = APPEARS;
            }
            pose
        });
        before.chain(colliders.iter().map(|c| scene::pose(c, origin, time_s + dt, 0.0))).collect()
    }

    /// Units of a sum of masses a kg.
    pub(super) fn mass_unit(&self) -> f32 {
        (MASS_UNITS / self.contact.total) as f32
    }

    /// Takes note of a step of `dt` (s) from `time_s` that has begun.
    pub(super) fn begin_contact(&mut self, time_s: f64, dt: f64) -> Result<(), EngineError> {
        self.contact.met_s = Some(time_s);
        self.contact.dt_s = dt;
        if self.buffers.links > 0 {
            let found = self.read_holding()?;
            self.contact.mass = f64::from(found[HOLDING_MASS]) / f64::from(self.params.mass_unit);
            self.contact.holding.set(self.stiffness(&found));
        }
        Ok(())
    }

    fn read_holding(&self) -> Result<Vec<u32>, EngineError> {
        self.memory().read(&self.gpu, "holding", HOLDING_BODIES + self.setup.bodies.len())
    }

    /// Of all springs that hold or press (N/m).
    fn stiffness(&self, found: &[u32]) -> f64 {
        let counts = self.setup.bodies.iter().zip(&found[HOLDING_BODIES..]);
        counts.map(|(body, &count)| f64::from(count) * Springs::of(&self.setup, body).stiffness).sum()
    }

    /// Sets the limits of friction at the particles to what presses at `dv`, and says what that has changed.
    pub(super) fn renew_contact(&self) -> Result<Renewed, EngineError> {
        if self.buffers.links == 0 {
            return Ok(Renewed::Nothing);
        }
        self.gpu.submit(|encoder| {
            encoder.clear_buffer(self.memory().get("holding"), 0, None);
            self.run(&mut encoder.begin_compute_pass(&Default::default()), &self.stages.renew);
        });
        let found = self.read_holding()?;
        self.contact.holding.set(self.stiffness(&found));
        Ok(match (found[HOLDING_GRIPS], found[HOLDING_LIMITS]) {
            (0, 0) => Renewed::Nothing,
            (0, _) => Renewed::Forces,
            _ => Renewed::Contacts,
        })
    }

    /// Part of the tolerance that the error of velocities may have, so that the forces of stiff faces have no
    /// larger error than the tolerance either; at most 1.
    pub(super) fn contact_sharpness(&self) -> f64 {
        if self.buffers.links == 0 {
            return 1.0;
        }
        let Contact { dt_s, mass, holding, .. } = &self.contact;
        1.0 / (dt_s * (holding.get() / mass).sqrt()).max(1.0)
    }
}
