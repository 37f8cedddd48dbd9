//! The sides of a sheet: which corners of a lattice cell lie on the other side of a surface without
//! inside.
//!
//! Two corners of a cell are on different sides if the surface goes through the edge between them
//! an odd number of times. This needs no orientation, and neighbouring cells agree about it. A cell
//! with a rim has edges beyond the rim; there the surface goes on as the plane of its nearest
//! triangle. Where that makes no two sides (three sheets at an edge, layers closer than a spacing), the
//! cell is filled up, so that nothing gets through.

use std::sync::atomic::Ordering::Relaxed;

use gridfall_core::sim::collider::{DistanceField, SOLID, sided};
use gridfall_core::sim::source::Effort;
use rayon::prelude::*;

use crate::mesh::bvh::Bvh;
use crate::mesh::triangles::{TriangleMesh, cross, dot, sub};

/// Most by which a cell's surface may miss the triangles (spacings). A right angle is rounded by 0.36.
const MISSED: f64 = 0.4;

/// Crossings of an edge this near to each other are one, at an edge of two triangles (spacings).
const SAME: f64 = 1e-6;

/// Where the surface goes through one edge twice, it is two layers if the cosine of the angle between
/// its normals along the edge is above this, and otherwise a fold whose tip is cut off.
const LAYERS: f64 = 0.5;

/// The corners of a cell at the ends of its edges; those along x come first.
const EDGES: [[usize; 2]; 12] =
    [[0, 1], [2, 3], [4, 5], [6, 7], [0, 2], [1, 3], [4, 6], [5, 7], [0, 4], [1, 5], [2, 6], [3, 7]];

/// The edges around each face of a cell: lower x, upper x, lower y, …
const FACES: [[usize; 4]; 6] = [[4, 10, 6, 8], [5, 11, 7, 9], [0, 9, 2, 8], [1, 11, 3, 10], [0, 5, 1, 4], [2, 7, 3, 6]];

/// Adds the sides of all cells to a field of distances. `effort` counts the triangles of cells; a field
/// that takes too much is left unfinished.
pub fn add_sides(field: &mut DistanceField, mesh: &TriangleMesh, bvh: &Bvh, effort: &Effort) {
    let rims = rims(mesh);
    let [nx, ny, nz] = field.size;
    let spacing = field.spacing;
    // No point of a cell is farther from its corner.
    let reach = 1.000_001 * 3f64.sqrt() * spacing;
    let sides = |k: usize| {
        let i = [k % nx, k / nx % ny, k / (nx * ny)];
        if f64::from(field.samples[k]) > reach || i[0] + 1 == nx || i[1] + 1 == ny || i[2] + 1 == nz {
            return 0;
        }
        let corner = std::array::from_fn(|a| field.origin[a] + i[a] as f64 * spacing);
        let distances = std::array::from_fn(|c| {
            let at = k + (c & 1) + nx * ((c >> 1 & 1) + ny * (c >> 2));
            f64::from(field.samples[at]) / spacing
        });
        if effort.is_over() {
            return 0;
        }
        Cell::new(bvh, &rims, corner, spacing).map_or(0, |cell| {
            effort.spent.fetch_add(cell.triangles.len() as u64, Relaxed);
            cell.sides(bvh, &distances)
        })
    };
    let sides: Vec<u8> = (0..field.samples.len()).into_par_iter().map(sides).collect();
    field.samples.iter_mut().zip(sides).for_each(|(sample, sides)| *sample = sided(*sample, sides));
}

/// For each triangle, which of the edges that start at its corners have no other triangle.
fn rims(mesh: &TriangleMesh) -> Vec<[bool; 3]> {
    let mut rims = vec![[false; 3]; mesh.triangles.len()];
    for sides in crate::mesh::mend::Edges::new(mesh).iter().filter(|sides| sides.len() == 1) {
        rims[sides[0].triangle as usize][sides[0].corner as usize] = true;
    }
    rims
}

/// A cell that the surface goes through, in coordinates from 0 to 1.
struct Cell {
    corner: [f64; 3],
    spacing: f64,
    triangles: Vec<[[f64; 3]; 3]>,
    /// Corners and middles of what triangles have in the cell.
    points: Vec<[f64; 3]>,
    /// The faces that a rim goes through.
    rimmed: [bool; 6],
    has_rim: bool,
}

impl Cell {
    /// The cell at a lowest corner (m); none if the surface does not go through it.
    fn new(bvh: &Bvh, rims: &[[bool; 3]], corner: [f64; 3], spacing: f64) -> Option<Self> {
        let mut cell =
            Self { corner, spacing, triangles: Vec::new(), points: Vec::new(), rimmed: [false; 6], has_rim: false };
        bvh.around(corner, corner.map(|x| x + spacing), |triangle, number| {
            let triangle = triangle.map(|v| sub(v, corner).map(|x| x / spacing));
            let within = clipped(&triangle);
            if within.is_empty() {
                return;
            }
            let middle = std::array::from_fn(|a| within.iter().map(|x| x[a]).sum::<f64>() / within.len() as f64);
            cell.points.push(middle);
            cell.points.extend(within);
            cell.triangles.push(triangle);
            for k in (0..3).filter(|&k| rims[number as usize][k]) {
                let line = [triangle[k], triangle[(k + 1) % 3]];
                cell.has_rim |= passes(line);
                (0..6).for_each(|face| cell.rimmed[face] |= pierces(line, face));
            }
        });
        (!cell.triangles.is_empty()).then_some(cell)
    }

    /// The sides of the corners, whose distances (spacings) are given.
    fn sides(&self, bvh: &Bvh, distances: &[f64; 8]) -> u8 {
        let mut apart = [false; 12];
        for (edge, apart) in apart.iter_mut().enumerate() {
            let crossings = self.crossings(edge);
            let along = |k: usize, l: usize| dot(crossings[k].1, crossings[l].1) > LAYERS;
            if (1..crossings.len()).any(|k| (0..k).any(|l| along(k, l))) {
                return SOLID;
            }
            *apart = crossings.len() % 2 == 1;
        }
        if self.has_rim {
            // Of a face that the surface goes right through, all is known.
            let known = |face: &usize| !self.rimmed[*face] && [2, 4].contains(&count(&apart, *face));
            let mut settled = [false; 12];
            (0..6).filter(known).for_each(|face| FACES[face].iter().for_each(|edge| settled[*edge] = true));
            for edge in (0..12).filter(|&edge| !settled[edge]) {
                apart[edge] |= self.would_cross(bvh, edge);
            }
        }
        two_sides(&apart).filter(|sides| self.misses(*sides, distances) <= MISSED).unwrap_or(SOLID)
    }

    /// Where triangles go through an edge, and their normals along it.
    fn crossings(&self, edge: usize) -> Vec<(f64, [f64; 3])> {
        let (start, along) = (place(EDGES[edge][0]), edge / 4);
        let (b, c) = ((along + 1) % 3, (along + 2) % 3);
        let mut crossings: Vec<(f64, [f64; 3])> = Vec::new();
        for t in &self.triangles {
            let area = |p: &[f64; 3], q: &[f64; 3]| {
                (p[b] - start[b]) * (q[c] - start[c]) - (p[c] - start[c]) * (q[b] - start[b])
            };
            let areas = [area(&t[1], &t[2]), area(&t[2], &t[0]), area(&t[0], &t[1])];
            let whole = areas.iter().sum::<f64>();
            let weights = areas.map(|area| area / whole);
            // A triangle along the edge gives no numbers, and is not crossed.
            if !weights.iter().all(|w| *w >= -1e-12) {
                continue;
            }
            let at = (0..3).map(|k| weights[k] * t[k][along]).sum::<f64>();
            let n = normal(t);
            if (0.0..=1.0).contains(&at) && !crossings.iter().any(|known| (known.0 - at).abs() < SAME) {
                crossings.push((at, n.map(|a| a * n[along].signum())));
            }
        }
        crossings
    }

    /// Whether the plane of the triangle nearest to an edge's middle goes through the edge.
    fn would_cross(&self, bvh: &Bvh, edge: usize) -> bool {
        let ends = EDGES[edge].map(|c| place(c).map(|x| x * self.spacing));
        let at = |share: f64| -> [f64; 3] {
            std::array::from_fn(|a| self.corner[a] + (1.0 - share) * ends[0][a] + share * ends[1][a])
        };
        let triangle = bvh.corners(bvh.nearest(at(0.5), 0, &mut 0).1);
        let n = normal(triangle);
        let [first, last] = [0.0, 1.0].map(|share| dot(n, sub(at(share), triangle[0])));
        (first < 0.0) != (last < 0.0)
    }

    /// The most by which the surface between the sides misses the triangles (spacings).
    fn misses(&self, sides: u8, distances: &[f64; 8]) -> f64 {
        let miss = |x: &[f64; 3]| {
            let term = |c: usize| {
                let weight: f64 = (0..3).map(|a| if c >> a & 1 == 1 { x[a] } else { 1.0 - x[a] }).product();
                weight * if sides >> c & 1 == 1 { -distances[c] } else { distances[c] }
            };
            (0..8).map(term).sum::<f64>().abs()
        };
        self.points.iter().map(miss).fold(0.0, f64::max)
    }
}

/// The sides of the corners, if the edges that the surface goes through part them into two sides, each
/// in one piece.
fn two_sides(apart: &[bool; 12]) -> Option<u8> {
    let (mut sides, mut known) = (0u8, 1u8);
    // No corner is more than three edges away.
    for _ in 0..3 {
        for (edge, [p, q]) in EDGES.iter().enumerate() {
            for (from, to) in [(p, q), (q, p)] {
                if known >> from & 1 == 1 && known >> to & 1 == 0 {
                    sides |= ((sides >> from & 1) ^ u8::from(apart[edge])) << to;
                    known |= 1 << to;
                }
            }
        }
    }
    let side = |corner: usize| sides >> corner & 1;
    let agree = EDGES.iter().zip(apart).all(|([p, q], apart)| (side(*p) != side(*q)) == *apart);
    // A face with four such edges does not say which of its corners belong together.
    let clear = (0..6).all(|face| count(apart, face) < 4);
    (agree && clear && in_one_piece(sides) && in_one_piece(!sides)).then_some(sides)
}

/// How many edges of a face the surface goes through.
fn count(apart: &[bool; 12], face: usize) -> usize {
    FACES[face].iter().filter(|edge| apart[**edge]).count()
}

/// Whether the corners of a set hang together along edges of the cell.
fn in_one_piece(corners: u8) -> bool {
    let mut reached = corners & corners.wrapping_neg();
    for _ in 0..7 {
        for [p, q] in EDGES {
            if reached >> p & 1 == 1 || reached >> q & 1 == 1 {
                reached |= (1 << p | 1 << q) & corners;
            }
        }
    }
    reached == corners
}

/// A corner's place in its cell.
fn place(corner: usize) -> [f64; 3] {
    std::array::from_fn(|a| (corner >> a & 1) as f64)
}

fn normal([a, b, c]: &[[f64; 3]; 3]) -> [f64; 3] {
    let n = cross(sub(*b, *a), sub(*c, *a));
    let size = dot(n, n).sqrt();
    n.map(|n| n / size)
}

/// The corners of what a triangle has in the unit cell (Sutherland & Hodgman 1974).
fn clipped(triangle: &[[f64; 3]; 3]) -> Vec<[f64; 3]> {
    let mut polygon = triangle.to_vec();
    for (a, upper) in (0..3).flat_map(|a| [(a, false), (a, true)]) {
        let depth = |x: &[f64; 3]| if upper { 1.0 - x[a] } else { x[a] };
        let mut kept = Vec::with_capacity(polygon.len() + 1);
        for (k, to) in polygon.iter().enumerate() {
            let from = &polygon[(k + polygon.len() - 1) % polygon.len()];
            let (before, after) = (depth(from), depth(to));
            if (before < 0.0) != (after < 0.0) {
                let share = before / (before - after);
                kept.push(std::array::from_fn(|a| from[a] + share * (to[a] - from[a])));
            }
            if after >= 0.0 {
                kept.push(*to);
            }
        }
        polygon = kept;
    }
    polygon
}

/// Whether a line goes through the unit cell.
fn passes([from, to]: [[f64; 3]; 2]) -> bool {
    let (mut enter, mut leave) = (0.0f64, 1.0f64);
    for a in 0..3 {
        let way = to[a] - from[a];
        if way == 0.0 {
            if !(0.0..=1.0).contains(&from[a]) {
                return false;
            }
            continue;
        }
        let [s, t] = [-from[a] / way, (1.0 - from[a]) / way];
        (enter, leave) = (enter.max(s.min(t)), leave.min(s.max(t)));
    }
    enter <= leave
}

/// Whether a line goes through a face of the unit cell.
fn pierces([from, to]: [[f64; 3]; 2], face: usize) -> bool {
    let (a, level) = (face / 2, (face % 2) as f64);
    if (from[a] < level) == (to[a] < level) {
        return false;
    }
    let share = (level - from[a]) / (to[a] - from[a]);
    (0..3).filter(|&b| b != a).all(|b| (0.0..=1.0).contains(&(from[b] + share * (to[b] - from[b]))))
}

#[cfg(test)]
mod tests;
