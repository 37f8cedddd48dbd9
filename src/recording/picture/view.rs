//! Where the camera stands: chosen from the problem alone, so that it does not move during a run.

use super::{Quality, V3};
use crate::colliders::domain_box;
use gridfall_core::sim::particles::Particles;
use gridfall_core::sim::setup::{Axis, Material, Setup};

/// A box by its corners.
pub type Bounds = [V3; 2];

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
    /// The view of a problem: from obliquely above, or straight at the plane of a 2D scene.
    pub fn of(setup: &Setup, focus: Bounds, quality: &Quality) -> Self {
        let size = quality.size.map(|s| s * quality.samples);
        let with_quality = |view| Self { samples: quality.samples, shadows: quality.shadows, ..view };
        if setup.dimension == 2 {
            return with_quality(Self::parallel(V3::x(), V3::y(), focus, size));
        }
        let extent = focus[1] - focus[0];
        let azimuth = if extent.x >= extent.y { TURN - std::f32::consts::FRAC_PI_2 } else { -TURN };
        let backward = V3::new(ELEVATION.cos() * azimuth.cos(), ELEVATION.cos() * azimuth.sin(), ELEVATION.sin());
        let right = V3::z().cross(&backward).normalize();
        with_quality(Self::perspective(right, backward.cross(&right), focus, size))
    }

    fn perspective(right: V3, up: V3, focus: Bounds, size: [usize; 2]) -> Self {
        let forward = up.cross(&right);
        let center = (focus[0] + focus[1]) / 2.0;
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
            shift += (up * middle(heights) + right * middle(widths)) * distance;
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

/// The corners of a box.
pub fn corners(bounds: &Bounds) -> [V3; 8] {
    std::array::from_fn(|k| V3::new(bounds[k & 1].x, bounds[k >> 1 & 1].y, bounds[k >> 2].z))
}

/// The height of the floor that things fall on. `None` unless gravity points along −z and there is
/// a wall.
pub fn floor(setup: &Setup) -> Option<f32> {
    let walled = setup.dimension == 3 && matches!(setup.axes[2], Axis::Walls(_));
    (walled && setup.gravity[2] < 0.0).then_some(setup.origin[2] as f32)
}

/// What will be visible: where the bodies are and where they would fly freely, inside the domain,
/// together with all of the floor that a fluid may flood, and the colliders.
pub fn focus(setup: &Setup, particles: &Particles) -> Bounds {
    let domain = domain_box(setup).map(to_f32);
    if setup.dimension == 2 {
        return domain;
    }
    let inside = |x: V3| x.sup(&domain[0]).inf(&domain[1]);
    let (mut lower, mut upper) = (domain[1], domain[0]);
    let mut add = |x: V3| (lower, upper) = (lower.inf(&inside(x)), upper.sup(&inside(x)));
    let end_s = setup.frame_s * f64::from(setup.frames);
    let (x, v) = (&particles.x, &particles.v);
    for body in setup.bodies.iter().filter(|body| !body.particles.is_empty()) {
        let count = body.particles.len() as f64;
        let mean: [f64; 3] =
            std::array::from_fn(|a| v[body.particles.clone()].iter().map(|v| v[a]).sum::<f64>() / count);
        for step in 0..=8 {
            let t = end_s * f64::from(step) / 8.0;
            let flight: [f64; 3] = std::array::from_fn(|a| t * (mean[a] + 0.5 * t * setup.gravity[a]));
            x[body.particles.clone()].iter().for_each(|x| add(to_f32(*x) + to_f32(flight)));
        }
    }
    for source in &setup.sources {
        let ends = corners(&source.sdf.bounds().map(to_f32));
        for t in (0..=8).map(|step| end_s * f64::from(step) / 8.0) {
            let flight: [f64; 3] = std::array::from_fn(|a| t * (source.velocity[a] + 0.5 * t * setup.gravity[a]));
            ends.iter().for_each(|corner| add(*corner + to_f32(flight)));
        }
    }
    for collider in &setup.colliders {
        let bounds = collider.sdf.bounds().map(to_f32);
        if bounds.iter().all(|corner| corner.iter().all(|c| c.abs() < 1e10)) {
            corners(&bounds).into_iter().for_each(&mut add);
        }
    }
    let fluid = setup.materials.iter().any(|material| matches!(material, Material::WeaklyCompressibleFluid(_)));
    let margin = V3::repeat(0.06 * (upper - lower).max());
    let mut focus = [inside(lower - margin), inside(upper + margin)];
    if let Some(floor) = floor(setup) {
        focus[0].z = floor;
        if fluid {
            for a in 0..2 {
                (focus[0][a], focus[1][a]) = (domain[0][a], domain[1][a]);
            }
        }
    }
    focus
}

fn to_f32(x: [f64; 3]) -> V3 {
    V3::from(x.map(|c| c as f32))
}
