//! Points to begin with: as many in each layer, and in each part of it, as its volume is worth.
//!
//! Cells of the lattice far below the layers get their lattice point. In all others, the shares of
//! the layers are measured with finer points. The cells are visited in an order in which neighbours
//! mostly follow one another, and a layer gains a point whenever its shares add up to the next whole
//! number: in every part of the layer, the number of points is right up to a few.

use rand::Rng;
use rayon::prelude::*;

use super::super::{Block, FINER, halves_above, random};
use super::{LAYERS, Solid};

/// The layers, and what lies below them.
type PerLayer<T> = [T; LAYERS + 1];

/// Points, their layers and the volume (m^d) that they share.
pub struct Seeds {
    pub x: Vec<[f64; 3]>,
    /// From the surface inwards; `LAYERS` below the layers.
    pub layer: Vec<u8>,
    pub volume: f64,
}

/// What the cells of a block consist of.
enum Piece {
    /// A whole cell below the layers: its lattice point.
    Cell([f64; 3]),
    /// A share of a cell at a point, in a layer.
    Share([f64; 3], usize, f64),
}

/// Scatters points over the solid.
pub fn scatter(solid: &Solid, seed: u64, body: u64) -> Seeds {
    let lattice = &solid.lattice;
    let mut leaves = Vec::new();
    lattice.leaves(&solid.sdf, lattice.range.clone(), &mut leaves);
    let measured: Vec<(u64, PerLayer<f64>)> = leaves.par_iter().map(|block| measure(solid, block)).collect();

    let whole: u64 = measured.iter().map(|(cells, _)| cells).sum();
    let totals: PerLayer<f64> = std::array::from_fn(|k| measured.iter().map(|(_, shares)| shares[k]).sum());
    let scale = stretch(&totals);
    // Where each layer's sum starts: between two whole numbers, by the seed.
    let mut random_start = random(seed, body, &lattice.range);
    let mut sum: PerLayer<f64> = std::array::from_fn(|_| random_start.random());
    let starts: Vec<PerLayer<f64>> = measured
        .iter()
        .map(|(_, shares)| {
            let start = sum;
            sum = std::array::from_fn(|k| sum[k] + scale[k] * shares[k]);
            start
        })
        .collect();

    let picked: Vec<Vec<([f64; 3], u8)>> = leaves
        .par_iter()
        .zip(starts)
        .map(|(block, mut sum)| {
            let mut random = random(seed, body, block);
            let mut picked = Vec::new();
            pieces(solid, block, |piece| match piece {
                Piece::Cell(x) => picked.push((x, LAYERS as u8)),
                Piece::Share(x, layer, share) => {
                    let before = sum[layer].floor();
                    sum[layer] += scale[layer] * share;
                    if sum[layer].floor() > before {
                        // No two points at the same place of a layer.
                        let mut off = || (random.random::<f64>() - 0.5) / FINER as f64 * lattice.spacing;
                        let x = std::array::from_fn(|a| if a < lattice.dimension { x[a] + off() } else { x[a] });
                        picked.push((x, layer as u8));
                    }
                }
            });
            picked
        })
        .collect();
    let (x, layer) = picked.into_iter().flatten().unzip();
    let cells = whole as f64 + totals.iter().sum::<f64>();
    Seeds { x, layer, volume: cells * lattice.spacing.powi(lattice.dimension as i32) }
}

/// Factors that make the shares of each layer a whole number. What one layer loses to rounding, the
/// next one gains.
fn stretch(totals: &PerLayer<f64>) -> PerLayer<f64> {
    let mut left = 0.0;
    totals.map(|total| {
        left += total;
        let count = left.round();
        left -= count;
        if total > 0.0 { count / total } else { 0.0 }
    })
}

/// Whole cells, and the shares of each layer in the other cells.
fn measure(solid: &Solid, block: &Block) -> (u64, PerLayer<f64>) {
    let (mut cells, mut shares) = (0, [0.0; LAYERS + 1]);
    pieces(solid, block, |piece| match piece {
        Piece::Cell(_) => cells += 1,
        Piece::Share(_, layer, share) => shares[layer] += share,
    });
    (cells, shares)
}

/// Visits the pieces of the cells of a block, always in the same order.
fn pieces(solid: &Solid, block: &Block, mut each: impl FnMut(Piece)) {
    let (h, d) = (solid.lattice.spacing, solid.lattice.dimension as u32);
    let (per_cell, half_diagonal) = (FINER.pow(d) as f64, 0.5 * f64::from(d).sqrt());
    one_by_one(block, &mut |cell| {
        let (center, reach) = (solid.center(cell), solid.reach(cell));
        let depth = solid.depth(center);
        if depth > (LAYERS as f64 + half_diagonal) * h {
            each(Piece::Cell(center));
        } else if depth > -reach {
            for x in solid.fine([cell[0].start, cell[1].start, cell[2].start]) {
                // What each layer has of a finer cell, in finer spacings.
                let depth = solid.depth(x) / h * FINER as f64;
                for layer in 0..=LAYERS {
                    let top = (layer as i64 * FINER) as f64;
                    let bottom = if layer < LAYERS { top + FINER as f64 } else { f64::INFINITY };
                    let share = bottom.min(depth + 0.5) - top.max(depth - 0.5);
                    if share > 0.0 {
                        each(Piece::Share(x, layer, share / per_cell));
                    }
                }
            }
        }
    });
}

/// Visits the cells of a block, half by half.
fn one_by_one(block: &Block, each: &mut impl FnMut(&Block)) {
    match halves_above(block, 1) {
        Some((low, high)) => {
            one_by_one(&low, each);
            one_by_one(&high, each);
        }
        None => each(block),
    }
}
