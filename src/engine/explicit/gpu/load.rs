//! Particles onto the device, a part at a time, so that little of them is in memory twice.

use super::engine::GpuEngine;
use crate::contract::EngineError;
use gridfall_core::sim::particles::Particles;
use gridfall_core::sim::side::Plates;

/// Particles that are converted and sent at a time.
const PART: usize = 1 << 18;

impl GpuEngine {
    /// Puts particles behind those that there are, for which there must be room.
    pub(super) fn put(&mut self, particles: &Particles) -> Result<(), EngineError> {
        let plates = Plates::of(&self.setup, self.time_s);
        let n = particles.len();
        for first in (0..n).step_by(PART) {
            let some = first..n.min(first + PART);
            let state = self.layout.state(particles, some.clone(), &plates)?;
            self.buffers.put_states(&self.gpu, &state, &particles.body[some]);
            // What was written waits in memory for the next submission to be done.
            let sent = self.gpu.submit(|_| {});
            self.gpu.wait(Some(sent))?;
        }
        self.count(&particles.body);
        Ok(())
    }

    /// Accounts for particles that are on the device now.
    pub(super) fn count(&mut self, body_of: &[u32]) {
        body_of.iter().for_each(|&body| self.population[body as usize] += 1);
        self.params.live = self.buffers.live as u32;
    }
}
