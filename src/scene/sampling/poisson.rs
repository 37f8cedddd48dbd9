//! Poisson-disk sampling: random points that are at least a radius apart, by parallel dart throwing
//! (Wei 2008, Parallel Poisson Disk Sampling).
//!
//! The plane or space is divided into cells as wide as the radius. Cells with equal indices modulo
//! 2 are at least a radius apart, so all cells of one of the 2^d phases can throw darts at the same
//! time. Every cell has its own generator: the points depend only on seed, body and radius, not on
//! threads. They are as dense near the surface as inside, because cells beyond the surface take
//! part.

use std::collections::HashMap;

use gridfall_core::sim::collider::Sdf;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

/// Rounds in which every cell throws darts, and darts per round.
const ROUNDS: u64 = 12;
const DARTS: usize = 6;

/// Most points of a cell, whose corners are a radius apart.
const MOST: usize = 8;

/// Memory of a cell while the points are drawn (bytes), neighbours and table included.
pub const CELL_BYTES: u64 = 512;

/// n r^d for n points per unit of volume, measured for these numbers of rounds and darts (2D, 3D).
const DENSITY: [f64; 2] = [0.673, 0.643];

/// Poisson-disk sampling with a given radius on cells that start at `origin`.
#[derive(Clone, Copy, Debug)]
pub struct Darts {
    origin: [f64; 3],
    radius: f64,
    dimension: usize,
}

type Index = [i32; 3];

struct Cell {
    index: Index,
    /// The cell itself and those around it that take part.
    near: Vec<u32>,
    points: Vec<[f64; 3]>,
}

impl Darts {
    /// Sampling with a density of `per_volume` points (1/m^d).
    pub fn new(origin: [f64; 3], per_volume: f64, dimension: usize) -> Self {
        let radius = (DENSITY[dimension - 2] / per_volume).powf(1.0 / dimension as f64);
        Self { origin, radius, dimension }
    }

    /// Number of cells that [`Darts::throw`] would fill for a solid in `bounds`; none if there are
    /// more than `most`.
    pub fn count_cells(&self, sdf: &Sdf, bounds: [[f64; 3]; 2], most: u64) -> Option<u64> {
        let mut cells = Vec::new();
        self.cells(sdf, self.range(bounds), most, &mut cells).then_some(cells.len() as u64)
    }

    /// All points in the box `bounds` that lie inside the solid, in a fixed order.
    pub fn throw(&self, sdf: &Sdf, bounds: [[f64; 3]; 2], seed: u64, body: u64) -> Vec<[f64; 3]> {
        let mut indices = Vec::new();
        self.cells(sdf, self.range(bounds), u64::MAX, &mut indices);
        let of: HashMap<Index, u32> = indices.iter().zip(0..).map(|(i, n)| (*i, n)).collect();
        let near = |index: &Index| -> Vec<u32> {
            let around = (0..27).map(|k| [k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1]);
            around.filter_map(|o| of.get(&std::array::from_fn(|a| index[a] + o[a])).copied()).collect()
        };
        let mut cells: Vec<Cell> =
            indices.par_iter().map(|i| Cell { index: *i, near: near(i), points: Vec::new() }).collect();
        let mut phases = vec![Vec::new(); 8];
        for (n, index) in indices.iter().enumerate() {
            phases[(0..3).map(|a| (index[a] as usize & 1) << a).sum::<usize>()].push(n);
        }
        for round in 0..ROUNDS {
            for phase in &phases {
                let added: Vec<Vec<[f64; 3]>> = phase
                    .par_iter()
                    .map(|&n| self.fill(&cells, n, &mut random(seed, body, cells[n].index, round)))
                    .collect();
                for (&n, added) in phase.iter().zip(added) {
                    cells[n].points.extend(added);
                }
            }
        }
        let within = |x: &[f64; 3]| (0..self.dimension).all(|a| bounds[0][a] <= x[a] && x[a] < bounds[1][a]);
        let kept = |cell: &Cell| -> Vec<[f64; 3]> {
            cell.points.iter().copied().filter(|x| within(x) && sdf.distance(*x) < 0.0).collect()
        };
        cells.par_iter().flat_map_iter(kept).collect()
    }

    /// The points that one cell gains in one round.
    fn fill(&self, cells: &[Cell], n: usize, random: &mut ChaCha8Rng) -> Vec<[f64; 3]> {
        let cell = &cells[n];
        let mut added: Vec<[f64; 3]> = Vec::new();
        for _ in 0..DARTS {
            let x = std::array::from_fn(|a| {
                let u: f64 = random.random();
                if a < self.dimension { self.origin[a] + (f64::from(cell.index[a]) + u) * self.radius } else { 0.0 }
            });
            let clear = |y: &[f64; 3]| {
                let r = [x[0] - y[0], x[1] - y[1], x[2] - y[2]];
                r[0] * r[0] + r[1] * r[1] + r[2] * r[2] >= self.radius * self.radius
            };
            let room = cell.points.len() + added.len() < MOST && added.iter().all(clear);
            if room && cell.near.iter().all(|&near| cells[near as usize].points.iter().all(clear)) {
                added.push(x);
            }
        }
        added
    }

    /// Indices of the cells that meet the box, with one more on each side.
    fn range(&self, bounds: [[f64; 3]; 2]) -> [Index; 2] {
        let index = |x: f64, a: usize| ((x - self.origin[a]) / self.radius).floor() as i32;
        let range = |side: usize, more: i32| {
            std::array::from_fn(|a| if a < self.dimension { index(bounds[side][a], a) + more } else { side as i32 })
        };
        [range(0, -1), range(1, 2)]
    }

    /// Finds the cells of a half-open range that are in the solid or within a radius of it. False
    /// if there are more than `most`.
    fn cells(&self, sdf: &Sdf, [low, high]: [Index; 2], most: u64, found: &mut Vec<Index>) -> bool {
        let extent: [i32; 3] = std::array::from_fn(|a| high[a] - low[a]);
        let middle: [f64; 3] = std::array::from_fn(|a| {
            let middle = f64::from(low[a]) + 0.5 * f64::from(extent[a]);
            if a < self.dimension { self.origin[a] + middle * self.radius } else { 0.0 }
        });
        let reach = (0..self.dimension).map(|a| f64::from(extent[a]).powi(2)).sum::<f64>().sqrt() * 0.5;
        if extent.contains(&0) || sdf.distance(middle) > (reach + 1.0) * self.radius + sdf.slack() {
            return true;
        }
        if extent == [1; 3] {
            found.push(low);
            return found.len() as u64 <= most;
        }
        let axis = (0..3).max_by_key(|&a| extent[a]).unwrap_or(0);
        let (mut below, mut above) = ([low, high], [low, high]);
        below[1][axis] = low[axis] + extent[axis] / 2;
        above[0][axis] = below[1][axis];
        self.cells(sdf, below, most, found) && self.cells(sdf, above, most, found)
    }
}

/// A separate generator for each body, cell and round.
fn random(seed: u64, body: u64, cell: Index, round: u64) -> ChaCha8Rng {
    let mut key = [0; 32];
    key[..8].copy_from_slice(&seed.to_le_bytes());
    key[8..12].copy_from_slice(&(body as u32).to_le_bytes());
    // Distinguishes it from the generators of jittered lattices.
    key[12..16].copy_from_slice(b"disk");
    for a in 0..3 {
        key[16 + 4 * a..20 + 4 * a].copy_from_slice(&cell[a].to_le_bytes());
    }
    key[28..32].copy_from_slice(&(round as u32).to_le_bytes());
    ChaCha8Rng::from_seed(key)
}

#[cfg(test)]
mod tests {
    use super::*;
    use gridfall_core::sim::collider::{Primitive, SdfOp};
    use gridfall_core::sim::particles::IDENTITY;

    fn cube(half: [f64; 3]) -> Sdf {
        let primitive = Primitive::Box(half);
        Sdf { ops: vec![SdfOp::Primitive { primitive, rotation: IDENTITY, translation: [0.0; 3] }] }
    }

    const BOUNDS: [[f64; 3]; 2] = [[-0.5; 3], [0.5; 3]];

    #[test]
    fn points_are_as_many_as_asked_for_and_never_too_close() {
        for (dimension, per_volume) in [(3, 30_000.0), (2, 30_000.0)] {
            let darts = Darts::new([0.1, 0.2, 0.3], per_volume, dimension);
            let half = if dimension == 3 { 0.5 } else { 1e30 };
            let points = darts.throw(&cube([0.5, 0.5, half]), BOUNDS, 3, 0);
            println!(
                "{dimension}D: {} points, n r^d = {}",
                points.len(),
                points.len() as f64 * darts.radius.powi(dimension as i32)
            );
            assert!((points.len() as f64 / per_volume - 1.0).abs() < 0.01, "{} points", points.len());
            let mut cells: HashMap<[i64; 3], Vec<[f64; 3]>> = HashMap::new();
            let cell = |x: &[f64; 3]| x.map(|x| (x / darts.radius).floor() as i64);
            for x in &points {
                for k in 0..27 {
                    let c = cell(x);
                    let c = [c[0] + k % 3 - 1, c[1] + k / 3 % 3 - 1, c[2] + k / 9 - 1];
                    for y in cells.get(&c).into_iter().flatten() {
                        let d = (0..3).map(|a| (x[a] - y[a]).powi(2)).sum::<f64>().sqrt();
                        assert!(d >= darts.radius, "{x:?} and {y:?} are {d} apart, {} wanted", darts.radius);
                    }
                }
                cells.entry(cell(x)).or_default().push(*x);
            }
        }
    }

    #[test]
    fn points_depend_on_seed_and_body_and_on_nothing_else() {
        let darts = Darts::new([0.0; 3], 2000.0, 3);
        let draw = |seed, body| darts.throw(&cube([0.4, 0.3, 0.45]), BOUNDS, seed, body);
        let one_thread = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        assert_eq!(draw(7, 0), one_thread.install(|| draw(7, 0)));
        assert_ne!(draw(7, 0), draw(8, 0));
        assert_ne!(draw(7, 0), draw(7, 1));
        // A smaller solid keeps most of the points that lie in it.
        let small = darts.throw(&cube([0.2; 3]), BOUNDS, 7, 0);
        let large = draw(7, 0);
        let kept = small.iter().filter(|x| large.contains(x)).count();
        assert!(small.len() > 100 && kept * 10 > small.len() * 7, "{kept} of {}", small.len());
    }

    #[test]
    fn cells_are_counted_no_further_than_asked() {
        let darts = Darts::new([0.0; 3], 2000.0, 3);
        let sdf = cube([0.4; 3]);
        let cells = darts.count_cells(&sdf, BOUNDS, u64::MAX).unwrap();
        assert!(cells > 800, "{cells}");
        assert_eq!(darts.count_cells(&sdf, BOUNDS, cells), Some(cells));
        assert_eq!(darts.count_cells(&sdf, BOUNDS, cells - 1), None);
    }
}
