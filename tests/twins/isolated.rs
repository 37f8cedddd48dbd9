//! A particle that shares no node with another is reset at the frame's end, on both engines;
//! nothing else is, and the step is planned for the stiffness that a deformation brings.

use gridfall_core::sim::diagnostics::Row;
use gridfall_core::sim::particles::Particles;
use gridfall_core::sim::setup::{Precision, Problem};
use gridfall_engine::explicit::cpu::CpuEngine;
use gridfall_engine::{Engine, NoControl};
use gridfall_scene::estimate::estimate;

use crate::common;

/// A lone, stretched, sheared, spinning particle and a block at rest; a pair of particles that hold
/// on to each other by their corners.
fn scene(kernel: &str, model: &str) -> Problem {
    common::problem(&format!(
        r#"{{ "gridfall": 1, "name": "alone", "domain": {{ "min": [0,0,0], "max": [1,1,1], "dx": 0.0625 }},
        "materials": {{ "m": {{ "model": "{model}", "density": 1000, "youngs_modulus": 1e4, "poissons_ratio": 0.3 }} }},
        "bodies": [
            {{ "name": "lone", "material": "m", "particles_per_cell": 1,
                "shape": {{ "box": {{ "min": [0.75,0.75,0.75], "max": [0.8125,0.8125,0.8125] }} }},
               "velocity": [0.3, -0.2, 0.1], "angular_velocity": [1, 2, 3],
                   "deformation_gradient": [[1.1,0.05,0],[0,0.95,0],[0,0,1.02]] }},
            {{ "name": "block", "material": "m", "shape": {{ "box": {{ "min": [0.25,0.25,0.25],
                "max": [0.375,0.375,0.375] }} }} }},
            {{ "name": "pair", "material": "m", "particles_per_cell": 1,
                "deformation_gradient": [[1.01,0,0],[0,1,0],[0,0,1]],
               "shape": {{ "box": {{ "min": [0.625,0.25,0.25], "max": [0.75,0.3125,0.3125] }} }} }} ],
        "time": {{ "end": 0.04, "frame_rate": 50 }}, "solver": {{ "kernel": "{kernel}" }} }}"#
    ))
}

fn identity_error(f: &[f64; 9]) -> f64 {
    f.iter().enumerate().fold(0.0, |m, (k, x)| m.max((x - if k % 4 == 0 { 1.0 } else { 0.0 }).abs()))
}

fn check(problem: &Problem, engine: &mut dyn Engine, tolerance: f64) {
    let before = Row::measure(&problem.setup, &problem.particles, 0, 0.0, &Default::default());
    let stats = engine.advance_frame(problem.setup.frame_s, &NoControl).unwrap();
    let p = engine.snapshot().unwrap();
    assert_eq!(stats.isolated_reset, 1, "{:?}", problem.setup.kernel);
    assert!(identity_error(&p.f[0]) == 0.0, "F = {:?}", p.f[0]);
    let pair = problem.setup.bodies[2].particles.clone();
    assert!(pair.into_iter().all(|i| identity_error(&p.f[i]) > 1e-4), "the pair was reset");
    // Position and momentum go on as if nothing had happened; so does the spin.
    for a in 0..3 {
        let expected = problem.particles.x[0][a] + problem.setup.frame_s * problem.particles.v[0][a];
        assert!((p.x[0][a] - expected).abs() < 1e-6, "x = {:?}", p.x[0]);
    }
    let after = Row::measure(&problem.setup, &p, 1, problem.setup.frame_s, &stats);
    for (name, a, b) in [
        ("px", before.momentum_x, after.momentum_x),
        ("lx", before.angular_momentum_x, after.angular_momentum_x),
        ("ly", before.angular_momentum_y, after.angular_momentum_y),
        ("lz", before.angular_momentum_z, after.angular_momentum_z),
    ] {
        assert!((a - b).abs() < tolerance, "{name}: {a} then {b}");
    }
}

#[test]
fn a_lone_particle_is_reset_on_both_engines() {
    for kernel in ["compact", "quadratic"] {
        for model in ["fixed-corotated", "stvk-hencky"] {
            let problem = scene(kernel, model);
            check(&problem, &mut common::gpu_engine(&problem), 2e-6);
            let mut exact = problem;
            exact.setup.precision = Precision::F64;
            check(&exact, &mut CpuEngine::new(&exact.setup, exact.particles.clone()).unwrap(), 1e-12);
        }
    }
}

/// Water at seven tenths of its volume is fifteen times as stiff as at rest: the plan knows, and
/// the burst stays bounded.
#[test]
fn the_step_follows_the_stiffness_of_the_present_deformation() {
    let problem = |j: f64| {
        common::problem(&format!(
            r#"{{ "gridfall": 1, "name": "burst", "domain": {{ "min": [0,0,0], "max": [1,1,1], "dx": 0.0625 }},
            "materials": {{ "water": {{ "model": "weakly-compressible-fluid", "density": 1000,
                "bulk_modulus": 1e5 }} }},
            "bodies": [ {{ "name": "drop", "material": "water", "J": {j},
                "shape": {{ "sphere": {{ "center": [0.5,0.5,0.5], "radius": 0.2 }} }} }} ],
            "time": {{ "end": 0.02, "frame_rate": 200 }} }}"#
        ))
    };
    let (rest, squeezed) = (estimate(&problem(1.0)), estimate(&problem(0.7)));
    assert_eq!((rest.dt_bound, squeezed.dt_bound), ("single-particle", "deformation"));
    assert!(rest.dt_s > 2.0 * squeezed.dt_s, "{} and {}", rest.dt_s, squeezed.dt_s);
    let problem = problem(0.7);
    let energy = |p: &Particles| {
        let row = Row::measure(&problem.setup, p, 0, 0.0, &Default::default());
        row.kinetic_j + row.affine_j + row.strain_j
    };
    let start = energy(&problem.particles);
    let mut exact = problem.clone();
    exact.setup.precision = Precision::F64;
    let engines: [Box<dyn Engine>; 2] = [
        Box::new(common::gpu_engine(&problem)),
        Box::new(CpuEngine::new(&exact.setup, exact.particles.clone()).unwrap()),
    ];
    for mut engine in engines {
        for _ in 0..problem.setup.frames {
            engine.advance_frame(problem.setup.frame_s, &NoControl).unwrap();
            let now = energy(&engine.snapshot().unwrap());
            assert!(now < 1.05 * start, "{now} J from {start} J on {}", engine.backend().kind);
        }
    }
}
