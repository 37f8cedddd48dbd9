//! The nodes of a step, and which particles touch them.
//!
//! Particles are sorted into groups that share all their nodes. Sums over particles at a node are
//! gathered: a group first adds up what its own particles bring to each of its nodes, then a node
//! adds up its groups in a fixed order. No two threads write the same number, and no result depends
//! on how many there are.

use rayon::prelude::*;

use super::stencil::{Interpolation, Stencil};
use crate::implicit::solver::objective::NodeId;
use crate::keys;
use gridfall_core::maths::linalg::Vector;
use gridfall_core::sim::setup::{Axis, Setup};

/// Groups per task of a thread.
const CHUNK: usize = 64;

/// Bits of a block coordinate in a packed node.
const BITS: u32 = 18;

/// The interpolation between particles and nodes at one instant. Particles are in the order of
/// their groups.
pub struct Topology<const D: usize> {
    pub interpolation: Interpolation<D>,
    /// Spacing of the nodes (m).
    pub dx: f64,
    /// Index in sampling order of each particle.
    pub order: Vec<u32>,
    /// Nodes of a particle and of a group.
    pub stride: usize,
    /// `stride` per particle.
    pub weights: Vec<f64>,
    /// `stride` per particle (1/m).
    pub gradients: Vec<Vector<f64, D>>,
    pub stencils: Vec<Stencil<D>>,
    /// Group of each particle.
    pub group_of: Vec<u32>,
    /// Particles of group k: `group_start[k]..group_start[k + 1]`.
    pub group_start: Vec<u32>,
    /// `stride` per group.
    pub group_nodes: Vec<u32>,
    pub nodes: Vec<NodeId<D>>,
    /// The groups that touch node i, as indices into `group_nodes`:
    /// `incidence[incidence_start[i]..incidence_start[i + 1]]`.
    pub incidence_start: Vec<u32>,
    pub incidence: Vec<u32>,
}

/// A node as one number: grid by grid, block by block.
fn pack<const D: usize>(node: &NodeId<D>) -> u64 {
    u64::from(node.grid) << keys::by_blocks_bits(BITS, D) | keys::pack_by_blocks::<BITS, D>(node.index)
}

fn unpack<const D: usize>(key: u64) -> NodeId<D> {
    NodeId { grid: (key >> keys::by_blocks_bits(BITS, D)) as u8, index: keys::unpack_by_blocks::<BITS, D>(key) }
}

/// Cells along the axes that are periodic.
pub fn period<const D: usize>(setup: &Setup) -> [Option<i32>; D] {
    std::array::from_fn(|a| matches!(setup.axes[a], Axis::Periodic).then_some(setup.cells[a] as i32))
}

impl<const D: usize> Topology<D> {
    /// Of particles at `x` (m, scene coordinates), on nodes of spacing `dx` (m).
    pub fn new(setup: &Setup, x: &[Vector<f64, D>], dx: f64) -> Self {
        let interpolation = Interpolation::<D>::new(setup.kernel, setup.transfer);
        let period = period::<D>(setup).map(|cells| cells.map(|n| (f64::from(n) * setup.dx / dx).round() as i32));
        let stride = interpolation.nodes();
        let local = |x: &Vector<f64, D>| -> Vector<f64, D> { std::array::from_fn(|a| (x[a] - setup.origin[a]) / dx) };
        let grids = interpolation.shape.grids;

        // Sort by the lowest nodes, which determine all others; then by index.
        let key = |id: usize| {
            let (mut w, mut g) = ([0.0; 64], [[0.0; D]; 64]);
            let stencil = interpolation.at(&local(&x[id]), dx, &mut w[..stride], &mut g[..stride]);
            let first = pack(&NodeId { grid: 0, index: stencil.base[0] });
            // The second grid's lowest node is the first's or one more on each axis.
            let second =
                (0..D).fold(0, |bits, a| bits << 1 | u8::from(grids > 1 && stencil.base[1][a] != stencil.base[0][a]));
            (first, second, id as u32)
        };
        let mut keys: Vec<(u64, u8, u32)> = (0..x.len()).into_par_iter().map(key).collect();
        keys.par_sort_unstable();
        let mut group_start = vec![0];
        for k in 1..=keys.len() {
            if k == keys.len() || (keys[k].0, keys[k].1) != (keys[k - 1].0, keys[k - 1].1) {
                group_start.push(k as u32);
            }
        }
        let counts = group_start.windows(2).map(|w| (w[1] - w[0]) as usize);
        let group_of = counts.enumerate().flat_map(|(k, n)| std::iter::repeat_n(k as u32, n)).collect();
        let order: Vec<u32> = keys.iter().map(|key| key.2).collect();

        let mut weights = vec![0.0; x.len() * stride];
        let mut gradients = vec![[0.0; D]; x.len() * stride];
        let tables = weights.par_chunks_exact_mut(stride).zip(gradients.par_chunks_exact_mut(stride)).zip(&order);
        let stencils: Vec<_> =
            tables.map(|((w, g), &id)| interpolation.at(&local(&x[id as usize]), dx, w, g)).collect();

        // All (node, place in group_nodes), sorted: runs of one node are its incidence.
        let groups = group_start.len() - 1;
        let mut touched: Vec<(u64, u32)> = (0..groups)
            .into_par_iter()
            .flat_map_iter(|group| {
                let base = stencils[group_start[group] as usize].base;
                (0..stride).map(move |slot| {
                    let (grid, offset) = interpolation.offset(slot);
                    let index: [i32; D] = std::array::from_fn(|a| {
                        let i = base[grid][a] + offset[a];
                        period[a].map_or(i, |n| i.rem_euclid(n))
                    });
                    (pack(&NodeId { grid: grid as u8, index }), (group * stride + slot) as u32)
                })
            })
            .collect();
        touched.par_sort_unstable();
        let (mut nodes, mut incidence_start) = (Vec::new(), Vec::new());
        let mut group_nodes = vec![0; groups * stride];
        for (at, &(key, slot)) in touched.iter().enumerate() {
            if at == 0 || touched[at - 1].0 != key {
                nodes.push(unpack(key));
                incidence_start.push(at as u32);
            }
            group_nodes[slot as usize] = nodes.len() as u32 - 1;
        }
        incidence_start.push(touched.len() as u32);
        Self {
            interpolation,
            dx,
            order,
            stride,
            weights,
            gradients,
            stencils,
            group_of,
            group_start,
            group_nodes,
            nodes,
            incidence_start,
            incidence: touched.iter().map(|t| t.1).collect(),
        }
    }

    /// Renumbers the nodes: the i-th of the new ones was `old[i]`.
    pub fn renumber(&mut self, old: &[u32]) {
        let mut new = vec![0; old.len()];
        let (mut starts, mut incidence) = (vec![0], Vec::with_capacity(self.incidence.len()));
        for (at, &was) in old.iter().enumerate() {
            new[was as usize] = at as u32;
            incidence.extend_from_slice(self.touching(was as usize));
            starts.push(incidence.len() as u32);
        }
        self.nodes = old.iter().map(|&was| self.nodes[was as usize]).collect();
        (self.incidence_start, self.incidence) = (starts, incidence);
        self.group_nodes.par_iter_mut().for_each(|node| *node = new[*node as usize]);
    }

    pub fn groups(&self) -> usize {
        self.group_start.len() - 1
    }

    /// Particles of a group.
    pub fn members(&self, group: usize) -> std::ops::Range<usize> {
        self.group_start[group] as usize..self.group_start[group + 1] as usize
    }

    /// Nodes of a group.
    pub fn nodes_of(&self, group: usize) -> &[u32] {
        &self.group_nodes[group * self.stride..(group + 1) * self.stride]
    }

    /// Weights and g vectors of a particle.
    pub fn stencil(&self, particle: usize) -> (&[f64], &[Vector<f64, D>]) {
        let range = particle * self.stride..(particle + 1) * self.stride;
        (&self.weights[range.clone()], &self.gradients[range])
    }

    /// x_i − x_p (m) for the `local`-th node of a particle at `x` (m).
    pub fn arm(&self, setup: &Setup, particle: usize, x: &Vector<f64, D>, local: usize) -> Vector<f64, D> {
        let (grid, offset) = self.interpolation.offset(local);
        let (base, shift) = (&self.stencils[particle].base[grid], self.interpolation.shape.shift[grid]);
        std::array::from_fn(|a| setup.origin[a] + (f64::from(base[a] + offset[a]) + shift) * self.dx - x[a])
    }

    /// The groups that touch a node, as places in `group_nodes`.
    pub fn touching(&self, node: usize) -> &[u32] {
        &self.incidence[self.incidence_start[node] as usize..self.incidence_start[node + 1] as usize]
    }

    /// Where a node is (m), in scene coordinates; z = 0 in 2D.
    pub fn position(&self, setup: &Setup, node: &NodeId<D>) -> [f64; 3] {
        let shift = self.interpolation.shape.shift[usize::from(node.grid)];
        let mut x = [0.0; 3];
        for a in 0..D {
            x[a] = setup.origin[a] + (f64::from(node.index[a]) + shift) * self.dx;
        }
        x
    }

    /// Sums at the nodes over what each group's particles contribute: `bring` adds a group's share
    /// to the values of its nodes.
    pub fn gather<V>(&self, zero: V, bring: impl Fn(usize, &mut [V]) + Sync, add: impl Fn(&mut V, &V) + Sync) -> Vec<V>
    where
        V: Copy + Send + Sync,
    {
        let mut shares = vec![zero; self.groups() * self.stride];
        shares.par_chunks_mut(self.stride * CHUNK).enumerate().for_each(|(chunk, shares)| {
            for (k, share) in shares.chunks_exact_mut(self.stride).enumerate() {
                bring(chunk * CHUNK + k, share);
            }
        });
        let sum = |node: usize| {
            let mut total = zero;
            for &slot in self.touching(node) {
                add(&mut total, &shares[slot as usize]);
            }
            total
        };
        (0..self.nodes.len()).into_par_iter().with_min_len(256).map(sum).collect()
    }
}
