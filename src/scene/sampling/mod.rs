//! Shapes to points: the lattice points inside a solid, counted without being stored, or sampled in
//! a fixed order.
//!
//! The lattice has a spacing of h = dx / ppc^(1/d). It is aligned with the grid, half a spacing
//! from the grid lines. Signed distances never exceed the true distance, so a single evaluation at
//! the centre of a block can decide for all points of the block. The cost of a count therefore
//! grows with the surface of the solid.

pub mod conforming;
pub mod poisson;

use std::ops::Range;
use std::sync::atomic::AtomicU64;
use std::sync::atomic::Ordering::Relaxed;

use gridfall_core::sim::collider::Sdf;
use gridfall_core::sim::source::Effort;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use crate::sampling::poisson::Darts;
use crate::schema::Sampling;

/// Points closer to the surface than this many spacings count as outside, so that rounding decides
/// nothing where two bodies touch.
const TIE: f64 = 1e-9;

/// Bound on the magnitude of lattice indices; the limits of scenes are far lower.
const FAR: f64 = (1u64 << 38) as f64;

/// Blocks of the lattice are split until they have at most this many points.
const LEAF_POINTS: u64 = 512;

/// Points per lattice point, along each axis, with which a volume is measured.
const FINER: i64 = 4;

/// Tests of points near the surface, per point that may be inside, before a count is abandoned.
const TESTS_PER_POINT: u64 = 16;

/// The lattice of a body.
#[derive(Clone, Debug)]
pub struct Lattice {
    pub origin: [f64; 3],
    pub spacing: f64,
    pub dimension: usize,
    /// Candidate indices on each axis (0..1 on z in 2D).
    pub range: [Range<i64>; 3],
    /// Upper corner of the grid that the lattice is clipped to.
    end: [f64; 3],
}

/// A half-open block of lattice indices.
type Block = [Range<i64>; 3];

/// A count that is abandoned when it becomes too large. Whether that happens does not depend on the
/// order of the work.
struct Count<'a> {
    inside: AtomicU64,
    tested: AtomicU64,
    most: u64,
    effort: &'a Effort,
}

impl Count<'_> {
    fn is_over(&self) -> bool {
        let tests = TESTS_PER_POINT.saturating_mul(self.most.max(1 << 20));
        self.inside.load(Relaxed) > self.most || self.tested.load(Relaxed) > tests || self.effort.is_over()
    }
}

#[derive(Clone, Copy, PartialEq)]
enum Side {
    Outside,
    Inside,
    Both,
}

impl Lattice {
    /// The lattice points whose cells meet the box `bounds`.
    pub fn over(origin: [f64; 3], spacing: f64, dimension: usize, bounds: [[f64; 3]; 2]) -> Self {
        let range = std::array::from_fn(|a| {
            if a >= dimension {
                return 0..1;
            }
            let index = |x: f64| ((x - origin[a]) / spacing).clamp(-FAR, FAR);
            let (low, high) = (index(bounds[0][a]).floor() as i64, index(bounds[1][a]).ceil() as i64);
            low..high.max(low)
        });
        Self { origin, spacing, dimension, range, end: [f64::INFINITY; 3] }
    }

    /// The part of the lattice inside a grid of `cells` with `per_axis` points per cell and axis; on
    /// periodic axes all of it.
    pub fn clipped(&self, cells: [usize; 3], per_axis: f64, periodic: [bool; 3]) -> Self {
        let range = std::array::from_fn(|a| {
            if a >= self.dimension {
                return 0..1;
            }
            if periodic[a] {
                return self.range[a].clone();
            }
            let end = (cells[a] as f64 * per_axis).ceil() as i64;
            let low = self.range[a].start.clamp(0, end);
            low..self.range[a].end.clamp(low, end)
        });
        let end = std::array::from_fn(|a| match periodic[a] {
            true => f64::INFINITY,
            false => self.origin[a] + cells[a] as f64 * per_axis * self.spacing,
        });
        Self { range, end, ..self.clone() }
    }

    /// Poisson-disk sampling at the density of the lattice.
    pub fn darts(&self) -> Darts {
        Darts::new(self.origin, self.spacing.powi(-(self.dimension as i32)), self.dimension)
    }

    /// Points in layers parallel to the surface, as dense as the lattice, and the volume (m^d) that
    /// they share.
    pub fn layers(&self, sdf: &Sdf, seed: u64, body: u64) -> (Vec<[f64; 3]>, f64) {
        conforming::fill(self, sdf, seed, body)
    }

    /// Whether the solid is thick enough for a layer of points somewhere.
    pub fn has_layers(&self, sdf: &Sdf) -> bool {
        conforming::is_thick(self, sdf)
    }

    /// Lower and upper corner of the box that the cells of the lattice fill inside the grid.
    pub fn bounds(&self) -> [[f64; 3]; 2] {
        let corner = |i: &dyn Fn(usize) -> i64| self.point([i(0), i(1), i(2)], [0.0; 3]);
        let upper = corner(&|a| self.range[a].end);
        [corner(&|a| self.range[a].start), std::array::from_fn(|a| upper[a].min(self.end[a]))]
    }

    /// The volume of the solid (m^d) in the range of the lattice, measured with points `FINER`
    /// times as close.
    pub fn volume(&self, sdf: &Sdf) -> f64 {
        let range = std::array::from_fn(|a| {
            if a < self.dimension { FINER * self.range[a].start..FINER * self.range[a].end } else { 0..1 }
        });
        let fine = Self { spacing: self.spacing / FINER as f64, range, ..*self };
        let inside = fine.count(sdf, u64::MAX).expect("a count without a limit");
        inside as f64 * fine.spacing.powi(self.dimension as i32)
    }

    /// Number of points in the range; the methods below need it to be below 2⁶³.
    pub fn candidates(&self) -> f64 {
        self.range.iter().map(|r| (r.end - r.start) as f64).product()
    }

    /// The position `offset` spacings from the lower corner of a lattice point's cell (½ is the
    /// point itself).
    fn point(&self, i: [i64; 3], offset: [f64; 3]) -> [f64; 3] {
        std::array::from_fn(|a| {
            if a < self.dimension { self.origin[a] + (i[a] as f64 + offset[a]) * self.spacing } else { 0.0 }
        })
    }

    fn side(&self, sdf: &Sdf, block: &Block) -> Side {
        let extent: [f64; 3] = std::array::from_fn(|a| (block[a].end - block[a].start) as f64);
        let corner = [block[0].start, block[1].start, block[2].start];
        let center = self.point(corner, extent.map(|e| 0.5 * e));
        let half = (0..self.dimension).map(|a| extent[a] * extent[a]).sum::<f64>().sqrt() * 0.5;
        let reach = half * self.spacing + sdf.slack();
        let tie = TIE * self.spacing;
        match sdf.distance(center) {
            d if d > reach - tie => Side::Outside,
            d if d < -(reach + tie) => Side::Inside,
            _ => Side::Both,
        }
    }

    fn inside(&self, sdf: &Sdf, x: [f64; 3]) -> bool {
        sdf.distance(x) < -TIE * self.spacing
    }

    /// Number of lattice points inside the solid, which is also the expected number of jittered
    /// points. None if there are more than `most`, or if the surface is so large that counting
    /// takes more than work in proportion to `most`.
    pub fn count(&self, sdf: &Sdf, most: u64) -> Option<u64> {
        self.count_within(sdf, most, &Effort::unlimited())
    }

    /// [`Self::count`], which is also given up once the effort is over.
    pub fn count_within(&self, sdf: &Sdf, most: u64, effort: &Effort) -> Option<u64> {
        let count = Count { inside: AtomicU64::new(0), tested: AtomicU64::new(0), most, effort };
        self.count_in(sdf, &self.range, &count);
        (!count.is_over()).then(|| count.inside.into_inner())
    }

    fn count_in(&self, sdf: &Sdf, block: &Block, count: &Count) {
        if count.is_over() {
            return;
        }
        count.effort.spent.fetch_add(1, Relaxed);
        match self.side(sdf, block) {
            Side::Outside => {}
            Side::Inside => drop(count.inside.fetch_add(points(block), Relaxed)),
            Side::Both => match halves(block) {
                Some((low, high)) => {
                    rayon::join(|| self.count_in(sdf, &low, count), || self.count_in(sdf, &high, count));
                }
                None => {
                    let inside = indices(block).filter(|&i| self.inside(sdf, self.point(i, [0.5; 3]))).count();
                    count.inside.fetch_add(inside as u64, Relaxed);
                    count.tested.fetch_add(points(block), Relaxed);
                    count.effort.spent.fetch_add(points(block), Relaxed);
                }
            },
        }
    }

    /// The points inside the solid, block by block. Their order and the random numbers depend only
    /// on the arguments.
    ///
    /// Poisson-disk points are as dense as the lattice and lie in the box that it covers.
    pub fn sample(&self, sdf: &Sdf, sampling: Sampling, seed: u64, body: u64) -> Vec<[f64; 3]> {
        if sampling == Sampling::PoissonDisk {
            return self.darts().throw(sdf, self.bounds(), seed, body);
        }
        let mut leaves = Vec::new();
        self.leaves(sdf, self.range.clone(), &mut leaves);
        let sampled: Vec<Vec<[f64; 3]>> = leaves
            .par_iter()
            .map(|block| {
                let mut random = random(seed, body, block);
                let jittered = sampling == Sampling::Jittered;
                let point =
                    |i| self.point(i, if jittered { std::array::from_fn(|_| random.random()) } else { [0.5; 3] });
                indices(block).map(point).filter(|&x| self.inside(sdf, x)).collect()
            })
            .collect();
        sampled.concat()
    }

    fn leaves(&self, sdf: &Sdf, block: Block, leaves: &mut Vec<Block>) {
        if self.side(sdf, &block) == Side::Outside {
            return;
        }
        match halves(&block) {
            Some((low, high)) => {
                self.leaves(sdf, low, leaves);
                self.leaves(sdf, high, leaves);
            }
            None => leaves.push(block),
        }
    }
}

/// A separate generator for each body and block.
fn random(seed: u64, body: u64, block: &Block) -> ChaCha8Rng {
    let mut key = [0; 32];
    key[..8].copy_from_slice(&seed.to_le_bytes());
    key[8..16].copy_from_slice(&body.to_le_bytes());
    for (a, range) in block.iter().enumerate() {
        key[16 + 5 * a..21 + 5 * a].copy_from_slice(&range.start.to_le_bytes()[..5]);
    }
    ChaCha8Rng::from_seed(key)
}

fn points(block: &Block) -> u64 {
    block.iter().map(|r| (r.end - r.start) as u64).product()
}

fn indices(block: &Block) -> impl Iterator<Item = [i64; 3]> {
    let [x, y, z] = block.clone();
    x.flat_map(move |i| {
        let z = z.clone();
        y.clone().flat_map(move |j| z.clone().map(move |k| [i, j, k]))
    })
}

/// The block cut across its longest axis; none if it is small enough.
fn halves(block: &Block) -> Option<(Block, Block)> {
    halves_above(block, LEAF_POINTS)
}

/// The block cut across its longest axis; none if it has no more points than `few`.
fn halves_above(block: &Block, few: u64) -> Option<(Block, Block)> {
    if points(block) <= few {
        return None;
    }
    let axis = (0..3).max_by_key(|&a| block[a].end - block[a].start).unwrap_or(0);
    let middle = (block[axis].start + block[axis].end) / 2;
    let (mut low, mut high) = (block.clone(), block.clone());
    low[axis].end = middle;
    high[axis].start = middle;
    Some((low, high))
}

#[cfg(test)]
mod tests {
    use super::*;
    use gridfall_core::sim::collider::{Primitive, SdfOp};
    use gridfall_core::sim::particles::IDENTITY;

    fn ball(radius: f64) -> Sdf {
        Sdf {
            ops: vec![SdfOp::Primitive {
                primitive: Primitive::Sphere(radius),
                rotation: IDENTITY,
                translation: [0.5; 3],
            }],
        }
    }

    #[test]
    fn counts_what_it_samples_and_what_a_plain_loop_finds() {
        let sdf = ball(0.31);
        let lattice = Lattice::over([0.0; 3], 1.0 / 64.0, 3, sdf.bounds());
        let plain = indices(&lattice.range).filter(|&i| lattice.inside(&sdf, lattice.point(i, [0.5; 3]))).count();
        let mut sampled = lattice.sample(&sdf, Sampling::Regular, 1, 0);
        assert_eq!(lattice.count(&sdf, u64::MAX), Some(plain as u64));
        assert_eq!(sampled.len(), plain);
        sampled.sort_by(|a, b| a.partial_cmp(b).unwrap());
        sampled.dedup();
        assert_eq!(sampled.len(), plain, "a point twice");
        assert_eq!(lattice.count(&sdf, plain as u64 - 1), None);
    }

    #[test]
    fn jitter_depends_on_seed_and_body_and_on_nothing_else() {
        let sdf = ball(0.31);
        let lattice = Lattice::over([0.0; 3], 1.0 / 32.0, 3, sdf.bounds());
        let draw = |seed, body| lattice.sample(&sdf, Sampling::Jittered, seed, body);
        let one_thread = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        assert_eq!(draw(7, 0), one_thread.install(|| draw(7, 0)));
        assert_ne!(draw(7, 0), draw(8, 0));
        assert_ne!(draw(7, 0), draw(7, 1));
        assert!(draw(7, 0).iter().all(|&x| sdf.distance(x) < 0.0));
    }

    #[test]
    fn a_shape_on_the_lattice_lines_keeps_whole_cells_only() {
        let sdf = Sdf {
            ops: vec![SdfOp::Primitive {
                primitive: Primitive::Box([0.2, 0.1, 0.3]),
                rotation: IDENTITY,
                translation: [0.5, 0.3, 0.4],
            }],
        };
        for cells in [10.0, 30.0, 70.0] {
            let lattice = Lattice::over([0.0; 3], 0.5 / cells, 3, sdf.bounds());
            let expected = 8.0 * 0.2 * 0.1 * 0.3 * (2.0 * cells).powi(3);
            assert_eq!(lattice.count(&sdf, 1 << 40), Some(expected.round() as u64));
        }
    }
}
