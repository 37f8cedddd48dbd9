//! The grid in space and time: cells, frames, the lattices of bodies and the streams of sources.

use gridfall_core::sim::collider::Sdf;
use gridfall_core::sim::source::Source;

use crate::sampling::Lattice;
use crate::schema::{self, Body, Boundary, Domain, Sampling, Scene};
use crate::vectors::vector3;

/// Cells on each axis, unrounded; 1 on z in 2D.
pub(crate) fn cells(domain: &Domain, dimension: usize) -> [f64; 3] {
    std::array::from_fn(|a| if a < dimension { (domain.max[a] - domain.min[a]) / domain.dx } else { 1.0 })
}

/// Whether this many cells are a whole number, but for rounding.
pub(crate) fn is_whole(n: f64) -> bool {
    n.round() >= 1.0 && (n - n.round()).abs() <= 1e-6 * n.max(1.0)
}

/// Which axes are periodic.
pub(crate) fn periodic(domain: &Domain, dimension: usize) -> [bool; 3] {
    let is_periodic = |name: &str| matches!(domain.boundary.get(name), Some(Boundary::Periodic(_)));
    std::array::from_fn(|a| a < dimension && is_periodic(["x", "y", "z"][a]))
}

/// Frames of a run after frame 0.
pub(crate) fn frames(scene: &Scene) -> u32 {
    (scene.time.end * scene.time.frame_rate).round() as u32
}

/// The number of particles per cell that a scene asks for.
pub(crate) fn particles_per_cell(given: Option<u32>, dimension: usize) -> u32 {
    given.unwrap_or(1 << dimension)
}

/// Particles along an axis of a cell that `per_cell` particles fill evenly; none if they cannot.
pub(crate) fn even_per_axis(per_cell: u32, dimension: usize) -> Option<u32> {
    let root = f64::from(per_cell).powf(1.0 / dimension as f64).round() as u32;
    (root > 0 && root.checked_pow(dimension as u32) == Some(per_cell)).then_some(root)
}

/// A body's particles along an axis of a cell: a whole number on a lattice, any number for other
/// points; none if the body's sampling cannot have so many.
pub(crate) fn particles_per_axis(body: &Body, dimension: usize) -> Option<f64> {
    let per_cell = particles_per_cell(body.particles_per_cell, dimension);
    let any = matches!(body.sampling, Sampling::PoissonDisk | Sampling::Conforming) || body.shape.is_none();
    let root = || f64::from(per_cell).powf(1.0 / dimension as f64);
    even_per_axis(per_cell, dimension).map(f64::from).or_else(|| (any && per_cell > 0).then(root))
}

/// The lattice over a body's bounds; where the body is unbounded, up to the domain's walls.
pub(crate) fn lattice(domain: &Domain, per_axis: f64, sdf: &Sdf, dimension: usize) -> Lattice {
    let [mut lower, mut upper] = sdf.bounds();
    for a in 0..dimension {
        if lower[a] == f64::NEG_INFINITY {
            lower[a] = domain.min[a];
        }
        if upper[a] == f64::INFINITY {
            upper[a] = domain.max[a];
        }
    }
    Lattice::over(vector3(&domain.min), domain.dx / per_axis, dimension, [lower, upper])
}

/// The stream of a source that is number `body` among the bodies and fills `sdf`. Its fields must
/// be valid; its particles are not counted yet.
pub(crate) fn stream(scene: &Scene, source: &schema::Source, sdf: Sdf, body: usize) -> Source {
    let dimension = scene.dimension as usize;
    let per_cell = particles_per_cell(source.particles_per_cell, dimension);
    let per_axis = even_per_axis(per_cell, dimension).expect("a valid source");
    Source {
        body,
        sdf,
        velocity: vector3(&source.velocity),
        open_s: [source.from.unwrap_or(0.0), source.until.unwrap_or(f64::INFINITY)],
        spacing: scene.domain.dx / f64::from(per_axis),
        origin: vector3(&scene.domain.min),
        dimension,
        frame_s: 1.0 / scene.time.frame_rate,
        by_frame: Vec::new(),
    }
}
