//! Blocks, bins and work items as the device has them, for comparison with what the host makes of
//! the particles.

use super::buffers::Buffers;
use super::layout::{self, BLOCK_NODES, NODE_CHANNELS, Params, Report, Work};
use super::table;
use crate::contract::EngineError;
use crate::gpu::Gpu;

/// Which blocks of a side are active.
#[derive(Clone, Debug, PartialEq)]
pub struct Blocks {
    /// By block: its slot + 1, or 0.
    pub table: Vec<u32>,
    /// By slot: its block.
    pub list: Vec<u32>,
}

/// What the next stage would find.
#[derive(Clone, Debug)]
pub struct Bookkeeping {
    pub params: Params,
    pub report: Report,
    /// Numbers of workgroups of the next step, in the order of [`layout::Groups`].
    pub dispatches: Vec<[u32; 4]>,
    /// Of the side whose grid was filled last.
    pub blocks: Blocks,
    /// Of the other side.
    pub blocks_before: Blocks,
    /// By slot: where its bin starts; 0 without particles.
    pub bins: Vec<u32>,
    pub work: Vec<Work>,
    /// Slot and rank in its bin of every particle: by id at a frame's start, by place in
    /// `positions` after a step.
    pub destinations: Vec<[u32; 2]>,
    /// By place in the bins: a place in `positions`.
    pub list: Vec<u32>,
    /// Offset in the block (cells, f32 bits), and id.
    pub positions: Vec<[u32; 4]>,
    /// By slot, grid, channel (see `wgsl/explicit/layout.wgsl`) and node.
    pub grid: Vec<i32>,
    /// Of the other side.
    pub grid_before: Vec<i32>,
}

/// Reads it, with `side` filled last.
pub fn read(gpu: &Gpu, b: &Buffers, params: &Params, side: usize) -> Result<Bookkeeping, EngineError> {
    let report: Report = b.memory.read(gpu, "report", 1)?[0];
    let active = report.blocks as usize;
    let blocks = self::blocks(gpu, b, params, side, active)?;
    let values = b.counts.grids * BLOCK_NODES * NODE_CHANNELS;
    Ok(Bookkeeping {
        params: *params,
        dispatches: gpu.read(b.memory.of_side("dispatches_in", side), layout::DISPATCHES)?,
        blocks_before: self::blocks(gpu, b, params, 1 - side, 0)?,
        bins: b.memory.read(gpu, "bins", active)?,
        work: b.memory.read(gpu, "work", report.work as usize)?,
        destinations: b.memory.read(gpu, "destinations", b.live)?,
        list: b.memory.read(gpu, "list", b.live)?,
        positions: gpu.read(b.memory.of_side("position_in", side), b.live)?,
        grid: gpu.read(b.memory.of_side("grid_in", side), active * values)?,
        grid_before: gpu.read(b.memory.of_side("grid_out", side), b.counts.capacity * values)?,
        blocks,
        report,
    })
}

/// Of a side on which `active` blocks are listed. Panics if the hash table has a block twice.
fn blocks(gpu: &Gpu, b: &Buffers, params: &Params, side: usize, active: usize) -> Result<Blocks, EngineError> {
    let list: Vec<u32> = gpu.read(b.memory.of_side("blocks_in", side), active)?;
    let hashed: Vec<[u32; 2]> = gpu.read(b.memory.of_side("table_in", side), table::entries(b.counts.capacity))?;
    let mut table = vec![0; params.blocks.iter().product::<u32>() as usize * params.fields as usize];
    for [key, slot] in hashed.into_iter().filter(|[key, _]| *key != 0) {
        let entry = &mut table[key as usize - 1];
        assert_eq!(*entry, 0, "block {} is in the table twice", key - 1);
        *entry = slot;
    }
    Ok(Blocks { table, list })
}
