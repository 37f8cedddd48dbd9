//! T-junctions: a vertex of one face lies on an edge of another, which does not know it.

use std::collections::HashMap;

use super::edges::Edges;
use crate::mesh::triangles::{TriangleMesh, dot, sub};

/// A vertex within this fraction of the mesh's extent of an edge lies on it.
const ON_EDGE: f64 = 1e-5;

/// Most pairs of an edge and a vertex that are looked at. A mesh of loose triangles has far more,
/// and nothing to be mended.
const MAX_PAIRS: usize = 200_000_000;

/// Splits triangles at vertices that lie on their open edges. Returns the number of vertices.
pub fn close_seams(mesh: &mut TriangleMesh) -> usize {
    let mut inserted = 0;
    // A round splits a triangle along one of its three edges.
    for _ in 0..3 {
        let splits = splits(mesh);
        if splits.is_empty() {
            break;
        }
        for (triangle, (corner, points)) in splits {
            inserted += points.len();
            let t = mesh.triangles[triangle as usize];
            let [from, to, apex] = [0, 1, 2].map(|k| t[(corner as usize + k) % 3]);
            let mut last = from;
            let ends = points.into_iter().chain([to]);
            let mut fan = ends.map(|end| [std::mem::replace(&mut last, end), end, apex]);
            mesh.triangles[triangle as usize] = fan.next().unwrap_or(t);
            mesh.triangles.extend(fan);
        }
    }
    inserted
}

/// For each triangle to be split: the corner where its open edge starts, and the vertices along the
/// edge.
fn splits(mesh: &TriangleMesh) -> Vec<(u32, (u8, Vec<u32>))> {
    let edges = Edges::new(mesh);
    let open: Vec<_> = edges.iter().filter(|sides| sides.len() == 1).map(|sides| sides[0]).collect();
    let mut rim: Vec<u32> = open.iter().flat_map(|side| side.edge).collect();
    rim.sort_unstable();
    rim.dedup();
    let [lower, upper] = mesh.bounds();
    let extent = |a: usize| upper[a] - lower[a];
    let axis = (0..3).max_by(|&a, &b| extent(a).total_cmp(&extent(b))).unwrap_or(0);
    let tolerance = ON_EDGE * extent(axis);
    let place = |v: u32| mesh.vertices[v as usize];
    rim.sort_by(|&a, &b| place(a)[axis].total_cmp(&place(b)[axis]));
    let mut found: HashMap<u32, (u8, Vec<u32>)> = HashMap::new();
    let mut pairs = 0;
    for side in open {
        let t = mesh.triangles[side.triangle as usize];
        let [from, to] = [0, 1].map(|k| t[(side.corner as usize + k) % 3]);
        let (a, b) = (place(from), place(to));
        let way = sub(b, a);
        let length = dot(way, way).sqrt();
        let (low, high) = (a[axis].min(b[axis]) - tolerance, a[axis].max(b[axis]) + tolerance);
        let first = rim.partition_point(|&v| place(v)[axis] < low);
        let near = rim[first..].iter().take_while(|&&v| place(v)[axis] <= high);
        let mut on: Vec<(f64, u32)> = Vec::new();
        for &v in near {
            pairs += 1;
            let arm = sub(place(v), a);
            let along = dot(arm, way) / length;
            let off = (dot(arm, arm) - along * along).max(0.0).sqrt();
            if !t.contains(&v) && along > tolerance && along < length - tolerance && off <= tolerance {
                on.push((along, v));
            }
        }
        if pairs > MAX_PAIRS {
            return Vec::new();
        }
        if !on.is_empty() {
            on.sort_by(|a, b| a.0.total_cmp(&b.0));
            let points = on.into_iter().map(|(_, v)| v).collect();
            found.entry(side.triangle).or_insert((side.corner, points));
        }
    }
    let mut found: Vec<_> = found.into_iter().collect();
    found.sort_unstable();
    found
}
