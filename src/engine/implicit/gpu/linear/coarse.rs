//! The coarsest level, solved exactly: the host inverts its matrix in f64, and a cycle multiplies by
//! the inverse. In f32 an elimination would lose the inertia of stiff bodies.

use std::collections::BTreeMap;

use rayon::prelude::*;

use super::level::Level;
use super::stages::{COARSE, append};
use crate::contract::EngineError;
use crate::gpu::Gpu;
use crate::gpu::memory::{Memory, Size, storage};
use crate::gpu::program::{Dispatches, Tools};
use crate::implicit::gpu::interface::NO_NODE;
use crate::implicit::solver::factor::Factor;
use crate::implicit::solver::hierarchy::Nodes;
use crate::implicit::solver::objective::NodeId;
use crate::implicit::solver::sparse::Bsr;

/// Nodes of a level that is small enough.
pub const MOST_NODES: u32 = 64;
/// Pivots below this part of the diagonal are rounding of the device's sums.
const ROUNDING: f64 = 1e-7;

/// What holds the inverse.
pub fn room() -> Size {
    storage("solution", 4 * (3 * MOST_NODES as usize).pow(2))
}

/// x number 0 from b, by the inverse in `memory`.
pub fn solve(list: &mut Dispatches, tools: Tools, level: &Level, memory: &Memory) {
    append(list, tools, COARSE, level, &level.scope(0, &[]).and(memory));
}

/// Inverts the level's matrix, as it is after all that was submitted, into `memory`.
pub fn invert(gpu: &Gpu, level: &Level, memory: &Memory) -> Result<(), EngineError> {
    let (matrix, nodes) = read(gpu, level)?;
    memory.write(gpu, "solution", 0, &inverse(&matrix, &nodes));
    Ok(())
}

/// A⁻¹, symmetric and dense, components of nodes in the order of vectors. What no pivot is left for
/// stays at rest.
fn inverse(matrix: &Bsr<f64, 3>, nodes: &Nodes<3>) -> Vec<f32> {
    let rows = matrix.rows();
    let all: Vec<u32> = (0..rows as u32).collect();
    let factor = Factor::new(matrix, nodes, &all, f64::INFINITY, ROUNDING).expect("no bound");
    let mut inverse = vec![0.0; (3 * rows).pow(2)];
    inverse.par_chunks_mut(3 * rows).enumerate().for_each(|(k, column)| {
        let (axis, node) = (k / rows, (k % rows) as u32);
        let mut b: Vec<[f64; 3]> =
            factor.nodes().iter().map(|&i| [0, 1, 2].map(|a| f64::from(a == axis && i == node))).collect();
        let mut x = vec![[0.0; 3]; rows];
        factor.add_solution(&mut b, &mut x);
        column.iter_mut().enumerate().for_each(|(k, value)| *value = x[k % rows][k / rows] as f32);
    });
    inverse
}

/// A level's matrix with the sums of its rows as the level knows them, made symmetric, and its nodes.
fn read(gpu: &Gpu, level: &Level) -> Result<(Bsr<f64, 3>, Nodes<3>), EngineError> {
    let (rows, stride, slots) = (level.shape.rows as usize, level.shape.stride as usize, level.slots as usize);
    let ids: Vec<[i32; 4]> = level.memory.read(gpu, "ids", rows)?;
    let columns: Vec<u32> = level.memory.read(gpu, "columns", slots * stride)?;
    let values: Vec<f32> = level.memory.read(gpu, "values", 9 * slots * stride)?;
    let anchors: Vec<f32> = level.memory.read(gpu, "anchors", 10 * stride)?;
    let mut blocks: BTreeMap<(u32, u32), [[f64; 3]; 3]> = (0..rows as u32).map(|i| ((i, i), [[0.0; 3]; 3])).collect();
    // Half of a value and half of its mirror image.
    let mut add = |i: usize, j: usize, a: usize, c: usize, value: f64| {
        blocks.entry((i as u32, j as u32)).or_default()[a][c] += 0.5 * value;
        blocks.entry((j as u32, i as u32)).or_default()[c][a] += 0.5 * value;
    };
    for (i, a, c) in (0..rows).flat_map(|i| (0..9).map(move |k| (i, k / 3, k % 3))) {
        let mut rest = f64::from(anchors[(3 * a + c) * stride + i]);
        for slot in 0..slots {
            let j = columns[slot * stride + i];
            if j != NO_NODE {
                let value = f64::from(values[(slot * 9 + 3 * a + c) * stride + i]);
                rest -= value;
                add(i, j as usize, a, c, value);
            }
        }
        add(i, anchors[9 * stride + i] as usize, a, c, rest);
    }
    let mut row_start = vec![0; rows + 1];
    blocks.keys().for_each(|&(i, _)| row_start[i as usize + 1] += 1);
    (0..rows).for_each(|i| row_start[i + 1] += row_start[i]);
    let columns = blocks.keys().map(|&(_, j)| j).collect();
    let matrix = Bsr { row_start, columns, blocks: blocks.into_values().collect() };
    let ids = ids.iter().map(|&[x, y, z, grid]| NodeId { grid: grid as u8, index: [x, y, z] }).collect();
    let period = level.shape.period.map(|cells| (cells > 0).then_some(cells));
    Ok((matrix, Nodes { ids, period }))
}
