//! A mesh's distance on a lattice.

use std::sync::atomic::Ordering::Relaxed;

use gridfall_core::sim::collider::DistanceField;
use gridfall_core::sim::source::Effort;
use rayon::prelude::*;

use super::bvh::Bvh;
use super::triangles::TriangleMesh;
use super::{inside, nearest, sheet};
use crate::schema::Fill;

/// Most samples of one field: 64 MiB, and up to a few minutes on one core for a mesh of a million
/// triangles.
pub const MAX_SAMPLES: u64 = 1 << 24;

/// Samples beyond the solid's bounds on each side.
const MARGIN: f64 = 2.0;

/// By how much the lattice of a sheet is out of the middle (spacings): no vertex, edge or diagonal of
/// a drawn mesh then goes through a sample.
const ASIDE: [f64; 3] = [0.173205, 0.223607, 0.331662];

/// The lattice that a mesh will be sampled on.
#[derive(Clone, Copy, Debug)]
pub struct Plan {
    pub(super) origin: [f64; 3],
    pub(super) spacing: f64,
    pub(super) size: [usize; 3],
    bounds: [[f64; 3]; 2],
}

impl Plan {
    /// A lattice of the given spacing over a mesh; in 2D over its section at z = 0.
    pub fn new(mesh: &TriangleMesh, spacing: f64, dimension: usize) -> Self {
        let [mut lower, mut upper] = mesh.bounds();
        let (mut origin, mut size) = ([0.0; 3], [1; 3]);
        for a in 0..3 {
            if a >= dimension {
                (lower[a], upper[a]) = (f64::NEG_INFINITY, f64::INFINITY);
                continue;
            }
            // Whole spacings, tolerant of rounding, with half of the remainder on each side.
            let cells = ((upper[a] - lower[a]) / spacing - 1e-6).ceil().max(0.0);
            origin[a] = 0.5 * (lower[a] + upper[a]) - (0.5 * cells + MARGIN) * spacing;
            size[a] = (cells + 2.0 * MARGIN) as usize + 1;
            // Interpolation may round a dent in the surface outwards by this much.
            (lower[a], upper[a]) = (lower[a] - spacing, upper[a] + spacing);
        }
        Self { origin, spacing, size, bounds: [lower, upper] }
    }

    /// Number of samples; `u64::MAX` when there are more.
    pub fn samples(&self) -> u64 {
        self.size.iter().fold(1u64, |n, &size| n.saturating_mul(size as u64))
    }

    /// Samples the mesh. For an open mesh with the winding number w, the distance u to the triangles
    /// becomes u (1 - 2w): it is ±u far from holes and crosses zero smoothly where a hole is closed.
    ///
    /// The samples of a sheet are distances without a sign, and the sides of cells (see [`sheet`]).
    ///
    /// `effort` counts nodes and triangles that were looked at. None if it takes too much.
    pub fn sample(&self, mesh: &TriangleMesh, fill: Fill, effort: &Effort) -> Option<DistanceField> {
        let bvh = Bvh::new(mesh);
        let mut plan = *self;
        if fill == Fill::Sheet {
            (0..3).for_each(|a| plan.origin[a] += ASIDE[a] * plan.spacing);
        }
        let mut field = plan.distances(&bvh, fill, effort);
        if fill == Fill::Sheet {
            sheet::add_sides(&mut field, mesh, &bvh, effort);
        }
        (!effort.is_over()).then_some(field)
    }

    /// Left unfinished where `effort` is over.
    fn distances(&self, bvh: &Bvh, fill: Fill, effort: &Effort) -> DistanceField {
        let mut samples = nearest::distances(self, bvh, effort);
        match fill {
            Fill::Sheet => {}
            Fill::Watertight => inside::negate(self, bvh, &mut samples, effort),
            Fill::WindingNumber => samples.par_iter_mut().enumerate().for_each(|(index, u)| {
                if !effort.is_over() {
                    let mut visited = 0;
                    let winding = bvh.winding(self.point(index), &mut visited).clamp(0.0, 1.0);
                    *u = (f64::from(*u) * (1.0 - 2.0 * winding)) as f32;
                    effort.spent.fetch_add(visited, Relaxed);
                }
            }),
        }
        let Self { origin, spacing, size, bounds } = *self;
        DistanceField { origin, spacing, size, samples, sheet: fill == Fill::Sheet, bounds }
    }

    /// The place of a sample (m).
    pub(super) fn point(&self, index: usize) -> [f64; 3] {
        let index = [index % self.size[0], index / self.size[0] % self.size[1], index / (self.size[0] * self.size[1])];
        std::array::from_fn(|a| self.origin[a] + index[a] as f64 * self.spacing)
    }
}
