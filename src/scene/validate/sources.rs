//! Meaning of sources: their streams, and how many particles they emit.

use gridfall_core::sim::source::Source;
use rayon::prelude::*;

use crate::fault::join;
use crate::grid::{even_per_axis, frames, particles_per_cell, periodic, stream};
use crate::schema::{self, Sampling};
use crate::validate::check::Check;
use crate::validate::motion::interval;
use crate::validate::plausible::SPEED;
use crate::validate::shape::check_solid;
use crate::vectors::vector3;

/// Most lattice points that are tested for one source, over all frames.
const MAX_CANDIDATES: f64 = 2e8;

/// Judges a source, which may emit at most `most` particles. Returns how many it emits if that is
/// known. The time must have been judged before.
pub fn check_source(check: &mut Check, at: &str, source: &schema::Source, most: u64) -> Option<u64> {
    check.known_material(at, &source.material);
    let velocity_at = join(at, "velocity");
    check.vector(&velocity_at, &source.velocity);
    check.plausible_length(&velocity_at, &source.velocity, &SPEED);
    if check.faults.clean(&velocity_at) && source.velocity.iter().all(|v| *v == 0.0) {
        check.fault(
            &velocity_at,
            "zero_vector",
            "a stream at rest brings nothing",
            "write a velocity that is not zero",
        );
    }
    interval(check, at, source.from, source.until);
    if check.has_dimension() {
        let per_cell = particles_per_cell(source.particles_per_cell, check.dimension);
        if even_per_axis(per_cell, check.dimension).is_none() {
            let reason = format!("{per_cell} particles do not fill a cell evenly");
            let remedy =
                if check.dimension == 2 { "write a square: 1, 4, 9, …" } else { "write a cube: 1, 8, 27, …" };
            check.fault(&join(at, "particles_per_cell"), "not_a_power", reason, remedy);
        }
    }
    if source.sampling != Sampling::Regular {
        check.fault(&join(at, "sampling"), "unsupported", "a source emits a regular stream", "write `regular`");
    }
    let shape_at = join(at, "shape");
    check_solid(check, &shape_at, &source.shape);
    if !(check.has_grid() && check.faults.clean(at) && check.faults.clean("/time")) {
        return None;
    }
    let sdf = check.sdf(&shape_at, &source.shape);
    let stream = stream(check.scene, source, sdf, 0);
    count(check, &shape_at, &stream, most)
}

/// Counts the particles of a stream without keeping them; none if there is a fault at `at`.
fn count(check: &mut Check, at: &str, source: &Source, most: u64) -> Option<u64> {
    let scene = check.scene;
    let d = source.dimension;
    let [lower, upper] = source.sdf.bounds();
    if (0..d).any(|a| !(lower[a].is_finite() && upper[a].is_finite())) {
        check.fault(at, "unbounded_shape", "the shape of a source must have an end", "intersect it with a box");
        return None;
    }
    let (min, max) = (vector3(&scene.domain.min), vector3(&scene.domain.max));
    let periodic = periodic(&scene.domain, d);
    let (mut candidates, mut total) = (0.0, 0u64);
    for frame in 0..frames(scene) {
        candidates += source.candidates(frame);
        if candidates > MAX_CANDIDATES {
            let reason = "the stream spans too many points to be looked for";
            check.fault(at, "too_many_particles", reason, "make the shape thinner along its velocity, or raise dx");
            return None;
        }
        let outside = |x: &[f64; 3]| (0..d).any(|a| !periodic[a] && (x[a] < min[a] || x[a] > max[a]));
        let effort = check.effort(&source.sdf);
        let (entering, lost) = source
            .entering_within(frame, Some(&effort))
            .map(|x| (1u64, u64::from(outside(&x))))
            .reduce(|| (0, 0), |a, b| (a.0 + b.0, a.1 + b.1));
        if !check.within(&effort, &source.sdf, at) {
            return None;
        }
        if lost > 0 {
            let reason = format!(
                "{lost} particles that enter the shape in frame {} begin that frame outside the domain, upstream",
                frame + 1
            );
            let remedy = "move the source away from the wall by its velocity times a frame, or enlarge the domain";
            check.fault(at, "outside_domain", reason, remedy);
            return None;
        }
        total += entering;
        if total > most {
            let reason = format!("the source emits more than {most} particles, the limit");
            check.fault(at, "too_many_particles", reason, "raise dx, lower particles_per_cell, or stop earlier");
            return None;
        }
    }
    if total == 0 {
        let reason = format!("no point of a stream with a spacing of {} m enters the shape", source.spacing);
        check.fault(at, "no_particles", reason, "make the shape larger, let it emit for longer, or lower dx");
        return None;
    }
    Some(total)
}
