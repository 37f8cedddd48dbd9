//! Meaning of particles from files: one source, one deformation, all in the domain.

use crate::fault::join;
use crate::grid::periodic;
use crate::schema::{Body, Points};
use crate::validate::check::Check;
use crate::validate::plausible::{SPEED, VOLUME_RATIO};
use crate::vectors::{determinant, length, vector3};

/// Judges the particles of the body at `at`. Returns their number if it is known.
pub fn check_points(check: &mut Check, at: &str, body: &Body, points: &Points) -> Option<u64> {
    let at_points = join(at, "points");
    one_source(check, &at_points, &points.asset, &points.file)?;
    // A file that could not be read is a fault already.
    let read = check.resolved.points.get(&at_points)?;
    if let Some(f) = &read.f {
        for (field, given) in [("deformation_gradient", body.deformation_gradient.is_some()), ("J", body.j.is_some())] {
            if given {
                let reason = format!("`{field}` is given beside the `F` of the file");
                check.fault(&join(at, field), "conflicting_fields", reason, "keep one of them");
            }
        }
        if let Some(n) = f.iter().position(|f| !(determinant(f) > 0.0 && determinant(f).is_finite())) {
            let reason = format!("the determinant of `F` of point {n} is {}", determinant(&f[n]));
            check.fault(&at_points, "not_positive", reason, "write matrices with positive determinants");
        }
        let extreme = |wanted: fn(f64, f64) -> f64, first: f64| f.iter().map(determinant).fold(first, wanted);
        check.plausible(&at_points, extreme(f64::min, 1.0), &VOLUME_RATIO);
        check.plausible(&at_points, extreme(f64::max, 1.0), &VOLUME_RATIO);
    }
    let fastest = read.v.iter().flatten().map(|v| length(v)).fold(0.0, f64::max);
    check.plausible(&at_points, fastest, &SPEED);
    if !check.has_grid() {
        return None;
    }
    within_domain(check, &at_points, &read.x)?;
    Some(read.x.len() as u64)
}

/// Judges the state that the run begins with. Whether it is of the scene's bodies is known once these have particles.
pub fn check_start(check: &mut Check) {
    let Some(start) = &check.scene.start else { return };
    if one_source(check, "/start", &start.asset, &start.file).is_none() {
        return;
    }
    let Some(state) = &check.resolved.start else { return };
    if let Some(n) = state.f.iter().position(|f| determinant(f).is_nan() || determinant(f) <= 0.0) {
        let reason = format!("the determinant of `F` of particle {n} is {}", determinant(&state.f[n]));
        check.fault("/start", "not_positive", reason, "take the state as the run left it");
    }
    let fastest = state.v.iter().map(|v| length(v)).fold(0.0, f64::max);
    check.plausible("/start", fastest, &SPEED);
    if check.has_grid() {
        within_domain(check, "/start", &state.x);
    }
}

fn one_source(check: &mut Check, at: &str, asset: &Option<String>, file: &Option<String>) -> Option<()> {
    if asset.is_some() != file.is_some() {
        return Some(());
    }
    let reason = if asset.is_some() { "`asset` is given beside `file`" } else { "the file is missing" };
    let remedy = "give one of `asset`, an upload's id, and `file`, a path (command line only)";
    check.fault(at, "not_one_source", reason, remedy);
    None
}

fn within_domain(check: &mut Check, at: &str, x: &[[f64; 3]]) -> Option<()> {
    let domain = &check.scene.domain;
    let (min, max) = (vector3(&domain.min), vector3(&domain.max));
    let periodic = periodic(domain, check.dimension);
    let outside = |x: &&[f64; 3]| (0..check.dimension).any(|a| !periodic[a] && (x[a] < min[a] || x[a] > max[a]));
    let out = x.iter().filter(outside).count();
    if out == 0 {
        return Some(());
    }
    let reason = format!("{out} of {} points are outside the domain", x.len());
    check.fault(at, "outside_domain", reason, "move the points or enlarge the domain");
    None
}
