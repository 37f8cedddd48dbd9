//! Light nodes, solved for in groups around a V-cycle.
//!
//! A node at the rim of a body sees few particles, and those from afar. Several such nodes together
//! may move without straining any of them, held by inertia alone. No smoother gets at these modes,
//! because each node's own stiffness hides them, and no coarse grid, because they are one or two
//! nodes wide. So each light node is solved for together with the light nodes around it, one group
//! after the other, before and after the cycle.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use rayon::prelude::*;

use super::krylov::Preconditioner;
use super::objective::{NodeId, NodeVectors, Objective};
use super::smoother::residual;
use super::sparse::{Bsr, row_times};
use super::vcycle::VCycle;
use super::verbs::axpy;
use gridfall_core::maths::linalg::Vector;

/// Nodes lighter than this part of the heaviest are light.
const LIGHT: f64 = 0.02;

/// A group of light nodes.
struct Patch {
    nodes: Vec<u32>,
    factor: Cholesky<f64, Dyn>,
}

/// All groups of a matrix.
pub struct Patches(Vec<Patch>);

impl Patches {
    pub fn new<const D: usize>(objective: &dyn Objective<D>, matrix: &Bsr<f64, D>) -> Self {
        let (nodes, masses) = (objective.nodes(), objective.masses());
        let heaviest = masses.iter().copied().fold(0.0, f64::max);
        let is_light = |i: usize| masses[i] < LIGHT * heaviest;
        let group = |i: usize| -> Vec<u32> {
            let around = |j: &&u32| is_light(**j as usize) && are_near(&nodes[i], &nodes[**j as usize]);
            matrix.row(i).0.iter().filter(around).copied().collect()
        };
        let mut groups: Vec<Vec<u32>> = (0..nodes.len()).into_par_iter().filter(|&i| is_light(i)).map(group).collect();
        groups.dedup();
        let factorised = groups.into_par_iter().with_min_len(16).filter_map(|nodes| {
            let factor = Cholesky::new(dense(matrix, &nodes))?;
            Some(Patch { nodes, factor })
        });
        Self(factorised.collect())
    }

    /// Solves for one group after the other, forwards or backwards.
    fn sweep<const D: usize>(&self, matrix: &Bsr<f64, D>, b: &NodeVectors<D>, x: &mut NodeVectors<D>, forwards: bool) {
        let mut solve = |patch: &Patch| {
            let mut r = DVector::<f64>::zeros(D * patch.nodes.len());
            for (at, &i) in patch.nodes.iter().enumerate() {
                let i = i as usize;
                let entries = matrix.blocks[matrix.row_start[i]..].as_flattened().as_flattened();
                let product: Vector<f64, D> = row_times(matrix.row(i).0, entries, |j| x[j]);
                (0..D).for_each(|a| r[D * at + a] = b[i][a] - product[a]);
            }
            patch.factor.solve_mut(&mut r);
            for (at, &i) in patch.nodes.iter().enumerate() {
                (0..D).for_each(|a| x[i as usize][a] += r[D * at + a]);
            }
        };
        if forwards {
            self.0.iter().for_each(&mut solve);
        } else {
            self.0.iter().rev().for_each(&mut solve);
        }
    }
}

/// Whether nodes of either grid lie within a cell of each other along every axis.
fn are_near<const D: usize>(a: &NodeId<D>, b: &NodeId<D>) -> bool {
    let shift = 0.5 * (f64::from(b.grid) - f64::from(a.grid));
    (0..D).all(|k| (f64::from(b.index[k] - a.index[k]) + shift).abs() <= 1.0)
}

/// The matrix between some nodes.
fn dense<const D: usize>(matrix: &Bsr<f64, D>, nodes: &[u32]) -> DMatrix<f64> {
    let mut dense = DMatrix::zeros(D * nodes.len(), D * nodes.len());
    for (row, &i) in nodes.iter().enumerate() {
        let (columns, blocks) = matrix.row(i as usize);
        for (column, j) in nodes.iter().enumerate() {
            let Ok(place) = columns.binary_search(j) else { continue };
            for a in 0..D {
                (0..D).for_each(|b| dense[(D * row + a, D * column + b)] = blocks[place][a][b]);
            }
        }
    }
    dense
}

/// A V-cycle between two sweeps over the groups: symmetric, as the cycle is.
pub struct Patched<'a, const D: usize> {
    pub matrix: &'a Bsr<f64, D>,
    pub patches: &'a Patches,
    pub cycle: &'a mut VCycle<f64, D>,
}

impl<const D: usize> Preconditioner<D> for Patched<'_, D> {
    fn apply(&mut self, r: &NodeVectors<D>, z: &mut NodeVectors<D>) -> u32 {
        if self.patches.0.is_empty() {
            return self.cycle.apply(r, z);
        }
        z.fill([0.0; D]);
        self.patches.sweep(self.matrix, r, z, true);
        let mut rest: NodeVectors<D> = vec![[0.0; D]; r.len()];
        residual(self.matrix, r, z, &mut rest);
        let mut correction: NodeVectors<D> = vec![[0.0; D]; r.len()];
        self.cycle.apply(&rest, &mut correction);
        axpy(1.0, &correction, z);
        self.patches.sweep(self.matrix, r, z, false);
        1
    }

    fn strengthen(&mut self) -> bool {
        self.cycle.strengthen()
    }
}
