//! Bodies and the particles they are made of.

use gridfall_core::sim::contact::ContactKind;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::motion::Grip;
use super::shape::Shape;
use super::vector::{Matrix, Vector, spin};

/// Particles of one material: a shape filled with them, or points from a file. Give one of `shape` and `points`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Body {
    /// Its own among bodies and sources.
    pub name: String,
    /// Name of an entry of `materials`, or a material as it would be there.
    pub material: String,
    /// What is filled with particles; without it, `points` has them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shape: Option<Shape>,
    /// Particles of a file in the place of a shape.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub points: Option<Points>,
    /// Particles per cell; 8 by default (2D: 4). A d-th power of a whole number if the sampling is `regular` or
    /// `jittered`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub particles_per_cell: Option<u32>,
    /// How particles are laid into the shape.
    #[serde(default)]
    pub sampling: Sampling,
    /// Initial velocity (m/s); at rest by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub velocity: Option<Vector>,
    /// Initial spin about the centre of the body's particles (rad/s); one number in 2D, none by default.
    #[serde(default, skip_serializing_if = "Option::is_none", deserialize_with = "spin::read")]
    #[schemars(schema_with = "spin::schema")]
    pub angular_velocity: Option<Vector>,
    /// Initial velocity gradient about the centre of the body's particles (1/s), d × d; none by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub velocity_gradient: Option<Matrix>,
    /// Initial deformation gradient, d × d; not together with `J`. The identity by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub deformation_gradient: Option<Matrix>,
    /// Initial volume ratio; 1 by default.
    #[serde(rename = "J", default, skip_serializing_if = "Option::is_none")]
    pub j: Option<f64>,
    #[doc = "Contact with other bodies, in explicit runs: `separate` slides on all others and parts from them, `slip` \
             slides only. By default it sticks to those that stick, with which it shares the nodes of the grid."]
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub contact: Option<ContactKind>,
    /// Coulomb friction coefficient; for `separate` only. Of two bodies' the smaller counts.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub friction: f64,
    /// Regions that hold the body, or move it.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub grips: Vec<Grip>,
}

fn is_zero(x: &f64) -> bool {
    *x == 0.0
}

#[doc = "Particles from a PLY (x, y, z; vx, vy, vz if it has them) or an npz (`x` n × d; `v` n × d, \
         `F` n × d × d and `volume` if it has"]
/// them). Give one of `asset` and `file`. Without a volume, each has that of a cell shared by `particles_per_cell`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Points {
    /// Id of an asset that was uploaded to the server: `sha256:` and 64 hexadecimal digits.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub asset: Option<String>,
    /// Path of a file, relative to the scene's; on the command line only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub file: Option<String>,
}

/// How particles are laid into a shape.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Sampling {
    /// A lattice of spacing dx / ppc^(1/d), half a spacing from the grid lines.
    #[default]
    Regular,
    /// One point drawn uniformly in each cell of that lattice, seeded.
    Jittered,
    /// Points at random with a least distance between them, seeded; `particles_per_cell` of them a cell on average.
    PoissonDisk,
    /// Points in layers parallel to the surface, seeded: the first half a spacing dx / ppc^(1/d) below it, the others
    /// a spacing apart, and a lattice deep inside. For curved bodies that roll or slide.
    Conforming,
}
