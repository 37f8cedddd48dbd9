//! What moves by prescription: colliders, grips and their motions.

use gridfall_core::sim::contact::ContactKind;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::shape::Shape;
use super::vector::{Vector, spin};

/// A rigid obstacle.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Collider {
    /// Its own among colliders.
    pub name: String,
    /// Where it is at time 0.
    pub shape: Shape,
    /// What it does to material that meets it.
    pub contact: ContactKind,
    /// Coulomb friction coefficient; for `separate` only.
    #[serde(default)]
    pub friction: f64,
    /// How it moves; without, it stays where it is.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub motion: Option<Motion>,
    /// Time at which it appears (s); it is there from the start by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub from: Option<f64>,
    /// Time at which it is gone (s); it stays by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub until: Option<f64>,
}

/// A region in which material takes a prescribed motion: a sticky collider that comes with a body.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Grip {
    /// Its own among the body's grips; elsewhere it is called `body/grip`.
    pub name: String,
    /// The region at time 0.
    pub shape: Shape,
    /// How the region moves, and what is in it; without, it is held where it is.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub motion: Option<Motion>,
    /// Time from which it holds (s); from the start by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub from: Option<f64>,
    /// Time at which it lets go (s); never by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub until: Option<f64>,
}

impl Grip {
    /// The name of a grip outside its body.
    pub fn name_in(&self, body: &str) -> String {
        format!("{body}/{}", self.name)
    }
}

/// Rigid motion of a collider: velocities, or keyframes.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Motion {
    /// Velocity (m/s); none by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub linear_velocity: Option<Vector>,
    /// Spin about `center` (rad/s); one number in 2D, none by default.
    #[serde(default, skip_serializing_if = "Option::is_none", deserialize_with = "spin::read")]
    #[schemars(schema_with = "spin::schema")]
    pub angular_velocity: Option<Vector>,
    /// Centre of rotation at time 0 (m), carried along by the motion; default: the centre of the shape's bounding box.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub center: Option<Vector>,
    /// Axis of the keyframes' angles (3D); default z.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub axis: Option<Vector>,
    #[doc = "At least two, by rising time, in the place of the velocities; none by default. Linear between them, held \
             before the first and after the last."]
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub keyframes: Vec<Keyframe>,
}

/// Where a motion is at a time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Keyframe {
    /// Time of the keyframe (s).
    pub time: f64,
    /// From where the shape is given (m); none by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub offset: Option<Vector>,
    /// Turn about `axis` through `center`.
    #[serde(default)]
    pub angle_degrees: f64,
}
