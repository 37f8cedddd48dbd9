//! The Hessian as a matrix, gathered row by row: H_ij = m_i δ_ij I + Σ_p (g_i · K_p · g_j + w_i w_j
//! k_p), k_p where faces press on particles.
//!
//! A row visits the groups that touch its node, and each particle there once. Because K is
//! contracted with the row's g first, a pair of nodes costs D³ operations. HOT scatters, calls that
//! its bottleneck, and gathering future work (§8).

use rayon::prelude::*;

use super::topology::Topology;
use crate::implicit::solver::objective::Freedom;
use crate::implicit::solver::sparse::Bsr;
use gridfall_core::material::Tensor4;
use gridfall_core::maths::linalg::{Matrix, Vector, add_scaled, mul, trace};
use gridfall_core::maths::widest::widest;

/// Largest number of nodes of a particle: the cubic kernel's 4³.
const MAX_NODES: usize = 64;

/// Stiffness at the places of particles: w_i w_j K between nodes i and j.
#[derive(Default)]
pub struct AtParticles<const D: usize> {
    /// The block of each particle, if there is one of that index; empty if there are none.
    pub of: Vec<u32>,
    /// dt² share K (kg).
    pub blocks: Vec<Matrix<f64, D>>,
}

impl<const D: usize> AtParticles<D> {
    pub fn get(&self, particle: usize) -> Option<&Matrix<f64, D>> {
        self.blocks.get(*self.of.get(particle)? as usize)
    }
}

/// The matrix of the nodes that have a freedom, which are the first; `tensors` are dt² V0 share K
/// of the particles (kg m²), masses in kg.
pub fn assemble<const D: usize>(
    topology: &Topology<D>,
    tensors: &[Tensor4<f64, D>],
    points: &AtParticles<D>,
    masses: &[f64],
    freedoms: &[Freedom<D>],
) -> Bsr<f64, D> {
    let n = freedoms.len();
    let projections: Vec<Option<Matrix<f64, D>>> = freedoms.iter().map(Freedom::projection).collect();
    // Threads take runs of rows; `place` is where in the current row a column is, if `owner` says
    // that the row has it.
    let rows: Vec<(Vec<u32>, Vec<Matrix<f64, D>>)> = (0..n)
        .into_par_iter()
        .with_min_len(64)
        .map_init(
            || (vec![u32::MAX; n], vec![0u32; n]),
            |(owner, place), i| {
                let mut columns: Vec<u32> = Vec::with_capacity(128);
                for &slot in topology.touching(i) {
                    for &node in topology.nodes_of(slot as usize / topology.stride) {
                        let j = node as usize;
                        if j < n && owner[j] != i as u32 {
                            owner[j] = i as u32;
                            columns.push(node);
                        }
                    }
                }
                columns.sort_unstable();
                columns.iter().enumerate().for_each(|(at, &j)| place[j as usize] = at as u32);
                let mut blocks = vec![[[0.0; D]; D]; columns.len()];
                let mut sums = [[[0.0; D]; D]; MAX_NODES];
                for &slot in topology.touching(i) {
                    let (group, local) = (slot as usize / topology.stride, slot as usize % topology.stride);
                    let sums = &mut sums[..topology.stride];
                    sums.fill([[0.0; D]; D]);
                    for p in topology.members(group) {
                        let (w, g) = topology.stencil(p);
                        couple::<D>(&tensors[p], &g[local], g, sums);
                        if let Some(k) = points.get(p) {
                            let tied = sums.iter_mut().zip(w);
                            tied.for_each(|(sum, w_j)| *sum = add_scaled(sum, w[local] * w_j, k));
                        }
                    }
                    for (sum, &node) in sums.iter().zip(topology.nodes_of(group)) {
                        if (node as usize) < n {
                            let block = &mut blocks[place[node as usize] as usize];
                            *block = add_scaled(block, 1.0, sum);
                        }
                    }
                }
                let diagonal = place[i] as usize;
                (0..D).for_each(|a| blocks[diagonal][a][a] += masses[i]);
                constrain(i, &projections, &columns, &mut blocks);
                (columns, blocks)
            },
        )
        .collect();
    let mut row_start = vec![0];
    for (columns, _) in &rows {
        row_start.push(row_start[row_start.len() - 1] + columns.len());
    }
    Bsr {
        row_start,
        columns: rows.iter().flat_map(|row| &row.0).copied().collect(),
        blocks: rows.iter().flat_map(|row| &row.1).copied().collect(),
    }
}

widest! {
    /// Adds g_i · K · g_j to the sums of all nodes j of a particle.
    fn couple[const D: usize][D](
        k: &Tensor4<f64, D>,
        g_i: &Vector<f64, D>,
        g: &[Vector<f64, D>],
        sums: &mut [Matrix<f64, D>],
    ) {
        // k_i[d][a][c] = Σ_b g_b K_abcd
        let mut k_i = [[[0.0; D]; D]; D];
        for a in 0..D {
            for b in 0..D {
                for c in 0..D {
                    for d in 0..D {
                        k_i[d][a][c] += g_i[b] * k[a][b][c][d];
                    }
                }
            }
        }
        for (sum, g_j) in sums.iter_mut().zip(g) {
            for d in 0..D {
                for a in 0..D {
                    for c in 0..D {
                        sum[a][c] += k_i[d][a][c] * g_j[d];
                    }
                }
            }
        }
    }
}

/// S H S of a row, and trace(H_ii)/D · (I − S) on the diagonal of a node that slides.
fn constrain<const D: usize>(
    i: usize,
    projections: &[Option<Matrix<f64, D>>],
    columns: &[u32],
    blocks: &mut [Matrix<f64, D>],
) {
    let own = &projections[i];
    for (&j, block) in columns.iter().zip(blocks) {
        let size = trace(block) / D as f64;
        if let Some(s) = own {
            *block = mul(s, block);
        }
        if let Some(s) = &projections[j as usize] {
            *block = mul(block, s);
            if j as usize == i {
                *block = add_scaled(block, -size, s);
                (0..D).for_each(|a| block[a][a] += size);
            }
        }
    }
}

/// The diagonal blocks of [`assemble`] alone.
pub fn diagonal<const D: usize>(
    topology: &Topology<D>,
    tensors: &[Tensor4<f64, D>],
    points: &AtParticles<D>,
    masses: &[f64],
    freedoms: &[Freedom<D>],
) -> Vec<Matrix<f64, D>> {
    let bring = |group: usize, shares: &mut [Matrix<f64, D>]| {
        for p in topology.members(group) {
            let (w, g) = topology.stencil(p);
            for ((share, g), w) in shares.iter_mut().zip(g).zip(w) {
                couple::<D>(&tensors[p], g, std::slice::from_ref(g), std::slice::from_mut(share));
                if let Some(k) = points.get(p) {
                    *share = add_scaled(share, w * w, k);
                }
            }
        }
    };
    let mut sums = topology.gather([[0.0; D]; D], bring, |sum, part| *sum = add_scaled(sum, 1.0, part));
    sums.truncate(freedoms.len());
    for (i, sum) in sums.iter_mut().enumerate() {
        (0..D).for_each(|a| sum[a][a] += masses[i]);
        constrain(0, &[freedoms[i].projection()], &[0], std::slice::from_mut(sum));
    }
    sums
}
