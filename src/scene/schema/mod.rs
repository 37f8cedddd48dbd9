//! The scene document (`"gridfall": 1`): serde types and the source of `api/scene.schema.json`.
//!
//! SI units, z up, unknown fields refused. Vectors have as many components as the scene has dimensions.
//! These types say what a scene may *look* like; whether it makes sense is decided by `scene::validate`.

mod motion;
mod source;

pub use gridfall_core::material::parameters::Material;
pub use gridfall_core::sim::contact::ContactKind;
pub use gridfall_core::sim::settings::{Field, Implicit, Integrator, Kernel, Precision, Transfer};
pub use motion::{Collider, Grip, Keyframe, Motion};
pub use source::Source;

use std::collections::BTreeMap;
use std::sync::Arc;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A vector of the scene's dimension (2 or 3 components).
pub type Vector = Vec<f64>;
/// A square matrix of the scene's dimension, rows first.
pub type Matrix = Vec<Vec<f64>>;

/// A complete scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Scene {
    /// Version of the scene format; 1.
    pub gridfall: u32,
    pub name: String,
    /// One line on what to look for in the result.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub description: Option<String>,
    /// 2 (plane strain) or 3.
    #[serde(default = "default_dimension")]
    pub dimension: u32,
    pub domain: Domain,
    /// Gravitational acceleration (m/s²); defaults to zero.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gravity: Option<Vector>,
    pub materials: BTreeMap<String, Material>,
    pub bodies: Vec<Body>,
    /// Shapes that emit material.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub sources: Vec<Source>,
    #[serde(default)]
    pub colliders: Vec<Collider>,
    pub time: Time,
    #[serde(default)]
    pub solver: Solver,
    #[serde(default)]
    pub output: Output,
    #[serde(default = "default_seed")]
    pub seed: u64,
}

impl Scene {
    /// The document, pretty-printed.
    pub fn to_json(&self) -> String {
        serde_json::to_string_pretty(self).expect("a scene is plain data")
    }
}

fn default_dimension() -> u32 {
    3
}
fn default_seed() -> u64 {
    1
}

/// The axis-aligned box that is simulated, and what its walls do.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Domain {
    /// Lower corner (m); the grid's origin.
    pub min: Vector,
    /// Upper corner (m); a whole number of `dx` from `min` on every axis.
    pub max: Vector,
    /// Grid spacing (m).
    pub dx: f64,
    /// Walls by name: `x-`, `x+`, `y-`, … for one wall, `x`, `y`, `z` for both walls of an axis.
    /// A wall that is not named is sticky.
    #[serde(default)]
    pub boundary: BTreeMap<String, Boundary>,
}

/// `"periodic"` (an axis only) or a contact.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum Boundary {
    Periodic(Periodic),
    Wall(WallContact),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum Periodic {
    #[serde(rename = "periodic")]
    Periodic,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct WallContact {
    pub contact: ContactKind,
    /// Coulomb friction coefficient; for `separate` only.
    #[serde(default)]
    pub friction: f64,
}

/// Particles of one material: a shape filled with them, or points from a file. Give one of `shape` and `points`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Body {
    pub name: String,
    /// Name of an entry of `materials`.
    pub material: String,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shape: Option<Shape>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub points: Option<Points>,
    /// Particles per cell, a d-th power of a whole number unless the sampling is `poisson-disk`; 8 by default (2D: 4).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub particles_per_cell: Option<u32>,
    #[serde(default)]
    pub sampling: Sampling,
    /// Initial velocity (m/s).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub velocity: Option<Vector>,
    /// Initial spin about the centre of the body's particles (rad/s); one component in 2D.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub angular_velocity: Option<Vector>,
    /// Initial velocity gradient about the centre of the body's particles (1/s), d × d.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub velocity_gradient: Option<Matrix>,
    /// Initial deformation gradient, d × d; not together with `J`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub deformation_gradient: Option<Matrix>,
    /// Initial volume ratio.
    #[serde(rename = "J", default, skip_serializing_if = "Option::is_none")]
    pub j: Option<f64>,
    /// Regions that hold the body, or move it.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub grips: Vec<Grip>,
}

/// Particles from a PLY (x, y, z; vx, vy, vz if it has them) or an npz (`x` n × d; `v` n × d, `F` n × d × d and `volume` if it has
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
    /// What `scene::resolve` has read; no part of the document.
    #[serde(skip)]
    pub read: Option<Arc<crate::points::Points>>,
}

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
}

/// A closed shape; in 2D its cross-section.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum Shape {
    Box {
        min: Vector,
        max: Vector,
    },
    Sphere {
        center: Vector,
        radius: f64,
    },
    /// A capped cylinder; `height` along `axis`, centred (3D only).
    Cylinder {
        center: Vector,
        #[serde(default = "default_axis")]
        axis: Vector,
        radius: f64,
        height: f64,
    },
    /// A cylinder with half-spheres on its ends; `height` is the length of the axis between their centres (3D only).
    Capsule {
        center: Vector,
        #[serde(default = "default_axis")]
        axis: Vector,
        radius: f64,
        height: f64,
    },
    /// A cone from the disc of `radius` about `base`, `height` along `axis`, to a point or to the disc of `top_radius` (3D only).
    Cone {
        base: Vector,
        #[serde(default = "default_axis")]
        axis: Vector,
        radius: f64,
        #[serde(default)]
        top_radius: f64,
        height: f64,
    },
    /// A ring about `axis` (3D only).
    Torus {
        center: Vector,
        #[serde(default = "default_axis")]
        axis: Vector,
        major_radius: f64,
        minor_radius: f64,
    },
    /// All points behind the plane: (x - point) · normal <= 0.
    HalfSpace {
        point: Vector,
        normal: Vector,
    },
    /// The solid between a plane and a surface above it. 3D: over the rectangle from `min` to `max` (x, y), from z = `base` up to
    /// `heights[j][i]`, i along x and j along y, evenly spaced. 2D: over the interval from `min` to `max` (x), from y = `base` up to
    /// `heights[0][i]`.
    Heightfield {
        min: Vector,
        max: Vector,
        base: f64,
        heights: Matrix,
        #[serde(skip)]
        field: Sampled,
    },
    /// A closed triangle mesh in metres, from an STL, OBJ, PLY or glTF (3D only). Give one of `asset` and `file`.
    Mesh {
        /// Id of an asset that was uploaded to the server: `sha256:` and 64 hexadecimal digits.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        asset: Option<String>,
        /// Path of a file, relative to the scene's; on the command line only.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        file: Option<String>,
        #[serde(default)]
        fill: Fill,
        #[serde(skip)]
        field: Sampled,
    },
    Union(Vec<Shape>),
    Intersection(Vec<Shape>),
    /// The first shape without all others.
    Difference(Vec<Shape>),
    Translate {
        offset: Vector,
        shape: Box_,
    },
    /// Turned by `angle_degrees` about `axis` (3D; default z) through `center` (default: origin).
    Rotate {
        #[serde(default = "default_axis")]
        axis: Vector,
        angle_degrees: f64,
        #[serde(default, skip_serializing_if = "Option::is_none")]
        center: Option<Vector>,
        shape: Box_,
    },
    /// Made larger by `factor` about `center` (default: origin).
    Scale {
        factor: f64,
        #[serde(default, skip_serializing_if = "Option::is_none")]
        center: Option<Vector>,
        shape: Box_,
    },
    /// The layer of the given thickness inside the shape's surface.
    Shell {
        thickness: f64,
        shape: Box_,
    },
}

/// How a mesh tells inside from outside.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Fill {
    /// It must be closed.
    #[default]
    Watertight,
    /// It may have holes: inside is where the generalized winding number is above a half (Jacobson et al. 2013).
    WindingNumber,
}

/// The signed distances of a shape that has no closed form, once `scene::resolve` has sampled them; no part of the document.
pub type Sampled = Option<Arc<gridfall_core::sim::collider::Field>>;

/// A shape inside a shape.
pub type Box_ = std::boxed::Box<Shape>;

fn default_axis() -> Vector {
    vec![0.0, 0.0, 1.0]
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Time {
    /// Simulated time at which the job ends (s).
    pub end: f64,
    /// Frames per simulated second.
    #[serde(default = "default_frame_rate")]
    pub frame_rate: f64,
}

fn default_frame_rate() -> f64 {
    48.0
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Solver {
    pub integrator: Integrator,
    pub kernel: Kernel,
    pub transfer: Transfer,
    /// A particle may move at most this share of dx in a step.
    pub cfl: f64,
    /// Upper bound on the step (s).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_dt: Option<f64>,
    /// Of the explicit integrator; the implicit one is f64 on the CPU and f32 on a GPU, which takes `f32` scenes only.
    pub precision: Precision,
    /// Settings of the implicit integrator.
    pub implicit: Implicit,
}

impl Default for Solver {
    fn default() -> Self {
        Self {
            integrator: Integrator::Auto,
            kernel: Kernel::Compact,
            transfer: Transfer::Mls,
            cfl: 0.5,
            max_dt: None,
            precision: Precision::F32,
            implicit: Implicit::default(),
        }
    }
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Output {
    /// Scalar and vector fields recorded with each point, beside position and colour.
    pub fields: Vec<Field>,
    /// Points recorded per frame at most; more are decimated evenly.
    pub preview_points: u32,
}

impl Default for Output {
    fn default() -> Self {
        Self { fields: vec![Field::Velocity], preview_points: 200_000 }
    }
}

/// The JSON Schema of scenes, pretty-printed: what `api/scene.schema.json` holds.
pub fn json_schema() -> String {
    let schema = schemars::schema_for!(Scene);
    serde_json::to_string_pretty(&schema).expect("a schema is plain data") + "\n"
}
