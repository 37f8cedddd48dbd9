//! The colliders and grips of a valid scene, and their motions.

use gridfall_core::sim::collider::{Collider, Keyframe, Motion, Sdf};
use gridfall_core::sim::setup::{Contact, ContactKind};

use crate::schema::{self, Scene};
use crate::shape::{self, Fields};
use crate::vectors::{spin, vector3};

/// The scene's colliders, then the grips of its bodies, which take precedence because they come
/// last.
pub(crate) fn colliders(scene: &Scene, fields: &Fields) -> Vec<Collider> {
    let d = scene.dimension as usize;
    let mut colliders = Vec::new();
    for (n, collider) in scene.colliders.iter().enumerate() {
        let sdf = shape::sdf(&collider.shape, &format!("/colliders/{n}/shape"), fields, d);
        colliders.push(Collider {
            name: collider.name.clone(),
            motion: motion(collider.motion.as_ref(), &sdf, d),
            sdf,
            contact: Contact { kind: collider.contact, friction: collider.friction },
            present_s: present_s(collider.from, collider.until),
            grip: false,
        });
    }
    for (b, body) in scene.bodies.iter().enumerate() {
        for (n, grip) in body.grips.iter().enumerate() {
            let sdf = shape::sdf(&grip.shape, &format!("/bodies/{b}/grips/{n}/shape"), fields, d);
            colliders.push(Collider {
                name: grip.name_in(&body.name),
                motion: motion(grip.motion.as_ref(), &sdf, d),
                sdf,
                contact: Contact { kind: ContactKind::Sticky, friction: 0.0 },
                present_s: present_s(grip.from, grip.until),
                grip: true,
            });
        }
    }
    colliders
}

fn present_s(from: Option<f64>, until: Option<f64>) -> [f64; 2] {
    [from.unwrap_or(f64::NEG_INFINITY), until.unwrap_or(f64::INFINITY)]
}

fn motion(motion: Option<&schema::Motion>, sdf: &Sdf, dimension: usize) -> Motion {
    let motion = motion.cloned().unwrap_or_default();
    let [lower, upper] = sdf.bounds();
    let middle = std::array::from_fn(|a| {
        let middle = 0.5 * (lower[a] + upper[a]);
        if a < dimension && middle.is_finite() { middle } else { 0.0 }
    });
    let axis = motion.axis.as_deref().map_or([0.0, 0.0, 1.0], vector3);
    let length = axis.iter().map(|a| a * a).sum::<f64>().sqrt();
    let keyframe = |key: &schema::Keyframe| Keyframe {
        time_s: key.time,
        offset: key.offset.as_deref().map_or([0.0; 3], vector3),
        turn: axis.map(|a| a / length * key.angle_degrees.to_radians()),
    };
    Motion {
        center: motion.center.as_deref().map_or(middle, vector3),
        linear_velocity: motion.linear_velocity.as_deref().map_or([0.0; 3], vector3),
        angular_velocity: motion.angular_velocity.as_deref().map_or([0.0; 3], spin),
        keyframes: motion.keyframes.iter().map(keyframe).collect(),
    }
}
