//! Device memory of a simulation: every size in one place.

use super::layout::{self, BLOCK_NODES, NODE_CHANNELS, TOUCH_CHANNELS, VELOCITY_CHANNELS, WORK_MAX};
use super::scene::SceneSizes;
use super::stages::{Extent, Placed};
use super::table;
use super::upload::DeviceState;
use crate::contract::EngineError;
use crate::gpu::Gpu;
use crate::gpu::memory::{Memory, Sizes, indirect, storage, uniform};
use crate::gpu::program::Workgroups;

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
    /// Buffers by the names in `wgsl/explicit/layout.wgsl`.
    pub fn sizes(&self) -> Sizes {
        let (particles, capacity) = (self.particles, self.capacity);
        let grid = capacity * self.grids * BLOCK_NODES * NODE_CHANNELS * 4;
        let deformation = particles * self.channels * 4;
        let groups = particles.next_multiple_of(layout::STATE_GROUP) * self.channels * 4;
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
            storage("deformation_in", groups),
            storage("deformation_out", groups),
            storage("frame_position", particles * 16),
            storage("frame_velocity", particles * VELOCITY_CHANNELS * 4),
            storage("frame_deformation", deformation),
            storage("body_of", particles * 4),
            // And where they are afterwards.
            self.scene.poses(CHUNK_STEPS + 1),
            storage("touches", if self.touches { particles * TOUCH_CHANNELS * 4 } else { 4 }),
            storage("reactions", layout::REPLICAS * self.scene.reaction_sums() * 8),
        ];
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
        let channels = |name: &str, values: &[f32]| {
            for (k, channel) in values.chunks_exact(n.max(1)).enumerate() {
                self.memory.write(gpu, name, k * stride + first, channel);
            }
        };
        self.memory.write(gpu, "frame_position", first, &state.position);
        self.memory.write(gpu, "body_of", first, body_of);
        channels("frame_velocity", &state.velocity);
        channels("frame_deformation", &state.deformation);
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
