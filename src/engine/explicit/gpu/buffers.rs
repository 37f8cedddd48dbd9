//! Device memory of a simulation: every size in one place.

use super::layout::{self, BLOCK_NODES, NODE_CHANNELS, TOUCH_CHANNELS, WORK_MAX};
use super::scene::SceneSizes;
use super::stages::{Extent, Placed};
use super::table;
use super::upload::{DeviceLayout, DeviceState, grid_offsets};
use crate::contract::EngineError;
use crate::gpu::Gpu;
use crate::gpu::memory::{Memory, Sizes, indirect, storage, uniform};
use crate::gpu::program::Workgroups;
use gridfall_core::sim::setup::Setup;
use gridfall_core::sim::touch;

/// Steps whose collider poses are uploaded at once, the most that one submission holds.
pub const CHUNK_STEPS: usize = 256;

/// What decides the size of every buffer.
#[derive(Clone, Copy, Debug)]
pub struct Counts {
    /// All that there will be.
    pub particles: usize,
    /// Slots for active blocks.
    pub capacity: usize,
    pub grids: usize,
    /// Deformation channels: 1 (fluids only), 9 or 10 (with plastic state).
    pub channels: usize,
    /// Whether colliders act on particles.
    pub touches: bool,
    pub scene: SceneSizes,
}

impl Counts {
    /// Of a scene with so many particles in all, in so many blocks.
    pub fn of(setup: &Setup, scene: SceneSizes, particles: usize, blocks: usize) -> Self {
        let layout = DeviceLayout::new(setup);
        Self {
            particles,
            // Room to spread before the first growth.
            capacity: blocks * 5 / 4 + 64,
            grids: grid_offsets(setup.kernel).len(),
            channels: layout.channels,
            touches: touch::acts(setup),
            scene,
        }
    }

    /// Buffers with the deformation of particles by id, and their channels.
    pub fn deformation(&self) -> [(&'static str, usize); 2] {
        let [first, rest] = layout::deformation_parts(self.channels);
        [("frame_deformation", first), ("frame_rest", rest)]
    }

    /// Buffers by the names in `wgsl/explicit/layout.wgsl`.
    pub fn sizes(&self) -> Sizes {
        let (particles, capacity) = (self.particles, self.capacity);
        let grid = capacity * self.grids * BLOCK_NODES * NODE_CHANNELS * 4;
        let by_id = |channels: usize| particles * channels * 4;
        let grouped = |channels: usize| particles.next_multiple_of(layout::STATE_GROUP) * channels * 4;
        let [first, rest] = layout::deformation_parts(self.channels);
        let work = capacity + particles / WORK_MAX + 1;
        let mut buffers = vec![
            uniform("params", size_of::<layout::Params>()),
            indirect("dispatches_in", layout::DISPATCHES * layout::DISPATCH_BYTES),
            indirect("dispatches_out", layout::DISPATCHES * layout::DISPATCH_BYTES),
            storage("report", size_of::<layout::Report>()),
            storage("table_in", table::entries(capacity) * 8),
            storage("table_out", table::entries(capacity) * 8),
            storage("blocks_in", capacity * 4),
            storage("blocks_out", capacity * 4),
            storage("grid_in", grid),
            storage("grid_out", grid),
            storage("bins", capacity * 4),
            storage("work", work * size_of::<layout::Work>()),
            storage("destinations", particles * 8),
            storage("list", particles * 4),
            storage("position_in", particles * 16),
            storage("position_out", particles * 16),
            storage("deformation_in", grouped(first)),
            storage("deformation_out", grouped(first)),
            storage("rest_in", grouped(rest)),
            storage("rest_out", grouped(rest)),
            storage("frame_position", particles * 16),
            storage("frame_deformation", by_id(first)),
            storage("frame_rest", by_id(rest)),
            storage("body_of", particles * 4),
            // And where they are afterwards.
            self.scene.poses(CHUNK_STEPS + 1),
            storage("touches", if self.touches { particles * TOUCH_CHANNELS * 4 } else { 4 }),
            storage("reactions", layout::REPLICAS * self.scene.reaction_sums() * 8),
        ];
        buffers.extend(layout::MOTION.map(|(name, channels)| storage(name, by_id(channels))));
        buffers.extend(self.scene.buffers);
        Sizes {
            buffers,
            load: format!("{particles} particles and {capacity} blocks"),
            remedy: "use fewer particles, a larger domain.dx, or the CPU engine",
        }
    }
}

/// All buffers of one simulation.
pub struct Buffers {
    pub counts: Counts,
    /// Particles that there are, of the room for [`Counts::particles`].
    pub live: usize,
    pub memory: Memory,
}

impl Buffers {
    /// Zeroed buffers. Errors: [`EngineError::Capacity`] when one does not fit the device.
    pub fn new(gpu: &Gpu, counts: Counts) -> Result<Self, EngineError> {
        Ok(Self { counts, live: 0, memory: Memory::new(gpu, &counts.sizes())? })
    }

    /// Writes states behind those that there are, for which there must be room.
    pub fn put_states(&mut self, gpu: &Gpu, state: &DeviceState, body_of: &[u32]) {
        let (first, stride, n) = (self.live, self.counts.particles, state.position.len());
        let channels = |parts: &[(&str, usize)], values: &[f32]| {
            let places = parts.iter().flat_map(|&(name, channels)| (0..channels).map(move |k| (name, k)));
            for ((name, k), channel) in places.zip(values.chunks_exact(n.max(1))) {
                self.memory.write(gpu, name, k * stride + first, channel);
            }
        };
        self.memory.write(gpu, "frame_position", first, &state.position);
        self.memory.write(gpu, "body_of", first, body_of);
        channels(&layout::MOTION, &state.velocity);
        channels(&self.counts.deformation(), &state.deformation);
        for (k, channel) in state.touches.chunks_exact(n.max(1)).enumerate() {
            self.memory.write(gpu, "touches", k * stride + first, channel);
        }
        self.live += n;
    }

    /// Makes room for `capacity` blocks; the grid and block list of `side`, bins and work survive.
    pub fn grow(&mut self, gpu: &Gpu, capacity: usize, side: usize) -> Result<(), EngineError> {
        self.counts.capacity = capacity;
        self.memory.grow(gpu, &self.counts.sizes(), side, &["blocks_in", "grid_in", "bins", "work"])
    }

    /// What an extent stands for now, with `workgroup` lanes.
    pub fn groups(&self, (extent, side): Placed, workgroup: u32) -> Workgroups<'_> {
        let on_device = |name: &str, groups| {
            Workgroups::Device(self.memory.of_side(name, side), (layout::DISPATCH_BYTES * groups as usize) as u64)
        };
        match extent {
            Extent::Particles => Workgroups::Folded(self.live.div_ceil(workgroup as usize)),
            Extent::Slots => Workgroups::Folded(self.counts.capacity),
            Extent::Device(groups) => on_device("dispatches_in", groups),
            Extent::Late(groups) => on_device("dispatches_out", groups),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::scene::SceneData;
    use super::*;
    use crate::gpu::{WORKGROUP, memory::most_bytes};

    /// The largest binding of Vulkan and DX12 by way of wgpu, and indices of 32 bits.
    #[test]
    fn a_hundred_million_particles_fit_bindings() {
        let particles = 100_000_000;
        // Eight to a cell in a body without much surface, and everything that a scene may have.
        let capacity = particles / 512 * 3 / 2;
        let scene = SceneData::default().sizes();
        let counts = Counts { particles, capacity, grids: 2, channels: 10, touches: true, scene };
        let sizes = counts.sizes();
        let limits = wgpu::Limits {
            max_storage_buffer_binding_size: (1 << 31) - 1,
            max_buffer_size: 1 << 40,
            ..Default::default()
        };
        sizes.check(&limits).unwrap_or_else(|e| panic!("{e}"));
        let words = sizes.buffers.iter().map(|size| size.bytes / 4).max().unwrap();
        println!("{:.1} GB in all, at most {words} words a buffer", sizes.total_bytes() as f64 / 1e9);
        assert!(most_bytes(&limits) as usize / 4 >= words && words < u32::MAX as usize);
        // Without a plastic state or contact at particles, still more.
        let simple = Counts { particles: 107_000_000, channels: 9, touches: false, ..counts };
        simple.sizes().check(&limits).unwrap_or_else(|e| panic!("{e}"));
        let [x, y] = crate::gpu::program::folded(particles.div_ceil(WORKGROUP as usize));
        assert!(x <= 65_535 && y <= 65_535 && (x * y) as usize * WORKGROUP as usize >= particles);
        // A buffer more than that is refused with a remedy.
        let too_many = Counts { particles: 140_000_000, ..counts };
        let refusal = too_many.sizes().check(&limits).unwrap_err().to_string();
        assert!(refusal.contains("use fewer particles"), "{refusal}");
    }
}
