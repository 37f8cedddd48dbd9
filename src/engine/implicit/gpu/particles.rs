//! Particle states to the device and back.

use std::io::{Read, Write};

use super::layout::{TOUCH_CHANNELS, UNMET};
use super::step::DeviceStep;
use crate::contract::{EngineError, StateError};
use crate::state::{get, get_bodies, get_count, get_one, get_time, put, put_time};
use gridfall_core::sim::particles::Particles;
use gridfall_core::sim::side::Plates;
use gridfall_core::sim::touch::Touch;

impl DeviceStep {
    /// Particles that there are.
    pub fn live(&self) -> usize {
        self.body_of.len()
    }

    /// Puts particles behind those that there are, for which there must be room.
    pub fn append(&mut self, particles: &Particles) -> Result<(), EngineError> {
        let state = self.layout.state(particles, 0..particles.len(), &Plates::of(&self.setup, 0.0))?;
        let (first, n, room) = (self.live(), particles.len(), self.buffers.counts.particles);
        let memory = &self.buffers.memory;
        let tags: Vec<[u32; 2]> = (first as u32..).zip(&particles.body).map(|(id, &body)| [id, body]).collect();
        memory.write(&self.gpu, "position_in", first, &state.position);
        memory.write(&self.gpu, "tag_in", first, &tags);
        let touches = if self.buffers.counts.touches { touches(particles) } else { Vec::new() };
        let channels = [&state.velocity, &state.deformation, &touches].map(|values| values.chunks_exact(n.max(1)));
        for (k, channel) in channels.into_iter().flatten().enumerate() {
            memory.write(&self.gpu, "state_in", k * room + first, channel);
        }
        self.body_of.extend(&particles.body);
        self.contact.total += particles.body.iter().map(|&b| self.setup.bodies[b as usize].mass).sum::<f64>();
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
        let mut particles = self.layout.particles(self.body_of.clone(), &position, velocity, deformation, n);
        if self.buffers.counts.touches {
            particles.touch = remembered(&by_id[self.params.touch as usize * n..], n);
        }
        Ok(particles)
    }

    /// Particle states at the start of the step that has begun.
    pub fn before(&self) -> Result<Particles, EngineError> {
        self.particles_of("position", "tag", "state")
    }
}

impl DeviceStep {
    /// Writes the particles as the next step finds them, in the device's order.
    pub fn save(&self, to: &mut dyn Write) -> Result<(), StateError> {
        let (n, room, channels) = (self.live(), self.buffers.counts.particles, self.buffers.counts.channels);
        let memory = &self.buffers.memory;
        put_time(to, self.contact.met_s)?;
        put(to, &[self.contact.total])?;
        put(to, &[n as u64])?;
        put(to, &self.body_of)?;
        put(to, &memory.read::<[u32; 4]>(&self.gpu, "position_in", n)?)?;
        put(to, &memory.read::<[u32; 2]>(&self.gpu, "tag_in", n)?)?;
        Ok(put(to, &memory.read::<f32>(&self.gpu, "state_in", channels * room)?)?)
    }

    /// Takes over what was saved.
    pub fn restore(&mut self, from: &mut dyn Read) -> Result<(), StateError> {
        let (room, channels) = (self.buffers.counts.particles, self.buffers.counts.channels);
        self.contact.met_s = get_time(from)?;
        self.contact.total = get_one(from)?;
        let n = get_count(from, room, "particles")?;
        self.body_of = get_bodies(from, n, self.setup.bodies.len())?;
        let memory = &self.buffers.memory;
        memory.write(&self.gpu, "position_in", 0, &get::<[u32; 4]>(from, n)?);
        memory.write(&self.gpu, "tag_in", 0, &get::<[u32; 2]>(from, n)?);
        memory.write(&self.gpu, "state_in", 0, &get::<f32>(from, channels * room)?);
        self.buffers.live = n;
        self.params.particles = n as u32;
        Ok(self.gpu.check()?)
    }
}

/// What particles remember of contact, by channel.
fn touches(particles: &Particles) -> Vec<f32> {
    let n = particles.len();
    let mut channels = vec![0.0; TOUCH_CHANNELS * n];
    channels[..n].fill(UNMET);
    for (id, touch) in particles.touch.iter().enumerate() {
        channels[id] = touch.with as f32;
        for (k, value) in (1..).zip([touch.radius].iter().chain(&touch.stretch)) {
            channels[k * n + id] = *value as f32;
        }
    }
    channels
}

/// The same as particles have it: of those before the first that has met no faces yet.
fn remembered(channels: &[f32], n: usize) -> Vec<Touch> {
    let value = |k: usize, id: usize| f64::from(channels[k * n + id]);
    let touch =
        |id: usize| Touch { radius: value(1, id), stretch: [2, 3, 4].map(|k| value(k, id)), with: channels[id] as u32 };
    (0..n).take_while(|&id| channels[id] != UNMET).map(touch).collect()
}
