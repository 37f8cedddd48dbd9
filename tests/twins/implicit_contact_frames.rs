//! Whole frames of implicit steps with contact at the particles: on the GPU as on the CPU.

use gridfall_core::sim::particles::Particles;
use gridfall_core::sim::setup::Problem;
use gridfall_engine::implicit::ImplicitEngine;
use gridfall_engine::{Engine, FrameStats, NoControl};

use crate::common;

const FRAMES: u32 = 3;

/// A body of `youngs_modulus` (Pa) at one collider.
fn scene(kernel: &str, youngs_modulus: f64, gravity: [f64; 3], body: &str, collider: &str) -> Problem {
    common::problem(&format!(
        r#"{{ "gridfall": 1, "name": "touching", "domain": {{ "min": [0, 0, 0], "max": [1, 0.6, 0.8], "dx": 0.05 }},
        "gravity": {gravity:?},
        "materials": {{ "m": {{ "model": "fixed-corotated", "density": 1000, "youngs_modulus": {youngs_modulus},
            "poissons_ratio": 0.3 }} }},
        "bodies": [ {{ "name": "b", "material": "m", {body} }} ],
        "colliders": [ {{ "name": "c", {collider} }} ],
        "time": {{ "end": 1, "frame_rate": 50 }},
        "solver": {{ "kernel": "{kernel}", "transfer": "mls", "integrator": "implicit",
            "implicit": {{ "method": "newton", "tolerance": 1e-4 }} }} }}"#
    ))
}

const BLOCK: &str = r#""shape": { "box": { "min": [0.3, 0.2, 0.22], "max": [0.5, 0.4, 0.37] } }"#;

/// At rest; sliding down a slope that the cells do not see; stuck to a plate that turns.
fn cases(kernel: &str, youngs_modulus: f64) -> Vec<(&'static str, Problem)> {
    let floor = |contact: &str| {
        format!(r#"{contact}, "shape": {{ "half-space": {{ "point": [0, 0, 0.22], "normal": [0, 0, 1] }} }}"#)
    };
    let slope = r#""contact": "separate", "friction": 0.3,
        "shape": { "half-space": { "point": [0.2, 0.3, 0.3], "normal": [0.5, 0, 0.866025403784] } }"#;
    let on_slope = r#""shape": { "rotate": { "axis": [0, 1, 0], "angle_degrees": 30, "center": [0.2, 0.3, 0.3], "shape":
        { "box": { "min": [0.2, 0.2, 0.3], "max": [0.4, 0.4, 0.45] } } } }, "sampling": "conforming""#;
    let plate = r#""contact": "sticky", "shape": { "box": { "min": [0.25, 0.15, 0.205], "max": [0.55, 0.45, 0.22] } },
        "motion": { "center": [0.4, 0.3, 0.2], "angular_velocity": [1, 0, 2], "linear_velocity": [0.2, 0, 0.5] }"#;
    let ball = r#""shape": { "sphere": { "center": [0.4, 0.3, 0.37], "radius": 0.15 } }, "sampling": "conforming""#;
    let (down, tilted) = ([0.0, 0.0, -9.81], [4.0, 0.0, -8.0]);
    let case = |name, gravity, body, collider: &str| (name, scene(kernel, youngs_modulus, gravity, body, collider));
    vec![
        case("rests", down, BLOCK, &floor(r#""contact": "separate", "friction": 0.3"#)),
        case("slides", down, on_slope, slope),
        case("rolls", tilted, ball, &floor(r#""contact": "separate", "friction": 0.8"#)),
        case("slips", tilted, BLOCK, &floor(r#""contact": "slip""#)),
        case("turns", down, BLOCK, plate),
    ]
}

fn run(engine: &mut dyn Engine, problem: &Problem) -> (Vec<FrameStats>, Particles) {
    let stats = (0..FRAMES).map(|_| engine.advance_frame(problem.setup.frame_s, &NoControl).unwrap()).collect();
    (stats, engine.snapshot().unwrap())
}

fn farthest(a: &[[f64; 3]], b: &[[f64; 3]]) -> f64 {
    let distance = |(a, b): (&[f64; 3], &[f64; 3])| (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>().sqrt();
    a.iter().zip(b).map(distance).fold(0.0, f64::max)
}

fn compare(kernel: &str, youngs_modulus: f64) {
    for (name, problem) in cases(kernel, youngs_modulus) {
        let on_gpu = ImplicitEngine::on_gpu(common::gpu(), &problem.setup, problem.particles.clone(), "test");
        let (stats, gpu) = run(&mut on_gpu.unwrap(), &problem);
        let (reference, cpu) =
            run(&mut ImplicitEngine::new(&problem.setup, problem.particles.clone()).unwrap(), &problem);
        let (x, v) = (farthest(&gpu.x, &cpu.x) / problem.setup.dx, farthest(&gpu.v, &cpu.v));
        let holding = |p: &Particles| p.touch.iter().filter(|touch| touch.with != 0).count();
        let weight: f64 = 9.81 * cpu.body.iter().map(|&b| problem.setup.bodies[b as usize].mass).sum::<f64>();
        let mut force = 0.0f64;
        for (a, b) in stats.iter().zip(&reference) {
            let (a, b) = (a.reactions.last().unwrap(), b.reactions.last().unwrap());
            force = force.max(farthest(&[a.force, a.torque], &[b.force, b.torque]) / weight);
        }
        let effort = |stats: &[FrameStats]| {
            let solves = stats.iter().flat_map(|stats| &stats.solves);
            solves.map(|solve| (solve.iterations, solve.inner_iterations, solve.residual)).collect::<Vec<_>>()
        };
        println!(
            "{kernel} {youngs_modulus:.0e} {name}: x {x:.1e} dx, v {v:.1e} m/s, force {force:.1e} of \
             the weight\n  {:?}\n  {:?}",
            effort(&stats),
            effort(&reference),
        );
        assert_eq!(holding(&gpu), holding(&cpu), "{name}");
        // Both solve for 1e-4 of what gravity does in a step, 0.08 dx and 0.2 m/s.
        assert!(x < 2e-5 && v < 1e-4 && force < 1e-4, "{name}");
    }
}

#[test]
fn soft_bodies_touch_as_on_the_cpu() {
    compare("quadratic", 1e5);
    compare("compact", 1e6);
}
