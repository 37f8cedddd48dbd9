//! Rigid obstacles: a signed distance field, a contact and a motion.

mod field;
mod sdf;

pub use field::Field;
pub use sdf::{FLAT_HALF_EXTENT, Primitive, SDF_STACK, Sdf, SdfOp, axis_angle, rotate, rotate_back};

use super::particles::IDENTITY;
use super::problem::Contact;

/// Half the step of the central differences of [`Collider::normal`], in units of dx; engines use the same.
pub const NORMAL_STEP_DX: f64 = 1.0 / 32.0;

/// Position and orientation at an instant: x_world = rotation x_start + translation (row-major).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    pub rotation: [f64; 9],
    pub translation: [f64; 3],
}

impl Pose {
    /// Where a point of space lies on the body as it was at time 0.
    pub fn to_start(&self, x: [f64; 3]) -> [f64; 3] {
        let t = self.translation;
        rotate_back(&self.rotation, [x[0] - t[0], x[1] - t[1], x[2] - t[2]])
    }
}

/// Rigid motion with constant linear and angular velocity.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Motion {
    /// Centre of rotation at time 0 (m).
    pub center: [f64; 3],
    pub linear_velocity: [f64; 3],
    pub angular_velocity: [f64; 3],
}

impl Motion {
    /// Pose at time `t` (s): x_world = R(t) (x_start - center) + center + v t.
    pub fn pose(&self, t: f64) -> Pose {
        let w = self.angular_velocity;
        let speed = (w[0] * w[0] + w[1] * w[1] + w[2] * w[2]).sqrt();
        let rotation = if speed == 0.0 { IDENTITY } else { axis_angle(w.map(|a| a / speed), speed * t) };
        let (center, v) = (self.center, self.linear_velocity);
        let turned = rotate(&rotation, center);
        Pose { rotation, translation: std::array::from_fn(|a| center[a] - turned[a] + v[a] * t) }
    }

    /// Velocity (m/s) of the rigid motion at a point of space and time.
    pub fn velocity_at(&self, x: [f64; 3], t: f64) -> [f64; 3] {
        let (v, w) = (self.linear_velocity, self.angular_velocity);
        let r: [f64; 3] = std::array::from_fn(|a| x[a] - self.center[a] - v[a] * t);
        [v[0] + w[1] * r[2] - w[2] * r[1], v[1] + w[2] * r[0] - w[0] * r[2], v[2] + w[0] * r[1] - w[1] * r[0]]
    }
}

/// A rigid obstacle.
#[derive(Clone, Debug, PartialEq)]
pub struct Collider {
    pub name: String,
    /// The solid at time 0.
    pub sdf: Sdf,
    pub contact: Contact,
    pub motion: Motion,
}

impl Collider {
    /// Signed distance (m) of a point at time `t`, negative inside.
    pub fn distance(&self, x: [f64; 3], t: f64) -> f64 {
        self.sdf.distance(self.motion.pose(t).to_start(x))
    }

    /// Velocity (m/s) of the obstacle at a point of space and time.
    pub fn velocity_at(&self, x: [f64; 3], t: f64) -> [f64; 3] {
        self.motion.velocity_at(x, t)
    }

    /// Outward unit normal at a point and time, by central differences of half step `h` (m): [`NORMAL_STEP_DX`] dx in engines.
    /// Zero where the distance has no slope.
    pub fn normal(&self, x: [f64; 3], t: f64, h: f64) -> [f64; 3] {
        let pose = self.motion.pose(t);
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
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sim::problem::ContactKind;

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
            },
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
            let (ahead, behind, v) = (at(t + h), at(t - h), collider.velocity_at(at(t), t));
            for a in 0..3 {
                assert!(((ahead[a] - behind[a]) / (2.0 * h) - v[a]).abs() < 1e-8, "axis {a} at t = {t}");
            }
            assert!(collider.distance(at(t), t).abs() < 1e-14);
            let back = collider.motion.pose(t).to_start(at(t));
            assert!((0..3).all(|a| (back[a] - start[a]).abs() < 1e-14));
        }
    }

    #[test]
    fn the_normal_turns_with_the_obstacle() {
        let collider = paddle();
        let t = 0.7;
        let pose = collider.motion.pose(t);
        let x = rotate(&pose.rotation, [0.71, 0.5, 0.6]);
        let x = [0, 1, 2].map(|a| x[a] + pose.translation[a]);
        let n = collider.normal(x, t, 1e-3);
        let expected = rotate(&pose.rotation, [1.0, 0.0, 0.0]);
        assert!((0..3).all(|a| (n[a] - expected[a]).abs() < 1e-12), "{n:?} against {expected:?}");
    }
}
