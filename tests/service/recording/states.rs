//! The last state of a run, and runs that begin with it; scenes that recordings carry.

use std::path::Path;

use gridfall_core::sim::particles::Particles;
use gridfall_core::sim::setup::Problem;
use gridfall_engine::Control;
use gridfall_engine::choice::{Choice, Devices};
use gridfall_recording::embedded;
use gridfall_recording::run::{Observer, Summary};
use gridfall_scene::assets::LocalFiles;
use gridfall_scene::{self as scene, Fault, Limits};
use serde_json::{Value, json};

use super::fixture::{outputs, run};

struct Quiet;
impl Control for Quiet {}
impl Observer for Quiet {}

/// Jelly, sand and water, each falling on a floor of its own; metal that yields, in implicit steps.
fn scenes() -> Vec<Value> {
    let body = |material: Value, solver: Value| {
        json!({
            "gridfall": 1, "name": "falls", "dimension": 2,
            "domain": { "min": [0, 0], "max": [1, 1], "dx": 0.0625 },
            "gravity": [0, -9.81], "materials": { "m": material },
            "bodies": [ { "name": "b", "material": "m", "velocity": [0.3, -1], "angular_velocity": [2],
                          "shape": { "box": { "min": [0.3, 0.1], "max": [0.6, 0.5] } } } ],
            "time": { "end": 0.4, "frame_rate": 50 }, "solver": solver, "output": { "state": true }
        })
    };
    let explicit = json!({ "precision": "f64" });
    vec![
        body(
            json!({ "model": "neo-hookean", "density": 1000, "youngs_modulus": 2e4, "poissons_ratio": 0.3 }),
            explicit.clone(),
        ),
        body(
            json!({ "model": "drucker-prager", "density": 1500, "youngs_modulus": 1e5, "poissons_ratio": 0.3,
                    "friction_angle_degrees": 30 }),
            explicit.clone(),
        ),
        body(json!({ "model": "weakly-compressible-fluid", "density": 1000, "bulk_modulus": 2e4 }), explicit),
        body(
            json!({ "model": "von-mises", "density": 1000, "youngs_modulus": 1e6, "poissons_ratio": 0.3,
                    "yield_stress": 1e4 }),
            json!({ "integrator": "implicit", "max_dt": 0.01 }),
        ),
    ]
}

fn load(document: &Value, folder: &Path) -> Result<Problem, Vec<Fault>> {
    let files = LocalFiles { folder: folder.to_owned() };
    scene::problem_with(&scene::from_value(document)?, &Limits::default(), &files)
}

/// Runs a scene on the CPU. Returns its last state, which lies as `state.npz` in the folder.
fn last_state(document: &Value, folder: &Path) -> (Summary, Particles) {
    let problem = load(document, folder).unwrap_or_else(|faults| panic!("{faults:#?}"));
    let devices = Devices::open(Choice::Cpu, None).unwrap();
    let mut engine = devices.engine(&problem.setup, problem.particles.clone()).unwrap();
    let scene = scene::from_value(document).unwrap();
    let summary = run(&scene, &problem, engine.as_mut(), &outputs(folder), &Quiet).unwrap();
    (summary, engine.snapshot().unwrap())
}

fn farthest(a: &Particles, b: &Particles) -> f64 {
    let apart = |(a, b): (&[f64; 3], &[f64; 3])| (0..3).map(|k| (a[k] - b[k]).abs()).fold(0.0, f64::max);
    a.x.iter().zip(&b.x).map(apart).fold(0.0, f64::max)
}

#[test]
fn a_run_that_begins_with_a_state_goes_on_as_the_one_that_left_it() {
    for document in scenes() {
        let dir = tempfile::tempdir().unwrap();
        let (_, whole) = last_state(&document, dir.path());
        let mut half = document.clone();
        half["time"]["end"] = json!(0.2);
        let (_, middle) = last_state(&half, dir.path());
        std::fs::rename(dir.path().join("state.npz"), dir.path().join("middle.npz")).unwrap();
        half["start"] = json!({ "file": "middle.npz" });
        let begun = load(&half, dir.path()).unwrap().particles;
        assert_eq!(
            (&begun.x, &begun.v, &begun.b, &begun.f, &begun.plastic, &begun.body),
            (&middle.x, &middle.v, &middle.b, &middle.f, &middle.plastic, &middle.body),
            "a state comes back to the bit"
        );
        let (_, end) = last_state(&half, dir.path());
        let model = &document["materials"]["m"]["model"];
        let (off, moved) = (farthest(&whole, &end), farthest(&whole, &middle));
        println!("{model}: {off:e} m apart after {moved} m");
        // Implicit steps are solved to a tolerance.
        let allowed = if *model == "von-mises" { 1e-3 * moved } else { 1e-9 };
        assert!(off < allowed && moved > 1e-3, "{model}: {off:e} m apart after {moved} m");
    }
}

#[test]
fn the_next_run_may_have_other_colliders_materials_and_times() {
    let dir = tempfile::tempdir().unwrap();
    let mut document = scenes().remove(0);
    last_state(&document, dir.path());
    std::fs::rename(dir.path().join("state.npz"), dir.path().join("settled.npz")).unwrap();
    document["start"] = json!({ "file": "settled.npz" });
    document["time"] = json!({ "end": 0.1, "frame_rate": 100 });
    document["gravity"] = json!([0, 0]);
    document["materials"]["m"]["youngs_modulus"] = json!(1e4);
    document["colliders"] = json!([{ "name": "lid", "shape": { "box": { "min": [0, 0.9], "max": [1, 1] } },
                                     "contact": "slip" }]);
    let (summary, _) = last_state(&document, dir.path());
    assert_eq!(summary.frames_written, 11);
}

#[test]
fn states_of_other_bodies_and_files_that_are_no_states_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    let document = scenes().remove(0);
    last_state(&document, dir.path());
    let refused = |change: &dyn Fn(&mut Value), at: &str, code: &str, part: &str| {
        let mut document = document.clone();
        document["start"] = json!({ "file": "state.npz" });
        change(&mut document);
        let faults = load(&document, dir.path()).map(drop).unwrap_err();
        let Fault { pointer, code: found, reason, .. } = &faults[0];
        assert!((pointer.as_str(), *found) == (at, code) && reason.contains(part), "{faults:#?}");
    };
    let finer = |document: &mut Value| document["bodies"][0]["particles_per_cell"] = json!(9);
    refused(&finer, "/start", "other_bodies", "particles of the body \"b\"");
    let smaller = |document: &mut Value| {
        document["domain"]["max"] = json!([0.5, 1]);
        document["bodies"][0]["shape"]["box"]["max"] = json!([0.45, 0.5]);
    };
    refused(&smaller, "/start", "outside_domain", "outside the domain");
    let named = |name: &'static str| move |document: &mut Value| document["start"] = json!({ "file": name });
    refused(&named("none.npz"), "/start/file", "file_not_read", "cannot read");
    refused(&named("out.mcap"), "/start/file", "bad_state", "it is no npz");
    std::fs::write(dir.path().join("cut.npz"), &std::fs::read(dir.path().join("state.npz")).unwrap()[..900]).unwrap();
    refused(&named("cut.npz"), "/start/file", "bad_state", "broken");
    refused(&|document| document["start"] = json!({}), "/start", "not_one_source", "missing");
    let both = json!({ "file": "state.npz", "asset": format!("sha256:{}", "0".repeat(64)) });
    refused(&|document| document["start"] = both.clone(), "/start", "not_one_source", "beside");
    let deep = |document: &mut Value| {
        document["dimension"] = json!(3);
        document["domain"] = json!({ "min": [0, 0, 0], "max": [1, 1, 1], "dx": 0.125 });
        document["gravity"] = json!([0, 0, -9.81]);
        document["bodies"][0] = json!({ "name": "b", "material": "m",
            "shape": { "box": { "min": [0.3, 0.1, 0.3], "max": [0.6, 0.5, 0.6] } } });
    };
    refused(&deep, "/start/file", "bad_state", "shape");
}

#[test]
fn a_recording_carries_its_scene_and_the_beginning_is_enough() {
    let dir = tempfile::tempdir().unwrap();
    let document = scenes().remove(0);
    last_state(&document, dir.path());
    let recording = std::fs::read(dir.path().join("out.mcap")).unwrap();
    let scene = scene::from_value(&document).unwrap().to_json();
    assert_eq!(embedded::scene(&recording).unwrap(), scene);
    assert_eq!(embedded::scene(&recording[..scene.len() + 4096]).unwrap(), scene);
    assert!(embedded::scene(&recording[..scene.len()]).unwrap_err().contains("not in these"));
    assert!(embedded::scene(b"{}").unwrap_err().contains("no MCAP"));
    assert!(embedded::is_recording(&recording) && !embedded::is_recording(b"{}"));
}
