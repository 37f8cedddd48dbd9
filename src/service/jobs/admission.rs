//! From a client's scene to a problem that can run, or all its faults at once.

use serde_json::Value;

use gridfall_core::sim::setup::Problem;
use gridfall_scene::assets::Assets;
use gridfall_scene::{self as scene, Fault, Limits, Scene};

/// A scene that was found valid.
pub struct Admitted {
    /// The document with overrides applied.
    pub document: String,
    pub scene: Scene,
    pub problem: Problem,
}

/// Applies `overrides` (each `path=value`) to a scene document and checks the result.
pub fn admit(
    mut document: Value,
    overrides: &[String],
    limits: &Limits,
    assets: &dyn Assets,
) -> Result<Admitted, Vec<Fault>> {
    let scene = scene::from_value_with(&mut document, overrides)?;
    let problem = scene::problem_with(&scene, limits, assets)?;
    Ok(Admitted { document: document.to_string(), scene, problem })
}
