//! Scenes: the versioned JSON that users write, its faults, and its way to a
//! [`gridfall_core::sim::setup::Problem`].
//!
//! A document passes through `document` (syntax), `overrides`, `presets` (materials made whole),
//! `structure` (types and fields), `fit` (whole cells), `resolve` (files, sampled shapes), `validate`
//! (meaning) and `build` (sampling). What `resolve` finds stays beside the document, in a table. A
//! module uses only those before it in this list:
//!
//! ```text
//! names, schema, fault, limits, suggest, vectors, memory
//! document, overrides, size, spelling                JSON
//! structure, presets                                 JSON to a scene
//! mesh, npz, points, state, assets                   files
//! sampling, grid, shape                              lattices, streams, signed distances
//! fit
//! resolve
//! validate, build
//! contract, estimate
//! ```

pub mod assets;
mod build;
pub mod contract;
mod document;
pub mod estimate;
mod fault;
mod fit;
mod grid;
mod limits;
mod memory;
mod mesh;
mod names;
mod npz;
mod overrides;
mod points;
pub mod presets;
pub mod prose;
mod resolve;
mod sampling;
pub mod schema;
mod shape;
mod size;
mod spelling;
mod state;
mod structure;
mod suggest;
mod validate;
mod vectors;

pub use fault::Fault;
pub use limits::Limits;
pub use names::{hidden, shown};
pub use schema::{Scene, SceneMaterial};

use gridfall_core::sim::cost;
use gridfall_core::sim::setup::{Integrator, Problem};
use serde_json::{Value, json};

use assets::{Assets, NoAssets};
use fault::Faults;
use fit::fit;
use resolve::Resolved;

/// Reads a scene: syntax and structure. When the structure is at fault, the meaning of the rest is
/// judged as well (under the default limits), so that all faults are reported at once.
pub fn parse(json: &str) -> Result<Scene, Vec<Fault>> {
    read(&mut document::read(json)?)
}

/// [`parse`] with `path=value` overrides (`solver.kernel=quadratic`) applied first.
pub fn parse_with(json: &str, overrides: &[String]) -> Result<Scene, Vec<Fault>> {
    from_value_with(&mut document::read(json)?, overrides)
}

/// [`parse`] for a document that is a JSON value already.
pub fn from_value(document: &Value) -> Result<Scene, Vec<Fault>> {
    read(&mut document.clone())
}

/// [`from_value`] with `path=value` overrides applied first. The document is left as it is stored:
/// with these, and with all parameters of materials that came from presets.
pub fn from_value_with(document: &mut Value, overrides: &[String]) -> Result<Scene, Vec<Fault>> {
    overrides::apply(document, overrides)?;
    read(document)
}

/// Makes the document's materials whole and takes it for a scene.
fn read(document: &mut Value) -> Result<Scene, Vec<Fault>> {
    let mut faults = Faults::default();
    size::check(document, &mut faults);
    if !faults.is_empty() {
        return Err(faults.into_vec());
    }
    let homes = presets::expand(document, &mut faults);
    let repaired = structure::check(document, &mut faults);
    let scene = match serde_json::from_value(repaired) {
        Ok(scene) => Scene { homes, ..scene },
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
    validate::check(&fit(&scene).0, &Resolved::default(), &Limits::default(), &mut faults);
    Err(as_written(&scene, faults.into_vec()))
}

/// Reads a material as it would stand in a scene, a preset or one with a model, after `field=value`
/// overrides. Faults have pointers in the material.
pub fn material(document: &Value, overrides: &[String]) -> Result<SceneMaterial, Vec<Fault>> {
    const AT: &str = "/materials/material";
    // The smallest scene there is.
    let mut scene = json!({
        "gridfall": 1, "name": "material", "domain": { "min": [0, 0, 0], "max": [4, 4, 4], "dx": 1 },
        "materials": { "material": document },
        "bodies": [{ "name": "element", "material": "material",
                     "shape": { "box": { "min": [1, 1, 1], "max": [2, 2, 2] } } }],
        "time": { "end": 1, "frame_rate": 1 },
    });
    let overrides: Vec<String> =
        overrides.iter().map(|change| format!("{AT}/{}", change.trim_start().trim_start_matches('/'))).collect();
    let judged = from_value_with(&mut scene, &overrides).and_then(|mut scene| {
        check(&scene, &Limits::default())?;
        Ok(scene.materials.remove("material").expect("it was there"))
    });
    judged.map_err(|mut faults| {
        for fault in &mut faults {
            fault.pointer = fault.pointer.strip_prefix(AT).unwrap_or(&fault.pointer).to_owned();
            fault.reason = fault.reason.replace(&format!("{AT}/"), "");
        }
        faults
    })
}

/// Faults with the pointers of the document as it was written.
fn as_written(scene: &Scene, mut faults: Vec<Fault>) -> Vec<Fault> {
    faults.iter_mut().for_each(|fault| fault.pointer = scene.homes.of(&fault.pointer));
    faults
}

/// Judges what a scene that names no files means, as far as possible without making particles: all
/// but the number of steps.
pub fn check(scene: &Scene, limits: &Limits) -> Result<(), Vec<Fault>> {
    judge(&fit(scene).0, limits, &NoAssets).map(drop).map_err(|faults| as_written(scene, faults))
}

/// What a scene of whole cells resolves to, if it has no fault that shows before particles are made.
fn judge(scene: &Scene, limits: &Limits, assets: &dyn Assets) -> Result<Resolved, Vec<Fault>> {
    let mut faults = Faults::default();
    let resolved = resolve::resolve(scene, limits, assets, &mut faults);
    validate::check(scene, &resolved, limits, &mut faults);
    if faults.is_empty() { Ok(resolved) } else { Err(faults.into_vec()) }
}

/// [`problem_with`] for a scene that names no files.
pub fn problem(scene: &Scene, limits: &Limits) -> Result<Problem, Vec<Fault>> {
    problem_with(scene, limits, &NoAssets)
}

/// Judges what a scene means and makes it ready to run, with `assets` for the files that it names.
/// Nothing is allocated before particles and memory are known to be within the limits.
pub fn problem_with(scene: &Scene, limits: &Limits, assets: &dyn Assets) -> Result<Problem, Vec<Fault>> {
    // On a thread of the pool. From outside, each small parallel loop, of which every body has some,
    // would wait for a hand-over to it: most of the time of scenes of many bodies.
    let mut problem = rayon::scope(|_| make(scene, limits, assets)).map_err(|faults| as_written(scene, faults))?;
    problem.setup.notices.extend(presets::notices(scene));
    problem.setup.notices.iter_mut().for_each(|notice| notice.pointer = scene.homes.of(&notice.pointer));
    Ok(problem)
}

fn make(scene: &Scene, limits: &Limits, assets: &dyn Assets) -> Result<Problem, Vec<Fault>> {
    let (scene, grown) = fit(scene);
    let resolved = judge(&scene, limits, assets)?;
    let mut faults = Faults::default();
    let mut problem = build::build(&scene, &resolved);
    problem.setup.notices.extend(grown);
    if let Some(start) = resolved.start
        && let Err(reason) = build::begin_with(&mut problem, start, scene.solver.integrator)
    {
        let remedy = "give the scene the bodies of that run, with the same shapes, dx, sampling and seed; \
                      or begin without `start`";
        faults.add("/start", "other_bodies", reason, remedy);
        return Err(faults.into_vec());
    }
    for (n, body) in problem.setup.bodies.iter().take(scene.bodies.len()).enumerate() {
        if body.particles.is_empty() {
            let at = format!("/bodies/{n}/shape");
            faults.add(&at, "no_particles", "no random point fell into the shape", "make the shape larger or lower dx");
        }
    }
    if problem.setup.integrator == Integrator::Implicit
        && let Some(reason) = cost::too_fast_for_implicit(&problem.setup, &problem.particles)
    {
        faults.add("/solver/integrator", "too_fast", reason, "write `explicit`, lower the speeds, or raise dx");
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
