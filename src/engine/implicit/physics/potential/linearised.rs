//! The Hessian as a product without a matrix.

use super::{Potential, project};
use crate::implicit::physics::assembly::{self, AtParticles};
use crate::implicit::solver::objective::{LinearOperator, NodeVectors};
use gridfall_core::material::Tensor4;
use gridfall_core::maths::linalg::{Matrix, Vector, add_scaled, apply};

/// The Hessian at a state, applied particle by particle.
pub struct Linearised<'a, const D: usize> {
    potential: &'a Potential<'a, D>,
    tensors: Vec<Tensor4<f64, D>>,
    /// Friction's part, by node.
    resistances: Vec<(usize, Matrix<f64, D>)>,
    /// That of faces that act on particles.
    points: AtParticles<D>,
}

impl<'a, const D: usize> Linearised<'a, D> {
    /// At Δv.
    pub fn new(potential: &'a Potential<'a, D>, dv: &NodeVectors<D>) -> Self {
        let (resistances, points) = (potential.resistances(dv), potential.pressed(dv));
        Self { potential, tensors: potential.elastic_tensors(dv), resistances, points }
    }
}

impl<const D: usize> LinearOperator<D> for Linearised<'_, D> {
    /// S (m + Σ g_i · K : Σ_j S x_j g_jᵀ) x. A sliding node's fixed directions are not acted on: a
    /// solver that starts in range stays there.
    fn apply(&self, x: &NodeVectors<D>, y: &mut NodeVectors<D>) {
        let potential = self.potential;
        let freedoms = &potential.step.boundary.freedoms;
        let mut moving = x.clone();
        project(freedoms, &mut moving);
        let bring = |group: usize, shares: &mut [Vector<f64, D>]| {
            potential.with_values(group, &moving, |p, local| {
                let (w, g) = potential.step.topology.stencil(p);
                let mut grad = [[0.0; D]; D];
                for (u, g) in local.iter().zip(g) {
                    for a in 0..D {
                        (0..D).for_each(|b| grad[a][b] += u[a] * g[b]);
                    }
                }
                let stress: Matrix<f64, D> = std::array::from_fn(|a| {
                    std::array::from_fn(|b| {
                        let k = &self.tensors[p][a][b];
                        (0..D).map(|c| (0..D).map(|d| k[c][d] * grad[c][d]).sum::<f64>()).sum()
                    })
                });
                for (share, g) in shares.iter_mut().zip(g) {
                    let force = apply(&stress, g);
                    (0..D).for_each(|a| share[a] += force[a]);
                }
                if let Some(k) = self.points.get(p) {
                    let mut u = [0.0; D];
                    local.iter().zip(w).for_each(|(x, w)| (0..D).for_each(|a| u[a] += w * x[a]));
                    let force = apply(k, &u);
                    shares.iter_mut().zip(w).for_each(|(share, w)| (0..D).for_each(|a| share[a] += w * force[a]));
                }
            });
        };
        let mut sums =
            potential.step.topology.gather([0.0; D], bring, |sum, part| (0..D).for_each(|a| sum[a] += part[a]));
        sums.truncate(freedoms.len());
        for (i, sum) in sums.iter_mut().enumerate() {
            (0..D).for_each(|a| sum[a] += potential.masses[i] * moving[i][a]);
        }
        for (node, block) in &self.resistances {
            let force = apply(block, &moving[*node]);
            (0..D).for_each(|a| sums[*node][a] += force[a]);
        }
        project(freedoms, &mut sums);
        *y = sums;
    }

    fn diagonal(&self) -> Vec<Matrix<f64, D>> {
        let potential = self.potential;
        let mut blocks = assembly::diagonal(
            &potential.step.topology,
            &self.tensors,
            &self.points,
            &potential.masses,
            &potential.step.boundary.freedoms,
        );
        for (node, block) in &self.resistances {
            blocks[*node] = add_scaled(&blocks[*node], 1.0, &potential.projected(*node, block));
        }
        blocks
    }
}
