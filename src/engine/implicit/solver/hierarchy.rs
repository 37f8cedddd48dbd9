//! The nodes of coarser and coarser levels, and what takes vectors from one level to the next (HOT
//! §4).
//!
//! Coarse node j of a grid lies on that grid's fine node 2j. A fine node is embedded in the coarse
//! grid like a particle in the fine one: with linear weights an even index has one parent and an
//! odd one two, with quadratic weights three and two (§4.2). A coarse node exists where a fine one
//! is embedded in it. Each of the compact kernel's two grids is coarsened by itself.

use rayon::prelude::*;

use super::objective::NodeId;
use super::verbs;
use crate::keys;
use gridfall_core::maths::linalg::{Matrix, Vector};
use gridfall_core::maths::real::Real;

/// How fine nodes are embedded in the coarser grid.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Embedding {
    Linear,
    Quadratic,
}

/// Nodes of a level.
#[derive(Clone, Debug, PartialEq)]
pub struct Nodes<const D: usize> {
    pub ids: Vec<NodeId<D>>,
    /// Cells along periodic axes.
    pub period: [Option<i32>; D],
}

/// A sparse matrix of scalars by rows.
#[derive(Clone, Debug, PartialEq)]
pub struct Weights {
    pub row_start: Vec<u32>,
    pub columns: Vec<u32>,
    pub weights: Vec<f32>,
}

/// Between a level and the next coarser one: P = S_i w_ij, R = Pᵀ. The weights are powers of two
/// over small numbers, exact in f32.
#[derive(Clone, Debug)]
pub struct Prolongation<const D: usize> {
    /// For every fine node, the coarse nodes that it is embedded in.
    pub parents: Weights,
    /// The transpose.
    pub children: Weights,
}

impl Weights {
    pub fn rows(&self) -> usize {
        self.row_start.len() - 1
    }

    pub fn row(&self, i: usize) -> impl Iterator<Item = (usize, f32)> {
        let range = self.row_start[i] as usize..self.row_start[i + 1] as usize;
        self.columns[range.clone()].iter().zip(&self.weights[range]).map(|(&j, &w)| (j as usize, w))
    }

    fn transpose(&self, columns: usize) -> Self {
        let mut row_start = vec![0u32; columns + 1];
        self.columns.iter().for_each(|&j| row_start[j as usize + 1] += 1);
        (0..columns).for_each(|j| row_start[j + 1] += row_start[j]);
        let mut next = row_start.clone();
        let mut transposed = (vec![0; self.columns.len()], vec![0.0; self.columns.len()]);
        for i in 0..self.rows() {
            for (j, w) in self.row(i) {
                let at = next[j] as usize;
                (transposed.0[at], transposed.1[at]) = (i as u32, w);
                next[j] += 1;
            }
        }
        Self { row_start, columns: transposed.0, weights: transposed.1 }
    }

    /// y_i = Σ_j w_ij x_j.
    fn multiply<T: Real, const D: usize>(&self, x: &[Vector<T, D>], y: &mut [Vector<T, D>]) {
        y.par_iter_mut().with_min_len(1024).enumerate().for_each(|(i, y)| {
            let mut sum = [T::ZERO; D];
            for (j, w) in self.row(i) {
                let w = T::from_f64(w as f64);
                for a in 0..D {
                    sum[a] += w * x[j][a];
                }
            }
            *y = sum;
        });
    }
}

impl<const D: usize> Prolongation<D> {
    /// R r; `r` is projected on the way.
    pub fn restrict<T: Real>(
        &self,
        projections: &[Option<Matrix<T, D>>],
        r: &mut [Vector<T, D>],
        coarse: &mut [Vector<T, D>],
    ) {
        verbs::project(projections, r);
        self.children.multiply(r, coarse);
    }

    /// x += P X; `correction` is room for P X.
    pub fn prolong<T: Real>(
        &self,
        projections: &[Option<Matrix<T, D>>],
        coarse: &[Vector<T, D>],
        correction: &mut [Vector<T, D>],
        x: &mut [Vector<T, D>],
    ) {
        self.parents.multiply(coarse, correction);
        verbs::project(projections, correction);
        verbs::axpy(T::ONE, correction, x);
    }
}

/// Where a node stands when nodes are taken by blocks of 4^D, which lie close together in memory,
/// and the grids' nodes side by side.
pub fn block_key<const D: usize>(id: &NodeId<D>) -> u64 {
    keys::pack_by_blocks::<19, D>(id.index) << 1 | u64::from(id.grid)
}

impl<const D: usize> Nodes<D> {
    /// An axis is coarsened unless it is periodic with an odd or very small number of cells.
    fn coarsened_axes(&self) -> [bool; D] {
        self.period.map(|cells| cells.is_none_or(|n| n % 2 == 0 && n >= 8))
    }

    /// Parents of a node and its weights there, up to three per axis.
    fn parents(&self, id: &NodeId<D>, embedding: Embedding, mut give: impl FnMut(NodeId<D>, f32)) {
        let coarsened = self.coarsened_axes();
        let axis = |a: usize| -> ([(i32, f32); 3], usize) {
            let (i, half) = (id.index[a], id.index[a].div_euclid(2));
            let wrapped = |j: i32| self.period[a].map_or(j, |cells| j.rem_euclid(cells / 2));
            match (coarsened[a], i.rem_euclid(2) == 0, embedding) {
                (false, ..) => ([(i, 1.0), (0, 0.0), (0, 0.0)], 1),
                (true, true, Embedding::Linear) => ([(half, 1.0), (0, 0.0), (0, 0.0)], 1),
                (true, true, Embedding::Quadratic) => {
                    ([(wrapped(half - 1), 0.125), (half, 0.75), (wrapped(half + 1), 0.125)], 3)
                }
                (true, false, _) => ([(half, 0.5), (wrapped(half + 1), 0.5), (0, 0.0)], 2),
            }
        };
        let axes: [_; D] = std::array::from_fn(axis);
        let count: usize = axes.iter().map(|(_, n)| n).product();
        for k in 0..count {
            let (mut rest, mut weight) = (k, 1.0);
            let index = std::array::from_fn(|a| {
                let (parents, n) = axes[a];
                let (j, w) = parents[rest % n];
                rest /= n;
                weight *= w;
                j
            });
            give(NodeId { grid: id.grid, index }, weight);
        }
    }

    /// The nodes of the next level, in order of [`block_key`], and the prolongation from them.
    pub fn coarsen(&self, embedding: Embedding) -> (Nodes<D>, Prolongation<D>) {
        let hit = |id: &NodeId<D>| {
            let mut parents = Vec::new();
            self.parents(id, embedding, |parent, _| parents.push(parent));
            parents
        };
        let mut ids: Vec<NodeId<D>> = self.ids.par_iter().with_min_len(256).flat_map_iter(hit).collect();
        ids.par_sort_unstable_by_key(block_key);
        ids.dedup();
        let coarsened = self.coarsened_axes();
        let period = std::array::from_fn(|a| self.period[a].map(|n| if coarsened[a] { n / 2 } else { n }));
        let coarse = Nodes { ids, period };
        let prolongation = self.prolongation(&coarse, embedding);
        (coarse, prolongation)
    }

    /// The prolongation from coarser nodes that are given, which lie in order of [`block_key`];
    /// parents that are not among them are left out.
    pub fn prolongation(&self, coarse: &Nodes<D>, embedding: Embedding) -> Prolongation<D> {
        let keys: Vec<u64> = coarse.ids.iter().map(block_key).collect();
        let row = |id: &NodeId<D>| {
            let mut row = Vec::new();
            self.parents(id, embedding, |parent, weight| {
                if let Ok(j) = keys.binary_search(&block_key(&parent)) {
                    row.push((j as u32, weight));
                }
            });
            row
        };
        let rows: Vec<Vec<(u32, f32)>> = self.ids.par_iter().with_min_len(256).map(row).collect();
        let mut parents = Weights { row_start: vec![0], columns: Vec::new(), weights: Vec::new() };
        for row in rows {
            for (j, weight) in row {
                parents.columns.push(j);
                parents.weights.push(weight);
            }
            parents.row_start.push(parents.columns.len() as u32);
        }
        Prolongation { children: parents.transpose(coarse.ids.len()), parents }
    }
}
