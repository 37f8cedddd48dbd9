//! Scenes: the versioned JSON that users write, its faults, and its way to a [`gridfall_core::sim::setup::Problem`].
//!
//! A document passes through `document` (syntax), `structure` (types and fields), `resolve` (files, sampled shapes), `validate`
//! (meaning) and `build` (sampling).

pub mod assets;
mod build;
mod document;
pub mod estimate;
mod fault;
mod mesh;
pub mod overrides;
pub mod points;
mod resolve;
mod sampling;
pub mod schema;
mod structure;
mod suggest;
mod validate;

pub use fault::Fault;
pub use schema::Scene;

use serde_json::Value;

use assets::{Assets, NoAssets};
use fault::Faults;
use gridfall_core::sim::cost;
use gridfall_core::sim::setup::Problem;

/// What a scene may ask for at most.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    pub max_particles: u64,
    /// Host memory of one run (bytes).
    pub max_memory_bytes: u64,
    /// Steps of the whole run.
    pub max_steps: u64,
}

impl Default for Limits {
    /// As many particles and as much memory as this machine can hold, and steps for some weeks of its time.
    fn default() -> Self {
        Self { max_particles: 1 << 30, max_memory_bytes: host_memory_bytes() / 10 * 9, max_steps: 1_000_000_000 }
    }
}

/// Memory of this machine (bytes); 8 GiB where it cannot be told.
fn host_memory_bytes() -> u64 {
    let total = |text: String| -> Option<u64> {
        let line = text.lines().find(|line| line.starts_with("MemTotal:"))?;
        line.split_whitespace().nth(1)?.parse::<u64>().ok().map(|kib| kib << 10)
    };
    std::fs::read_to_string("/proc/meminfo").ok().and_then(total).unwrap_or(8 << 30)
}

/// Reads a scene: syntax and structure. When the structure is at fault, the meaning of the rest is judged as well (under the
/// default limits), so that the faults are all there.
pub fn parse(json: &str) -> Result<Scene, Vec<Fault>> {
    from_value(&document::read(json)?)
}

/// [`parse`] with `path=value` overrides (see [`overrides::apply`]) applied first.
pub fn parse_with(json: &str, sets: &[String]) -> Result<Scene, Vec<Fault>> {
    let mut document = document::read(json)?;
    let refused: Vec<Fault> = sets.iter().filter_map(|set| overrides::apply(&mut document, set).err()).collect();
    if refused.is_empty() { from_value(&document) } else { Err(refused) }
}

/// [`parse`] for a document that is a JSON value already.
pub fn from_value(document: &Value) -> Result<Scene, Vec<Fault>> {
    let mut faults = Faults::default();
    let repaired = structure::check(document, &mut faults);
    let scene: Scene = match serde_json::from_value(repaired) {
        Ok(scene) => scene,
        Err(e) => {
            faults.add(
                "",
                "structure",
                e.to_string(),
                "compare the document with the JSON Schema (`gridfall schema scene`)",
            );
            return Err(faults.into_vec());
        }
    };
    if faults.is_empty() {
        return Ok(scene);
    }
    validate::check(&scene, &Limits::default(), &mut faults);
    Err(faults.into_vec())
}

/// Judges what a scene that names no files means, as far as that can be told without making particles: all but the number of steps.
pub fn check(scene: &Scene, limits: &Limits) -> Result<(), Vec<Fault>> {
    resolved(scene, limits, &NoAssets).map(drop)
}

/// The scene with its files read and its shapes sampled, if it has no fault that can be told without making particles.
fn resolved(scene: &Scene, limits: &Limits, assets: &dyn Assets) -> Result<Scene, Vec<Fault>> {
    let mut faults = Faults::default();
    let scene = resolve::resolve(scene, limits, assets, &mut faults);
    validate::check(&scene, limits, &mut faults);
    if faults.is_empty() { Ok(scene) } else { Err(faults.into_vec()) }
}

/// [`problem_with`] for a scene that names no files.
pub fn problem(scene: &Scene, limits: &Limits) -> Result<Problem, Vec<Fault>> {
    problem_with(scene, limits, &NoAssets)
}

/// Judges what a scene means and makes it ready to run, with `assets` for the files that it names. Nothing is allocated before
/// particles and memory are known to be in the limits.
pub fn problem_with(scene: &Scene, limits: &Limits, assets: &dyn Assets) -> Result<Problem, Vec<Fault>> {
    let scene = resolved(scene, limits, assets)?;
    let mut faults = Faults::default();
    let problem = build::build(&scene);
    for (n, body) in problem.setup.bodies.iter().take(scene.bodies.len()).enumerate() {
        if body.particles.is_empty() {
            let at = format!("/bodies/{n}/shape");
            faults.add(&at, "no_particles", "no random point fell into the shape", "make the shape larger or lower dx");
        }
    }
    let cost::Prediction { plan, steps, .. } = cost::chosen(&problem.setup, &problem.particles);
    if steps > limits.max_steps {
        let reason = format!("the run takes {steps} steps of {:.2e} s; the limit is {}", plan.dt_s, limits.max_steps);
        let remedy =
            format!("end earlier, or lengthen the step, which is set by {}", plan.bound.explain(&problem.setup));
        faults.add("/time/end", "too_many_steps", reason, remedy);
    }
    if faults.is_empty() { Ok(problem) } else { Err(faults.into_vec()) }
}
