//! Meaning of colliders, grips and their prescribed motions.

use gridfall_core::sim::reaction::{WALLS, wall_name};

use crate::fault::join;
use crate::schema::{Keyframe, Motion, Shape};
use crate::validate::check::Check;
use crate::validate::plausible::{PLACE, SPEED};
use crate::validate::shape::{check_shape, check_solid, direction};
use crate::vectors::length;

/// Judges all colliders and the grips of all bodies, which become colliders as well.
pub fn check_colliders(check: &mut Check) {
    let scene = check.scene;
    let colliders = scene.colliders.iter().enumerate().map(|(n, c)| (format!("/colliders/{n}/name"), c.name.clone()));
    let grips = scene.bodies.iter().enumerate().flat_map(|(b, body)| {
        let grips = body.grips.iter().enumerate();
        grips.map(move |(n, grip)| (format!("/bodies/{b}/grips/{n}/name"), grip.name_in(&body.name)))
    });
    check.unique(colliders.chain(grips));
    for (n, c) in scene.colliders.iter().enumerate() {
        if (0..WALLS).any(|wall| wall_name(wall) == c.name) {
            let reason = "diagnostics call a wall of the domain by this name";
            check.fault(&format!("/colliders/{n}/name"), "reserved_name", reason, "choose another name");
        }
    }
    for (n, c) in scene.colliders.iter().enumerate() {
        if check.faults.full() {
            return;
        }
        let at = format!("/colliders/{n}");
        check_shape(check, &join(&at, "shape"), &c.shape);
        check.contact(&at, c.contact, c.friction);
        motion(check, &at, c.motion.as_ref(), &c.shape);
        interval(check, &at, c.from, c.until);
    }
    for (b, body) in scene.bodies.iter().enumerate() {
        for (n, grip) in body.grips.iter().enumerate() {
            let at = format!("/bodies/{b}/grips/{n}");
            check.name(&join(&at, "name"), &grip.name);
            check_solid(check, &join(&at, "shape"), &grip.shape);
            motion(check, &at, grip.motion.as_ref(), &grip.shape);
            interval(check, &at, grip.from, grip.until);
        }
    }
}

/// Judges `from` and `until` of the value at `at`.
pub fn interval(check: &mut Check, at: &str, from: Option<f64>, until: Option<f64>) {
    if let Some(from) = from {
        check.not_negative(&join(at, "from"), from, "the first time");
    }
    let at_until = join(at, "until");
    if let Some(until) = until
        && check.finite(&at_until, until)
        && until <= from.unwrap_or(0.0)
    {
        let reason = format!("ends at {until} s, not after it begins at {} s", from.unwrap_or(0.0));
        check.fault(&at_until, "empty", reason, "write a later time, or take it out");
    }
}

fn motion(check: &mut Check, at: &str, motion: Option<&Motion>, shape: &Shape) {
    let Some(motion) = motion else { return };
    let shape_at = join(at, "shape");
    let at = join(at, "motion");
    if let Some(velocity) = &motion.linear_velocity {
        let at = join(&at, "linear_velocity");
        check.vector(&at, velocity);
        check.plausible_length(&at, velocity, &SPEED);
    }
    if let Some(center) = &motion.center {
        let at = join(&at, "center");
        check.vector(&at, center);
        check.plausible_length(&at, center, &PLACE);
    }
    if let Some(spin) = &motion.angular_velocity {
        let at = join(&at, "angular_velocity");
        check.angular(&at, spin);
        check.plausible_rate(&at, length(spin), arm(motion));
    }
    keyframes(check, &at, motion);
    let spins = motion.angular_velocity.iter().flatten().any(|w| *w != 0.0);
    let turns = spins || motion.keyframes.iter().any(|key| key.angle_degrees != 0.0);
    if turns && motion.center.is_none() && check.has_dimension() && check.faults.clean(&shape_at) {
        let [lower, upper] = check.sdf(&shape_at, shape).bounds();
        if (0..check.dimension).any(|a| !(lower[a] + upper[a]).is_finite()) {
            let reason = "an unbounded shape turns and has no centre to turn about";
            check.fault(&join(&at, "center"), "missing_field", reason, "add `center`");
        }
    }
}

fn keyframes(check: &mut Check, at: &str, motion: &Motion) {
    if let Some(axis) = &motion.axis {
        let at = join(at, "axis");
        if check.dimension == 2 && check.has_dimension() {
            check.fault(&at, "needs_3d", "in 2D there is only one axis", "take `axis` out");
        } else if motion.keyframes.is_empty() {
            let reason = "only the angles of keyframes have an axis";
            check.fault(&at, "axis_unused", reason, "take `axis` out, add `keyframes`, or write `angular_velocity`");
        } else {
            direction(check, &at, axis);
        }
    }
    if motion.keyframes.is_empty() {
        return;
    }
    let at_keys = join(at, "keyframes");
    let velocities = motion.linear_velocity.is_some() || motion.angular_velocity.is_some();
    if velocities {
        let reason = "keyframes are given beside velocities";
        check.fault(&at_keys, "conflicting_fields", reason, "keep the keyframes or the velocities");
    }
    if motion.keyframes.len() < 2 {
        let reason = "one keyframe makes no motion";
        check.fault(&at_keys, "too_few_keyframes", reason, "list at least two");
    }
    for (n, key) in motion.keyframes.iter().enumerate() {
        keyframe(check, &join(&at_keys, n), key);
        let times = [n.saturating_sub(1), n].map(|n| join(&join(&at_keys, n), "time"));
        let before = motion.keyframes[n.saturating_sub(1)].time;
        if n > 0 && key.time <= before && times.iter().all(|at| check.faults.clean(at)) {
            let reason = format!("{} s does not come after the keyframe at {before} s", key.time);
            check.fault(&times[1], "not_rising", reason, "put the keyframes in order of time");
        } else if n > 0 {
            keyframe_speed(check, &join(&at_keys, n), [&motion.keyframes[n - 1], key], arm(motion));
        }
    }
}

/// How far the centre of rotation may be from the domain (m).
fn arm(motion: &Motion) -> f64 {
    motion.center.as_deref().map_or(0.0, length)
}

/// Judges the speed on the way to the second keyframe, which is at `at`.
fn keyframe_speed(check: &mut Check, at: &str, keys: [&Keyframe; 2], arm: f64) {
    let time = keys[1].time - keys[0].time;
    let offset =
        |key: &Keyframe, a: usize| key.offset.as_ref().and_then(|offset| offset.get(a)).copied().unwrap_or(0.0);
    let way = [0, 1, 2].map(|a| offset(keys[1], a) - offset(keys[0], a));
    let turn = (keys[1].angle_degrees - keys[0].angle_degrees).abs().to_radians();
    check.plausible(&join(at, "time"), length(&way) / time, &SPEED);
    check.plausible_rate(&join(at, "time"), turn / time, arm);
}

fn keyframe(check: &mut Check, at: &str, key: &Keyframe) {
    if let Some(offset) = &key.offset {
        check.vector(&join(at, "offset"), offset);
    }
    check.finite(&join(at, "angle_degrees"), key.angle_degrees);
    check.not_negative(&join(at, "time"), key.time, "the time");
}
