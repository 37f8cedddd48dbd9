//! Binning: particles in order of (block, body, index), in chunks of one block and body.

use rayon::prelude::*;

use super::chunk::{Chunk, LANES};
use super::fill::wall_room;
use super::grid_update::Grid;
use super::simulation::{Block, Simulation};
use super::tile::BLOCK;
use crate::keys;
use gridfall_core::maths::real::Real;
use gridfall_core::sim::setup::{Axis, ContactKind};
use gridfall_core::sim::side::Plates;
use gridfall_core::sim::touch::Touch;

/// Where a particle goes, and where it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Place {
    /// Packed field and coordinates of its block.
    pub block: u64,
    /// Index in sampling order; a body's particles are consecutive.
    pub id: u32,
    /// Where its state is read from.
    pub at: u32,
}

/// Bits of a packed block coordinate.
const BITS: u32 = 20;
/// Where a packed field begins, above three coordinates.
const FIELD: u32 = 60;

/// A field ([`gridfall_core::sim::pair`]) and block coordinates as one number of the same order.
pub fn pack<const D: usize>(field: u32, block: [i32; D]) -> u64 {
    u64::from(field) << FIELD | keys::pack::<BITS, D>(block)
}

/// The field and the block coordinates that [`pack`] made a number of.
pub fn unpack<const D: usize>(key: u64) -> (u32, [i32; D]) {
    ((key >> FIELD) as u32, keys::unpack::<BITS, D>(key))
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

/// Parts in which blocks are built, so that old ones can be given up in between.
const PARTS: usize = 16;

/// The blocks of the last binning while their particles are moved out of them.
struct Old<T, const D: usize> {
    blocks: Vec<Block<T, D>>,
    /// By chunk, counted through all blocks: its block, and its index there.
    chunks: Vec<(u32, u32)>,
    /// By block: particles that are still to be moved.
    left: Vec<u32>,
}

impl<T: Real, const D: usize> Old<T, D> {
    fn new(blocks: Vec<Block<T, D>>) -> Self {
        let of_block = |(b, block): (usize, &Block<T, D>)| (0..block.chunks.len() as u32).map(move |k| (b as u32, k));
        let chunks = blocks.iter().enumerate().flat_map(of_block).collect();
        let count = |block: &Block<T, D>| block.chunks.iter().map(|chunk| chunk.count as u32).sum();
        let left = blocks.iter().map(count).collect();
        Self { blocks, chunks, left }
    }

    /// The block, chunk and lane of a place.
    fn at(&self, at: usize) -> (&Block<T, D>, &Chunk<T, D>, usize) {
        let (block, chunk) = self.chunks[at / LANES];
        let block = &self.blocks[block as usize];
        (block, &block.chunks[chunk as usize], at % LANES)
    }

    /// Gives up the blocks from which all particles have been moved.
    fn moved(&mut self, places: &[Place]) {
        for place in places {
            let block = self.chunks[place.at as usize / LANES].0 as usize;
            self.left[block] -= 1;
            if self.left[block] == 0 {
                self.blocks[block].chunks = Vec::new();
            }
        }
    }
}

impl<T: Real, const D: usize> Simulation<T, D> {
    /// Sorts particles into blocks by their positions and prepares the nodes of these blocks.
    pub fn bin(&mut self) {
        let old = Old::new(self.clear());
        self.rebin(old, |old, at| old.at(at).0.field);
    }

    /// [`Self::bin`], after particles have been asked which side of plates they are on.
    pub fn sort(&mut self) {
        if !self.constants.sided {
            return self.bin();
        }
        let (setup, period) = (self.setup.clone(), self.constants.period);
        let plates = Plates::new(&setup, self.time_s);
        let old = Old::new(self.clear());
        let place = |coordinates: &[i32; D], x: [f64; D]| {
            let mut place = [0.0; 3];
            for a in 0..D {
                place[a] = setup.origin[a] + (f64::from(BLOCK * coordinates[a]) + x[a]) * setup.dx;
            }
            place
        };
        // Particles lie at most two cells outside their blocks.
        let (middle, around) = (0.5 * f64::from(BLOCK), (0.5 * f64::from(BLOCK) + 2.0) * (D as f64).sqrt() * setup.dx);
        // Those on a periodic seam may be on either side of the domain.
        let folds = period.iter().any(Option::is_some);
        let near = |block: &Block<T, D>| folds || plates.reach(place(&block.coordinates, [middle; D]), around);
        let near: Vec<bool> = old.blocks.par_iter().map(near).collect();
        self.rebin(old, |old, at| {
            let (block, chunk, l) = old.at(at);
            let x = std::array::from_fn(|a| chunk.x[a][l].to_f64());
            let is_near = near[old.chunks[at / LANES].0 as usize];
            if is_near { plates.layer(setup.wrapped(place(&block.coordinates, x))) } else { 0 }
        });
    }

    /// Sorts particles into blocks. `field` tells that of the particle at a place.
    fn rebin(&mut self, old: Old<T, D>, field: impl Fn(&Old<T, D>, usize) -> u32 + Sync) {
        let (cell, period) = (self.constants.layout.cell, self.constants.period);
        let home = |old: &Old<T, D>, at: usize| {
            let (block, chunk, l) = old.at(at);
            let x = std::array::from_fn(|a| chunk.x[a][l]);
            home::<T, D>(cell, &period, block.coordinates, x)
        };
        let used = (0..old.chunks.len() * LANES).into_par_iter().filter(|&at| at % LANES < old.at(at).1.count);
        let place = |at: usize| {
            let (_, chunk, l) = old.at(at);
            Place { block: pack(field(&old, at), home(&old, at).0), id: chunk.id[l], at: at as u32 }
        };
        let places: Vec<Place> = used.map(place).collect();
        let mut bodies = vec![0; places.len()];
        for chunk in old.blocks.iter().flat_map(|block| &block.chunks) {
            for &id in &chunk.id[..chunk.count] {
                bodies[id as usize] = chunk.body;
            }
        }
        let fill = |old: &Old<T, D>, at: usize, chunk: &mut Chunk<T, D>, lane: usize| {
            let (_, from, l) = old.at(at);
            chunk.copy_state(lane, from, l);
            let (_, local) = home(old, at);
            for a in 0..D {
                chunk.x[a][lane] = local[a];
            }
        };
        self.place(places, &bodies, old, fill, Old::moved);
    }

    /// Gives up all particles and nodes; returns the blocks.
    pub(super) fn clear(&mut self) -> Vec<Block<T, D>> {
        (self.tiles, self.volumes, self.grid) = (Vec::new(), Vec::new(), Grid::default());
        std::mem::take(&mut self.blocks)
    }

    /// Builds blocks, chunks and node tables from places. `bodies` is by index in sampling order.
    /// `fill` writes the state of the particle at a place of `source` to a lane of a chunk; after a
    /// part of the places has been built, `source` is told.
    pub(super) fn place<S: Sync>(
        &mut self,
        mut places: Vec<Place>,
        bodies: &[u32],
        mut source: S,
        fill: impl Fn(&S, usize, &mut Chunk<T, D>, usize) + Sync,
        built: impl Fn(&mut S, &[Place]),
    ) {
        places.par_sort_unstable();
        let of_block: Vec<&[Place]> = places.chunk_by(|a, b| a.block == b.block).collect();
        let body = |place: &Place| bodies[place.id as usize];
        let chunk = |source: &S, run: &[Place]| {
            let index = body(&run[0]);
            let touch = self.springs.get(index as usize).map(Touch::new);
            let mut chunk = Chunk::empty(index, self.constants.bodies[index as usize].kind(), touch);
            for (lane, place) in run.iter().enumerate() {
                fill(source, place.at as usize, &mut chunk, lane);
            }
            chunk.count = run.len();
            // The other lanes rest where a particle of the chunk is: inside the domain.
            for x in &mut chunk.x {
                let first = x[0];
                x[run.len()..].fill(first);
            }
            chunk
        };
        let block = |source: &S, places: &[Place]| {
            let (field, coordinates) = unpack(places[0].block);
            let runs = places.chunk_by(|a, b| body(a) == body(b)).flat_map(|of_body| of_body.chunks(LANES));
            let runs: Vec<&[Place]> = runs.collect();
            let chunks = runs.into_iter().map(|run| chunk(source, run)).collect();
            let follows = self.constants.follows;
            let walls = follows.then(|| wall_room(&self.setup, &self.constants.layout, &coordinates)).flatten();
            let (inside, planes) = (self.inside(&coordinates), self.planes(&coordinates));
            Block { field, coordinates, chunks, inside, planes, walls }
        };
        let mut blocks = Vec::with_capacity(of_block.len());
        for part in of_block.chunks(of_block.len().div_ceil(PARTS).max(1)) {
            blocks.par_extend(part.par_iter().map(|places| block(&source, places)));
            part.iter().for_each(|places| built(&mut source, places));
        }
        drop(source);
        drop(of_block);
        drop(places);
        self.tiles = vec![[T::ZERO; 4]; blocks.len() * self.constants.layout.tile(D)];
        self.volumes = vec![T::ZERO; if self.constants.mixed { self.tiles.len() } else { 0 }];
        self.grid = Grid::new(&blocks, &self.constants.layout, &self.constants.period);
        self.blocks = blocks;
    }

    /// Where the planes of sticky walls are, relative to a block.
    pub(super) fn planes(&self, block: &[i32; D]) -> [[T; 2]; D] {
        std::array::from_fn(|a| {
            let planes = [0, self.setup.cells[a] as i32].map(|plane| T::from_i32(plane - BLOCK * block[a]));
            let Axis::Walls(contacts) = &self.setup.axes[a] else { return [-1e30, 1e30].map(T::from_f64) };
            let plane = |side: usize, beyond: f64| match contacts[side].kind {
                ContactKind::Sticky => planes[side],
                _ => T::from_f64(beyond),
            };
            [plane(0, -1e30), plane(1, 1e30)]
        })
    }

    pub(super) fn inside(&self, block: &[i32; D]) -> [[T; 2]; D] {
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
