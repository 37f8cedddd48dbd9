//! Rigid obstacles: a signed distance field, a contact and a motion.

mod field;
mod motion;
mod sdf;

pub use field::{DistanceField, FAR_ERROR, FILLING, SOLID, sided, sides};
pub use motion::{Instant, Keyframe, Motion, Pose, TIME_TIE_S};
pub use sdf::{FLAT_HALF_EXTENT, Primitive, SDF_STACK, Sdf, SdfOp, axis_angle, rotate, rotate_back};

use super::setup::Contact;

/// Half the step of the central differences of [`Placed::normal`], in units of dx. Engines use the
/// same.
pub const NORMAL_STEP_DX: f64 = 1.0 / 32.0;

/// A rigid obstacle.
#[derive(Clone, Debug, PartialEq)]
pub struct Collider {
    pub name: String,
    /// The solid at time 0.
    pub sdf: Sdf,
    pub contact: Contact,
    pub motion: Motion,
    /// When the obstacle exists: from the first time up to the second (s).
    pub present_s: [f64; 2],
    /// True for a grip, which holds the material that it overlaps. Pictures draw it so that the
    /// material shows through.
    pub grip: bool,
}

/// The time span of an obstacle that always exists.
pub const ALWAYS: [f64; 2] = [f64::NEG_INFINITY, f64::INFINITY];

impl Collider {
    pub fn is_present(&self, t: f64) -> bool {
        let t = t + TIME_TIE_S;
        t >= self.present_s[0] && t < self.present_s[1]
    }

    /// The obstacle at time `t` (s), whether or not it exists then.
    pub fn at(&self, t: f64) -> Placed<'_> {
        Placed { sdf: &self.sdf, motion: self.motion.at(t), step: None }
    }

    /// The obstacle at time `t` (s), with the velocities that take it where it is `dt` (s) later.
    pub fn over(&self, t: f64, dt: f64) -> Placed<'_> {
        let step = (dt > 0.0 && self.motion.moves()).then(|| (self.motion.pose(t + dt), dt));
        Placed { step, ..self.at(t) }
    }
}

/// An obstacle at an instant.
#[derive(Clone, Copy, Debug)]
pub struct Placed<'a> {
    sdf: &'a Sdf,
    pub motion: Instant,
    /// Where it is after a step, and how long that takes (s).
    step: Option<(Pose, f64)>,
}

impl Placed<'_> {
    /// Signed distance (m) of a point, negative inside.
    pub fn distance(&self, x: [f64; 3]) -> f64 {
        self.sdf.distance(self.motion.pose.to_start(x))
    }

    /// By how much two distances may differ beyond the distance between their points (m).
    pub fn slack(&self) -> f64 {
        self.sdf.slack()
    }

    /// Whether some of it is a surface without inside.
    pub fn is_sheet(&self) -> bool {
        self.sdf.is_sheet()
    }

    /// Velocity (m/s) of the obstacle at a point in space; over a step, the secant of its path. The
    /// tangent would take what turns with it outwards, a little in every step.
    pub fn velocity_at(&self, x: [f64; 3]) -> [f64; 3] {
        let Some((pose, dt)) = &self.step else { return self.motion.velocity_at(x) };
        let to = pose.to_space(self.motion.pose.to_start(x));
        std::array::from_fn(|a| (to[a] - x[a]) / dt)
    }

    /// Over a step: linear velocity l of its centre c (m/s), angular velocity w (rad/s) and κ (s), with
    /// which [`Self::velocity_at`] is l + w × r + κ w × (w × r), r = x − c. κ is 0 at an instant.
    pub fn rates(&self) -> ([f64; 3], [f64; 3], f64) {
        let now = &self.motion;
        let Some((after, dt)) = &self.step else { return (now.linear_velocity, now.angular_velocity, 0.0) };
        // Turns by θ about a unit axis a: I + sin θ [a] + (1 − cos θ) [a]².
        let rows: [[f64; 3]; 3] = std::array::from_fn(|i| {
            let row = std::array::from_fn(|a| after.rotation[3 * i + a]);
            rotate(&now.pose.rotation, row)
        });
        let axis = [rows[2][1] - rows[1][2], rows[0][2] - rows[2][0], rows[1][0] - rows[0][1]];
        let cosine = 0.5 * (rows[0][0] + rows[1][1] + rows[2][2] - 1.0);
        let center = after.to_space(now.pose.to_start(now.center));
        let linear = std::array::from_fn(|a| (center[a] - now.center[a]) / dt);
        (linear, axis.map(|a| 0.5 * a / dt), dt / (1.0 + cosine))
    }

    /// Outward unit normal at a point, by central differences of half step `h` (m); engines use
    /// [`NORMAL_STEP_DX`] dx. Zero where the distance has no slope.
    pub fn normal(&self, x: [f64; 3], h: f64) -> [f64; 3] {
        let pose = &self.motion.pose;
        let x = pose.to_start(x);
        let n: [f64; 3] = std::array::from_fn(|a| {
            let (mut ahead, mut behind) = (x, x);
            ahead[a] += h;
            behind[a] -= h;
            self.sdf.distance(ahead) - self.sdf.distance(behind)
        });
        let length = (n[0] * n[0] + n[1] * n[1] + n[2] * n[2]).sqrt();
        if length == 0.0 { [0.0; 3] } else { rotate(&pose.rotation, n.map(|a| a / length)) }
    }

    /// Share, from 0 to 1, of the way from `from` here to `to` in `then`, the same obstacle later, at
    /// which a point that is outside comes within `least` (m) of the obstacle on its way towards it;
    /// none if it does not. It is followed in steps no longer than its distance, so that no wall is
    /// too thin.
    pub fn meets(&self, then: &Self, from: [f64; 3], to: [f64; 3], least: f64) -> Option<f64> {
        let [from, to] = [self.motion.pose.to_start(from), then.motion.pose.to_start(to)];
        let way: [f64; 3] = std::array::from_fn(|a| to[a] - from[a]);
        let length = (way[0] * way[0] + way[1] * way[1] + way[2] * way[2]).sqrt();
        let (first, slack) = (self.sdf.distance(from), self.sdf.slack());
        if length == 0.0 || first < 0.0 || first - length > least + slack {
            return None;
        }
        // Distances of sampled shapes may change faster than the distance moved.
        let trust = if slack > 0.0 { 0.5 } else { 1.0 };
        let (mut gone, mut before) = (0.0, first);
        while gone < length {
            let step = (trust * before - 0.5 * least).max(0.5 * before).max(1e-3 * least);
            let next = (gone + step).min(length);
            let here = self.sdf.distance(std::array::from_fn(|a| from[a] + next / length * way[a]));
            if here < least && here < before {
                // Where a sheet fills a cell, distances jump.
                return Some(if before < least || here < 0.0 { gone } else { next } / length);
            }
            (gone, before) = (next, here);
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sim::particles::IDENTITY;
    use crate::sim::setup::ContactKind;

    fn paddle() -> Collider {
        Collider {
            name: "paddle".into(),
            sdf: Sdf {
                ops: vec![SdfOp::Primitive {
                    primitive: Primitive::Box([0.3, 0.05, 0.2]),
                    rotation: IDENTITY,
                    translation: [0.4, 0.5, 0.6],
                }],
            },
            contact: Contact { kind: ContactKind::Slip, friction: 0.0 },
            motion: Motion {
                center: [0.1, 0.5, 0.6],
                linear_velocity: [0.2, -0.1, 0.3],
                angular_velocity: [0.5, 1.0, -2.0],
                keyframes: vec![],
            },
            present_s: [0.5, 1.0],
            grip: false,
        }
    }

    #[test]
    fn a_material_point_moves_with_the_velocity_of_the_field() {
        let collider = paddle();
        let start = [0.7, 0.5, 0.6];
        let at = |t: f64| {
            let pose = collider.motion.pose(t);
            let x = rotate(&pose.rotation, start);
            [0, 1, 2].map(|a| x[a] + pose.translation[a])
        };
        for t in [0.0, 0.4, 3.0] {
            let h = 1e-6;
            let (ahead, behind, v) = (at(t + h), at(t - h), collider.at(t).velocity_at(at(t)));
            for a in 0..3 {
                assert!(((ahead[a] - behind[a]) / (2.0 * h) - v[a]).abs() < 1e-8, "axis {a} at t = {t}");
            }
            assert!(collider.at(t).distance(at(t)).abs() < 1e-14);
            let back = collider.motion.pose(t).to_start(at(t));
            assert!((0..3).all(|a| (back[a] - start[a]).abs() < 1e-14));
        }
    }

    #[test]
    fn the_rates_of_a_step_are_its_secants() {
        let collider = paddle();
        for dt in [1e-4, 0.1, 0.9] {
            let over = collider.over(0.7, dt);
            let (l, w, kappa) = over.rates();
            let cross = |a: [f64; 3], b: [f64; 3]| {
                [0, 1, 2].map(|k| a[(k + 1) % 3] * b[(k + 2) % 3] - a[(k + 2) % 3] * b[(k + 1) % 3])
            };
            let x = [0.9, -0.3, 0.4];
            let r = [0, 1, 2].map(|a| x[a] - over.motion.center[a]);
            let (turned, again) = (cross(w, r), cross(w, cross(w, r)));
            let v = over.velocity_at(x);
            for a in 0..3 {
                assert!((l[a] + turned[a] + kappa * again[a] - v[a]).abs() < 1e-10, "axis {a}, dt {dt}");
            }
        }
    }

    #[test]
    fn the_normal_turns_with_the_obstacle() {
        let collider = paddle();
        let t = 0.7;
        let pose = collider.motion.pose(t);
        let x = rotate(&pose.rotation, [0.71, 0.5, 0.6]);
        let x = [0, 1, 2].map(|a| x[a] + pose.translation[a]);
        let n = collider.at(t).normal(x, 1e-3);
        let expected = rotate(&pose.rotation, [1.0, 0.0, 0.0]);
        assert!((0..3).all(|a| (n[a] - expected[a]).abs() < 1e-12), "{n:?} against {expected:?}");
    }

    #[test]
    fn it_is_there_from_its_first_time_up_to_its_last() {
        let there = |t: f64| paddle().is_present(t);
        assert_eq!([0.4, 0.5 - 1e-15, 0.7, 1.0 - 1e-15, 1.0, 2.0].map(there), [false, true, true, false, false, false]);
    }
}
