//! States from the device: particles at a frame boundary, grid nodes for comparison with the CPU.

use bytemuck::Pod;

use super::buffers::{Buffers, binding};
use super::layout::{BLOCK_NODES, NODE_CHANNELS, Params, REACTION_UNITS, REPLICAS};
use super::upload::{Frame, grid_offsets};
use crate::contract::EngineError;
use crate::gpu::device::Gpu;
use gridfall_core::sim::particles::Particles;
use gridfall_core::sim::reaction::Reaction;
use gridfall_core::sim::setup::Setup;

/// A grid node as the device sees it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GridNode {
    /// +1 and -1 on the compact kernel's pair, 0 on a single grid.
    pub grid: i32,
    /// The node lies at `domain.min + (node + grid/4) dx`.
    pub node: [i32; 3],
    /// kg.
    pub mass: f64,
    /// Momentum (kg m/s) after p2g, velocity (m/s) after the grid update.
    pub value: [f64; 3],
}

/// Copies a buffer's first `count` elements home.
pub fn read<T: Pod>(gpu: &Gpu, buffer: &wgpu::Buffer, count: usize) -> Result<Vec<T>, EngineError> {
    let bytes = (count * size_of::<T>()) as u64;
    let staging = gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("readback"),
        size: bytes,
        usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    });
    let mut encoder = gpu.device.create_command_encoder(&Default::default());
    encoder.copy_buffer_to_buffer(buffer, 0, &staging, 0, bytes);
    let submission = gpu.queue.submit([encoder.finish()]);
    staging.map_async(wgpu::MapMode::Read, .., |_| {});
    gpu.wait(Some(submission))?;
    let view = staging.get_mapped_range(..).map_err(|e| EngineError::DeviceLost(format!("{e:?}")))?;
    // The mapping may be less aligned than T.
    Ok(view.chunks_exact(size_of::<T>()).map(bytemuck::pod_read_unaligned).collect())
}

/// Full states at the last frame boundary.
pub fn particles(gpu: &Gpu, b: &Buffers, frame: &Frame) -> Result<Particles, EngineError> {
    let n = b.sizes.particles;
    let position: Vec<[u32; 4]> = read(gpu, b.get(binding::FRAME_POSITION), b.live)?;
    let velocity: Vec<f32> = read(gpu, b.get(binding::FRAME_VELOCITY), 12 * n)?;
    let deformation: Vec<f32> = read(gpu, b.get(binding::FRAME_DEFORMATION), b.sizes.channels * n)?;
    Ok(frame.particles(&position, &velocity, &deformation, n))
}

/// What the surfaces took since the sums were cleared: impulses and moments.
pub fn reactions(gpu: &Gpu, b: &Buffers, params: &Params) -> Result<Vec<Reaction>, EngineError> {
    let n = b.sizes.reaction_sums();
    let words: Vec<[u32; 2]> = read(gpu, b.get(binding::REACTIONS), REPLICAS * n)?;
    let sum = |k: usize| -> f64 {
        let value = |[low, high]: [u32; 2]| (u64::from(high) << 32 | u64::from(low)) as i64;
        (0..REPLICAS).fold(0i64, |sum, r| sum.wrapping_add(value(words[r * n + k]))) as f64
    };
    // Both grids of a pair carry all mass.
    let unit = 1.0 / (REACTION_UNITS * f64::from(params.momentum_scale) * b.sizes.grids as f64);
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
    let blocks: Vec<u32> = read(gpu, b.of_side(binding::BLOCKS, side), b.sizes.capacity + 1)?;
    let active = (blocks[0] as usize).min(b.sizes.capacity);
    let grids = b.sizes.grids;
    let values: Vec<i32> = read(gpu, b.of_side(binding::GRID, side), active * grids * BLOCK_NODES * NODE_CHANNELS)?;
    let momentum_unit = 1.0 / f64::from(params.momentum_scale);
    let mut out = Vec::new();
    for slot in 0..active {
        let block = blocks[slot + 1];
        let [nx, ny, _] = params.blocks;
        let corner = [block % nx, (block / nx) % ny, block / (nx * ny)];
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
