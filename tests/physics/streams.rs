//! Sources: a stream emits the right amount, in time and without gaps.

use crate::problems::{mass, momentum};
use gridfall_core::sim::particles::Particles;
use gridfall_core::sim::setup::Problem;
use gridfall_engine::explicit::cpu::CpuEngine;
use gridfall_engine::{Engine, NoControl};
use gridfall_scene::estimate::estimate;
use gridfall_scene::{self as scene, Limits};

/// Two streams, one through a box from the start and one through a ball later, with a block on the
/// floor below the second.
fn pouring(precision: &str, gravity: f64, bodies: &str) -> Problem {
    let json = format!(
        r#"{{ "gridfall": 1, "name": "pouring", "domain": {{ "min": [0, 0, 0], "max": [1, 0.5, 1], "dx": 0.0625 }},
        "gravity": [0, 0, -{gravity}],
        "materials": {{ "water": {{ "model": "weakly-compressible-fluid", "density": 1000, "bulk_modulus": 1e4 }},
                        "sand": {{ "model": "drucker-prager", "density": 1600, "youngs_modulus": 1e5,
                                   "poissons_ratio": 0.3, "friction_angle_degrees": 30 }} }},
        "bodies": [ {bodies} ],
        "sources": [
            {{ "name": "tap", "material": "water", "velocity": [0, 0, -1], "until": 0.25,
               "shape": {{ "box": {{ "min": [0.1875, 0.1875, 0.75], "max": [0.3125, 0.3125, 0.8125] }} }} }},
            {{ "name": "hopper", "material": "sand", "velocity": [0.3, 0, -0.8], "from": 0.1, "until": 0.3,
               "shape": {{ "sphere": {{ "center": [0.7, 0.25, 0.7], "radius": 0.1 }} }} }} ],
        "time": {{ "end": 0.4, "frame_rate": 20 }}, "solver": {{ "precision": "{precision}" }} }}"#
    );
    let scene = scene::parse(&json).unwrap_or_else(|faults| panic!("{faults:#?}"));
    scene::problem(&scene, &Limits::default()).unwrap_or_else(|faults| panic!("{faults:#?}"))
}

/// The states of all frames.
fn run(problem: &Problem) -> Vec<Particles> {
    let mut engine = CpuEngine::new(&problem.setup, problem.particles.clone()).unwrap();
    let frame = |frame: u32| {
        gridfall_recording::run::advance(&problem.setup, &mut engine, frame, &NoControl).unwrap();
        engine.snapshot().unwrap()
    };
    (0..problem.setup.frames).map(frame).collect()
}

#[test]
fn a_stream_brings_what_was_promised_in_free_flight() {
    let problem = pouring("f64", 0.0, "");
    let frames = run(&problem);
    let last = frames.last().unwrap();
    assert_eq!(last.len() as u64, estimate(&problem).particles);
    assert_eq!(last.len(), problem.setup.total_particles());
    // Through 0.125 m × 0.125 m at 1 m/s for 0.25 s.
    let of_tap = |p: &Particles| (0..p.len()).filter(|&i| p.body[i] == 0).map(|i| mass(&problem, p, i)).sum::<f64>();
    for (n, p) in frames.iter().enumerate() {
        let t = (f64::from(n as u32 + 1) * problem.setup.frame_s).min(0.25);
        let expected = 1000.0 * 0.125 * 0.125 * t;
        let layer = 1000.0 * 0.125 * 0.125 * 0.03125;
        assert!((of_tap(p) - expected).abs() < 0.51 * layer, "{} kg after {t} s, expected {expected}", of_tap(p));
    }
    assert!((of_tap(last) - 3.90625).abs() < 1e-9, "{}", of_tap(last));
    // Streams keep their velocity and their lattice.
    let expected = [(0, [0.0, 0.0, -1.0]), (1, [0.3, 0.0, -0.8])];
    for i in 0..last.len() {
        let (_, v) = expected[last.body[i] as usize];
        assert!((0..3).all(|a| (last.v[i][a] - v[a]).abs() < 1e-9), "{:?}", last.v[i]);
    }
}

#[test]
fn streams_are_the_same_in_every_run_and_fall_on_what_is_there() {
    let block =
        r#"{ "name": "pool", "material": "water", "shape": { "box": { "min": [0, 0, 0], "max": [1, 0.5, 0.125] } } }"#;
    let problem = pouring("f32", 9.81, block);
    let (first, second) = (run(&problem), run(&problem));
    assert_eq!(first, second);
    let last = first.last().unwrap();
    assert_eq!(last.len(), problem.setup.total_particles());
    let there = problem.particles.len();
    assert!(last.body[..there].iter().all(|&body| body == 0) && last.body[there..].iter().all(|&body| body > 0));
    assert!(last.x.iter().flatten().all(|x| x.is_finite()) && momentum(&problem, last)[2] < 0.0);
}
