//! Device memory of an implicit simulation beside its [`System`]: every size in one place.

use super::interface::{System, slots};
use super::layout::{HOLDING_BODIES, Link, PRESS_CHANNELS, Params, Report, Sweep, Touch};
use super::stages::Extent;
use crate::explicit::gpu::scene::SceneSizes;
use crate::gpu::memory::{Memory, Sizes, storage, uniform};
use crate::gpu::program::Workgroups;
use gridfall_core::sim::setup::Kernel;

/// Lanes of a workgroup (`LANES` in the shaders).
const LANES: usize = 64;
/// Entries that a workgroup of a prefix sum takes.
const PART: usize = 2048;
/// Lanes of the pass that adds the parts' sums.
const ENTRIES: usize = 256;

/// What decides the size of every buffer.
#[derive(Clone, Copy, Debug)]
pub struct Counts {
    pub kernel: Kernel,
    /// All that there will be.
    pub particles: usize,
    /// Channels of a particle's state: v, B, F and, if any law has one, the plastic state; what it
    /// remembers of contact.
    pub channels: usize,
    /// Blocks of the dense table.
    pub table: usize,
    /// Slots for blocks that particles touch.
    pub capacity: usize,
    pub bodies: usize,
    /// Whether colliders act on particles.
    pub touches: bool,
    /// Room for particles and faces near them.
    pub links: usize,
    pub scene: SceneSizes,
}

impl Counts {
    pub fn grids(&self) -> usize {
        if self.kernel == Kernel::Quadratic { 1 } else { 2 }
    }

    /// Cells of a block that particles are sorted by.
    pub fn cells(&self) -> usize {
        (4 * self.grids()).pow(3)
    }

    /// Buffers by the names in `wgsl/implicit/layout.wgsl`.
    pub fn sizes(&self) -> Sizes {
        let (n, blocks) = (self.particles, self.capacity);
        let nodes = blocks * self.grids() * 64;
        let near = if self.touches { n } else { 0 };
        let scanned = self.table.max(nodes).max(blocks * self.cells()).max(near);
        let mut buffers = vec![
            uniform("params", size_of::<Params>()),
            storage("report", size_of::<Report>()),
            storage("table", self.table * 4),
            storage("block_list", blocks * 4),
            storage("prefix", (self.table.max(nodes) + 1) * 4),
            storage("counts", blocks * self.cells() * 4),
            storage("starts", (blocks * self.cells() + 1) * 4),
            storage("totals", scanned.div_ceil(PART) * 4),
            storage("list", n * 4),
            storage("keys", n * 8),
            storage("position_in", n * 16),
            storage("tag_in", n * 8),
            storage("state_in", n * self.channels * 4),
            storage("position", n * 16),
            storage("tag", n * 8),
            storage("state", n * self.channels * 4),
            storage("node", nodes * 16),
            storage("node_scale", nodes * 4),
            storage("moving", nodes * 16),
            storage("freedom", nodes * 16),
            storage("begin", nodes * 16),
            storage("row_of", nodes * 4),
            storage("predicted", n * 36),
            storage("push", n * 36),
            storage("tensor", n * 180),
            storage("partials", (blocks * (1 + self.grids()) + self.links.div_ceil(LANES)) * 8),
            storage("characteristic", self.bodies * 4),
            self.scene.poses(2),
            storage("sweeps", self.scene.colliders.max(1) * size_of::<Sweep>()),
            storage("touches", 3 * nodes * size_of::<Touch>()),
            storage("presses", blocks * self.grids() * 16),
            storage("faces", near * 4),
            storage("link_starts", (near + 1) * 4),
            storage("links", self.links.max(1) * size_of::<Link>()),
            storage("press", self.links * PRESS_CHANNELS * 4),
            storage("holding", (HOLDING_BODIES + self.bodies) * 4),
            storage("reactions", blocks * self.scene.reaction_sums() * 4),
        ];
        buffers.extend(self.scene.buffers);
        Sizes {
            buffers,
            load: format!("{n} particles and {blocks} blocks"),
            remedy: "use fewer particles, a larger domain.dx, or the CPU engine",
        }
    }
}

/// All buffers, and what is in use of them.
pub struct Buffers {
    pub counts: Counts,
    pub memory: Memory,
    pub system: System,
    /// Particles that there are.
    pub live: usize,
    /// Blocks that particles touch in this step.
    pub blocks: usize,
    /// Particles and faces near them in this step.
    pub links: usize,
}

impl Buffers {
    /// What an extent stands for now.
    pub fn groups(&self, extent: Extent) -> Workgroups<'static> {
        let entries = |name| self.memory.get(name).size() as usize / 4;
        let rows = self.system.rows;
        Workgroups::Folded(match extent {
            Extent::One => 1,
            Extent::Particles => self.live.div_ceil(LANES),
            Extent::Table => self.counts.table.div_ceil(LANES),
            Extent::Cells => (self.counts.capacity * self.counts.cells()).div_ceil(LANES),
            Extent::Room => self.counts.capacity * self.counts.grids(),
            Extent::Blocks => self.blocks,
            Extent::Grids => self.blocks * self.counts.grids(),
            Extent::Rows => rows as usize,
            Extent::Links => self.links.div_ceil(LANES),
            Extent::LinkedGrids => self.linked(self.blocks * self.counts.grids()),
            Extent::LinkedRows => self.linked(rows as usize),
            Extent::Neighbours => {
                return Workgroups::Grid([rows.div_ceil(LANES as u32), slots(self.counts.kernel)]);
            }
            Extent::Parts(name) => entries(name).div_ceil(PART),
            Extent::Entries(name) => (entries(name) + 1).div_ceil(ENTRIES),
        })
    }

    /// So many, or none where no particle is near a face.
    fn linked(&self, groups: usize) -> usize {
        if self.links == 0 { 0 } else { groups }
    }
}
