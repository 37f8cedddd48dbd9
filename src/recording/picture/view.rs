//! Where the camera stands: chosen from the problem alone, so that it does not move during a run.

use super::{Aim, Quality};
use crate::appearance::{Bounds, V3, corners, local};
use gridfall_core::sim::setup::Setup;

/// A perspective camera, or a parallel one for plane scenes and for the light.
#[derive(Clone, Debug)]
pub struct View {
    /// Width and height (samples).
    pub size: [usize; 2],
    /// Samples of a pixel along each axis.
    pub samples: usize,
    /// Pixels along each side of the shadow map that goes with the view.
    pub shadows: usize,
    /// What must be in view.
    pub focus: Bounds,
    pub right: V3,
    pub up: V3,
    pub forward: V3,
    /// The camera, from which depths are measured; of a parallel one, the centre of its picture.
    pub eye: V3,
    /// Pixels per metre at unit depth; everywhere if parallel.
    scale: f32,
    perspective: bool,
}

/// Height above the horizon, and the angle between the picture's plane and the scene's longer side.
const ELEVATION: f32 = 0.40;
const TURN: f32 = 0.5;
/// Half the horizontal angle of view.
const HALF_ANGLE: f32 = 0.26;
/// Share of the picture that the focus may fill.
const FILL: f32 = 0.92;

impl View {
    /// The view of a problem: from obliquely above, or straight at the plane of a 2D scene, unless the aim says
    /// otherwise.
    pub fn of(setup: &Setup, focus: Bounds, quality: &Quality, aim: &Aim) -> Self {
        let size = quality.size.map(|s| s * quality.samples);
        let with_quality = |view| Self { samples: quality.samples, shadows: quality.shadows, ..view };
        let (zoom, target) = (aim.zoom.unwrap_or(1.0) as f32, aim.look_at_m.map(|x| local(setup, x)));
        if setup.dimension == 2 {
            let mut view = Self::parallel(V3::x(), V3::y(), focus, size);
            view.scale *= zoom;
            if let Some(target) = target {
                (view.eye.x, view.eye.y) = (target.x, target.y);
            }
            return with_quality(view);
        }
        let extent = focus[1] - focus[0];
        let chosen = if extent.x >= extent.y { TURN - std::f32::consts::FRAC_PI_2 } else { -TURN };
        let azimuth = aim.azimuth_deg.map_or(chosen, |degrees| degrees.to_radians() as f32);
        let elevation = aim.elevation_deg.map_or(ELEVATION, |degrees| degrees.to_radians() as f32);
        let backward = V3::new(elevation.cos() * azimuth.cos(), elevation.cos() * azimuth.sin(), elevation.sin());
        let right = V3::new(-azimuth.sin(), azimuth.cos(), 0.0);
        let mut view = Self::perspective(right, backward.cross(&right), focus, size, target);
        let fitting = (target.unwrap_or((focus[0] + focus[1]) / 2.0) - view.eye).dot(&view.forward);
        let distance = aim.distance_m.map_or(fitting / zoom, |distance| distance as f32);
        view.eye += view.forward * (fitting - distance);
        with_quality(view)
    }

    /// A perspective view that all of a box is in, with `target` in its middle, or else the box.
    fn perspective(right: V3, up: V3, focus: Bounds, size: [usize; 2], target: Option<V3>) -> Self {
        let forward = up.cross(&right);
        let center = target.unwrap_or((focus[0] + focus[1]) / 2.0);
        let tangent = HALF_ANGLE.tan() * FILL;
        let aspect = size[1] as f32 / size[0] as f32;
        // Twice: first the distance from which all corners are visible, then the shift that centres
        // them.
        let (mut distance, mut shift) = (0.0f32, V3::zeros());
        for _ in 0..4 {
            distance = 0.0;
            for c in corners(&focus) {
                let r = c - center - shift;
                let across = r.dot(&right).abs().max(r.dot(&up).abs() / aspect);
                distance = distance.max(across / tangent - r.dot(&forward));
            }
            let heights = corners(&focus).map(|c| {
                let r = c - center - shift;
                r.dot(&up) / (distance + r.dot(&forward))
            });
            let widths = corners(&focus).map(|c| {
                let r = c - center - shift;
                r.dot(&right) / (distance + r.dot(&forward))
            });
            let middle =
                |v: [f32; 8]| (v.into_iter().fold(f32::MAX, f32::min) + v.into_iter().fold(f32::MIN, f32::max)) / 2.0;
            if target.is_none() {
                shift += (up * middle(heights) + right * middle(widths)) * distance;
            }
        }
        let scale = size[0] as f32 / 2.0 / HALF_ANGLE.tan();
        let eye = center + shift - forward * distance;
        Self { size, samples: 1, shadows: 0, focus, right, up, forward, eye, scale, perspective: true }
    }

    /// A parallel view of a box.
    pub fn parallel(right: V3, up: V3, focus: Bounds, size: [usize; 2]) -> Self {
        let forward = up.cross(&right);
        let center = (focus[0] + focus[1]) / 2.0;
        let reach = |axis: &V3| corners(&focus).map(|c| (c - center).dot(axis)).into_iter().fold(0.0, f32::max);
        let scale = FILL / 2.0 * (size[0] as f32 / reach(&right)).min(size[1] as f32 / reach(&up));
        // From well behind the box, because particles may fly out of it.
        let eye = center - forward * (3.0 * reach(&forward));
        Self { size, samples: 1, shadows: 0, focus, right, up, forward, eye, scale, perspective: false }
    }

    /// Column, row and depth of a point (pixels, pixels, m).
    pub fn project(&self, x: &V3) -> [f32; 3] {
        let r = x - self.eye;
        let depth = r.dot(&self.forward);
        let scale = self.pixels_per_metre(depth);
        let [w, h] = self.size.map(|s| s as f32 / 2.0);
        [w + r.dot(&self.right) * scale, h - r.dot(&self.up) * scale, depth]
    }

    pub fn is_parallel(&self) -> bool {
        !self.perspective
    }

    pub fn pixels_per_metre(&self, depth: f32) -> f32 {
        if self.perspective { self.scale / depth } else { self.scale }
    }

    /// Origin and unnormalised direction of a pixel's ray: the point at a depth is
    /// start + depth × direction.
    pub fn ray(&self, column: f32, row: f32) -> [V3; 2] {
        let [w, h] = self.size.map(|s| s as f32 / 2.0);
        let offset = (self.right * (column - w) + self.up * (h - row)) / self.scale;
        if self.perspective { [self.eye, self.forward + offset] } else { [self.eye + offset, self.forward] }
    }
}
