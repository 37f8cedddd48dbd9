//! Binning: particles in order of (block, body, index), in chunks of one block and body, and the node tables of the blocks.

use std::collections::HashMap;

use rayon::prelude::*;

use super::chunk::{Chunk, LANES};
use super::grid_update::Grid;
use super::solver::{Block, Solver};
use super::tile::{self, BLOCK};
use crate::sim::kernel::Kernel;
use crate::sim::real::Real;

/// Where a particle goes, and where it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Place {
    /// Packed coordinates of its block.
    pub block: u64,
    /// Index in sampling order; a body's particles are consecutive.
    pub id: u32,
    /// Where its state is read from.
    pub at: u32,
}

/// Bits of a packed block coordinate.
const BITS: u32 = 21;
const BIAS: i32 = 1 << (BITS - 1);

/// Block coordinates as one number of the same order.
pub fn pack<const D: usize>(block: [i32; D]) -> u64 {
    block.iter().fold(0, |key, &b| key << BITS | (b + BIAS) as u64)
}

pub fn unpack<const D: usize>(key: u64) -> [i32; D] {
    std::array::from_fn(|a| ((key >> (BITS * (D - 1 - a) as u32)) & ((1 << BITS) - 1)) as i32 - BIAS)
}

/// The block that a position (dx, relative to `block`) belongs to, and the position relative to that.
#[inline]
pub fn home<T: Real, K: Kernel<G, W>, const D: usize, const G: usize, const W: usize>(
    period: &[Option<i32>; D],
    block: [i32; D],
    x: [T; D],
) -> ([i32; D], [T; D]) {
    let (mut to, mut local) = (block, x);
    for a in 0..D {
        let cell = (x[a] - T::from_f64(K::CELL)).floor_i32();
        let global = BLOCK * block[a] + cell;
        let wrapped = period[a].map_or(global, |n| global.rem_euclid(n));
        to[a] = wrapped.div_euclid(BLOCK);
        local[a] = x[a] - T::from_i32(cell - (wrapped - BLOCK * to[a]));
    }
    (to, local)
}

impl<T: Real, K: Kernel<G, W>, const D: usize, const G: usize, const W: usize> Solver<T, K, D, G, W> {
    /// Sorts particles into blocks by their positions and prepares the nodes of these blocks.
    pub fn bin(&mut self) {
        let (blocks, period) = (&self.blocks, self.setup.period);
        let places = self.chunks.par_iter().enumerate().flat_map_iter(|(index, chunk)| {
            let from = blocks[chunk.block as usize].coordinates;
            (0..chunk.count).map(move |l| {
                let x = std::array::from_fn(|a| chunk.x[a][l]);
                let (block, _) = home::<T, K, D, G, W>(&period, from, x);
                Place { block: pack(block), id: chunk.id[l], at: (index * LANES + l) as u32 }
            })
        });
        let places: Vec<Place> = places.collect();
        let mut bodies = vec![0; places.len()];
        for chunk in &self.chunks {
            for l in 0..chunk.count {
                bodies[chunk.id[l] as usize] = chunk.body;
            }
        }
        let old = std::mem::take(&mut self.chunks);
        let corners: Vec<[i32; D]> = self.blocks.iter().map(|b| b.coordinates).collect();
        self.place(places, &bodies, |at, chunk, lane| {
            let (from, l) = (&old[at / LANES], at % LANES);
            chunk.copy_state(lane, from, l);
            let x = std::array::from_fn(|a| from.x[a][l]);
            let (_, local) = home::<T, K, D, G, W>(&period, corners[from.block as usize], x);
            for a in 0..D {
                chunk.x[a][lane] = local[a];
            }
        });
    }

    /// Builds chunks, blocks and node tables from places. `fill(at, chunk, lane)` writes a particle's state.
    pub(super) fn place(
        &mut self,
        mut places: Vec<Place>,
        bodies: &[u32],
        fill: impl Fn(usize, &mut Chunk<T, D>, usize) + Sync,
    ) {
        places.par_sort_unstable();
        let same_chunk = |a: &Place, b: &Place| a.block == b.block && bodies[a.id as usize] == bodies[b.id as usize];
        let mut runs: Vec<(u32, &[Place])> = Vec::new();
        let mut blocks: Vec<Block<T, D>> = Vec::new();
        for group in places.chunk_by(same_chunk) {
            let coordinates = unpack(group[0].block);
            if blocks.last().is_none_or(|b| b.coordinates != coordinates) {
                let inside = self.inside(&coordinates);
                blocks.push(Block { coordinates, chunks: runs.len()..runs.len(), inside });
            }
            let index = blocks.len() - 1;
            runs.extend(group.chunks(LANES).map(|run| (index as u32, run)));
            blocks[index].chunks.end = runs.len();
        }
        let build = |&(block, run): &(u32, &[Place])| {
            let mut chunk = Chunk::empty(block, bodies[run[0].id as usize]);
            for (lane, place) in run.iter().enumerate() {
                fill(place.at as usize, &mut chunk, lane);
            }
            chunk.count = run.len();
            for a in 0..D {
                let x = chunk.x[a][0];
                chunk.x[a][run.len()..].fill(x);
            }
            chunk
        };
        self.chunks = runs.par_iter().map(build).collect();
        self.tiles = vec![[T::ZERO; 4]; blocks.len() * Self::TILE];
        self.grid = self.node_tables(&blocks);
        self.blocks = blocks;
    }

    fn inside(&self, block: &[i32; D]) -> [[T; 2]; D] {
        std::array::from_fn(|a| {
            if self.setup.period[a].is_some() {
                return [-1e30, 1e30].map(T::from_f64);
            }
            let corner = BLOCK * block[a];
            [-1 - corner, self.problem.cells[a] as i32 + 1 - corner].map(T::from_i32)
        })
    }

    /// The grid blocks that the tiles cover, and which node each entry of a tile is.
    fn node_tables(&self, blocks: &[Block<T, D>]) -> Grid<T, D, G> {
        let n = tile::width(G, W);
        // Per axis, grid and tile entry: the node's block and place in it, periodic images folded.
        let axis_nodes = |block: &Block<T, D>, a: usize, g: usize| -> Vec<(i32, usize)> {
            let first = BLOCK * block.coordinates[a] + self.setup.lowest[g];
            let fold = |node: i32| self.setup.period[a].map_or(node, |period| node.rem_euclid(period));
            (first..first + n as i32).map(|i| (fold(i).div_euclid(BLOCK), fold(i).rem_euclid(BLOCK) as usize)).collect()
        };
        let all_axes = |block: &Block<T, D>| -> [[Vec<(i32, usize)>; D]; G] {
            std::array::from_fn(|g| std::array::from_fn(|a| axis_nodes(block, a, g)))
        };
        let touched = |block: &Block<T, D>| -> Vec<u64> {
            let axes = all_axes(block);
            let mut corners = vec![[0; D]];
            for a in 0..D {
                let mut along: Vec<i32> = axes.iter().flat_map(|grid| grid[a].iter().map(|&(b, _)| b)).collect();
                along.sort_unstable();
                along.dedup();
                let extend = |corner: [i32; D]| {
                    along.iter().map(move |&b| {
                        let mut next = corner;
                        next[a] = b;
                        next
                    })
                };
                corners = corners.into_iter().flat_map(extend).collect();
            }
            corners.into_iter().map(pack).collect()
        };
        let mut keys: Vec<u64> = blocks.par_iter().flat_map_iter(touched).collect();
        keys.par_sort_unstable();
        keys.dedup();
        let index: HashMap<u64, u32> = keys.iter().zip(0..).map(|(&key, i)| (key, i)).collect();

        let slots_of = |block: &Block<T, D>| -> Vec<u32> {
            let axes = all_axes(block);
            let mut slots = Vec::with_capacity(Self::TILE);
            for (g, grid) in axes.iter().enumerate() {
                let mut known = (u64::MAX, 0);
                for entry in 0..n.pow(D as u32) {
                    let (mut corner, mut local) = ([0; D], g);
                    for a in 0..D {
                        let (b, place) = grid[a][entry / n.pow((D - 1 - a) as u32) % n];
                        corner[a] = b;
                        local = local * BLOCK as usize + place;
                    }
                    let key = pack(corner);
                    if key != known.0 {
                        known = (key, index[&key]);
                    }
                    slots.push(known.1 * Grid::<T, D, G>::NODES as u32 + local as u32);
                }
            }
            slots
        };
        let slots: Vec<Vec<u32>> = blocks.par_iter().map(slots_of).collect();
        Grid::new(keys.iter().map(|&key| unpack(key)).collect(), slots.concat(), Self::TILE)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sim::kernel::{Compact, Quadratic};

    #[test]
    fn block_coordinates_pack_and_keep_their_order() {
        let blocks = [[-3, 5, -1], [-3, 5, 0], [-2, -7, 9], [0, 0, 0], [4, -1, 2]];
        assert!(blocks.windows(2).all(|w| pack(w[0]) < pack(w[1])));
        assert!(blocks.iter().all(|&b| unpack::<3>(pack(b)) == b));
        assert_eq!(unpack::<2>(pack([-1, 7])), [-1, 7]);
    }

    #[test]
    fn homes_fold_periodic_axes_of_any_number_of_cells() {
        let home = |x: f64| home::<f64, Compact, 1, 2, 2>(&[Some(6)], [1], [x]);
        assert_eq!(home(0.5), ([1], [0.5]));
        assert_eq!(home(2.5), ([0], [0.5]));
        assert_eq!(home(-0.5), ([0], [3.5]));
        assert_eq!(home(-4.5), ([1], [1.5]));
    }

    #[test]
    fn quadratic_homes_are_shifted_by_half_a_cell() {
        let home = |x: f64| home::<f64, Quadratic, 1, 1, 3>(&[None], [0], [x]).0[0];
        assert_eq!([0.4, 0.5, 4.4, 4.5].map(home), [-1, 0, 0, 1]);
    }
}
