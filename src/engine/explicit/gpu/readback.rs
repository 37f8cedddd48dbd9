//! States from the device: particles at a frame boundary, grid nodes for comparison with the CPU.

use super::buffers::Buffers;
use super::layout::{self, BLOCK_NODES, NODE_CHANNELS, Params, REACTION_UNITS, REPLICAS, Report, TOUCH_CHANNELS};
use super::upload::{DeviceLayout, grid_offsets};
use crate::contract::{EngineError, TakePlaces};
use crate::gpu::Gpu;
use gridfall_core::sim::particles::Particles;
use gridfall_core::sim::reaction::Reaction;
use gridfall_core::sim::setup::Setup;

/// Particles of a part.
const PART: usize = 1 << 20;

/// A grid node as the device sees it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GridNode {
    /// Of the bodies whose node it is, see [`gridfall_core::sim::pair`].
    pub field: u32,
    /// +1 and -1 on the compact kernel's pair, 0 on a single grid.
    pub grid: i32,
    /// The node lies at `domain.min + (node + grid/4) dx`.
    pub node: [i32; 3],
    /// kg.
    pub mass: f64,
    /// Momentum (kg m/s) after p2g, velocity (m/s) after the grid update.
    pub value: [f64; 3],
}

/// Full states at the last frame boundary.
pub fn particles(gpu: &Gpu, b: &Buffers, layout: &DeviceLayout) -> Result<Particles, EngineError> {
    let n = b.counts.particles;
    let body: Vec<u32> = b.memory.read(gpu, "body_of", b.live)?;
    let position: Vec<[u32; 4]> = b.memory.read(gpu, "frame_position", b.live)?;
    let read = |parts: &[(&str, usize)]| -> Result<Vec<f32>, EngineError> {
        let read: Result<Vec<_>, _> = parts.iter().map(|(name, k)| b.memory.read(gpu, name, k * n)).collect();
        Ok(read?.concat())
    };
    let velocity = read(&layout::MOTION)?;
    let deformation = read(&b.counts.deformation())?;
    let mut particles = layout.particles(body, &position, &velocity, &deformation, n);
    if b.counts.touches {
        let touches: Vec<u32> = b.memory.read(gpu, "touches", TOUCH_CHANNELS * n)?;
        particles.touch = DeviceLayout::touches(&touches, b.live, n);
    }
    Ok(particles)
}

/// Hands over positions and bodies at the last frame boundary, in parts.
pub fn positions(gpu: &Gpu, b: &Buffers, layout: &DeviceLayout, take: &mut TakePlaces) -> Result<(), EngineError> {
    for first in (0..b.live).step_by(PART) {
        let n = PART.min(b.live - first);
        let position: Vec<[u32; 4]> = b.memory.read_from(gpu, "frame_position", first, n)?;
        let body: Vec<u32> = b.memory.read_from(gpu, "body_of", first, n)?;
        take(&position.into_iter().map(|p| layout.scene_position(p)).collect::<Vec<_>>(), &body);
    }
    Ok(())
}

/// What the surfaces took since the sums were cleared: impulses and moments.
pub fn reactions(gpu: &Gpu, b: &Buffers, params: &Params) -> Result<Vec<Reaction>, EngineError> {
    let n = b.counts.scene.reaction_sums();
    let words: Vec<[u32; 2]> = b.memory.read(gpu, "reactions", REPLICAS * n)?;
    let sum = |k: usize| -> f64 {
        let value = |[low, high]: [u32; 2]| (u64::from(high) << 32 | u64::from(low)) as i64;
        (0..REPLICAS).fold(0i64, |sum, r| sum.wrapping_add(value(words[r * n + k]))) as f64
    };
    // Both grids of a pair carry all mass.
    let unit = 1.0 / (REACTION_UNITS * f64::from(params.momentum_scale) * b.counts.grids as f64);
    let reaction = |first: usize| Reaction {
        force: [0, 1, 2].map(|k| sum(first + k) * unit),
        torque: [3, 4, 5].map(|k| sum(first + k) * unit * f64::from(params.dx)),
    };
    Ok((0..n).step_by(6).map(reaction).collect())
}

/// Nodes with mass on a side. `updated`: whether the grid update has run there.
pub fn nodes(
    gpu: &Gpu,
    b: &Buffers,
    setup: &Setup,
    params: &Params,
    side: usize,
    updated: bool,
) -> Result<Vec<GridNode>, EngineError> {
    let active = b.memory.read::<Report>(gpu, "report", 1)?[0].blocks as usize;
    let blocks: Vec<u32> = gpu.read(b.memory.of_side("blocks_in", side), active)?;
    let grids = b.counts.grids;
    let values: Vec<i32> = gpu.read(b.memory.of_side("grid_in", side), active * grids * BLOCK_NODES * NODE_CHANNELS)?;
    let momentum_unit = 1.0 / f64::from(params.momentum_scale);
    let mut out = Vec::new();
    for slot in 0..active {
        let block = blocks[slot];
        let [nx, ny, nz] = params.blocks;
        let corner = [block % nx, (block / nx) % ny, (block / (nx * ny)) % nz];
        for grid in 0..grids {
            for n in 0..BLOCK_NODES {
                let at = (slot * grids + grid) * BLOCK_NODES * NODE_CHANNELS + n;
                if values[at] == 0 {
                    continue;
                }
                let local = [n % 4, (n / 4) % 4, n / 16];
                let value = [1, 2, 3].map(|c| {
                    let raw = values[at + c * BLOCK_NODES];
                    if updated { f64::from(f32::from_bits(raw as u32)) } else { f64::from(raw) * momentum_unit }
                });
                out.push(GridNode {
                    field: block / (nx * ny * nz),
                    grid: grid_offsets(setup.kernel)[grid],
                    node: std::array::from_fn(|a| 4 * corner[a] as i32 + local[a] as i32 - params.pad[a]),
                    mass: f64::from(values[at]) / f64::from(params.mass_scale),
                    value,
                });
            }
        }
    }
    Ok(out)
}
