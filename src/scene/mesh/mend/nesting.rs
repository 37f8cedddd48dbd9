//! Which parts lie inside which, and what that makes of them: solids, hollows, parts inside out.

use rayon::prelude::*;

use super::orient::Part;
use crate::mesh::bvh::Bvh;
use crate::mesh::triangles::TriangleMesh;

/// Most points of a part that are looked at.
const MAX_PROBES: usize = 32;

/// A ray that no mesh is aligned with.
const RAY: [f64; 3] = [0.5377, 0.6180, 0.5736];

/// A part with less than this share of the volume of the mesh's box has no volume.
const NO_VOLUME: f64 = 1e-12;

/// What a mesh's parts were made to be.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Nesting {
    /// Parts that were inside out, and were turned.
    pub turned: usize,
    /// Parts that lie inside another one and face the same way, so that they add nothing to it.
    pub swallowed: usize,
    /// Parts that lie partly inside another one.
    pub crossing: usize,
    /// The volume that all parts enclose together (m³), if none cross.
    pub volume: f64,
}

/// Turns whole parts so that solids face outwards and hollows inwards.
///
/// A part in empty space is a solid. A part inside a solid is a hollow if the two face opposite
/// ways in the file, and otherwise a solid as well. If the outermost part is inside out, so is
/// everything in it.
pub fn settle(mesh: &mut TriangleMesh, parts: &[Part]) -> Nesting {
    let mut nesting = Nesting::default();
    let [lower, upper] = mesh.bounds();
    let least = NO_VOLUME * (0..3).map(|a| upper[a] - lower[a]).product::<f64>();
    let inside = containers(mesh, parts, &mut nesting);
    let mut order: Vec<usize> = (0..parts.len()).collect();
    order.sort_by_key(|&n| inside[n].len());
    // Of each part: whether the outermost one around it turns, and which way it faces at last.
    let mut settled = vec![(false, 0i32); parts.len()];
    for n in order {
        let part = &parts[n];
        if part.volume.abs() <= least {
            continue;
        }
        let faces = if part.volume > 0.0 { 1 } else { -1 };
        let outermost = inside[n].iter().copied().min_by_key(|&c| inside[c].len());
        let all_turn = outermost.map_or(faces < 0, |c| settled[c].0);
        // How often the space around it is filled.
        let filled: i32 = inside[n].iter().map(|&c| settled[c].1).sum();
        let wanted = if filled > 0 && (faces < 0) != all_turn { -1 } else { 1 };
        settled[n] = (all_turn, wanted);
        nesting.volume += match (wanted, filled) {
            (1, ..=0) => part.volume.abs(),
            (-1, 1) => -part.volume.abs(),
            _ => 0.0,
        };
        nesting.swallowed += usize::from(wanted > 0 && filled > 0);
        if wanted != faces {
            nesting.turned += 1;
            part.triangles.iter().for_each(|&t| mesh.triangles[t as usize].swap(1, 2));
        }
    }
    nesting
}

/// The parts around each part: those that hold more than half of its points.
fn containers(mesh: &TriangleMesh, parts: &[Part], nesting: &mut Nesting) -> Vec<Vec<usize>> {
    if parts.len() < 2 {
        return vec![Vec::new(); parts.len()];
    }
    let mut part_of = vec![0u32; mesh.triangles.len()];
    for (n, part) in parts.iter().enumerate() {
        part.triangles.iter().for_each(|&t| part_of[t as usize] = n as u32);
    }
    let bvh = Bvh::new(mesh);
    // Pairs of a part around and the number of points that it holds.
    let around = |(n, part): (usize, &Part)| -> Vec<(u32, usize)> {
        let stride = part.triangles.len().div_ceil(MAX_PROBES);
        let mut holding: Vec<u32> = Vec::new();
        for &t in part.triangles.iter().step_by(stride) {
            let mut crossed: Vec<(u32, i32)> = Vec::new();
            bvh.crossings(mesh.middle(t as usize), RAY, |t, outwards| {
                let other = part_of[t as usize];
                if other != n as u32 {
                    crossed.push((other, if outwards { 1 } else { -1 }));
                }
            });
            crossed.sort_unstable();
            let others = crossed.chunk_by(|a, b| a.0 == b.0);
            holding.extend(others.filter(|o| o.iter().map(|c| c.1).sum::<i32>() != 0).map(|o| o[0].0));
        }
        holding.sort_unstable();
        holding.chunk_by(|a, b| a == b).map(|points| (points[0], points.len())).collect()
    };
    let around: Vec<Vec<(u32, usize)>> = parts.par_iter().enumerate().map(around).collect();
    let probes = |n: usize| parts[n].triangles.len().div_ceil(parts[n].triangles.len().div_ceil(MAX_PROBES));
    nesting.crossing = (0..parts.len()).filter(|&n| around[n].iter().any(|(_, held)| *held < probes(n))).count();
    let most = |n: usize| {
        let held = around[n].iter().filter(move |(_, held)| 2 * held > probes(n));
        held.map(|(other, _)| *other as usize).collect()
    };
    (0..parts.len()).map(most).collect()
}
