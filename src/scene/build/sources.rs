//! Sources of a scene: what is wrong with them, and what they become.

use rayon::prelude::*;

use crate::build::solid::{sdf, vector3};
use crate::fault::join;
use crate::schema::{self, Sampling, Scene};
use crate::validate::Check;
use crate::validate::motion::interval;
use crate::validate::shape::check_shape;
use gridfall_core::sim::source::Source;

/// Lattice points that may be looked at for one source, in all frames together.
const MAX_CANDIDATES: f64 = 2e8;

/// Frames of a run.
pub(crate) fn frames(scene: &Scene) -> u32 {
    (scene.time.end * scene.time.frame_rate).round() as u32
}

/// A source whose particles are not counted yet. Its fields must be sound.
fn uncounted(scene: &Scene, source: &schema::Source, body: usize) -> Source {
    let dimension = scene.dimension as usize;
    let per_cell = source.particles_per_cell.unwrap_or(1 << dimension);
    let per_axis = f64::from(per_cell).powf(1.0 / dimension as f64).round();
    Source {
        body,
        sdf: sdf(&source.shape, dimension),
        velocity: vector3(&source.velocity),
        open_s: [source.from.unwrap_or(0.0), source.until.unwrap_or(f64::INFINITY)],
        spacing: scene.domain.dx / per_axis,
        origin: vector3(&scene.domain.min),
        dimension,
        frame_s: 1.0 / scene.time.frame_rate,
        by_frame: Vec::new(),
    }
}

/// A valid scene's source, which is body number `body`.
pub(crate) fn build(scene: &Scene, source: &schema::Source, body: usize) -> Source {
    let mut built = uncounted(scene, source, body);
    built.by_frame = (0..frames(scene)).map(|frame| built.entering(frame).count() as u64).collect();
    built
}

/// Judges a source; its number of particles, if that can be told. The time must have been judged before.
pub(crate) fn check_source(
    check: &mut Check,
    at: &str,
    scene: &Scene,
    source: &schema::Source,
    most: u64,
) -> Option<u64> {
    check.known_material(at, &source.material);
    let velocity_at = join(at, "velocity");
    check.vector(&velocity_at, &source.velocity);
    if check.faults.clean(&velocity_at) && source.velocity.iter().all(|v| *v == 0.0) {
        check.fault(
            &velocity_at,
            "zero_vector",
            "a stream at rest brings nothing",
            "write a velocity that is not zero",
        );
    }
    interval(check, at, source.from, source.until);
    let per_cell = source.particles_per_cell.unwrap_or(1 << check.dimension);
    let root = f64::from(per_cell).powf(1.0 / check.dimension as f64).round() as u32;
    if check.has_dimension() && (root == 0 || root.checked_pow(check.dimension as u32) != Some(per_cell)) {
        let reason = format!("{per_cell} particles do not fill a cell evenly");
        let remedy = if check.dimension == 2 { "write a square: 1, 4, 9, …" } else { "write a cube: 1, 8, 27, …" };
        check.fault(&join(at, "particles_per_cell"), "not_a_power", reason, remedy);
    }
    if source.sampling != Sampling::Regular {
        check.fault(&join(at, "sampling"), "unsupported", "a source emits a regular stream", "write `regular`");
    }
    let shape_at = join(at, "shape");
    check_shape(check, &shape_at, &source.shape);
    if !(check.has_grid() && check.faults.clean(at) && check.faults.clean("/time")) {
        return None;
    }
    count(check, &shape_at, scene, &uncounted(scene, source, 0), most)
}

fn count(check: &mut Check, at: &str, scene: &Scene, source: &Source, most: u64) -> Option<u64> {
    let d = source.dimension;
    let [lower, upper] = source.sdf.bounds();
    if (0..d).any(|a| !(lower[a].is_finite() && upper[a].is_finite())) {
        check.fault(at, "unbounded_shape", "the shape of a source must have an end", "intersect it with a box");
        return None;
    }
    let (min, max) = (vector3(&scene.domain.min), vector3(&scene.domain.max));
    let (mut candidates, mut total) = (0.0, 0u64);
    for frame in 0..frames(scene) {
        candidates += source.candidates(frame);
        if candidates > MAX_CANDIDATES {
            let reason = "the stream spans too many points to be looked for";
            check.fault(at, "too_many_particles", reason, "make the shape thinner along its velocity, or raise dx");
            return None;
        }
        let outside = |x: &[f64; 3]| (0..d).any(|a| x[a] < min[a] || x[a] > max[a]);
        let (entering, lost) = source
            .entering(frame)
            .map(|x| (1u64, u64::from(outside(&x))))
            .reduce(|| (0, 0), |a, b| (a.0 + b.0, a.1 + b.1));
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
