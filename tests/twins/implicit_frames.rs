//! The implicit engine on the GPU: the CPU's motion, repeatable, through every kind of frame.

use gridfall_core::sim::particles::Particles;
use gridfall_core::sim::setup::Problem;
use gridfall_engine::implicit::ImplicitEngine;
use gridfall_engine::implicit::gpu::supports;
use gridfall_engine::{Engine, FrameStats, NoControl};

use crate::common;

/// A bar that hangs in a grip which turns and pulls, beside a block that slides on a floor with friction.
fn scene(kernel: &str, transfer: &str) -> Problem {
    scene_of(kernel, transfer, r#"{ "method": "hot", "tolerance": 1e-8 }"#)
}

/// The same with these settings of the solver.
fn scene_of(kernel: &str, transfer: &str, implicit: &str) -> Problem {
    common::problem(&format!(
        r#"{{ "gridfall": 1, "name": "implicit",
        "domain": {{ "min": [0, 0, 0], "max": [1, 0.6, 1], "dx": 0.05,
                     "boundary": {{ "z-": {{ "contact": "separate", "friction": 0.3 }},
                         "x+": {{ "contact": "slip" }} }} }},
        "materials": {{
            "gum": {{ "model": "fixed-corotated", "density": 1000, "youngs_modulus": 1e5, "poissons_ratio": 0.3 }},
            "tin": {{ "model": "von-mises", "density": 2000, "youngs_modulus": 1e6, "poissons_ratio": 0.3,
                "yield_stress": 2e4 }} }},
        "bodies": [
            {{ "name": "bar", "material": "gum", "sampling": "jittered",
                "shape": {{ "box": {{ "min": [0.2, 0.2, 0.4], "max": [0.35, 0.35, 0.8] }} }} }},
            {{ "name": "block", "material": "tin", "sampling": "jittered", "velocity": [1, 0, -0.5],
               "shape": {{ "box": {{ "min": [0.5, 0.2, 0.02], "max": [0.7, 0.35, 0.17] }} }} }} ],
        "colliders": [
            {{ "name": "grip", "contact": "sticky", "shape": {{ "box": {{ "min": [0.1, 0.1, 0.72],
                "max": [0.45, 0.45, 0.9] }} }},
               "motion": {{ "center": [0.275, 0.275, 0.8], "linear_velocity": [0, 0, 0.2],
                   "angular_velocity": [0, 0, 4] }} }} ],
        "time": {{ "end": 1, "frame_rate": 24 }},
        "solver": {{ "kernel": "{kernel}", "transfer": "{transfer}", "integrator": "implicit", "contact": "nodes",
            "implicit": {implicit} }} }}"#
    ))
}

fn engine(problem: &Problem) -> ImplicitEngine {
    ImplicitEngine::on_gpu(common::gpu(), &problem.setup, problem.particles.clone(), "test").unwrap()
}

fn run(engine: &mut dyn Engine, problem: &Problem, frames: u32) -> (Vec<FrameStats>, Particles) {
    let stats = (0..frames).map(|_| engine.advance_frame(problem.setup.frame_s, &NoControl).unwrap()).collect();
    (stats, engine.snapshot().unwrap())
}

fn farthest(a: &[[f64; 3]], b: &[[f64; 3]]) -> f64 {
    let distance = |(a, b): (&[f64; 3], &[f64; 3])| (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>().sqrt();
    a.iter().zip(b).map(distance).fold(0.0, f64::max)
}

#[test]
fn it_moves_as_on_the_cpu() {
    for (kernel, transfer) in [("quadratic", "apic"), ("compact", "mls")] {
        let problem = scene(kernel, transfer);
        let (stats, gpu) = run(&mut engine(&problem), &problem, 2);
        let (reference, cpu) =
            run(&mut ImplicitEngine::new(&problem.setup, problem.particles.clone()).unwrap(), &problem, 2);
        let (x, v) = (farthest(&gpu.x, &cpu.x) / problem.setup.dx, farthest(&gpu.v, &cpu.v));
        println!("{kernel} {transfer}: x {x:.1e} dx, v {v:.1e} m/s");
        for (stats, reference) in stats.iter().zip(&reference) {
            assert_eq!(stats.steps, reference.steps);
            assert!(stats.solves.iter().all(|solve| solve.converged), "{:?}", stats.solves);
            for (a, b) in stats.reactions.iter().zip(&reference.reactions) {
                let difference = farthest(&[a.force, a.torque], &[b.force, b.torque]);
                assert!(difference < 0.05, "{a:?} against {b:?}");
            }
        }
        assert!(x < 1e-3 && v < 1e-2);
    }
}

/// Newton's method, with metal that flows: each engine is off by the tolerance, of how far particles go.
#[test]
fn newtons_steps_are_those_of_the_cpu() {
    for (kernel, transfer, tolerance) in [("quadratic", "apic", 2e-3), ("compact", "mls", 1e-2)] {
        let problem = scene_of(kernel, transfer, &format!(r#"{{ "tolerance": {tolerance} }}"#));
        let (stats, gpu) = run(&mut engine(&problem), &problem, 1);
        let (reference, cpu) =
            run(&mut ImplicitEngine::new(&problem.setup, problem.particles.clone()).unwrap(), &problem, 1);
        let dx = problem.setup.dx;
        let (x, way) = (farthest(&gpu.x, &cpu.x) / dx, farthest(&cpu.x, &problem.particles.x) / dx);
        println!("{kernel} {transfer}: x {x:.1e} of {way:.2} dx");
        for (a, b) in stats.iter().zip(&reference).flat_map(|(a, b)| a.solves.iter().zip(&b.solves)) {
            println!("  {} iterations, {} cycles, {:.1e}", a.iterations, a.inner_iterations, a.residual);
            println!("  {} iterations, {} cycles, {:.1e} on the CPU", b.iterations, b.inner_iterations, b.residual);
        }
        assert!(stats.iter().zip(&reference).all(|(a, b)| a.steps == b.steps));
        assert!(x < 2.0 * tolerance * way);
    }
}

/// A block of 1e10 Pa that spins as it falls: gravity is all that it feels, in f32 as in f64.
#[test]
fn stiff_bodies_fall_freely() {
    for (kernel, transfer) in [("quadratic", "apic"), ("compact", "mls")] {
        let problem = common::problem(&format!(
            r#"{{ "gridfall": 1, "name": "fall", "gravity": [0, 0, -9.81],
            "domain": {{ "min": [0, 0, 0], "max": [1, 1, 1], "dx": 0.05 }},
            "materials": {{ "stone": {{ "model": "fixed-corotated", "density": 2500, "youngs_modulus": 1e10,
                "poissons_ratio": 0.2 }} }},
            "bodies": [ {{ "name": "stone", "material": "stone", "angular_velocity": [1, 4, 2], "velocity": [0.5, 0, 1],
                "shape": {{ "box": {{ "min": [0.3, 0.4, 0.4], "max": [0.5, 0.55, 0.6] }} }} }} ],
            "time": {{ "end": 1, "frame_rate": 50 }},
            "solver": {{ "kernel": "{kernel}", "transfer": "{transfer}", "integrator": "implicit" }} }}"#
        ));
        let frames = 3;
        let (stats, gpu) = run(&mut engine(&problem), &problem, frames);
        let (_, cpu) =
            run(&mut ImplicitEngine::new(&problem.setup, problem.particles.clone()).unwrap(), &problem, frames);
        let centre = |x: &[[f64; 3]]| [0, 1, 2].map(|a| x.iter().map(|x| x[a]).sum::<f64>() / x.len() as f64);
        let time_s = f64::from(frames) * problem.setup.frame_s;
        let solves: Vec<_> = stats.iter().flat_map(|stats| &stats.solves).collect();
        // Implicit Euler falls by g Σ t dt, half a step ahead of the parabola.
        let mut fall = [0.0; 2];
        for solve in &solves {
            fall[0] += 9.81 * solve.dt_s;
            fall[1] += fall[0] * solve.dt_s;
        }
        let mut right = centre(&problem.particles.x);
        (right[0], right[2]) = (right[0] + 0.5 * time_s, right[2] + time_s - fall[1]);
        let dx = problem.setup.dx;
        let off = [&gpu, &cpu].map(|end| farthest(&[centre(&end.x)], &[right]) / dx);
        let apart = farthest(&gpu.x, &cpu.x) / dx;
        let effort = |of: fn(&gridfall_engine::Solve) -> u32| solves.iter().map(|solve| of(solve)).sum::<u32>();
        println!(
            "{kernel}: centre off by {:.1e} dx, {:.1e} on the CPU; particles {apart:.1e} dx apart; {} steps, {} \
             iterations, {} cycles",
            off[0],
            off[1],
            solves.len(),
            effort(|solve| solve.iterations),
            effort(|solve| solve.inner_iterations)
        );
        // The tolerance, of how far it falls; each engine has it.
        assert!(off[0] < 1e-2 * fall[1] / dx);
        assert!(apart < 2e-2 * fall[1] / dx);
    }
}

#[test]
fn it_repeats_itself_to_the_bit() {
    for problem in [scene("compact", "apic"), scene_of("compact", "apic", "{}")] {
        assert_eq!(run(&mut engine(&problem), &problem, 1), run(&mut engine(&problem), &problem, 1));
    }
}

#[test]
fn steps_in_which_particles_go_too_far_are_halved() {
    // Compressed and let go: at rest and without gravity, so that the first step is planned as long as the frame.
    let problem = common::problem(
        r#"{ "gridfall": 1, "name": "burst", "domain": { "min": [0, 0, 0], "max": [1, 1, 1], "dx": 0.125 },
        "gravity": [0, 0, 0],
        "materials": { "m": { "model": "fixed-corotated", "density": 1000, "youngs_modulus": 1e5,
            "poissons_ratio": 0.3 } },
        "bodies": [ { "name": "a", "material": "m", "shape": { "box": { "min": [0.375, 0.375, 0.375],
            "max": [0.625, 0.625, 0.625] } },
                      "deformation_gradient": [[0.5, 0, 0], [0, 0.5, 0], [0, 0, 0.5]] } ],
        "time": { "end": 1, "frame_rate": 10 },
        "solver": { "integrator": "implicit", "implicit": { "method": "hot" } } }"#,
    );
    let frame_s = 0.1;
    let stats = engine(&problem).advance_frame(frame_s, &NoControl).unwrap();
    let first = stats.solves[0].dt_s;
    println!("{} steps, the first {first} s", stats.steps);
    assert!(stats.steps > 1 && first < frame_s);
    let time_s: f64 = stats.solves.iter().map(|solve| solve.dt_s).sum();
    assert!((time_s - frame_s).abs() < 1e-12);
}

/// A stream on the GPU is the stream on the CPU; with nothing there before it opens.
#[test]
fn sources_emit_what_the_cpu_emits() {
    let problem = common::problem(
        r#"{ "gridfall": 1, "name": "press", "domain": { "min": [0, 0, 0], "max": [0.5, 0.5, 0.5], "dx": 0.0625 },
        "materials": { "jelly": { "model": "fixed-corotated", "density": 1000, "youngs_modulus": 1e4,
            "poissons_ratio": 0.3 } },
        "bodies": [],
        "sources": [ { "name": "press", "material": "jelly", "velocity": [0.5, 0, 0], "from": 0.05, "until": 0.14,
                       "shape": { "sphere": { "center": [0.25, 0.25, 0.3], "radius": 0.08 } } } ],
        "time": { "end": 0.2, "frame_rate": 25 },
        "solver": { "integrator": "implicit", "implicit": { "method": "hot" } } }"#,
    );
    let simulate = |engine: &mut dyn Engine| -> Vec<Particles> {
        let frame = |frame: u32| {
            engine.append(problem.setup.emission(frame)).unwrap();
            engine.advance_frame(problem.setup.frame_s, &NoControl).unwrap();
            engine.snapshot().unwrap()
        };
        (0..problem.setup.frames).map(frame).collect()
    };
    let (gpu, cpu) = (
        simulate(&mut engine(&problem)),
        simulate(&mut ImplicitEngine::new(&problem.setup, problem.particles.clone()).unwrap()),
    );
    assert!(gpu[0].is_empty() && !gpu[4].is_empty());
    for (gpu, cpu) in gpu.iter().zip(&cpu) {
        assert_eq!(gpu.body, cpu.body);
        let worst = farthest(&gpu.x, &cpu.x) / problem.setup.dx;
        println!("{} particles, worst difference {worst:.1e} dx", gpu.len());
        assert!(worst < 1e-3);
    }
}

#[test]
fn what_it_cannot_run_is_said() {
    use gridfall_core::sim::setup::{ContactAt, Kernel, Method, Precision, Transfer};
    type Change<'a> = (&'a str, &'a dyn Fn(&mut Problem));
    let problem = scene("compact", "mls");
    assert_eq!(supports(&problem.setup), Ok(()));
    let cases: [Change; 6] = [
        ("3D", &|p| p.setup.dimension = 2),
        ("kernel", &|p| p.setup.kernel = Kernel::Cubic),
        ("apic, mls", &|p| p.setup.transfer = Transfer::Pic),
        ("f32", &|p| p.setup.precision = Precision::F64),
        ("newton only", &|p| p.setup.contact_at = ContactAt::Particles),
        ("hot", &|p| p.setup.implicit.method = Method::PnPcg),
    ];
    for (word, change) in cases {
        let mut other = problem.clone();
        change(&mut other);
        assert!(supports(&other.setup).unwrap_err().contains(word), "{word}");
    }
}
