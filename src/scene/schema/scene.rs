//! The document as a whole, its domain and its settings.

use std::collections::BTreeMap;

use gridfall_core::sim::contact::ContactKind;
use gridfall_core::sim::settings::{ContactAt, Implicit, Integrator, Kernel, OutputField, Precision, Transfer};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::body::Body;
use super::material::{Homes, SceneMaterial};
use super::motion::Collider;
use super::source::Source;
use super::vector::Vector;

/// A complete scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Scene {
    /// Where the JSON Schema is, for editors; nothing depends on it, and by default there is none.
    #[serde(rename = "$schema", default, skip_serializing_if = "Option::is_none")]
    pub schema: Option<String>,
    /// Version of the scene format; 1.
    pub gridfall: u32,
    /// What the scene, and by default its jobs, are called.
    pub name: String,
    /// One line on what to look for in the result; empty by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub description: Option<String>,
    /// 2 (plane strain) or 3.
    #[serde(default = "default_dimension")]
    pub dimension: u32,
    /// Where it takes place, and on what grid.
    pub domain: Domain,
    /// Gravitational acceleration (m/s²); defaults to zero.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gravity: Option<Vector>,
    /// Materials by name; those that stand in bodies get the names of these. By default only those are there.
    pub materials: BTreeMap<String, SceneMaterial>,
    /// What moves by its own laws.
    pub bodies: Vec<Body>,
    /// What the run begins with: the last state of another run; by default, the bodies' first state.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub start: Option<Start>,
    /// Shapes that emit material.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub sources: Vec<Source>,
    /// Rigid obstacles.
    #[serde(default)]
    pub colliders: Vec<Collider>,
    /// How long it lasts, and how often it is recorded.
    pub time: Time,
    /// How it is computed.
    #[serde(default)]
    pub solver: Solver,
    /// What is recorded.
    #[serde(default)]
    pub output: Output,
    /// Of everything that is drawn at random; the same seed gives the same run.
    #[serde(default = "default_seed")]
    pub seed: u64,
    /// Where materials were written that have moved; for messages only.
    #[serde(skip)]
    pub homes: Homes,
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
    /// Upper corner (m), a whole number of `dx` from `min` on every axis, or see `fit`.
    pub max: Vector,
    /// Grid spacing (m).
    pub dx: f64,
    /// What becomes of an axis that is not a whole number of cells.
    #[serde(default, skip_serializing_if = "DomainFit::is_default")]
    pub fit: DomainFit,
    /// Walls by name: `x-`, `x+`, `y-`, … for one wall, `x`, `y`, `z` for both walls of an axis.
    /// A wall that is not named is sticky.
    #[serde(default)]
    pub boundary: BTreeMap<String, Boundary>,
}

/// What becomes of an axis that is not a whole number of cells.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum DomainFit {
    /// Its upper wall moves outward by less than a cell, with a notice. Periodic axes are refused.
    #[default]
    Grow,
    /// It is refused.
    Exact,
}

impl DomainFit {
    fn is_default(&self) -> bool {
        *self == Self::default()
    }
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

/// What a wall does.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct WallContact {
    /// What the wall does to material that meets it.
    pub contact: ContactKind,
    /// Coulomb friction coefficient; for `separate` only.
    #[serde(default)]
    pub friction: f64,
}

/// How long a scene lasts, and how often it is recorded.
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

/// How a scene is computed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Solver {
    /// How steps are taken in time.
    pub integrator: Integrator,
    /// How far particles and nodes reach each other.
    pub kernel: Kernel,
    /// How velocities go from particles to the grid and back.
    pub transfer: Transfer,
    /// Where colliders act on the material, in explicit runs.
    pub contact: ContactAt,
    /// A particle may move at most this share of dx in a step.
    pub cfl: f64,
    /// Upper bound on the step (s); none by default.
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
            contact: ContactAt::default(),
            cfl: 0.5,
            max_dt: None,
            precision: Precision::F32,
            implicit: Implicit::default(),
        }
    }
}

/// What a run records.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Output {
    /// Scalar and vector fields recorded with each point, beside position and colour.
    pub fields: Vec<OutputField>,
    /// Points recorded per frame at most; more are decimated evenly.
    pub preview_points: u32,
    /// Whether the run leaves its last state, for another run to `start` with.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub state: bool,
}

impl Default for Output {
    fn default() -> Self {
        Self { fields: vec![OutputField::Velocity], preview_points: 200_000, state: false }
    }
}

/// The last state of a run with `output.state`: an npz of all particles. The bodies of this scene must make as many
/// particles as they did in that run; materials, colliders, gravity and times may be others. Time begins at 0. Give
/// one of `asset` and `file`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "StartState")]
pub struct Start {
    /// Id of an asset that was uploaded to the server: `sha256:` and 64 hexadecimal digits.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub asset: Option<String>,
    /// Path of a file, relative to the scene's; on the command line only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub file: Option<String>,
}
