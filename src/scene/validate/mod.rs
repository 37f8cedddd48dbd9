//! Meaning: whether the numbers of a scene make sense together. Every fault is found; what depends
//! on a faulty value is skipped.

mod bodies;
mod check;
mod domain;
mod material;
mod motion;
pub(crate) mod plausible;
mod points;
mod shape;
mod solver;
mod sources;

use crate::fault::{Faults, join, plain};
use crate::limits::Limits;
use crate::resolve::Resolved;
use crate::schema::{Output, Scene, Time};
use bodies::check_bodies;
use check::Check;
pub(crate) use check::MAX_NAME;
use domain::check_domain;
use material::check_material;
use motion::check_colliders;
use plausible::{END, GRAVITY};
use points::check_start;
use solver::check_solver;
pub(crate) use solver::{MAX_ERROR, MAX_LEVELS};

/// Most frames of one run.
const MAX_FRAMES: f64 = 100_000.0;
/// Most points of a recorded frame.
pub(crate) const MAX_PREVIEW_POINTS: u32 = 100_000_000;

/// Judges a scene of sound structure. Parts that depend on its dimension are judged only if that is
/// valid.
pub(crate) fn check(scene: &Scene, resolved: &Resolved, limits: &Limits, faults: &mut Faults) {
    if scene.gridfall != 1 {
        faults.add(
            "/gridfall",
            "unsupported_version",
            format!("version {} of the scene format is not known", scene.gridfall),
            "write 1",
        );
    }
    if !(2..=3).contains(&scene.dimension) {
        faults.add("/dimension", "out_of_range", format!("{} dimensions", scene.dimension), "write 2 or 3");
    }
    let check = &mut Check { scene, resolved, dimension: scene.dimension as usize, limits, faults, work: 0 };
    check.name("/name", &scene.name);
    if let Some(text) = &scene.schema {
        check.legible("/$schema", text);
    }
    if let Some(text) = &scene.description {
        check.legible("/description", &text.replace(['\n', '\r', '\t'], " "));
    }
    if let Some(gravity) = &scene.gravity {
        check.vector("/gravity", gravity);
        check.plausible_length("/gravity", gravity, &GRAVITY);
    }
    check_domain(check, &scene.domain);
    for (name, material) in &scene.materials {
        let at = join("/materials", name);
        check.name(&at, name);
        check_material(check, &at, material);
    }
    check_time(check, &scene.time);
    check_bodies(check);
    check_start(check);
    check_colliders(check);
    check_solver(check, &scene.solver);
    check_output(check, &scene.output);
}

fn check_time(check: &mut Check, time: &Time) {
    check.positive("/time/end", time.end, "the end");
    check.plausible("/time/end", time.end, &END);
    check.positive("/time/frame_rate", time.frame_rate, "the frame rate");
    if !check.faults.clean("/time") {
        return;
    }
    let frames = time.end * time.frame_rate;
    if frames > MAX_FRAMES {
        let reason = format!("{frames:.0} frames; {MAX_FRAMES} is the most");
        check.fault("/time/end", "too_many_frames", reason, "end earlier or lower frame_rate");
    } else if frames.round() < 1.0 || (frames - frames.round()).abs() > 1e-3 {
        let at = |frames: f64| plain(frames / time.frame_rate);
        let reason = format!("{} s at {} frames a second are {frames:.4} frames", time.end, time.frame_rate);
        let remedy = format!(
            "end on a frame: at {} or {} s, or change frame_rate",
            at(frames.floor().max(1.0)),
            at(frames.ceil().max(2.0))
        );
        check.fault("/time/end", "not_whole_frames", reason, remedy);
    }
}

fn check_output(check: &mut Check, output: &Output) {
    if !(1..=MAX_PREVIEW_POINTS).contains(&output.preview_points) {
        let remedy = format!("write a number from 1 to {MAX_PREVIEW_POINTS}");
        let reason = format!("{} points a frame", output.preview_points);
        check.fault("/output/preview_points", "out_of_range", reason, remedy);
    }
    for (n, field) in output.fields.iter().enumerate() {
        if output.fields[..n].contains(field) {
            let at = format!("/output/fields/{n}");
            check.fault(&at, "duplicate", "the field is named twice", "name it once");
        }
    }
}
