//! The damping of solids: modes decay at their rates, nothing but motion within a body is damped, steps are stable up
//! to the bound.

use std::f64::consts::PI;

use gridfall_core::sim::particles::{IDENTITY, Particles};
use gridfall_core::sim::setup::{Axis, Material, Problem};
use gridfall_core::sim::timestep::{elastic_bounds_s, moduli};
use gridfall_engine::explicit::cpu::{CpuEngine, stages};
use gridfall_engine::{Engine, NoControl};
use gridfall_scene::schema::{Kernel, Transfer};
use rand::{Rng, SeedableRng, rngs::StdRng};

use crate::elastic::{energy, stretched};
use crate::problems::*;

fn damp(problem: &mut Problem, damping: f64) {
    match &mut problem.setup.materials[0] {
        Material::FixedCorotated(elastic) | Material::NeoHookean(elastic) => elastic.damping = damping,
        other => panic!("{other:?}"),
    }
}

/// A slender free bar in its first longitudinal mode, and the mode's angular frequency (1/s).
fn bar(dimension: usize, kernel: Kernel, transfer: Transfer, poissons_ratio: f64) -> (Problem, f64) {
    let (cells, dx) = (32, 1.0 / 32.0);
    let length = cells as f64 * dx;
    let depth = if dimension == 3 { 12.0 } else { 1.0 };
    let mut problem = empty(dimension, [cells as f64 + 8.0, 12.0, depth], dx);
    (problem.setup.kernel, problem.setup.transfer) = (kernel, transfer);
    let side = |a: usize, at: f64| if a < dimension { at * dx } else { 0.0 };
    let low: Vec3 = std::array::from_fn(|a| side(a, 4.0));
    let high = [low[0] + length, side(1, 8.0), side(2, 8.0)];
    let waves = (1e4f64 / 1000.0).sqrt();
    let (size, wave) = (1e-4 * waves, PI / length);
    let swing = move |x: Vec3| {
        let phase = wave * (x[0] - low[0]);
        ([size * phase.cos(), 0.0, 0.0], [[-size * wave * phase.sin(), 0.0, 0.0], [0.0; 3], [0.0; 3]])
    };
    fill(&mut problem, elastic(1e4, poissons_ratio, 1000.0), 2, in_box(low, high), swing);
    (problem, wave * waves)
}

/// Decay (1/s) of the bar's mode over two periods, by least squares on a' = 2 r cos φ a − r² a_before.
fn decay(problem: &Problem, omega: f64) -> f64 {
    let frame_s = 2.0 * PI / omega / 40.0;
    let low = 4.0 * problem.setup.dx;
    let length = problem.setup.dx * 32.0;
    let amplitude = |p: &Particles| {
        let of = |(v, x): (&Vec3, &Vec3)| v[0] * (PI * (x[0] - low) / length).cos();
        p.v.iter().zip(&problem.particles.x).map(of).sum::<f64>()
    };
    let mut engine = CpuEngine::new(&problem.setup, problem.particles.clone()).unwrap();
    let mut values = vec![amplitude(&problem.particles)];
    for _ in 0..80 {
        engine.advance_frame(frame_s, &NoControl).unwrap();
        values.push(amplitude(&engine.snapshot().unwrap()));
    }
    let (mut m, mut rhs) = ([[0.0; 2]; 2], [0.0; 2]);
    for w in values.windows(3) {
        let row = [w[1], -w[0]];
        for i in 0..2 {
            rhs[i] += row[i] * w[2];
            (0..2).for_each(|j| m[i][j] += row[i] * row[j]);
        }
    }
    let squared = (m[0][0] * rhs[1] - m[1][0] * rhs[0]) / (m[0][0] * m[1][1] - m[0][1] * m[1][0]);
    -0.5 * squared.ln() / frame_s
}

#[test]
fn a_damped_bar_decays_at_its_rate() {
    for (dimension, kernel, transfer, poissons_ratio) in [
        (2, Kernel::Compact, Transfer::Mls, 0.0),
        (2, Kernel::Compact, Transfer::Apic, 0.0),
        (2, Kernel::Quadratic, Transfer::Mls, 0.0),
        (2, Kernel::Quadratic, Transfer::Apic, 0.0),
        (2, Kernel::Cubic, Transfer::Mls, 0.0),
        (3, Kernel::Compact, Transfer::Mls, 0.3),
        (3, Kernel::Quadratic, Transfer::Mls, 0.3),
    ] {
        let (mut problem, omega) = bar(dimension, kernel, transfer, poissons_ratio);
        let name = format!("{dimension}D {kernel:?} {transfer:?}");
        for ratio in [0.1, 0.3] {
            damp(&mut problem, 2.0 * ratio / omega);
            let share = decay(&problem, omega) / (ratio * omega);
            println!("{name}: {share:.4} of the rate at the ratio {ratio}");
            assert!((share - 1.0).abs() < 0.05, "{name}: {share} of the rate at the ratio {ratio}");
        }
        // Planted: a tenth too much damping must show.
        damp(&mut problem, 2.0 * 0.33 / omega);
        let share = decay(&problem, omega) / (0.3 * omega);
        assert!((share - 1.0).abs() > 0.05, "{name}: {share} of the rate, and a tenth more was planted");
    }
}

#[test]
fn damping_keeps_momentum_and_spin_and_takes_energy() {
    for (kernel, transfer) in [
        (Kernel::Compact, Transfer::Mls),
        (Kernel::Compact, Transfer::MlsPublished),
        (Kernel::Compact, Transfer::Apic),
        (Kernel::Quadratic, Transfer::Mls),
        (Kernel::Quadratic, Transfer::Apic),
        (Kernel::Cubic, Transfer::Mls),
    ] {
        // The lowest mode of the block has about 10 Hz: ratios of 0.1 and 1.
        for damping in [3e-3, 3e-2] {
            let mut problem = stretched(kernel, transfer);
            damp(&mut problem, damping);
            problem.setup.frame_s = 0.02;
            let name = format!("{kernel:?} {transfer:?}, {damping} s");
            let mut engine = CpuEngine::new(&problem.setup, problem.particles.clone()).unwrap();
            let first = energy(&problem, &problem.particles);
            let scale = norm(angular_momentum(&problem, &problem.particles));
            let mut energies = vec![first];
            for _ in 0..20 {
                engine.advance_frame(problem.setup.frame_s, &NoControl).unwrap();
                let p = engine.snapshot().unwrap();
                energies.push(energy(&problem, &p));
                let drift = norm(minus(momentum(&problem, &p), momentum(&problem, &problem.particles)));
                let spin = norm(minus(angular_momentum(&problem, &p), angular_momentum(&problem, &problem.particles)));
                assert!(drift < 1e-12, "{name}: momentum drifts by {drift:e}");
                assert!(spin < 1e-12 * scale.max(1.0), "{name}: angular momentum drifts by {spin:e} of {scale}");
            }
            let rise = energies.windows(2).map(|e| (e[1] - e[0]) / first).fold(f64::MIN, f64::max);
            println!("{name}: {first:.3} J, last {:.3}, largest rise {rise:.1e}", energies[20]);
            assert!(rise < 1e-6, "{name}: energy rises by {rise:e}: {energies:?}");
        }
    }
}

/// Random motion and strain in a periodic box with one particle a cell, where it is worst: the largest strain after
/// many steps over that at the start. (Modes of PIC have strain without velocity at the particles.)
fn growth(kernel: Kernel, transfer: Transfer, damping: f64, share: f64) -> f64 {
    let dx = 1.0 / 32.0;
    let mut problem = empty(2, [16.0, 16.0, 1.0], dx);
    (problem.setup.kernel, problem.setup.transfer) = (kernel, transfer);
    problem.setup.axes = [Axis::Periodic, Axis::Periodic, FREE];
    fill(&mut problem, neo_hookean(1e3, 0.3, 1000.0), 1, |_| true, uniform([0.0; 3]));
    let place = if kernel == Kernel::Compact { [-0.25, 0.25] } else { [0.0; 2] };
    let rng = &mut StdRng::seed_from_u64(7);
    let p = &mut problem.particles;
    for i in 0..p.len() {
        for a in 0..2 {
            p.x[i][a] += place[a] * dx;
            p.v[i][a] = rng.random_range(-1e-6..1e-6);
            for b in 0..2 {
                p.f[i][3 * a + b] += rng.random_range(-1e-6..1e-6);
            }
        }
    }
    let (lambda, mu, _) = moduli(&problem.setup.materials[0]);
    let bound = elastic_bounds_s(&problem.setup, lambda, mu, 1000.0).0;
    let t_d = damping * bound;
    damp(&mut problem, t_d);
    let dt = share * ((bound * bound + t_d * t_d).sqrt() - t_d);
    let mut solver = stages(&problem.setup, problem.particles.clone());
    solver.p2g(dt);
    for step in 1..=2000 {
        solver.grid_update(dt, step as f64 * dt, dt);
        let moved = solver.g2p2g(dt, dt);
        if moved.diverged || moved.growing || moved.max_speed_m_s > 1e-2 {
            return f64::INFINITY;
        }
    }
    let strain = |f: &[f64; 9]| f.iter().zip(IDENTITY).map(|(f, i)| (f - i).abs()).fold(0.0, f64::max);
    solver.particles().f.iter().map(strain).fold(0.0, f64::max) / 1e-6
}

/// The largest strain must not grow tenfold (Bai & Schroeder), and grows beyond all bounds above.
#[test]
fn the_bulk_is_stable_up_to_the_bound_with_damping() {
    for (kernel, transfer) in [
        (Kernel::Compact, Transfer::Mls),
        (Kernel::Compact, Transfer::Apic),
        (Kernel::Compact, Transfer::Pic),
        (Kernel::Quadratic, Transfer::Mls),
        (Kernel::Quadratic, Transfer::Apic),
        (Kernel::Quadratic, Transfer::Pic),
        (Kernel::Cubic, Transfer::Mls),
        (Kernel::Cubic, Transfer::Apic),
    ] {
        for damping in [0.03, 0.3, 3.0] {
            let [half, below, above] = [0.5, 0.99, 1.05].map(|share| growth(kernel, transfer, damping, share));
            println!("{kernel:?} {transfer:?}, t_d = {damping} T: {half:.1e}, {below:.1e}, above {above:.1e}");
            assert!(half < 10.0 && below < 10.0, "{kernel:?} {transfer:?}, t_d = {damping} T: grows to {below:e}");
            assert!(above > 1e3, "{kernel:?} {transfer:?}, t_d = {damping} T: only {above:e} above the bound");
        }
    }
}

#[test]
fn a_damped_run_continues_from_a_snapshot() {
    for (kernel, transfer) in [(Kernel::Compact, Transfer::Mls), (Kernel::Quadratic, Transfer::Pic)] {
        let mut problem = stretched(kernel, transfer);
        damp(&mut problem, 1e-2);
        let frame = |engine: &mut CpuEngine| {
            engine.advance_frame(problem.setup.frame_s, &NoControl).unwrap();
            engine.snapshot().unwrap()
        };
        let mut engine = CpuEngine::new(&problem.setup, problem.particles.clone()).unwrap();
        let between = frame(&mut engine);
        let after = frame(&mut engine);
        let continued = frame(&mut CpuEngine::new(&problem.setup, between).unwrap());
        for i in 0..after.len() {
            let apart = norm(minus(after.v[i], continued.v[i]));
            assert!(apart < 1e-11, "{kernel:?} {transfer:?}: particle {i} is {apart:e} m/s apart");
        }
    }
}
