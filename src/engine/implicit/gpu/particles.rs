//! Particle states to the device and back.

use super::step::DeviceStep;
use crate::contract::EngineError;
use gridfall_core::sim::particles::Particles;
use gridfall_core::sim::side::Plates;

impl DeviceStep {
    /// Particles that there are.
    pub fn live(&self) -> usize {
        self.layout.body_of.len()
    }

    /// Puts particles behind those that there are, for which there must be room.
    pub fn append(&mut self, particles: &Particles) -> Result<(), EngineError> {
        let state = self.layout.state(particles, &Plates::of(&self.setup, 0.0))?;
        let (first, n, room) = (self.live(), particles.len(), self.buffers.counts.particles);
        let memory = &self.buffers.memory;
        let tags: Vec<[u32; 2]> = (first as u32..).zip(&particles.body).map(|(id, &body)| [id, body]).collect();
        memory.write(&self.gpu, "position_in", first, &state.position);
        memory.write(&self.gpu, "tag_in", first, &tags);
        let channels = [&state.velocity, &state.deformation].map(|values| values.chunks_exact(n.max(1)));
        for (k, channel) in channels.into_iter().flatten().enumerate() {
            memory.write(&self.gpu, "state_in", k * room + first, channel);
        }
        self.layout.body_of.extend(&particles.body);
        self.buffers.live = self.live();
        self.params.particles = self.live() as u32;
        self.gpu.check()
    }

    /// Particle states at the end of the last step that was kept, by id.
    pub fn snapshot(&self) -> Result<Particles, EngineError> {
        self.particles_of("position_in", "tag_in", "state_in")
    }

    fn particles_of(&self, position: &str, tag: &str, state: &str) -> Result<Particles, EngineError> {
        let (n, room, channels) = (self.live(), self.buffers.counts.particles, self.buffers.counts.channels);
        let memory = &self.buffers.memory;
        let place: Vec<[u32; 4]> = memory.read(&self.gpu, position, n)?;
        let tags: Vec<[u32; 2]> = memory.read(&self.gpu, tag, n)?;
        let state: Vec<f32> = memory.read(&self.gpu, state, channels * room)?;
        let mut position = vec![[0; 4]; n];
        let mut by_id = vec![0.0; channels * n];
        for (at, &[id, _]) in tags.iter().enumerate() {
            position[id as usize] = place[at];
            for k in 0..channels {
                by_id[k * n + id as usize] = state[k * room + at];
            }
        }
        let (velocity, deformation) = by_id.split_at(12 * n);
        Ok(self.layout.particles(&position, velocity, deformation, n))
    }

    /// Particle states at the start of the step that has begun.
    pub fn before(&self) -> Result<Particles, EngineError> {
        self.particles_of("position", "tag", "state")
    }
}
