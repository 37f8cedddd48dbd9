//! Scenes: the versioned JSON that users write, its faults, and its way to a [`crate::sim::problem::Problem`].

mod build;
mod fault;
mod sampling;
pub mod schema;
mod solid;

pub use fault::Fault;
pub use schema::Scene;

use crate::sim::problem::Problem;

/// What a scene may ask for at most.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    pub max_particles: u64,
    /// Host memory of one run (bytes).
    pub max_memory_bytes: u64,
}

impl Default for Limits {
    fn default() -> Self {
        Self { max_particles: 200_000_000, max_memory_bytes: 64 << 30 }
    }
}

/// Reads a scene: syntax and structure.
pub fn parse(json: &str) -> Result<Scene, Vec<Fault>> {
    serde_json::from_str(json).map_err(|e| {
        vec![Fault { pointer: String::new(), code: "syntax", reason: e.to_string(), remedy: "correct the JSON".into() }]
    })
}

/// Judges what a scene means and makes it ready to run.
pub fn problem(scene: &Scene, _limits: &Limits) -> Result<Problem, Vec<Fault>> {
    Ok(build::build(scene))
}
