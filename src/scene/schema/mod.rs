//! The scene document (`"gridfall": 1`): serde types and the source of `api/scene.schema.json`, which
//! `contract` makes of them.
//!
//! SI units, z up, unknown fields refused. Vectors have as many components as the scene has
//! dimensions. These types say what a scene may *look* like; `validate` decides whether it makes
//! sense. Their doc comments are the descriptions in the JSON Schema, line breaks included.

mod body;
mod material;
mod motion;
mod scene;
mod shape;
mod source;
mod vector;

pub use body::{Body, Points, Sampling};
pub use gridfall_core::material::parameters::Material;
pub use gridfall_core::sim::contact::ContactKind;
pub use gridfall_core::sim::settings::{ContactAt, Implicit, Integrator, Kernel, OutputField, Precision, Transfer};
pub use material::{Homes, SceneMaterial};
pub use motion::{Collider, Grip, Keyframe, Motion};
pub use scene::{Boundary, Domain, DomainFit, Output, Periodic, Scene, Solver, Start, Time, WallContact};
pub use shape::{Fill, Shape};
pub use source::Source;
pub use vector::{Matrix, Vector};
