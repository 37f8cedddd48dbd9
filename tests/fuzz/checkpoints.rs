//! Checkpoints with right hashes and wrong contents, restored into engines of the CPU.

use std::path::Path;

use gridfall_core::sim::setup::Problem;
use gridfall_engine::choice::{Choice, Devices};
use gridfall_engine::{Engine, NoControl};
use gridfall_recording::checkpoint::{Checkpoint, Draft, Reached, list};
use gridfall_scene::{self as scene, Limits};
use serde_json::{Value, json};
use sha2::{Digest, Sha256};

use super::campaign;

const HASH_BYTES: usize = 32;

/// Small problems of every kind of state: solids and fluids, contact that particles remember, sources, both precisions.
fn problems() -> Vec<Problem> {
    let problem = |dimension: usize, solver: Value, poured: bool| {
        let vector = |x: f64| vec![x; dimension];
        let cube = |min: f64, max: f64| json!({ "box": { "min": vector(min), "max": vector(max) } });
        let mut velocity = vector(0.0);
        velocity[0] = 1.0;
        let source = json!({ "name": "s", "material": "water", "velocity": velocity, "until": 0.1,
            "shape": cube(0.6, 0.7) });
        let mut document = json!({
            "gridfall": 1, "name": "small", "dimension": dimension,
            "domain": { "min": vector(0.0), "max": vector(1.0), "dx": 0.125 },
            "materials": {
                "m": { "model": "neo-hookean", "density": 1000, "youngs_modulus": 1e4, "poissons_ratio": 0.3 },
                "water": { "model": "weakly-compressible-fluid", "density": 1000, "bulk_modulus": 5e3 },
            },
            "bodies": [
                { "name": "a", "material": "m", "shape": cube(0.15, 0.3) },
                { "name": "b", "material": "water", "shape": cube(0.4, 0.5) },
            ],
            "sources": if poured { json!([source]) } else { json!([]) },
            "colliders": [{ "name": "c", "contact": "separate", "friction": 0.3, "shape": cube(0.05, 0.16) }],
            "solver": solver, "time": { "end": 0.2, "frame_rate": 50 },
        });
        if document["solver"]["integrator"] == "implicit" {
            // Fluids run explicitly only.
            document["materials"].as_object_mut().expect("an object").remove("water");
            document["bodies"][1]["material"] = "m".into();
        }
        let scene = scene::from_value(&document).unwrap_or_else(|faults| panic!("{faults:#?}"));
        scene::problem(&scene, &Limits::default()).unwrap_or_else(|faults| panic!("{faults:#?}"))
    };
    vec![
        problem(2, json!({ "integrator": "explicit" }), true),
        problem(2, json!({ "integrator": "explicit", "precision": "f64", "contact": "particles" }), false),
        problem(3, json!({ "integrator": "explicit" }), false),
        problem(2, json!({ "integrator": "implicit" }), false),
        problem(3, json!({ "integrator": "implicit", "contact": "particles" }), false),
    ]
}

fn engine(problem: &Problem) -> Box<dyn Engine> {
    let devices = Devices::open(Choice::Cpu, None).expect("there is a processor");
    devices.engine(&problem.setup, problem.particles.clone()).unwrap_or_else(|error| panic!("{error}"))
}

/// A checkpoint after a frame, without its hash, behind the number of its problem.
fn written(n: usize, problem: &Problem, dir: &Path) -> Vec<u8> {
    let mut engine = engine(problem);
    engine.advance_frame(problem.setup.frame_s, &NoControl).unwrap_or_else(|error| panic!("{error}"));
    let dir = dir.join(n.to_string());
    let reached = Reached { frame: 1, steps: 4, lengths: [1000, 100, 10] };
    Draft::write(&dir, 1, &mut *engine).unwrap().complete("scene a, gridfall b, cpu c", &reached).unwrap();
    let mut bytes = std::fs::read(&list(&dir).unwrap()[0]).unwrap();
    bytes.truncate(bytes.len() - HASH_BYTES);
    bytes.insert(0, n as u8);
    bytes
}

#[test]
fn checkpoint() {
    let dir = tempfile::tempdir().unwrap();
    let problems = problems();
    let corpus = problems.iter().enumerate().map(|(n, problem)| written(n, problem, dir.path())).collect();
    let path = dir.path().join("0000000001.checkpoint");
    campaign::run("checkpoint", corpus, |input| {
        let Some((&n, bytes)) = input.split_first() else { return String::new() };
        let mut hash = Sha256::digest(bytes);
        // The highest bit makes it wrong.
        hash[0] ^= n >> 7;
        std::fs::write(&path, [bytes, &hash].concat()).unwrap();
        let checkpoint = match Checkpoint::open(&path) {
            Ok(checkpoint) => checkpoint,
            Err(error) => return error.to_string(),
        };
        let _ = checkpoint.agrees("scene a");
        let problem = &problems[n as usize % problems.len()];
        let mut engine = engine(problem);
        match checkpoint.restore(&mut *engine) {
            Ok(()) => {
                let particles = engine.snapshot().unwrap_or_else(|error| panic!("{error}"));
                assert!(particles.len() <= problem.setup.total_particles());
                format!("{n} restored")
            }
            Err(error) => format!("{n} {error}"),
        }
    });
}
