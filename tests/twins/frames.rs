//! The GPU engine on its own: exact motions, repeatability, growth, guards and errors.

use gridfall_core::sim::particles::Particles;
use gridfall_core::sim::setup::{Method, Problem};
use gridfall_engine::implicit::ImplicitEngine;
use gridfall_engine::{Control, Engine, EngineError, FrameStats, NoControl};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use crate::common;

fn block(kernel: &str, boundary: &str, extra: &str) -> Problem {
    common::problem(&format!(
        r#"{{ "gridfall": 1, "name": "block",
        "domain": {{ "min": [0, 0, 0], "max": [1, 1, 1], "dx": 0.0625, "boundary": {{ {boundary} }} }},
        "gravity": [0, 0, -2],
        "materials": {{ "jelly": {{ "model": "fixed-corotated", "density": 1000, "youngs_modulus": 1e4,
            "poissons_ratio": 0.3 }} }},
        "bodies": [ {{ "name": "a", "material": "jelly", "shape": {{ "box": {{ "min": [0.3, 0.3, 0.5],
            "max": [0.6, 0.6, 0.8] }} }}, {extra} }} ],
        "time": {{ "end": 0.1, "frame_rate": 100 }}, "solver": {{ "kernel": "{kernel}" }} }}"#
    ))
}

fn run(problem: &Problem, frames: u32) -> (Particles, u64) {
    let (particles, stats) = run_with_stats(problem, frames);
    (particles, stats.iter().map(|s| s.steps).sum())
}

fn run_with_stats(problem: &Problem, frames: u32) -> (Particles, Vec<FrameStats>) {
    let mut engine = common::gpu_engine(problem);
    let stats = (0..frames).map(|_| engine.advance_frame(problem.setup.frame_s, &NoControl).unwrap()).collect();
    (engine.snapshot().unwrap(), stats)
}

#[test]
fn free_fall_is_exact_to_rounding() {
    for kernel in ["compact", "quadratic"] {
        let problem = block(kernel, "", r#""velocity": [0.2, -0.1, 0.3]"#);
        let (after, steps) = run(&problem, 10);
        let t: f64 = 0.1;
        let expected = [0.2 * t, -0.1 * t, 0.3 * t - t * t];
        let (mut x_error, mut v_error, mut f_error) = (0.0f64, 0.0f64, 0.0f64);
        for id in 0..after.len() {
            for a in 0..3 {
                x_error =
                    x_error.max((after.x[id][a] - problem.particles.x[id][a] - expected[a]).abs() / problem.setup.dx);
                v_error = v_error.max((after.v[id][a] - [0.2, -0.1, 0.3 - 2.0 * t][a]).abs());
            }
            for k in 0..9 {
                f_error = f_error.max((after.f[id][k] - problem.particles.f[id][k]).abs());
            }
        }
        println!("{kernel}: {steps} steps, x {x_error:.1e} dx, v {v_error:.1e} m/s, F {f_error:.1e}");
        assert!(x_error < 2e-5 && v_error < 2e-5 && f_error < 2e-5);
    }
}

#[test]
fn two_runs_are_equal_bit_for_bit() {
    let mut problem = block("compact", r#""z-": {"contact":"slip"}"#, r#""sampling": "jittered""#);
    println!("seed 5");
    common::randomise(&mut problem, &mut ChaCha8Rng::seed_from_u64(5));
    // Near the floor, so that it bears something.
    problem.particles.x.iter_mut().for_each(|x| x[2] -= 0.48);
    let first = run_with_stats(&problem, 3);
    assert!(first.1[2].reactions[4].force[2] != 0.0, "{:?}", first.1);
    assert_eq!(first, run_with_stats(&problem, 3));
}

#[test]
fn periodic_axes_carry_bodies_around() {
    for kernel in ["compact", "quadratic"] {
        let mut problem =
            block(kernel, r#""x": "periodic", "y": "periodic", "z": "periodic""#, r#""velocity": [4, -3, 0]"#);
        problem.setup.gravity = [0.0; 3];
        problem.setup.frame_s = 0.1;
        let (after, _) = run(&problem, 10);
        // One second at 4 and -3 m/s: four and three times around.
        for (x, x0) in after.x.iter().zip(&problem.particles.x) {
            for a in 0..3 {
                assert!((x[a] - x0[a]).abs() < 2e-4 * problem.setup.dx, "{kernel}: {x:?} {x0:?}");
            }
        }
    }
}

#[test]
fn capacity_grows_without_losing_a_step() {
    let problem = common::problem(
        r#"{ "gridfall": 1, "name": "burst",
        "domain": { "min": [0, 0, 0], "max": [3, 3, 3], "dx": 0.0625 },
        "materials": { "gas": { "model": "weakly-compressible-fluid", "density": 1000, "bulk_modulus": 1,
            "gamma": 2 } },
        "bodies": [ { "name": "a", "material": "gas", "shape": { "box": { "min": [1.375, 1.375, 1.375],
            "max": [1.625, 1.625, 1.625] } },
            "velocity_gradient": [[20, 0, 0], [0, 20, 0], [0, 0, 20]] } ],
        "time": { "end": 0.3, "frame_rate": 10 } }"#,
    );
    let mut engine = common::gpu_engine(&problem);
    let before = engine.device_bytes();
    let mut cpu = gridfall_engine::explicit::cpu::CpuEngine::new(&problem.setup, problem.particles.clone()).unwrap();
    for _ in 0..3 {
        engine.advance_frame(problem.setup.frame_s, &NoControl).unwrap();
        cpu.advance_frame(problem.setup.frame_s, &NoControl).unwrap();
    }
    assert!(engine.device_bytes() > before, "the burst was meant to need more blocks");
    let (gpu, cpu) = (engine.snapshot().unwrap(), cpu.snapshot().unwrap());
    let worst = gpu.x.iter().zip(&cpu.x).flat_map(|(a, b)| (0..3).map(|k| (a[k] - b[k]).abs())).fold(0.0, f64::max);
    println!("{before} → {} bytes, worst difference {worst:.1e} m", engine.device_bytes());
    assert!(worst < 1e-2 * problem.setup.dx);
}

#[test]
fn momentum_is_kept_over_a_thousand_steps() {
    let mut problem = block("compact", "", r#""angular_velocity": [0, 0, 3], "velocity": [0.1, 0, 0]"#);
    problem.setup.gravity = [0.0; 3];
    problem.setup.max_dt_s = Some(1e-4);
    let momentum =
        |p: &Particles| -> [f64; 3] { std::array::from_fn(|a| p.v.iter().map(|v| v[a]).sum::<f64>() / p.len() as f64) };
    // About z through where the body's middle begins, in mean (m²/s). About the origin, what the body has from its
    // motion and from its rotation nearly cancel, and f32 rounds each by more than 1e-5 of the rest.
    let spin = |p: &Particles| -> f64 {
        let of = |i: usize| (p.x[i][0] - 0.45) * p.v[i][1] - (p.x[i][1] - 0.45) * p.v[i][0] + p.b[i][3] - p.b[i][1];
        (0..p.len()).map(of).sum::<f64>() / p.len() as f64
    };
    let (after, steps) = run(&problem, 10);
    assert!(steps >= 1000);
    let (p0, p1) = (momentum(&problem.particles), momentum(&after));
    let (l0, l1) = (spin(&problem.particles), spin(&after));
    println!("{steps} steps: momentum {p0:?} → {p1:?}, angular {l0} → {l1}");
    for a in 0..3 {
        assert!((p1[a] - p0[a]).abs() < 1e-6);
    }
    assert!((l1 - l0).abs() < 1e-5 * l0.abs());
}

#[test]
fn a_speed_that_grows_inside_a_frame_leads_to_a_new_plan() {
    // A strongly squeezed block bursts from rest: the plan at rest is far too long for it.
    let mut problem = block("compact", "", r#""J": 0.2"#);
    problem.setup.gravity = [0.0; 3];
    problem.setup.cfl = 0.05;
    problem.setup.frame_s = 0.05;
    let mut engine = common::gpu_engine(&problem);
    let stats = engine.advance_frame(problem.setup.frame_s, &NoControl).unwrap();
    let mut quiet = block("compact", "", r#""J": 1.0"#);
    (quiet.setup.gravity, quiet.setup.cfl) = ([0.0; 3], 0.05);
    let mut at_rest = common::gpu_engine(&quiet);
    let planned = at_rest.advance_frame(problem.setup.frame_s, &NoControl).unwrap();
    assert!(stats.steps > planned.steps, "{stats:?} {planned:?}");
    assert!(engine.snapshot().unwrap().x.iter().flatten().all(|x| x.is_finite()));
}

/// Plans change while velocities are half a step ahead of positions; a body falls as if they had not.
#[test]
fn a_new_plan_keeps_the_fall_exact() {
    for kernel in ["compact", "quadratic"] {
        let mut problem = block(kernel, "", r#""J": 0.2, "velocity": [0.2, -0.1, 0.3]"#);
        (problem.setup.cfl, problem.setup.frame_s) = (0.05, 0.05);
        let mut engine = common::gpu_engine(&problem);
        let stats = engine.advance_frame(problem.setup.frame_s, &NoControl).unwrap();
        let mut cpu =
            gridfall_engine::explicit::cpu::CpuEngine::new(&problem.setup, problem.particles.clone()).unwrap();
        let on_cpu = cpu.advance_frame(problem.setup.frame_s, &NoControl).unwrap();
        let even = gridfall_core::sim::timestep::plan_frame(
            &problem.setup,
            &gridfall_core::sim::timestep::initial_extremes(&problem.setup, &problem.particles),
            problem.setup.frame_s,
        );
        assert!(stats.steps > even.steps, "{stats:?}, planned {}", even.steps);
        let after = engine.snapshot().unwrap();
        let mean = |of: &[[f64; 3]], a: usize| of.iter().map(|x| x[a]).sum::<f64>() / of.len() as f64;
        let t = problem.setup.frame_s;
        let (mut x_error, mut v_error) = (0.0f64, 0.0f64);
        for (a, v) in [0.2, -0.1, 0.3].into_iter().enumerate() {
            let g = problem.setup.gravity[a];
            let gone = mean(&after.x, a) - mean(&problem.particles.x, a);
            x_error = x_error.max((gone - v * t - 0.5 * g * t * t).abs() / problem.setup.dx);
            v_error = v_error.max((mean(&after.v, a) - v - g * t).abs());
        }
        println!(
            "{kernel}: {} steps ({} on the CPU, {} planned), x {x_error:.1e} dx, v {v_error:.1e} m/s",
            stats.steps, on_cpu.steps, even.steps
        );
        assert!(x_error < 2e-5 && v_error < 2e-5);
    }
}

#[test]
fn failures_name_step_and_particle() {
    let mut problem = block("compact", "", "\"velocity\": [0, 0, 0]");
    problem.particles.f[77][0] = f64::NAN;
    match common::gpu_engine(&problem).advance_frame(problem.setup.frame_s, &NoControl) {
        Err(EngineError::Diverged { step: 0, what, .. }) => assert!(what.contains("particle 77"), "{what}"),
        other => panic!("{other:?}"),
    }
}

#[test]
fn speeds_beyond_all_bounds_are_errors_that_name_the_particle() {
    for speed in [1e16, 1e30] {
        let mut problem = block("compact", "", "\"velocity\": [0, 0, 0]");
        problem.particles.v[77] = [0.0, 0.0, speed];
        problem.setup.implicit.method = Method::Hot;
        let implicit = ImplicitEngine::on_gpu(common::gpu(), &problem.setup, problem.particles.clone(), "test");
        for mut engine in [Box::new(common::gpu_engine(&problem)) as Box<dyn Engine>, Box::new(implicit.unwrap())] {
            match engine.advance_frame(problem.setup.frame_s, &NoControl) {
                Err(EngineError::Diverged { step: 0, what, .. }) => assert!(what.contains("particle 77"), "{what}"),
                other => panic!("{other:?}"),
            }
        }
    }
}

#[test]
fn a_particle_outside_the_domain_is_an_error() {
    let mut problem = block("compact", "", "\"velocity\": [0, 0, 0]");
    problem.particles.x[12] = [-1.5 * problem.setup.dx, 0.5, 0.5];
    match common::gpu_engine(&problem).advance_frame(problem.setup.frame_s, &NoControl) {
        Err(EngineError::LeftDomain { what, .. }) => assert!(what.contains("particle 12"), "{what}"),
        other => panic!("{other:?}"),
    }
}

#[test]
fn cancel_is_heard() {
    struct Cancel;
    impl Control for Cancel {
        fn canceled(&self) -> bool {
            true
        }
    }
    let problem = block("compact", "", "\"velocity\": [0, 0, 0]");
    assert!(matches!(common::gpu_engine(&problem).advance_frame(1.0, &Cancel), Err(EngineError::Canceled)));
}

/// What the floor bears is what the block loses, to the resolution of the sums.
#[test]
fn surfaces_take_the_momentum_that_is_lost() {
    for kernel in ["compact", "quadratic"] {
        let mut problem =
            block(kernel, r#""z-": {"contact":"separate","friction":0.5}"#, r#""velocity": [0.5, 0, -3]"#);
        problem.particles.x.iter_mut().for_each(|x| x[2] -= 0.47);
        let (after, stats) = run_with_stats(&problem, 8);
        let m = problem.setup.bodies[0].mass;
        let p = |p: &Particles, a: usize| m * p.v.iter().map(|v| v[a]).sum::<f64>();
        for a in 0..3 {
            let lost =
                p(&problem.particles, a) + m * after.len() as f64 * problem.setup.gravity[a] * 0.08 - p(&after, a);
            let taken: f64 = stats.iter().flat_map(|s| &s.reactions).map(|r| r.force[a] * problem.setup.frame_s).sum();
            let whole = 3.0 * m * after.len() as f64;
            println!(
                "{kernel} axis {a}: {taken:.6} N s taken, {lost:.6} lost, of {whole:.3}; {:.1e}",
                (taken - lost) / whole
            );
            assert!((taken - lost).abs() < 1e-5 * whole);
        }
    }
}

/// A stream on the GPU is the stream on the CPU; with nothing there before it opens.
#[test]
fn sources_emit_what_the_cpu_emits() {
    let problem = common::problem(
        r#"{ "gridfall": 1, "name": "tap", "domain": { "min": [0, 0, 0], "max": [0.5, 0.5, 1], "dx": 0.0625 },
        "gravity": [0, 0, -5],
        "materials": { "water": { "model": "weakly-compressible-fluid", "density": 1000, "bulk_modulus": 1e4 },
                       "jelly": { "model": "fixed-corotated", "density": 1000, "youngs_modulus": 1e4,
                           "poissons_ratio": 0.3 } },
        "bodies": [],
        "sources": [ { "name": "tap", "material": "water", "velocity": [0, 0, -1], "from": 0.06,
                       "shape": { "box": { "min": [0.125, 0.125, 0.75], "max": [0.25, 0.25, 0.8] } } },
                     { "name": "press", "material": "jelly", "velocity": [0.5, 0, 0], "from": 0.1, "until": 0.14,
                       "shape": { "sphere": { "center": [0.35, 0.3, 0.4], "radius": 0.08 } } } ],
        "time": { "end": 0.2, "frame_rate": 50 } }"#,
    );
    let simulate = |engine: &mut dyn Engine| -> Vec<Particles> {
        let frame = |frame: u32| {
            gridfall_recording::run::advance(&problem.setup, engine, frame, &NoControl).unwrap();
            engine.snapshot().unwrap()
        };
        (0..problem.setup.frames).map(frame).collect()
    };
    let gpu = simulate(&mut common::gpu_engine(&problem));
    let cpu = simulate(
        &mut gridfall_engine::explicit::cpu::CpuEngine::new(&problem.setup, problem.particles.clone()).unwrap(),
    );
    assert!(gpu[1].is_empty() && cpu[1].is_empty(), "the sources open later");
    assert_eq!(gpu[9].len(), problem.setup.total_particles());
    for (gpu, cpu) in gpu.iter().zip(&cpu) {
        assert_eq!(gpu.body, cpu.body);
        let differences = gpu.x.iter().zip(&cpu.x).flat_map(|(a, b)| (0..3).map(|k| (a[k] - b[k]).abs()));
        let worst = differences.fold(0.0, f64::max);
        println!("{} particles, worst difference {worst:.1e} m", gpu.len());
        assert!(worst < 1e-3 * problem.setup.dx);
    }
    // And again, bit for bit.
    assert_eq!(gpu, simulate(&mut common::gpu_engine(&problem)));
}
