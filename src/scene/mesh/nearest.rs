//! Distances from a lattice to the nearest triangle: exact near the surface, carried on from sample to
//! sample far from it, where a search would look at thousands of triangles that are almost as near
//! as the nearest (as in Bridson's SDFGen).

use std::sync::atomic::Ordering::Relaxed;

use gridfall_core::sim::source::Effort;
use rayon::prelude::*;

use super::bvh::Bvh;
use super::sample::Plan;

/// Distances up to this are exact (spacings). No surface is felt from farther away.
const NEAR: f64 = 4.0;

/// Samples along an edge of a block. All samples of a block are near or all are far.
const BLOCK: usize = 4;

/// A sample's distance (m) and the place of its triangle in the tree.
struct Sample {
    index: usize,
    u: f32,
    triangle: u32,
    exact: bool,
}

/// Distances without a sign (m), x fastest. Unfinished where `effort` is over. Beyond 4 spacings they
/// may be too large by [`FAR_ERROR`](gridfall_core::sim::collider::FAR_ERROR).
pub fn distances(plan: &Plan, bvh: &Bvh, effort: &Effort) -> Vec<f32> {
    let samples: usize = plan.size.iter().product();
    let mut field =
        Field { plan, bvh, u: vec![f32::INFINITY; samples], triangle: vec![0; samples], exact: vec![false; samples] };
    let [_, ny, nz] = plan.size.map(|n| n.div_ceil(BLOCK));
    // Rows of blocks, so that each block begins with the triangle of the one before.
    let rows: Vec<Vec<Sample>> = (0..ny * nz).into_par_iter().map(|row| blocks(plan, bvh, row, ny, effort)).collect();
    for sample in rows.into_iter().flatten() {
        let Sample { index, u, triangle, exact } = sample;
        (field.u[index], field.triangle[index], field.exact[index]) = (u, triangle, exact);
    }
    for signs in 0..8 {
        let signs = [0, 1, 2].map(|a| signs >> a & 1 == 1);
        let flat = (0..3).any(|a| plan.size[a] == 1 && signs[a]);
        if !flat && !effort.is_over() {
            effort.spent.fetch_add(samples as u64, Relaxed);
            field.sweep(signs);
        }
    }
    field.u
}

/// The samples of a row of blocks: exact ones of blocks near the surface, and others with the triangle
/// that is nearest to the middle of their block.
fn blocks(plan: &Plan, bvh: &Bvh, row: usize, ny: usize, effort: &Effort) -> Vec<Sample> {
    let [start_y, start_z] = [row % ny * BLOCK, row / ny * BLOCK];
    let range = |a: usize, start: usize| start..(start + BLOCK).min(plan.size[a]);
    let (mut samples, mut triangle) = (Vec::new(), 0);
    for start_x in (0..plan.size[0]).step_by(BLOCK) {
        if effort.is_over() {
            break;
        }
        let block = [range(0, start_x), range(1, start_y), range(2, start_z)];
        let ends = |end: fn(&std::ops::Range<usize>) -> usize| [0, 1, 2].map(|a| end(&block[a]) as f64);
        let (first, last) = (ends(|range| range.start), ends(|range| range.end - 1));
        let middle = std::array::from_fn(|a| plan.origin[a] + 0.5 * (first[a] + last[a]) * plan.spacing);
        let reach = 0.5 * plan.spacing * (0..3).map(|a| (last[a] - first[a]).powi(2)).sum::<f64>().sqrt();
        let mut visited = 0;
        let (u, nearest) = bvh.nearest(middle, triangle, &mut visited);
        triangle = nearest;
        let exact = u - reach <= NEAR * plan.spacing;
        for (z, y) in block[2].clone().flat_map(|z| block[1].clone().map(move |y| (z, y))) {
            let mut guess = nearest;
            for x in block[0].clone() {
                let index = x + plan.size[0] * (y + plan.size[1] * z);
                let place = plan.point(index);
                let (u, found) = match exact {
                    true => bvh.nearest(place, guess, &mut visited),
                    false => (bvh.distance_to(nearest, place), nearest),
                };
                guess = found;
                samples.push(Sample { index, u: u as f32, triangle: found as u32, exact });
            }
        }
        effort.spent.fetch_add(visited, Relaxed);
    }
    samples
}

struct Field<'a> {
    plan: &'a Plan,
    bvh: &'a Bvh,
    u: Vec<f32>,
    triangle: Vec<u32>,
    exact: Vec<bool>,
}

impl Field<'_> {
    /// Carries triangles from sample to sample, along each axis upwards or, where `down`, downwards.
    fn sweep(&mut self, down: [bool; 3]) {
        let size = self.plan.size;
        let strides = [1, size[0], size[0] * size[1]];
        let at = |a: usize, n: usize| if down[a] { size[a] - 1 - n } else { n };
        for n in (0..size[2]).flat_map(|k| (0..size[1]).map(move |j| [j, k])) {
            for i in 0..size[0] {
                let steps = [i, n[0], n[1]];
                let index: usize = (0..3).map(|a| strides[a] * at(a, steps[a])).sum();
                if self.exact[index] {
                    continue;
                }
                for a in (0..3).filter(|&a| steps[a] > 0) {
                    let before = if down[a] { index + strides[a] } else { index - strides[a] };
                    let triangle = self.triangle[before];
                    if triangle != self.triangle[index] {
                        let u = self.bvh.distance_to(triangle as usize, self.plan.point(index)) as f32;
                        if u < self.u[index] {
                            (self.u[index], self.triangle[index]) = (u, triangle);
                        }
                    }
                }
            }
        }
    }
}
