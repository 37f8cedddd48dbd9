//! The colour scale and the camera focus of a run, fixed at its start so that colours do not
//! flicker and the camera does not move. They are derived from the particles at time 0, which need
//! not be kept afterwards.

use gridfall_core::sim::particles::Particles;
use gridfall_core::sim::setup::{Axis, Material, Setup};
use nalgebra::Vector3;

use crate::colliders::domain_box;

pub type V3 = Vector3<f32>;

/// A box by its corners, in [`local`] coordinates.
pub type Bounds = [V3; 2];

/// A point as pictures have it: relative to the domain's lower corner, because f32 is too coarse for
/// coordinates far from the origin.
pub fn local(setup: &Setup, x: [f64; 3]) -> V3 {
    V3::from(std::array::from_fn(|a| (x[a] - setup.origin[a]) as f32))
}

/// The inverse of [`local`].
pub fn global(setup: &Setup, x: V3) -> [f64; 3] {
    std::array::from_fn(|a| f64::from(x[a]) + setup.origin[a])
}

/// The fixed colour scale and camera focus of a run.
#[derive(Clone, Debug)]
pub struct Appearance {
    /// Speed at which a particle has its body's bright colour (m/s).
    pub(crate) full_speed_m_s: f64,
    /// The box that the camera shows.
    pub(crate) focus: Bounds,
}

impl Appearance {
    /// The appearance of a run that starts with these particles.
    pub fn new(setup: &Setup, particles: &Particles) -> Self {
        Self { full_speed_m_s: characteristic_speed_m_s(setup, particles), focus: focus(setup, particles) }
    }
}

/// The larger of twice the initial top speed and the speed of a fall through the domain; 1 m/s if
/// nothing moves.
fn characteristic_speed_m_s(setup: &Setup, particles: &Particles) -> f64 {
    let sources = setup.sources.iter().map(|source| &source.velocity);
    let fastest = particles.v.iter().chain(sources).map(|v| v.iter().map(|c| c * c).sum()).fold(0.0, f64::max);
    let fall: f64 = (0..3).map(|a| 2.0 * setup.gravity[a].abs() * setup.cells[a] as f64 * setup.dx).sum();
    let speed = (4.0 * fastest).max(fall).sqrt();
    if speed > 0.0 { speed } else { 1.0 }
}

/// The corners of a box.
pub fn corners(bounds: &Bounds) -> [V3; 8] {
    std::array::from_fn(|k| V3::new(bounds[k & 1].x, bounds[k >> 1 & 1].y, bounds[k >> 2].z))
}

/// The height of the floor that things fall on, above the domain's lower corner. `None` unless
/// gravity points along −z and there is a wall.
pub fn floor(setup: &Setup) -> Option<f32> {
    let walled = setup.dimension == 3 && matches!(setup.axes[2], Axis::Walls(_));
    (walled && setup.gravity[2] < 0.0).then_some(0.0)
}

/// What will be visible: where the bodies are and where they would fly freely, inside the domain,
/// together with all of the floor that a fluid may flood, and the colliders.
pub fn focus(setup: &Setup, particles: &Particles) -> Bounds {
    let local = |x| local(setup, x);
    let domain = domain_box(setup).map(local);
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
            x[body.particles.clone()].iter().for_each(|x| add(local(*x) + to_f32(flight)));
        }
    }
    for source in &setup.sources {
        let ends = corners(&source.sdf.bounds().map(local));
        for t in (0..=8).map(|step| end_s * f64::from(step) / 8.0) {
            let flight: [f64; 3] = std::array::from_fn(|a| t * (source.velocity[a] + 0.5 * t * setup.gravity[a]));
            ends.iter().for_each(|corner| add(*corner + to_f32(flight)));
        }
    }
    for collider in &setup.colliders {
        let bounds = collider.sdf.bounds().map(local);
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
