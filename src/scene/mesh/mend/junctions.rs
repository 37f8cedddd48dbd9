//! Patches of faces that meet more than two at an edge, such as parts with a wall in common that is
//! triangulated twice. Neighbours alone do not say which way such patches face.

use super::edges::{Edges, balance};
use super::union::Union;
use crate::mesh::triangles::TriangleMesh;

/// Most patches that are turned to fit each other; all ways to do so are tried.
const MAX_PATCHES: usize = 12;

/// Of two ways that enclose the same but for this share, the one that turns fewer faces is taken.
const SAME: f64 = 1e-9;

/// Turns patches so that all edges are run along as often forwards as backwards. Of several ways to
/// do so it takes the one that encloses most. Returns how many faces turned.
pub fn fit(mesh: &mut TriangleMesh) -> usize {
    let edges = Edges::new(mesh);
    let count = mesh.triangles.len();
    let (mut patches, mut groups) = (Union::new(count), Union::new(count));
    for sides in edges.iter() {
        for pair in sides.windows(2) {
            if sides.len() == 2 {
                patches.join(pair[0].triangle, pair[1].triangle);
            }
            groups.join(pair[0].triangle, pair[1].triangle);
        }
    }
    // What each edge with more than two faces asks of the patches there: Σ excess · turn = 0.
    let mut asked: Vec<(u32, Vec<(u32, i32)>)> = Vec::new();
    for sides in edges.iter().filter(|sides| sides.len() > 2) {
        let mut keyed: Vec<(u32, i32)> =
            sides.iter().map(|side| (patches.find(side.triangle), balance([side]))).collect();
        keyed.sort_unstable();
        let sum = |patch: &[(u32, i32)]| (patch[0].0, patch.iter().map(|(_, side)| side).sum());
        let terms: Vec<(u32, i32)> = keyed.chunk_by(|a, b| a.0 == b.0).map(sum).filter(|term| term.1 != 0).collect();
        if !terms.is_empty() {
            asked.push((groups.find(sides[0].triangle), terms));
        }
    }
    asked.sort_unstable();
    asked.dedup();
    if asked.is_empty() {
        return 0;
    }
    // Triangles by patch.
    let mut faces: Vec<(u32, u32)> = (0..count as u32).map(|n| (patches.find(n), n)).collect();
    faces.sort_unstable();
    let mut turned = 0;
    for equations in asked.chunk_by(|a, b| a.0 == b.0) {
        for patch in solve(mesh, equations, &faces) {
            patch.iter().for_each(|&(_, n)| mesh.triangles[n as usize].swap(1, 2));
            turned += patch.len();
        }
    }
    turned
}

/// The patches to turn so that all equations hold, as they are in `faces`; none if they cannot or
/// are too many.
fn solve<'a>(
    mesh: &TriangleMesh,
    equations: &[(u32, Vec<(u32, i32)>)],
    faces: &'a [(u32, u32)],
) -> Vec<&'a [(u32, u32)]> {
    let mut names: Vec<u32> = equations.iter().flat_map(|(_, terms)| terms.iter().map(|term| term.0)).collect();
    names.sort_unstable();
    names.dedup();
    if names.len() > MAX_PATCHES {
        return Vec::new();
    }
    let of_patch = |name: &u32| {
        let [start, end] = [0, 1].map(|k| faces.partition_point(|face| face.0 < name + k));
        &faces[start..end]
    };
    let triangles: Vec<&[(u32, u32)]> = names.iter().map(of_patch).collect();
    let origin = mesh.corners(triangles[0][0].1 as usize)[0];
    let volume = |patch: &&[(u32, u32)]| mesh.volume_of(patch.iter().map(|face| face.1), origin);
    let volumes: Vec<f64> = triangles.iter().map(volume).collect();
    let turn = |way: u32, k: usize| if way >> k & 1 == 1 { -1 } else { 1 };
    let holds = |way: u32, terms: &[(u32, i32)]| {
        let term = |&(name, excess): &(u32, i32)| excess * turn(way, names.binary_search(&name).unwrap_or(0));
        terms.iter().map(term).sum::<i32>() == 0
    };
    let enclosed = |way: u32| -> f64 { (0..names.len()).map(|k| f64::from(turn(way, k)) * volumes[k]).sum() };
    let turned = |way: u32| (0..names.len()).filter(|&k| turn(way, k) < 0).map(|k| triangles[k].len()).sum::<usize>();
    let ways: Vec<(f64, u32)> = (0..1u32 << names.len())
        .filter(|&way| equations.iter().all(|(_, terms)| holds(way, terms)))
        .map(|way| (enclosed(way), way))
        .collect();
    let most = ways.iter().fold(0.0, |most: f64, (volume, _)| most.max(*volume));
    let best = ways.iter().filter(|(volume, _)| *volume >= most * (1.0 - SAME)).min_by_key(|(_, way)| turned(*way));
    let best = best.map_or(0, |(_, way)| *way);
    (0..names.len()).filter(|&k| turn(best, k) < 0).map(|k| triangles[k]).collect()
}
