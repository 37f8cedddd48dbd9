//! Bodies whose points lie in layers: they rest, fly and bounce like others.

use gridfall_core::sim::diagnostics::Row;
use gridfall_core::sim::particles::Particles;
use gridfall_core::sim::setup::Problem;
use gridfall_core::sim::stats::FrameStats;
use gridfall_engine::explicit::cpu::CpuEngine;
use gridfall_engine::{Engine, NoControl};
use gridfall_scene::{self as scene, Limits};
use serde_json::json;

use crate::problems::*;

const DX: f64 = 0.03125;

/// A disc or a ball in the middle of the domain, above a floor that slips.
fn ball(dimension: usize, kernel: &str, height: f64, velocity: f64, gravity: f64) -> Problem {
    let along = |floor: f64, others: f64| {
        let mut v = vec![others; dimension];
        v[dimension - 1] = floor;
        v
    };
    let document = json!({
        "gridfall": 1, "name": "ball", "dimension": dimension,
        "domain": { "min": vec![0.0; dimension], "max": vec![1.0; dimension], "dx": DX,
                    "boundary": { "x": { "contact": "slip" }, "y": { "contact": "slip" } } },
        "gravity": along(gravity, 0.0),
        "materials": { "m": { "model": "neo-hookean", "density": 1000, "youngs_modulus": 1e5, "poissons_ratio": 0.3 } },
        "bodies": [ { "name": "b", "material": "m", "sampling": "conforming",
                      "velocity": along(velocity, 0.3 * velocity),
                      "angular_velocity": vec![velocity; if dimension == 2 { 1 } else { 3 }],
                      "shape": { "sphere": { "center": along(height, 0.5), "radius": 0.2 } } } ],
        "time": { "end": 1, "frame_rate": 50 },
        "solver": { "kernel": kernel, "precision": "f64", "integrator": "explicit" },
    });
    let mut document = document;
    if dimension == 3 {
        document["domain"]["boundary"]["z"] = json!({ "contact": "slip" });
    }
    let scene = scene::from_value(&document).unwrap_or_else(|faults| panic!("{faults:#?}"));
    scene::problem(&scene, &Limits::default()).unwrap_or_else(|faults| panic!("{faults:#?}"))
}

const CASES: [(usize, &str); 4] = [(2, "compact"), (2, "quadratic"), (3, "compact"), (3, "quadratic")];

#[test]
fn an_unstrained_body_at_rest_stays_at_rest() {
    for (dimension, kernel) in CASES {
        let problem = ball(dimension, kernel, 0.5, 0.0, 0.0);
        let (p, _) = run(&problem, 5);
        assert!(p.x == problem.particles.x && p.v.iter().all(|v| *v == [0.0; 3]), "{dimension}D {kernel}: it moves");
    }
}

#[test]
fn a_body_in_flight_keeps_its_momenta() {
    for (dimension, kernel) in CASES {
        let problem = ball(dimension, kernel, 0.5, 0.5, 0.0);
        let (p, steps) = run(&problem, 5);
        let (before, after) = (momentum(&problem, &problem.particles), momentum(&problem, &p));
        let turning = |p| angular_momentum(&problem, p);
        let (spin, kept) = (turning(&problem.particles), turning(&p));
        let [off, turned] = [norm(minus(before, after)) / norm(before), norm(minus(spin, kept)) / norm(spin)];
        println!("{dimension}D {kernel}: {off:.1e} of the momentum and {turned:.1e} of the spin after {steps} steps");
        assert!(off < 1e-12 && turned < 1e-10, "{dimension}D {kernel}: {off:e}, {turned:e}");
    }
}

#[test]
fn a_body_dropped_on_a_slipping_floor_gains_no_energy() {
    for (dimension, kernel) in CASES {
        let problem = ball(dimension, kernel, 0.22, 0.0, -9.81);
        let setup = &problem.setup;
        let energy = |p: &Particles| {
            let row = Row::measure(setup, p, 0, 0.0, &FrameStats::default());
            row.kinetic_j + row.affine_j + row.strain_j + row.gravity_j
        };
        let mut engine = CpuEngine::new(setup, problem.particles.clone()).unwrap();
        let first = energy(&problem.particles);
        // Half a second: it falls by 2 cm, sags by as much as the fall and its weight ask for, and bounces.
        let mut largest = first;
        for _ in 0..25 {
            engine.advance_frame(setup.frame_s, &NoControl).unwrap();
            largest = energy(&engine.snapshot().unwrap()).max(largest);
        }
        let last = energy(&engine.snapshot().unwrap());
        let fall = 9.81 * 0.02 * setup.bodies[0].mass * problem.particles.len() as f64;
        println!(
            "{dimension}D {kernel}: energy {first:.4} J, at most {largest:.4}, in the end {last:.4}; fall {fall:.4}"
        );
        // Energies at frames are of one time up to the order of the step.
        assert!(largest < first + 1e-3 * fall && last < first, "{dimension}D {kernel}: {first} to {largest} J");
    }
}
