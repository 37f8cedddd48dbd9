//! Meaning of bodies: materials, initial states, and how many particles they and the sources have.

use gridfall_core::sim::pair;

use crate::fault::join;
use crate::grid::{cells, lattice, particles_per_axis, particles_per_cell, periodic};
use crate::memory::{HOST_BYTES_PER_PARTICLE, memory_bytes};
use crate::sampling::{Lattice, poisson};
use crate::schema::{Body, ContactKind, Sampling, Shape};
use crate::validate::check::Check;
use crate::validate::plausible::{SPEED, VOLUME_RATIO};
use crate::validate::points::check_points;
use crate::validate::shape::check_solid;
use crate::validate::sources::check_source;
use crate::vectors::{determinant, length, matrix3, vector3};

/// Most lattice points in the bounds of one body; the limits on its particles are far lower.
const MAX_CANDIDATES: f64 = 1e15;

/// Judges all bodies and sources, and what they cost together.
pub fn check_bodies(check: &mut Check) {
    let scene = check.scene;
    if scene.bodies.is_empty() && scene.sources.is_empty() {
        check.fault("/bodies", "empty", "there are no bodies", "add at least one, or a source");
    }
    let bodies = scene.bodies.iter().enumerate().map(|(n, body)| (format!("/bodies/{n}/name"), body.name.clone()));
    let sources = scene.sources.iter().enumerate().map(|(n, s)| (format!("/sources/{n}/name"), s.name.clone()));
    check.unique(bodies.chain(sources));
    let mut fields = 1;
    for (n, body) in scene.bodies.iter().enumerate() {
        let at = format!("/bodies/{n}");
        let kind = body.contact.unwrap_or(ContactKind::Sticky);
        check.contact(&at, kind, body.friction);
        fields += u64::from(kind != ContactKind::Sticky);
        if kind != ContactKind::Sticky && fields > 1 + pair::MOST as u64 {
            let reason = format!("more than {} bodies have contact of their own", pair::MOST);
            let remedy = "take it out of some: bodies without contact stick to each other only";
            check.fault(&join(&at, "contact"), "too_many_contacts", reason, remedy);
        }
    }
    let (mut total, mut counted) = (0, true);
    for (n, body) in scene.bodies.iter().enumerate() {
        if check.faults.full() {
            return;
        }
        match check_body(check, &format!("/bodies/{n}"), body) {
            Some(particles) => total += particles,
            None => counted = false,
        }
    }
    let most = most_particles(check);
    for (n, source) in scene.sources.iter().enumerate() {
        if check.faults.full() {
            return;
        }
        match check_source(check, &format!("/sources/{n}"), source, most) {
            Some(particles) => total += particles,
            None => counted = false,
        }
    }
    let limit = check.limits.max_particles;
    if total > limit {
        let reason = format!("{total} particles; the limit is {limit}");
        let remedy = "raise dx, lower particles_per_cell or shrink the bodies";
        check.fault("/bodies", "too_many_particles", reason, remedy);
    } else if counted && check.has_grid() {
        let cells = cells(&scene.domain, check.dimension).map(|n| n.round() as u64);
        let bytes = memory_bytes(total, cells, fields, scene.solver.integrator);
        let limit = check.limits.max_memory_bytes;
        if bytes > limit {
            let reason =
                format!("{total} particles on {cells:?} cells take {} MiB; the limit is {}", bytes >> 20, limit >> 20);
            let remedy = "raise dx, lower particles_per_cell, or shrink the bodies or the domain";
            check.fault("/bodies", "too_much_memory", reason, remedy);
        }
    }
}

/// Most particles of one body or source.
fn most_particles(check: &Check) -> u64 {
    check.limits.max_particles.min(check.limits.max_memory_bytes / HOST_BYTES_PER_PARTICLE)
}

/// Judges a body. Returns its number of particles if that is known.
fn check_body(check: &mut Check, at: &str, body: &Body) -> Option<u64> {
    check.known_material(at, &body.material);
    let d = check.dimension;
    let per_axis = if check.has_dimension() { particles_per_axis(body, d) } else { None };
    if per_axis.is_none() && check.has_dimension() {
        let per_cell = particles_per_cell(body.particles_per_cell, d);
        let reason = format!("{per_cell} particles do not fill a cell evenly");
        let remedy = match d {
            2 => "write a square: 1, 4, 9, 16, …, or sample by `poisson-disk` or `conforming`",
            _ => "write a cube: 1, 8, 27, 64, …, or sample by `poisson-disk` or `conforming`",
        };
        check.fault(&join(at, "particles_per_cell"), "not_a_power", reason, remedy);
    }
    check_initial_state(check, at, body);
    let shape = match (&body.shape, &body.points) {
        (Some(shape), None) => shape,
        (None, Some(points)) => {
            if body.sampling == Sampling::Conforming {
                let reason = "`conforming` needs a surface, which points from a file do not have";
                check.fault(&join(at, "sampling"), "needs_shape", reason, "take `sampling` out, or give a `shape`");
            }
            return check_points(check, at, body, points);
        }
        (shape, _) => {
            let reason = match shape {
                Some(_) => "`shape` is given beside `points`",
                None => "the body has neither `shape` nor `points`",
            };
            check.fault(&join(at, "shape"), "not_one_source", reason, "give one of `shape` and `points`");
            return None;
        }
    };
    let shape_at = join(at, "shape");
    check_solid(check, &shape_at, shape);
    let judged =
        check.has_grid() && check.faults.clean(&join(at, "particles_per_cell")) && check.faults.clean(&shape_at);
    if judged { count_particles(check, &shape_at, body, shape, per_axis?) } else { None }
}

fn check_initial_state(check: &mut Check, at: &str, body: &Body) {
    if let Some(velocity) = &body.velocity {
        let at = join(at, "velocity");
        check.vector(&at, velocity);
        check.plausible_length(&at, velocity, &SPEED);
    }
    if let Some(spin) = &body.angular_velocity {
        let at = join(at, "angular_velocity");
        check.angular(&at, spin);
        check.plausible_rate(&at, length(spin), 0.0);
    }
    if let Some(gradient) = &body.velocity_gradient {
        let at = join(at, "velocity_gradient");
        check.matrix(&at, gradient);
        check.plausible_rate(&at, length(&gradient.concat()), 0.0);
    }
    if let Some(f) = &body.deformation_gradient {
        let at = join(at, "deformation_gradient");
        check.matrix(&at, f);
        if check.faults.clean(&at) && check.has_dimension() {
            let determinant = determinant(&matrix3(f));
            if determinant <= 0.0 {
                let reason = format!("its determinant is {determinant}, which turns the body inside out");
                check.fault(&at, "not_positive", reason, "write a matrix with a positive determinant");
            }
            check.plausible(&at, determinant, &VOLUME_RATIO);
        }
    }
    if let Some(j) = body.j {
        check.positive(&join(at, "J"), j, "the volume ratio");
        check.plausible(&join(at, "J"), j, &VOLUME_RATIO);
        if body.deformation_gradient.is_some() {
            let reason = "`J` is given beside `deformation_gradient`";
            check.fault(&join(at, "J"), "conflicting_fields", reason, "keep one of them");
        }
    }
}

/// Counts the particles of a body without making them. Particles outside the domain are a fault.
fn count_particles(check: &mut Check, at: &str, body: &Body, shape: &Shape, per_axis: f64) -> Option<u64> {
    let (domain, d) = (&check.scene.domain, check.dimension);
    let sdf = check.sdf(at, shape);
    let whole = lattice(domain, per_axis, &sdf, d);
    let [lower, upper] = sdf.bounds();
    let (min, max) = (vector3(&domain.min), vector3(&domain.max));
    let extent = |v: [f64; 3]| format!("{:?}", &v[..d]);
    let periodic = periodic(domain, d);
    let walled = || (0..d).filter(|&a| !periodic[a]);
    // A body may lie across the seam of a periodic axis, but not reach around onto itself.
    let length = |a: usize| upper[a] - lower[a];
    let period = |a: usize| max[a] - min[a];
    let too_long = |a: &usize| periodic[*a] && length(*a).is_finite() && length(*a) > period(*a) * (1.0 + 1e-9);
    if let Some(a) = (0..d).find(too_long) {
        let reason = format!("the body is {} m long on an axis that repeats every {} m", length(a), period(a));
        check.fault(at, "outside_domain", reason, "shrink the body to one period, or enlarge the domain");
        return None;
    }
    let apart = walled().any(|a| lower[a] >= max[a] || upper[a] <= min[a]);
    if apart && (0..d).all(|a| lower[a] < upper[a]) {
        let reason = format!("the body spans {} to {}, outside the domain", extent(lower), extent(upper));
        check.fault(at, "outside_domain", reason, "move the body or enlarge the domain");
        return None;
    }
    let n = cells(domain, d).map(|n| n.round() as usize);
    let inside = whole.clipped(n, per_axis, periodic);
    let sticks_out = whole.candidates() > inside.candidates();
    let most = most_particles(check);
    let effort = check.effort(&sdf);
    let count = |lattice: &Lattice| lattice.count_within(&sdf, most, &effort);
    if whole.candidates() > MAX_CANDIDATES && sticks_out {
        let reason = format!("the body spans {} to {}, far beyond the domain", extent(lower), extent(upper));
        check.fault(at, "outside_domain", reason, "shrink the body or enlarge the domain");
        return None;
    }
    let counts = if whole.candidates() > MAX_CANDIDATES {
        None
    } else {
        count(&inside).and_then(|n| Some((n, if sticks_out { count(&whole)? } else { n })))
    };
    if !check.within(&effort, &sdf, at) {
        return None;
    }
    let Some((particles, all)) = counts else {
        let reason = format!("the body has more than {most} particles at a spacing of {} m, the limit", whole.spacing);
        let remedy = "raise dx, lower particles_per_cell or shrink the body";
        check.fault(at, "too_many_particles", reason, remedy);
        return None;
    };
    if all > particles {
        let reason = format!(
            "{} of the body's {all} particles are outside the domain: it spans {} to {}, the domain {} to {}",
            all - particles,
            extent(lower),
            extent(upper),
            extent(min),
            extent(max)
        );
        check.fault(at, "outside_domain", reason, "move or shrink the body, or enlarge the domain");
        return None;
    }
    if particles == 0 {
        let reason = format!("no particle lies in the shape at a spacing of {} m", whole.spacing);
        let remedy =
            "make the shape larger, lower dx or raise particles_per_cell; a difference may have taken all of it";
        check.fault(at, "no_particles", reason, remedy);
        return None;
    }
    if body.sampling == Sampling::PoissonDisk {
        let limit = check.limits.max_memory_bytes;
        if inside.darts().count_cells(&sdf, inside.bounds(), limit / poisson::CELL_BYTES).is_none() {
            let reason = format!("to sample the shape takes more than {} MiB, the limit", limit >> 20);
            check.fault(at, "too_much_memory", reason, "raise dx, shrink the body, or write `jittered`");
            return None;
        }
    }
    if body.sampling == Sampling::Conforming && !inside.has_layers(&sdf) {
        let reason = format!("the shape is nowhere as thick as the spacing of its particles, {} m", inside.spacing);
        let remedy = "make it thicker, lower dx, raise particles_per_cell, or write another `sampling`";
        check.fault(at, "too_thin", reason, remedy);
        return None;
    }
    Some(particles)
}
