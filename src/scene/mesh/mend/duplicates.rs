//! Faces that are there twice.

use super::edges::{Edges, Side};
use super::union::Union;
use crate::mesh::triangles::TriangleMesh;

/// Leaves one of all triangles with the same three vertices, whichever way they face. Where they
/// are a wall inside a solid, or a fin without thickness, none of them bounds anything, and all go:
/// with one of them left, more edges would have an odd number of triangles. Returns how many went.
pub fn drop_duplicates(mesh: &mut TriangleMesh) -> usize {
    let before = mesh.triangles.len();
    let double = leave_one(mesh);
    if !double.contains(&true) {
        return 0;
    }
    let useless = useless(mesh, &double);
    let mut n = 0..;
    mesh.triangles.retain(|_| !useless[n.next().unwrap_or(0)]);
    before - mesh.triangles.len()
}

/// Leaves one of all triangles with the same three vertices. Returns which of those left were there
/// more than once.
pub fn leave_one(mesh: &mut TriangleMesh) -> Vec<bool> {
    let before = mesh.triangles.len();
    let key = |t: &[u32; 3]| {
        let mut key = *t;
        key.sort_unstable();
        key
    };
    let mut order: Vec<u32> = (0..before as u32).collect();
    order.sort_unstable_by_key(|&n| (key(&mesh.triangles[n as usize]), n));
    let groups = order.chunk_by(|&a, &b| key(&mesh.triangles[a as usize]) == key(&mesh.triangles[b as usize]));
    let mut kept: Vec<(u32, bool)> = groups.map(|group| (group[0], group.len() > 1)).collect();
    kept.sort_unstable();
    mesh.triangles = kept.iter().map(|&(n, _)| mesh.triangles[n as usize]).collect();
    kept.iter().map(|&(_, double)| double).collect()
}

/// Which of the triangles that were there more than once bound nothing.
fn useless(mesh: &TriangleMesh, double: &[bool]) -> Vec<bool> {
    let edges = Edges::new(mesh);
    let is_double = |side: &&Side| double[side.triangle as usize];
    // Doubles that meet at an edge with no others bound something together, or nothing.
    let mut patches = Union::new(mesh.triangles.len());
    for sides in edges.iter().filter(|sides| sides.len() == 2 && sides.iter().all(|side| is_double(&side))) {
        patches.join(sides[0].triangle, sides[1].triangle);
    }
    // By how much the number of odd edges falls without a patch.
    let mut gain = vec![0i32; mesh.triangles.len()];
    for sides in edges.iter() {
        let mut at: Vec<u32> = sides.iter().filter(is_double).map(|side| patches.find(side.triangle)).collect();
        at.sort_unstable();
        for patch in at.chunk_by(|a, b| a == b) {
            let [with, without] = [sides.len(), sides.len() - patch.len()].map(|n| (n % 2) as i32);
            gain[patch[0] as usize] += with - without;
        }
    }
    (0..double.len()).map(|n| double[n] && gain[patches.find(n as u32) as usize] > 0).collect()
}
