//! What a frame starts from, as bytes: the full states as the device has them, and what the host plans with.

use std::io::{Read, Write};

use super::engine::GpuEngine;
use super::layout::{self, TOUCH_CHANNELS};
use crate::contract::StateError;
use crate::state::{get, get_bodies, get_count, get_one, put};

impl GpuEngine {
    /// Buffers of full states that have a number of values a particle of the room for all.
    fn channels(&self) -> impl Iterator<Item = (&'static str, usize)> {
        let counts = &self.buffers.counts;
        let touches = counts.touches.then_some(("touches", TOUCH_CHANNELS));
        layout::MOTION.into_iter().chain(counts.deformation()).chain(touches)
    }

    pub(super) fn save_state(&self, to: &mut dyn Write) -> Result<(), StateError> {
        let (live, room) = (self.buffers.live, self.buffers.counts.particles);
        put(to, &[self.steps, live as u64])?;
        put(to, &[self.time_s, self.max_speed, self.max_demand, self.mass_range, self.momentum_range])?;
        put(to, &self.memory().read::<u32>(&self.gpu, "body_of", live)?)?;
        put(to, &self.memory().read::<[u32; 4]>(&self.gpu, "frame_position", live)?)?;
        for (name, channels) in self.channels() {
            for channel in 0..channels {
                put(to, &self.memory().read_from::<u32>(&self.gpu, name, channel * room, room)?)?;
            }
        }
        Ok(())
    }

    pub(super) fn restore_state(&mut self, from: &mut dyn Read) -> Result<(), StateError> {
        let room = self.buffers.counts.particles;
        self.steps = get_one(from)?;
        let live = get_count(from, room, "particles")?;
        [self.time_s, self.max_speed, self.max_demand, self.mass_range, self.momentum_range] = get_one(from)?;
        let body_of = get_bodies(from, live, self.setup.bodies.len())?;
        self.memory().write(&self.gpu, "body_of", 0, &body_of);
        self.memory().write(&self.gpu, "frame_position", 0, &get::<[u32; 4]>(from, live)?);
        for (name, channels) in self.channels() {
            for channel in 0..channels {
                self.memory().write(&self.gpu, name, channel * room, &get::<u32>(from, room)?);
            }
        }
        self.buffers.live = live;
        self.population.fill(0);
        self.count(&body_of);
        Ok(self.gpu.check()?)
    }
}
