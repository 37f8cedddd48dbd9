//! Faces that agree with their neighbours, and the parts that they make.

use super::edges::{Edges, Side, balance};
use super::union::Union;
use crate::mesh::triangles::{TriangleMesh, cross, dot, sub};

/// No neighbour.
const NONE: u32 = u32::MAX;

/// Turns triangles so that they agree with their neighbours about the outside, where exactly two
/// share an edge. In each patch of such neighbours, those with the larger area stay as they are.
/// Returns how many turned; none if a patch cannot be oriented (a Möbius strip).
pub fn agree(mesh: &mut TriangleMesh) -> Option<usize> {
    let neighbours = neighbours(mesh);
    let count = mesh.triangles.len();
    // Whether a triangle turns; none before it was met.
    let mut turns: Vec<Option<bool>> = vec![None; count];
    let mut turned = 0;
    let (mut open, mut patch) = (Vec::new(), Vec::new());
    for seed in 0..count as u32 {
        if turns[seed as usize].is_some() {
            continue;
        }
        turns[seed as usize] = Some(false);
        patch.clear();
        open.push(seed);
        while let Some(n) = open.pop() {
            patch.push(n);
            let turn = turns[n as usize]?;
            for (k, &other) in neighbours[n as usize].iter().enumerate().filter(|(_, other)| **other != NONE) {
                let wanted = turn ^ runs_alike(mesh, n, k, other);
                match turns[other as usize] {
                    Some(known) if known != wanted => return None,
                    Some(_) => {}
                    None => {
                        turns[other as usize] = Some(wanted);
                        open.push(other);
                    }
                }
            }
        }
        let area = |turn: bool| -> f64 {
            patch.iter().filter(|&&n| turns[n as usize] == Some(turn)).map(|&n| mesh.area(n as usize)).sum()
        };
        let fewer = area(true) <= area(false);
        for &n in patch.iter().filter(|&&n| turns[n as usize] == Some(fewer)) {
            mesh.triangles[n as usize].swap(1, 2);
            turned += 1;
        }
    }
    Some(turned)
}

/// Whether triangle `other` runs along the edge at corner `k` of triangle `n` in the same direction.
fn runs_alike(mesh: &TriangleMesh, n: u32, k: usize, other: u32) -> bool {
    let t = mesh.triangles[n as usize];
    let (from, to) = (t[k], t[(k + 1) % 3]);
    let o = mesh.triangles[other as usize];
    (0..3).any(|k| (o[k], o[(k + 1) % 3]) == (from, to))
}

/// For each corner of each triangle, the only other triangle at the edge that starts there.
fn neighbours(mesh: &TriangleMesh) -> Vec<[u32; 3]> {
    let mut neighbours = vec![[NONE; 3]; mesh.triangles.len()];
    for sides in Edges::new(mesh).iter() {
        if let [a, b] = sides {
            neighbours[a.triangle as usize][a.corner as usize] = b.triangle;
            neighbours[b.triangle as usize][b.corner as usize] = a.triangle;
        }
    }
    neighbours
}

/// A connected part of a mesh.
#[derive(Clone, Debug, Default)]
pub struct Part {
    pub triangles: Vec<u32>,
    /// Enclosed volume with holes capped flat (m³); negative if it faces inwards.
    pub volume: f64,
}

/// A part with holes of more than this share of its surface has no inside of its own.
const MAX_HOLES: f64 = 0.5;

/// The parts of a mesh whose neighbours agree. Pieces that have no inside of their own make up one
/// part together: only the file knows how they face.
pub fn parts(mesh: &TriangleMesh) -> Vec<Part> {
    let edges = Edges::new(mesh);
    let mut union = Union::new(mesh.triangles.len());
    for sides in edges.iter().filter(|sides| sides.len() == 2) {
        union.join(sides[0].triangle, sides[1].triangle);
    }
    // Where more than two meet, those are connected that are not closed there by themselves.
    for sides in edges.iter().filter(|sides| sides.len() > 2) {
        let loose = by_part(sides, &mut union).filter(|part| balance(part.iter()) != 0);
        let loose: Vec<u32> = loose.map(|part| part[0].triangle).collect();
        loose.windows(2).for_each(|pair| union.join(pair[0], pair[1]));
    }
    let mut number = vec![NONE; mesh.triangles.len()];
    let mut parts: Vec<Part> = Vec::new();
    for n in 0..mesh.triangles.len() as u32 {
        let root = union.find(n) as usize;
        if number[root] == NONE {
            number[root] = parts.len() as u32;
            parts.push(Part::default());
        }
        parts[number[root] as usize].triangles.push(n);
    }
    let mut rims: Vec<Vec<Side>> = vec![Vec::new(); parts.len()];
    for sides in edges.iter().filter(|sides| balance(sides.iter()) != 0) {
        for part in by_part(sides, &mut union) {
            let rim = &mut rims[number[union.find(part[0].triangle) as usize] as usize];
            let excess = balance(part.iter());
            let loose = part.iter().filter(|side| side.forward == (excess > 0));
            rim.extend(loose.take(excess.unsigned_abs() as usize).copied());
        }
    }
    let mut pieces = Part::default();
    let mut whole = Vec::new();
    for (mut part, rim) in parts.into_iter().zip(rims) {
        let (caps, cap_area) = caps(mesh, &rim, place_of(mesh, &part));
        let area: f64 = part.triangles.iter().map(|&n| mesh.area(n as usize)).sum();
        if cap_area > MAX_HOLES * area {
            pieces.triangles.extend(part.triangles);
        } else {
            part.volume = mesh.volume_of(part.triangles.iter().copied(), place_of(mesh, &part)) + caps;
            whole.push(part);
        }
    }
    if !pieces.triangles.is_empty() {
        let [lower, upper] = mesh.bounds();
        let middle = std::array::from_fn(|a| 0.5 * (lower[a] + upper[a]));
        pieces.volume = mesh.volume_of(pieces.triangles.iter().copied(), middle);
        whole.push(pieces);
    }
    whole
}

/// The sides of an edge, by part.
fn by_part(sides: &[Side], union: &mut Union) -> impl Iterator<Item = Vec<Side>> + use<> {
    let mut keyed: Vec<(u32, Side)> = sides.iter().map(|side| (union.find(side.triangle), *side)).collect();
    keyed.sort_unstable();
    let parts = keyed.chunk_by(|a, b| a.0 == b.0);
    parts.map(|part| part.iter().map(|(_, side)| *side).collect::<Vec<Side>>()).collect::<Vec<_>>().into_iter()
}

/// A vertex of a part. Volumes are taken about it, so that places far from the origin lose nothing.
fn place_of(mesh: &TriangleMesh, part: &Part) -> [f64; 3] {
    mesh.vertices[mesh.triangles[part.triangles[0] as usize][0] as usize]
}

/// What caps over the holes within `rim` add to the volume about `origin`, and their area. Each cap
/// is a fan about the middle of its hole.
fn caps(mesh: &TriangleMesh, rim: &[Side], origin: [f64; 3]) -> (f64, f64) {
    let mut vertices: Vec<u32> = rim.iter().flat_map(|side| side.edge).collect();
    vertices.sort_unstable();
    vertices.dedup();
    let local = |v: u32| vertices.partition_point(|&w| w < v) as u32;
    let mut holes = Union::new(vertices.len());
    rim.iter().for_each(|side| holes.join(local(side.edge[0]), local(side.edge[1])));
    let mut middles = vec![([0.0; 3], 0.0); vertices.len()];
    for n in 0..vertices.len() as u32 {
        let x = sub(mesh.vertices[vertices[n as usize] as usize], origin);
        let (sum, count) = &mut middles[holes.find(n) as usize];
        (0..3).for_each(|a| sum[a] += x[a]);
        *count += 1.0;
    }
    let (mut volume, mut area) = (0.0, 0.0);
    for side in rim {
        let (sum, count) = middles[holes.find(local(side.edge[0])) as usize];
        let apex = sum.map(|x| x / count);
        let [a, b] = side.edge.map(|v| sub(mesh.vertices[v as usize], origin));
        // The cap runs along the edge the other way.
        let (a, b) = if side.forward { (b, a) } else { (a, b) };
        volume += dot(a, cross(b, apex)) / 6.0;
        let normal = cross(sub(b, a), sub(apex, a));
        area += 0.5 * dot(normal, normal).sqrt();
    }
    (volume, area)
}
