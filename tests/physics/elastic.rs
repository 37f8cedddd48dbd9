//! Elastic bodies: a bar's period, energy that does not grow, steps that adapt to a body that
//! accelerates.

use std::f64::consts::PI;

use crate::problems::*;
use gridfall_core::material::energy_density;
use gridfall_core::maths::linalg::{Matrix, cofactor, det, double_dot, from_row_major, mul};
use gridfall_core::sim::moments::moment_matrix;
use gridfall_core::sim::particles::Particles;
use gridfall_core::sim::setup::Problem;
use gridfall_engine::explicit::cpu::CpuEngine;
use gridfall_engine::{Engine, EngineError, NoControl};
use gridfall_scene::schema::{Kernel, Transfer};

/// Kinetic energy of the velocities and of the affine part, and strain energy (J).
pub fn energy(problem: &Problem, p: &Particles) -> f64 {
    let d = problem.setup.dimension;
    let of_particle = |i: usize| {
        let body = &problem.setup.bodies[p.body[i] as usize];
        let units = std::array::from_fn(|a| (p.x[i][a] - problem.setup.origin[a]) / problem.setup.dx);
        let mut moment: Matrix<f64, 3> =
            from_row_major(&moment_matrix(problem.setup.kernel, units, problem.setup.dx, d));
        if d == 2 {
            moment[2][2] = 1.0;
        }
        let b = from_row_major(&p.b[i]);
        let inverse = cofactor(&moment).map(|row| row.map(|c| c / det(&moment)));
        let affine = double_dot(&mul(&b, &inverse), &b);
        let strain = body.volume0
            * energy_density(&problem.setup.materials[body.material], problem.setup.dimension, &p.f[i], p.plastic[i]);
        0.5 * body.mass * (p.v[i].iter().map(|v| v * v).sum::<f64>() + affine) + strain
    };
    (0..p.len()).map(of_particle).sum()
}

/// The first longitudinal mode of a free–free bar with ν = 0: T = 2 L / sqrt(E/ρ).
#[test]
fn a_free_bar_swings_with_its_period() {
    for (kernel, transfer) in [
        (Kernel::Compact, Transfer::Mls),
        (Kernel::Compact, Transfer::Apic),
        (Kernel::Quadratic, Transfer::Mls),
        (Kernel::Cubic, Transfer::Apic),
    ] {
        let (cells, dx) = (48, 1.0 / 64.0);
        let length = cells as f64 * dx;
        let mut problem = empty(2, [cells as f64 + 8.0, 12.0, 1.0], dx);
        (problem.setup.kernel, problem.setup.transfer) = (kernel, transfer);
        let (low, high) = ([4.0 * dx, 4.0 * dx, 0.0], [4.0 * dx + length, 8.0 * dx, 0.0]);
        let mode = move |x: f64| (PI * (x - low[0]) / length).cos();
        let slope = move |x: f64| -PI / length * (PI * (x - low[0]) / length).sin();
        let speed = 1e-3;
        let swing =
            move |x: Vec3| ([speed * mode(x[0]), 0.0, 0.0], [[speed * slope(x[0]), 0.0, 0.0], [0.0; 3], [0.0; 3]]);
        fill(&mut problem, elastic(1e4, 0.0, 1000.0), 2, in_box(low, high), swing);
        let period = 2.0 * length / (1e4f64 / 1000.0).sqrt();
        problem.setup.frame_s = period / 40.0;
        let start = problem.particles.x.clone();
        let mut engine = CpuEngine::new(&problem.setup, problem.particles.clone()).unwrap();
        // Zero crossings of the mode's velocity, at odd quarters of a period.
        let (mut crossings, mut before) = (Vec::new(), 1.0);
        for frame in 1..=130 {
            engine.advance_frame(problem.setup.frame_s, &NoControl).unwrap();
            let p = engine.snapshot().unwrap();
            let now: f64 = p.v.iter().zip(&start).map(|(v, x)| v[0] * mode(x[0])).sum();
            if now * before < 0.0 {
                crossings.push((frame as f64 - now / (now - before)) * problem.setup.frame_s);
            }
            before = now;
        }
        let count = crossings.len();
        let measured = 2.0 * (crossings[count - 1] - crossings[0]) / (count - 1) as f64;
        println!(
            "{kernel:?} {transfer:?}: T = {measured:.5} s, analytic {period:.5} s ({:+.2}%)",
            100.0 * (measured / period - 1.0)
        );
        assert!((measured / period - 1.0).abs() < 0.01, "{kernel:?} {transfer:?}: T = {measured}, analytic {period}");
    }
}

/// A block that is released stretched and spinning.
pub fn stretched(kernel: Kernel, transfer: Transfer) -> Problem {
    let dx = 1.0 / 32.0;
    let mut problem = empty(3, [16.0, 16.0, 16.0], dx);
    (problem.setup.kernel, problem.setup.transfer) = (kernel, transfer);
    let center = [8.0 * dx; 3];
    let block = in_box([5.0 * dx; 3], [11.0 * dx, 10.0 * dx, 10.0 * dx]);
    let spin = [[0.0, -1.0, 0.0], [1.0, 0.0, 0.5], [0.0, -0.5, 0.0]];
    fill(&mut problem, neo_hookean(2e4, 0.3, 1000.0), 2, block, linear([0.0; 3], spin, center));
    for f in &mut problem.particles.f {
        *f = [1.15, 0.1, 0.0, 0.0, 0.95, 0.0, 0.0, 0.05, 0.9];
    }
    problem
}

#[test]
fn energy_does_not_grow() {
    for (kernel, transfer) in [
        (Kernel::Compact, Transfer::Mls),
        (Kernel::Compact, Transfer::Apic),
        (Kernel::Compact, Transfer::Pic),
        (Kernel::Quadratic, Transfer::Mls),
        (Kernel::Quadratic, Transfer::Apic),
        (Kernel::Cubic, Transfer::Mls),
    ] {
        let problem = stretched(kernel, transfer);
        let mut engine = CpuEngine::new(&problem.setup, problem.particles.clone()).unwrap();
        let first = energy(&problem, &problem.particles);
        let (mut highest, mut last, mut steps) = (0.0f64, first, 0);
        for _ in 0..20 {
            steps += engine.advance_frame(problem.setup.frame_s, &NoControl).unwrap().steps;
            last = energy(&problem, &engine.snapshot().unwrap());
            highest = highest.max(last);
        }
        println!("{kernel:?} {transfer:?}: {steps} steps, {first:.3} J, highest {highest:.3}, last {last:.3}");
        // The energy of symplectic Euler oscillates about the true energy by the order of the step.
        assert!(highest < 1.01 * first, "{kernel:?} {transfer:?}: {highest} J from {first} J");
        assert!(last < first, "{kernel:?} {transfer:?}");
    }
}

#[test]
fn steps_shorten_when_a_body_outruns_the_plan() {
    let mut problem = stretched(Kernel::Compact, Transfer::Mls);
    problem.setup.cfl = 0.02;
    for f in &mut problem.particles.f {
        *f = [0.8, 0.0, 0.0, 0.0, 0.8, 0.0, 0.0, 0.0, 0.8];
    }
    (problem.particles.v, problem.particles.b) =
        (vec![[0.0; 3]; problem.particles.len()], vec![[0.0; 9]; problem.particles.len()]);
    let planned = gridfall_core::sim::timestep::plan_frame(&problem.setup, &Default::default(), problem.setup.frame_s);
    let mut engine = CpuEngine::new(&problem.setup, problem.particles.clone()).unwrap();
    let stats = engine.advance_frame(problem.setup.frame_s, &NoControl).unwrap();
    println!("planned {planned:?}, took {stats:?}");
    assert!(stats.steps > planned.steps + 5);
    assert!((stats.dt_s * stats.steps as f64 / problem.setup.frame_s - 1.0).abs() < 1e-12);
    let p = engine.snapshot().unwrap();
    assert!(norm(momentum(&problem, &p)) < 1e-12, "a symmetric burst has no momentum");
}

#[test]
fn a_state_without_a_stress_is_a_divergence_that_names_the_particle() {
    let mut problem = stretched(Kernel::Quadratic, Transfer::Mls);
    problem.particles.f[5] = [-1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
    let mut engine = CpuEngine::new(&problem.setup, problem.particles.clone()).unwrap();
    let error = engine.advance_frame(problem.setup.frame_s, &NoControl).unwrap_err();
    assert!(matches!(&error, EngineError::Diverged { step: 1, .. }), "{error}");
    let text = error.to_string();
    assert!(text.contains("particle") && text.contains("body 0") && text.contains("solver.max_dt"), "{text}");
}

#[test]
fn cancellation_is_noticed_between_steps() {
    struct Stop(std::sync::atomic::AtomicU64);
    impl gridfall_engine::Control for Stop {
        fn canceled(&self) -> bool {
            self.0.load(std::sync::atomic::Ordering::Relaxed) >= 3
        }
        fn progress(&self, step: u64, _time_s: f64) {
            self.0.store(step, std::sync::atomic::Ordering::Relaxed);
        }
    }
    let control = Stop(Default::default());
    let problem = stretched(Kernel::Compact, Transfer::Mls);
    let mut engine = CpuEngine::new(&problem.setup, problem.particles.clone()).unwrap();
    assert!(matches!(engine.advance_frame(1.0, &control), Err(EngineError::Canceled)));
    assert_eq!(control.0.into_inner(), 3);
}
