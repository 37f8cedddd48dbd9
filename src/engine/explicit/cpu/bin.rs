//! Binning: particles in order of (block, body, index), in chunks of one block and body.

use rayon::prelude::*;

use super::chunk::{Chunk, LANES};
use super::grid_update::Grid;
use super::simulation::{Block, Simulation};
use super::tile::BLOCK;
use crate::keys;
use gridfall_core::maths::real::Real;

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

/// Block coordinates as one number of the same order.
pub fn pack<const D: usize>(block: [i32; D]) -> u64 {
    keys::pack::<BITS, D>(block)
}

/// The block coordinates that [`pack`] made a number of.
pub fn unpack<const D: usize>(key: u64) -> [i32; D] {
    keys::unpack::<BITS, D>(key)
}

/// The block that a position (dx, relative to `block`) belongs to, and the position relative to that; `cell` as in
/// [`super::tile::Layout`].
#[inline]
pub fn home<T: Real, const D: usize>(
    cell: f64,
    period: &[Option<i32>; D],
    block: [i32; D],
    x: [T; D],
) -> ([i32; D], [T; D]) {
    let (mut to, mut local) = (block, x);
    for a in 0..D {
        let inside = (x[a] - T::from_f64(cell)).floor().to_i32();
        let global = BLOCK * block[a] + inside;
        let wrapped = period[a].map_or(global, |n| global.rem_euclid(n));
        to[a] = wrapped.div_euclid(BLOCK);
        local[a] = x[a] - T::from_i32(inside - (wrapped - BLOCK * to[a]));
    }
    (to, local)
}

/// Writes the state of the particle at an old place to a lane of a chunk.
type Fill<'a, T, const D: usize> = &'a (dyn Fn(usize, &mut Chunk<T, D>, usize) + Sync);

impl<T: Real, const D: usize> Simulation<T, D> {
    /// Sorts particles into blocks by their positions and prepares the nodes of these blocks.
    pub fn bin(&mut self) {
        let (cell, period) = (self.constants.layout.cell, self.constants.period);
        let old = std::mem::take(&mut self.chunks);
        let corners: Vec<[i32; D]> = self.blocks.iter().map(|b| b.coordinates).collect();
        let home = |at: usize| {
            let (chunk, l) = (&old[at / LANES], at % LANES);
            let x = std::array::from_fn(|a| chunk.x[a][l]);
            home::<T, D>(cell, &period, corners[chunk.block as usize], x)
        };
        let used = (0..old.len() * LANES).into_par_iter().filter(|at| at % LANES < old[at / LANES].count);
        let place = |at: usize| Place { block: pack(home(at).0), id: old[at / LANES].id[at % LANES], at: at as u32 };
        let places: Vec<Place> = used.map(place).collect();
        let mut bodies = vec![0; places.len()];
        for chunk in &old {
            for &id in &chunk.id[..chunk.count] {
                bodies[id as usize] = chunk.body;
            }
        }
        self.place(places, &bodies, &|at, chunk, lane| {
            chunk.copy_state(lane, &old[at / LANES], at % LANES);
            let (_, local) = home(at);
            for a in 0..D {
                chunk.x[a][lane] = local[a];
            }
        });
    }

    /// Builds blocks, chunks and node tables from places. `bodies` is by index in sampling order.
    pub(super) fn place(&mut self, mut places: Vec<Place>, bodies: &[u32], fill: Fill<T, D>) {
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
            // The other lanes rest where a particle of the chunk is: inside the domain.
            for x in &mut chunk.x {
                let first = x[0];
                x[run.len()..].fill(first);
            }
            chunk
        };
        self.chunks = runs.par_iter().map(build).collect();
        self.tiles = vec![[T::ZERO; 4]; blocks.len() * self.constants.layout.tile(D)];
        self.grid = Grid::new(&blocks, &self.constants.layout, &self.constants.period);
        self.blocks = blocks;
    }

    fn inside(&self, block: &[i32; D]) -> [[T; 2]; D] {
        std::array::from_fn(|a| {
            if self.constants.period[a].is_some() {
                return [-1e30, 1e30].map(T::from_f64);
            }
            let corner = BLOCK * block[a];
            [-1 - corner, self.setup.cells[a] as i32 + 1 - corner].map(T::from_i32)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn homes_fold_periodic_axes_of_any_number_of_cells() {
        let home = |x: f64| home(0.0, &[Some(6)], [1], [x]);
        assert_eq!(home(0.5), ([1], [0.5]));
        assert_eq!(home(2.5), ([0], [0.5]));
        assert_eq!(home(-0.5), ([0], [3.5]));
        assert_eq!(home(-4.5), ([1], [1.5]));
    }

    #[test]
    fn homes_may_begin_within_a_cell() {
        let home = |x: f64| home(0.5, &[None], [0], [x]).0[0];
        assert_eq!([0.4, 0.5, 4.4, 4.5].map(home), [-1, 0, 0, 1]);
    }
}
