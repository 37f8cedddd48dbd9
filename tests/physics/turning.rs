//! Implicit steps of stiff bodies at the default settings: they turn as far as at ever smaller
//! tolerances, metal yields within a step, and a step that does not converge is never silent.

use crate::prescribed::problem;
use gridfall_core::sim::particles::Particles;
use gridfall_core::sim::setup::{Plasticity, Problem};
use gridfall_engine::implicit::ImplicitEngine;
use gridfall_engine::{Engine, EngineError, FrameStats, NoControl};

/// A stiff part between two soft ones, held below and turned above once a second.
fn bar(kernel: &str, middle: f64) -> Problem {
    let soft = r#""model": "fixed-corotated", "density": 2000, "poissons_ratio": 0.3, "youngs_modulus""#;
    let shape = |from: f64, to: f64| format!(r#""box": {{ "min": [0.2, 0.2, {from}], "max": [0.32, 0.32, {to}] }}"#);
    let grip = |from: f64, to: f64| format!(r#""box": {{ "min": [0.1, 0.1, {from}], "max": [0.4, 0.4, {to}] }}"#);
    problem(&format!(
        r#"{{ "gridfall": 1, "name": "bar", "domain": {{ "min": [0, 0, -0.16], "max": [0.52, 0.52, 0.8], "dx": 0.04 }},
        "materials": {{ "soft": {{ {soft}: 1e5 }}, "stiff": {{ {soft}: {middle} }} }},
        "bodies": [
            {{ "name": "below", "material": "soft", "shape": {{ {} }}, "grips": [ {{ "name": "held",
                "shape": {{ {} }} }} ] }},
            {{ "name": "middle", "material": "stiff", "shape": {{ {} }} }},
            {{ "name": "above", "material": "soft", "shape": {{ {} }}, "grips": [ {{ "name": "turned",
                "motion": {{ "angular_velocity": [0, 0, 6.283] }}, "shape": {{ {} }} }} ] }} ],
        "time": {{ "end": 1, "frame_rate": 48 }},
        "solver": {{ "kernel": "{kernel}", "integrator": "implicit", "cfl": 1 }} }}"#,
        shape(0.0, 0.2),
        grip(-0.1, 0.06),
        shape(0.2, 0.4),
        shape(0.4, 0.6),
        grip(0.54, 0.7),
    ))
}

fn run(problem: &Problem, frames: u32) -> (Particles, Vec<FrameStats>) {
    let mut engine = ImplicitEngine::new(&problem.setup, problem.particles.clone()).unwrap();
    let mut frame = |_| engine.advance_frame(problem.setup.frame_s, &NoControl).unwrap_or_else(|e| panic!("{e}"));
    let stats = (0..frames).map(&mut frame).collect();
    (engine.snapshot().unwrap(), stats)
}

/// How far the middle of the bar has turned (degrees).
fn angle(problem: &Problem, now: &Particles) -> f64 {
    let (mut sin, mut cos) = (0.0, 0.0);
    for p in problem.setup.bodies[1].particles.clone() {
        let [a, b] = [problem.particles.x[p], now.x[p]].map(|x| [x[0] - 0.26, x[1] - 0.26]);
        sin += a[0] * b[1] - a[1] * b[0];
        cos += a[0] * b[0] + a[1] * b[1];
    }
    sin.atan2(cos).to_degrees()
}

#[test]
fn a_stiff_part_turns_as_its_soft_neighbours_twist_it() {
    for kernel in ["quadratic", "compact"] {
        for middle in [1e7, 1e9] {
            let mut problem = bar(kernel, middle);
            let (now, stats) = run(&problem, 8);
            let (got, most) = (angle(&problem, &now), stats.iter().map(|s| s.solves[0].iterations).max().unwrap());
            problem.setup.implicit.tolerance = Some(1e-6);
            let right = angle(&problem, &run(&problem, 8).0);
            println!("{kernel} {middle:.0e} Pa: {got:.2} of {right:.2}°, at most {most} iterations");
            assert!((got / right - 1.0).abs() < 0.02 && right > 5.0 && most <= 4);
        }
    }
}

/// A bar in plane strain that is pulled to twice its yield strain, in ten steps.
#[test]
fn metal_yields_within_a_step() {
    let mut problem = problem(
        r#"{ "gridfall": 1, "name": "pull", "dimension": 2,
        "domain": { "min": [0, 0], "max": [0.4, 0.8], "dx": 0.025 },
        "materials": { "m": { "model": "von-mises", "density": 2000, "youngs_modulus": 1e8, "poissons_ratio": 0.3,
            "yield_stress": 1e6 } },
        "bodies": [ { "name": "b", "material": "m", "particles_per_cell": 9,
            "shape": { "box": { "min": [0.15, 0.2], "max": [0.25, 0.6] } }, "grips": [
            { "name": "low", "shape": { "box": { "min": [0.1, 0.1], "max": [0.3, 0.25] } } },
            { "name": "high", "shape": { "box": { "min": [0.1, 0.55], "max": [0.3, 0.7] } },
              "motion": { "linear_velocity": [0, 0.2] } } ] } ],
        "time": { "end": 0.1, "frame_rate": 100 },
        "solver": { "kernel": "quadratic", "transfer": "apic", "integrator": "implicit" } }"#,
    );
    let force = |problem: &Problem| {
        let (_, stats) = run(problem, 10);
        stats[9].reactions[7].force[1].abs() / (2.0 / 3.0f64.sqrt() * 1e6 * 0.1)
    };
    let flowing = force(&problem);
    problem.setup.implicit.plasticity = Some(Plasticity::Lagged);
    let lagged = force(&problem);
    println!("{flowing:.3} of the yield force, {lagged:.3} where plasticity is lagged");
    // The section has become thinner by then.
    assert!((flowing / 0.9 - 1.0).abs() < 0.06 && lagged > 1.3);
}

#[test]
fn a_step_that_does_not_converge_is_an_error_in_the_end() {
    let mut problem = bar("quadratic", 1e9);
    problem.setup.implicit.tolerance = Some(1e-14);
    problem.setup.implicit.max_iterations = 1;
    let mut engine = ImplicitEngine::new(&problem.setup, problem.particles.clone()).unwrap();
    match engine.advance_frame(problem.setup.frame_s, &NoControl) {
        Err(EngineError::Diverged { step: 0, what, .. }) => assert!(what.contains("tolerance"), "{what}"),
        other => panic!("{other:?}"),
    }
}
