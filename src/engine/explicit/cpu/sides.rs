//! Nodes that both sides of a plate have (see [`gridfall_core::sim::side`]): where several layers have mass,
//! those that are at home at the node move together, and those for which it lies beyond a plate.
//!
//! In: sums of the tiles. Out: the nodes' momenta, each layer's with its own mass, and what fills a node
//! over the layers that move together. One thread a place of grid blocks, that of the lowest layer.

use rayon::prelude::*;

use super::constants::Constants;
use super::simulation::Block;
use super::tables::Tables;
use super::tile::{BLOCK, MASS, Node, position};
use gridfall_core::maths::real::Real;
use gridfall_core::sim::setup::Setup;
use gridfall_core::sim::side::{LAYERS, Plates};

/// The nodes of all layers.
pub struct Layers<'a, T, const D: usize> {
    pub tables: &'a Tables<D>,
    /// By node: whether it lies beyond a plate for its layer.
    pub beyond: &'a [bool],
    pub nodes: Vec<Node<T>>,
    /// Rest volumes over dx^d; empty if nobody asks.
    pub volumes: Vec<T>,
}

/// What a node becomes, and what fills it.
type Joined<T> = (usize, Node<T>, T);

impl<T: Real, const D: usize> Layers<'_, T, D> {
    /// The nodes after those have been joined that move together, and what fills them.
    pub fn join(mut self) -> (Vec<Node<T>>, Vec<T>) {
        let blocks = (0..self.tables.blocks.len()).into_par_iter();
        let joined: Vec<Vec<Joined<T>>> = blocks.map(|block| self.block(block)).collect();
        for (slot, node, filled) in joined.into_iter().flatten() {
            self.nodes[slot] = node;
            if let Some(volume) = self.volumes.get_mut(slot) {
                *volume = filled;
            }
        }
        (self.nodes, self.volumes)
    }

    /// What changes at the nodes of a block and of those of other layers in its place.
    fn block(&self, block: usize) -> Vec<Joined<T>> {
        let (layer, corner) = self.tables.blocks[block];
        let there = |layer: u32| self.tables.block(layer, corner).map(|block| (layer, block));
        let here: Vec<(u32, usize)> = (0..LAYERS as u32).filter_map(there).collect();
        let mut joined = Vec::new();
        if here.len() < 2 || here[0].0 != layer {
            return joined;
        }
        let size = self.tables.block_nodes();
        for local in 0..size {
            let mut groups = [Vec::new(), Vec::new()];
            for slot in here.iter().map(|(_, block)| block * size + local) {
                groups[usize::from(self.beyond[slot])].push(slot);
            }
            for slots in &groups {
                self.together(slots, &mut joined);
            }
        }
        joined
    }

    /// Gives the nodes of several layers one velocity, and the sum of what fills them.
    fn together(&self, slots: &[usize], joined: &mut Vec<Joined<T>>) {
        let mut sum = [T::ZERO; 4];
        let mut filled = T::ZERO;
        for &slot in slots {
            sum = std::array::from_fn(|c| sum[c] + self.nodes[slot][c]);
            filled += self.volumes.get(slot).copied().unwrap_or(T::ZERO);
        }
        for &slot in slots {
            let mut node = self.nodes[slot];
            let share = node[MASS] / sum[MASS].max(T::TINY);
            for c in (0..4).filter(|&c| c != MASS) {
                node[c] = share * sum[c];
            }
            joined.push((slot, node, filled));
        }
    }
}

/// By node: whether it lies beyond a plate for its layer.
pub fn beyond<T: Real, const D: usize>(
    setup: &Setup,
    constants: &Constants<T, D>,
    tables: &Tables<D>,
    time_s: f64,
) -> Vec<bool> {
    let plates = Plates::new(setup, time_s);
    let size = tables.block_nodes();
    let of_block = |(layer, corner): &(u32, [i32; D])| {
        let middle = position(setup, corner.map(|c| BLOCK * c + BLOCK / 2), 0.0);
        let far = *layer == 0 || !plates.reach(middle, 2.25 * (D as f64).sqrt() * setup.dx);
        let is_beyond = |local| {
            let (grid, node) = Tables::node(corner, local);
            !far && plates.is_beyond(position(setup, node, constants.layout.shift[grid]), *layer)
        };
        (0..size).map(is_beyond).collect::<Vec<bool>>()
    };
    let blocks: Vec<Vec<bool>> = tables.blocks.par_iter().map(of_block).collect();
    blocks.into_iter().flatten().collect()
}

/// By block: whether particles of other layers may share nodes with its own.
pub fn accompanied<T, const D: usize>(blocks: &[Block<T, D>], period: &[Option<i32>; D]) -> Vec<bool> {
    let fold = |a: usize, c: i32| period[a].map_or(c, |n| c.rem_euclid((n + BLOCK - 1) / BLOCK));
    let mut layers = std::collections::HashMap::<[i32; D], u32>::new();
    for block in blocks {
        *layers.entry(block.coordinates).or_default() |= 1 << block.field;
    }
    let near = |block: &Block<T, D>| {
        (0..3usize.pow(D as u32)).any(|k| {
            let beside = |a: usize| fold(a, block.coordinates[a] + (k / 3usize.pow(a as u32) % 3) as i32 - 1);
            layers.get(&std::array::from_fn(beside)).is_some_and(|&there| there & !(1 << block.field) != 0)
        })
    };
    blocks.iter().map(near).collect()
}
