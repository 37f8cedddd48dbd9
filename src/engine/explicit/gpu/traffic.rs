//! Bytes that the stages of a step must move, counted from the layout and from what there is to do.
//!
//! The rule: each workgroup's distinct addresses count once as read and once as written, and an atomic addition is
//! both. Nothing stays in a cache from one workgroup to the next, and nothing is fetched that is not used. Left out is
//! what all workgroups share, which caches hold: parameters, the report, bodies, laws, colliders and their poses, sums
//! of reactions. Every block counts as full: its particles read and fill all nodes that it has in reach, and no others.
//! What bodies and sides of plates exchange at nodes where they meet is left out as well.

use super::engine::GpuEngine;
use super::layout::{BLOCK_NODES, NODE_CHANNELS, TOUCH_CHANNELS, Work};
use super::table;
use super::upload::grid_offsets;
use crate::contract::EngineError;
use crate::gpu::Fills;
use gridfall_core::sim::setup::Setup;
use gridfall_core::sim::side;

const WORD: usize = 4;
const POSITION: usize = 4 * WORD;
const DESTINATION: usize = 2 * WORD;
const WORK: usize = size_of::<Work>();
/// Of the block table.
const ENTRY: usize = 2 * WORD;
/// Words of a node's momentum or velocity.
const VECTOR: usize = 3;
/// Blocks that a block's particles read nodes of, and those that they fill.
const READ_BLOCKS: usize = 8;
const NEIGHBOURS: usize = 27;

/// What a step has to do.
#[derive(Clone, Copy, Debug)]
pub struct Load {
    pub particles: usize,
    /// Values of the particles' deformations, all together.
    pub deformations: usize,
    /// Active blocks.
    pub blocks: usize,
    /// Work items.
    pub items: usize,
    /// Work items near colliders that act on particles, and their particles.
    pub touched: [usize; 2],
    /// Grids of a block.
    pub grids: usize,
    /// Entries of the block table.
    pub entries: usize,
    /// Layers of blocks.
    pub layers: usize,
    pub fills: Fills,
    /// Lanes of a workgroup.
    pub workgroup: usize,
}

/// Bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Moved {
    pub read: usize,
    pub written: usize,
}

/// The traffic of a step.
#[derive(Clone, Debug)]
pub struct Traffic {
    pub load: Load,
    /// By stage, in the order of a step.
    pub stages: Vec<(&'static str, Moved)>,
}

impl Load {
    /// Nodes that a block's particles read: their first ones are 0..3 (one grid and `+`), or 0..4 (`-`).
    fn nodes_in_reach(&self) -> usize {
        if self.grids == 2 { 5 * 5 * 5 + 6 * 6 * 6 } else { 6 * 6 * 6 }
    }

    /// What a stage moves; none if the stage is not known.
    fn moved_by(&self, stage: &str) -> Option<Moved> {
        let Self { particles, deformations, blocks, items, touched: [near, touching], .. } = *self;
        let nodes = BLOCK_NODES * self.grids;
        let fill = usize::from(self.fills != Fills::Nothing);
        let volume = usize::from(self.fills == Fills::Volume);
        // Of a work item: itself, and where its blocks are.
        let gather = WORK + READ_BLOCKS * ENTRY;
        let scatter = NEIGHBOURS * ENTRY;
        let (mass, momentum) = (1, VECTOR);
        let (read, written) = match stage {
            // A look at a key a neighbour; the entry and the place in the list of those that are new.
            "explicit/activate" => (items * (WORK + NEIGHBOURS * WORD), blocks * (ENTRY + WORD)),
            "explicit/join" => (blocks * (WORD + self.layers * ENTRY), 0),
            "explicit/pairs" => (blocks * (WORD + self.layers * ENTRY + nodes * mass * WORD), 0),
            // It empties the bins, too.
            "explicit/grid_update" => (
                blocks * (1 + nodes * (mass + momentum + volume)) * WORD,
                blocks * (1 + nodes * (VECTOR + fill)) * WORD,
            ),
            "explicit/touch" => (
                items * gather
                    + near * self.nodes_in_reach() * VECTOR * WORD
                    + touching * ((2 + TOUCH_CHANNELS) * WORD + POSITION),
                items * WORD + touching * (TOUCH_CHANNELS * WORD + POSITION + DESTINATION),
            ),
            "explicit/g2p2g" => {
                let sums = self.nodes_in_reach() * (mass + momentum + volume) * WORD + NEIGHBOURS * WORD;
                let nodes = self.nodes_in_reach() * (VECTOR + fill) * WORD;
                (
                    items * (gather + scatter + nodes + sums)
                        + particles * (2 * WORD + POSITION + DESTINATION)
                        + deformations * WORD
                        + touching * POSITION,
                    items * sums + particles * (POSITION + DESTINATION) + deformations * WORD,
                )
            }
            "explicit/sweep" => (
                (blocks + items) * WORD,
                blocks * nodes * NODE_CHANNELS * WORD + self.entries * ENTRY + items * (WORK + WORD),
            ),
            // A workgroup's particles come from one work item or two, and most of them stay in its block.
            "explicit/bin" => (particles * DESTINATION + particles.div_ceil(self.workgroup) * WORD, particles * WORD),
            _ => return None,
        };
        Some(Moved { read, written })
    }
}

/// Values of a particle's deformation, by body.
fn deformation_values(setup: &Setup) -> Vec<usize> {
    let values = |body: &gridfall_core::sim::setup::Body| match &setup.materials[body.material] {
        law if law.is_fluid() => 1,
        law => 9 + usize::from(law.has_plastic_state()),
    };
    setup.bodies.iter().map(values).collect()
}

impl GpuEngine {
    /// Counts the traffic of a step, as it was at the end of the last frame.
    pub fn traffic(&self) -> Result<Traffic, EngineError> {
        let report = self.read_report()?;
        let items = report.work as usize;
        let work: Vec<Work> = self.memory().read(&self.gpu, "work", items)?;
        let near: Vec<_> = work.iter().filter(|work| work.touched != 0).collect();
        let values = deformation_values(&self.setup);
        let load = Load {
            particles: self.buffers.live,
            deformations: self.population.iter().zip(&values).map(|(&count, values)| count as usize * values).sum(),
            blocks: report.blocks as usize,
            items,
            touched: [near.len(), near.iter().map(|work| work.count as usize).sum()],
            grids: grid_offsets(self.setup.kernel).len(),
            entries: table::entries(self.buffers.counts.capacity),
            layers: side::layers(&self.setup),
            fills: Fills::of(&self.setup),
            workgroup: self.gpu.workgroup as usize,
        };
        let counted = |stage: &'static str| (stage, load.moved_by(stage).expect("a test asks for every stage"));
        let stages = self.stages.step[0].iter().map(|dispatch| counted(dispatch.name())).collect();
        Ok(Traffic { load, stages })
    }
}

#[cfg(test)]
mod tests {
    use super::super::stages::STEP;
    use super::*;
    use crate::gpu::file;

    /// A full block of a fluid in the middle of nothing.
    const LOAD: Load = Load {
        particles: 512,
        deformations: 512,
        blocks: 27,
        items: 1,
        touched: [0, 0],
        grids: 2,
        entries: 256,
        layers: 1,
        fills: Fills::Nothing,
        workgroup: 128,
    };

    #[test]
    fn every_stage_of_a_step_is_counted() {
        for (stage, _) in STEP {
            assert!(LOAD.moved_by(stage).is_some(), "{stage} is missing in `moved_by`");
        }
    }

    #[test]
    fn a_block_alone_by_hand() {
        let counted = |load: Load, stage: &str| load.moved_by(stage).unwrap();
        // 27 blocks: their number; 128 nodes of mass and momentum read, and velocity written.
        let update = Moved { read: 27 * (4 + 128 * 16), written: 27 * (4 + 128 * 12) };
        assert_eq!(counted(LOAD, "explicit/grid_update"), update);
        // 27 bins and a block; their 2560 B each, the table, the item and its bin.
        let sweep = Moved { read: 28 * 4, written: 27 * 2560 + 256 * 8 + 36 };
        assert_eq!(counted(LOAD, "explicit/sweep"), sweep);
        // The item's 32 B, 8 and 27 entries of the table, 341 velocities, 341 masses and momenta, 27 bins; place in
        // the list, body, position, destination and J.
        let sums = 341 * 16 + 108;
        let read = 32 + 64 + 216 + 341 * 12 + sums + 512 * (4 + 4 + 16 + 8 + 4);
        assert_eq!(counted(LOAD, "explicit/g2p2g"), Moved { read, written: sums + 512 * (16 + 8 + 4) });
        assert_eq!(counted(LOAD, "explicit/bin"), Moved { read: 512 * 8 + 4 * 4, written: 512 * 4 });
        // F and a plastic state, one grid, volumes at nodes.
        let solid = Load { deformations: 5120, grids: 1, fills: Fills::Volume, ..LOAD };
        let sums = 216 * 20 + 108;
        let read = 32 + 64 + 216 + 216 * 16 + sums + 512 * (4 + 4 + 16 + 8 + 40);
        assert_eq!(counted(solid, "explicit/g2p2g"), Moved { read, written: sums + 512 * (16 + 8 + 40) });
        let update = Moved { read: 27 * (4 + 64 * 20), written: 27 * (4 + 64 * 16) };
        assert_eq!(counted(solid, "explicit/grid_update"), update);
    }

    #[test]
    fn tiles_are_those_of_the_shaders() {
        for (kernel, grids) in [("compact", 2), ("quadratic", 1)] {
            let tile = file(&format!("explicit/tile_{kernel}")).unwrap();
            let nodes = Load { grids, ..LOAD }.nodes_in_reach();
            assert!(tile.contains(&format!("const READ_NODES = {nodes}u;")), "{kernel}: {nodes}");
        }
    }
}
