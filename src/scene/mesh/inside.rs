//! Which samples of a lattice lie inside a closed mesh.

use std::sync::atomic::Ordering::Relaxed;

use gridfall_core::sim::source::Effort;

use super::bvh::Bvh;
use super::sample::Plan;

/// Distances are rounded to f32. Together they may seem longer than they are by this share.
const ROUNDED: f64 = 1.0 + 1e-6;

/// Makes the distances of samples inside the mesh negative.
///
/// No surface lies between two samples whose distances from it are together longer than the way from
/// one to the other. So samples fall into regions, and the winding number is asked for once a region, at
/// the sample that is farthest from the surface. What is left over where `effort` is over stays as it
/// was.
pub fn negate(plan: &Plan, bvh: &Bvh, samples: &mut [f32], effort: &Effort) {
    let strides = [1, plan.size[0], plan.size[0] * plan.size[1]];
    let apart = (plan.spacing * ROUNDED) as f32;
    let mut seen = vec![false; samples.len()];
    let mut region = Vec::new();
    for start in 0..samples.len() {
        if seen[start] {
            continue;
        }
        seen[start] = true;
        region.clear();
        region.push(start);
        let (mut next, mut farthest) = (0, start);
        while let Some(&at) = region.get(next) {
            next += 1;
            if samples[at] > samples[farthest] {
                farthest = at;
            }
            for (a, stride) in strides.into_iter().enumerate() {
                let n = at / stride % plan.size[a];
                let below = (n > 0).then(|| at - stride);
                let above = (n + 1 < plan.size[a]).then(|| at + stride);
                for there in below.into_iter().chain(above) {
                    if !seen[there] && samples[at] + samples[there] > apart {
                        seen[there] = true;
                        region.push(there);
                    }
                }
            }
        }
        if effort.is_over() {
            return;
        }
        let mut visited = region.len() as u64;
        if bvh.winding(plan.point(farthest), &mut visited) > 0.5 {
            region.iter().for_each(|&at| samples[at] = -samples[at]);
        }
        effort.spent.fetch_add(visited, Relaxed);
    }
}
