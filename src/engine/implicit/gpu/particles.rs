//! Particle states to the device and back.

use super::step::DeviceStep;
use crate::contract::EngineError;
use crate::explicit::gpu::readback::read;
use gridfall_core::sim::particles::Particles;

impl DeviceStep {
    /// Particles that there are.
    pub fn live(&self) -> usize {
        self.frame.body_of.len()
    }

    /// Puts particles behind those that there are, for which there must be room.
    pub fn append(&mut self, particles: &Particles) -> Result<(), EngineError> {
        let data = self.frame.data(particles)?;
        let (first, n, room) = (self.live(), particles.len(), self.buffers.sizes.particles);
        let put = |name: &str, at: usize, bytes: &[u8]| {
            self.gpu.queue.write_buffer(self.buffers.get(name), at as u64, bytes);
        };
        let tags: Vec<[u32; 2]> = (first as u32..).zip(&particles.body).map(|(id, &body)| [id, body]).collect();
        put("position_in", 16 * first, bytemuck::cast_slice(&data.position));
        put("tag_in", 8 * first, bytemuck::cast_slice(&tags));
        for (k, channel) in
            data.velocity.chunks_exact(n.max(1)).chain(data.deformation.chunks_exact(n.max(1))).enumerate()
        {
            put("state_in", 4 * (k * room + first), bytemuck::cast_slice(channel));
        }
        self.frame.body_of.extend(&particles.body);
        self.params.particles = self.live() as u32;
        self.gpu.check()
    }

    /// Particle states at the end of the last step that was kept, by id.
    pub fn snapshot(&self) -> Result<Particles, EngineError> {
        self.particles_of("position_in", "tag_in", "state_in")
    }

    fn particles_of(&self, position: &str, tag: &str, state: &str) -> Result<Particles, EngineError> {
        let (n, room) = (self.live(), self.buffers.sizes.particles);
        let channels = self.buffers.sizes.channels;
        let place: Vec<[u32; 4]> = read(&self.gpu, self.buffers.get(position), n)?;
        let tags: Vec<[u32; 2]> = read(&self.gpu, self.buffers.get(tag), n)?;
        let state: Vec<f32> = read(&self.gpu, self.buffers.get(state), channels * room)?;
        let mut position = vec![[0; 4]; n];
        let mut by_id = vec![0.0; channels * n];
        for (at, &[id, _]) in tags.iter().enumerate() {
            position[id as usize] = place[at];
            for k in 0..channels {
                by_id[k * n + id as usize] = state[k * room + at];
            }
        }
        let (velocity, deformation) = by_id.split_at(12 * n);
        Ok(self.frame.particles(&position, velocity, deformation, n))
    }

    /// Particle states at the start of the step that has begun.
    pub fn before(&self) -> Result<Particles, EngineError> {
        self.particles_of("position", "tag", "state")
    }
}
