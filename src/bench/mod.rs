//! Benchmarks: named cases of any size, their measurement on one engine, and comparison with earlier
//! measurements; and the methods of the implicit integrator side by side.

pub mod amount;
pub mod cases;
pub mod compare;
pub mod implicit;
mod machine;
mod measure;
mod row;

pub use machine::copy_bandwidth;
pub use measure::measure;
pub use row::{Row, Spread, Stage};

use serde::Serialize;

use gridfall_core::sim::setup::Problem;
use gridfall_engine::{EngineError, StateError};
use gridfall_scene::{self as scene, Fault};

/// What can go wrong: the user's scene, or the device.
#[derive(Debug, thiserror::Error)]
pub enum BenchError {
    #[error("the scene has faults")]
    Faults(Vec<Fault>),
    #[error(transparent)]
    Engine(#[from] EngineError),
}

impl From<StateError> for BenchError {
    fn from(error: StateError) -> Self {
        match error {
            StateError::Engine(error) => Self::Engine(error),
            StateError::Io(error) => unreachable!("states are kept in memory, of an engine's own: {error}"),
        }
    }
}

/// The problem of a scene document.
pub fn problem(json: &str) -> Result<Problem, BenchError> {
    let scene = scene::parse(json).map_err(BenchError::Faults)?;
    scene::problem(&scene, &scene::Limits::default()).map_err(BenchError::Faults)
}

/// The spelling of a value in scenes.
pub fn spelled(value: &impl Serialize) -> String {
    serde_json::to_value(value).ok().and_then(|value| value.as_str().map(str::to_owned)).unwrap_or_default()
}
