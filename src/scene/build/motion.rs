//! Colliders and grips of a valid scene, with their motions.

use crate::build::solid::{sdf, vector3};
use crate::build::spin;
use crate::schema::{self, Scene, Shape};
use crate::validate::motion::grip_name;
use gridfall_core::sim::collider::{Collider, Keyframe, Motion, Sdf};
use gridfall_core::sim::setup::{Contact, ContactKind};

/// The scene's colliders, then the grips of its bodies, which have the last word.
pub(crate) fn colliders(scene: &Scene) -> Vec<Collider> {
    let dimension = scene.dimension as usize;
    let build = |name: String, shape: &Shape, given: &Option<schema::Motion>, from: Option<f64>, until: Option<f64>| {
        let sdf = sdf(shape, dimension);
        Collider {
            name,
            motion: motion(given.as_ref(), &sdf, dimension),
            sdf,
            contact: Contact { kind: ContactKind::Sticky, friction: 0.0 },
            present_s: [from.unwrap_or(f64::NEG_INFINITY), until.unwrap_or(f64::INFINITY)],
            grip: true,
        }
    };
    let colliders = scene.colliders.iter().map(|c| Collider {
        contact: Contact { kind: c.contact, friction: c.friction },
        grip: false,
        ..build(c.name.clone(), &c.shape, &c.motion, c.from, c.until)
    });
    let grips = scene.bodies.iter().flat_map(|body| {
        let name = |grip: &schema::Grip| grip_name(&body.name, &grip.name);
        body.grips.iter().map(move |g| build(name(g), &g.shape, &g.motion, g.from, g.until))
    });
    colliders.chain(grips).collect()
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
