//! What must hold for every combination of kernel, transfer, dimension and precision: conservation,
//! free motion, symmetry, determinism.

use crate::problems::*;
use gridfall_core::sim::particles::Particles;
use gridfall_core::sim::setup::{Axis, Problem};
use gridfall_engine::explicit::cpu::{CpuEngine, stages};
use gridfall_engine::{Engine, NoControl};
use gridfall_scene::schema::{Kernel, Precision, Transfer};

const KERNELS: [Kernel; 4] = [Kernel::Compact, Kernel::Quadratic, Kernel::Cubic, Kernel::Linear];
const TRANSFERS: [Transfer; 4] = [Transfer::Pic, Transfer::Apic, Transfer::Mls, Transfer::MlsPublished];
const PRECISIONS: [Precision; 2] = [Precision::F32, Precision::F64];

fn all_combinations() -> impl Iterator<Item = (usize, Kernel, Transfer, Precision)> {
    [2, 3].into_iter().flat_map(|d| {
        KERNELS.into_iter().flat_map(move |k| {
            // Single grids know no published form of MLS.
            let known = move |t: &Transfer| k == Kernel::Compact || *t != Transfer::MlsPublished;
            let transfers = TRANSFERS.into_iter().filter(known);
            transfers.flat_map(move |t| PRECISIONS.into_iter().map(move |p| (d, k, t, p)))
        })
    })
}

/// Two elastic bodies and a drop of fluid that collide.
fn collision(dimension: usize, kernel: Kernel, transfer: Transfer, precision: Precision) -> Problem {
    let mut problem = empty(dimension, [16.0, 16.0, if dimension == 3 { 12.0 } else { 1.0 }], 0.05);
    (problem.setup.kernel, problem.setup.transfer, problem.setup.precision) = (kernel, transfer, precision);
    // No step is short enough for a lone particle of the linear kernel beside a node. A short step
    // makes such particles rare.
    problem.setup.max_dt_s = (kernel == Kernel::Linear).then_some(1e-3);
    let z = if dimension == 3 { 0.3 } else { 0.0 };
    let spin = [[0.0, -2.0, 0.0], [2.0, 0.0, 0.0], [0.0, 0.0, 0.0]];
    let up = if dimension == 3 { 0.1 } else { 0.0 };
    let center = [0.25, 0.4, z];
    fill(&mut problem, elastic(2e4, 0.3, 1000.0), 2, in_ball(center, 0.11), linear([0.5, 0.05, up], spin, center));
    fill(&mut problem, neo_hookean(1e4, 0.4, 900.0), 2, in_ball([0.5, 0.43, z], 0.11), uniform([-0.5, 0.0, -up]));
    fill(&mut problem, fluid(1e4, 2.0), 2, in_ball([0.4, 0.6, z], 0.06), uniform([0.0, -0.4, 0.0]));
    problem
}

#[test]
fn mass_and_momentum_are_conserved_by_every_combination() {
    for (dimension, kernel, transfer, precision) in all_combinations() {
        let problem = collision(dimension, kernel, transfer, precision);
        let scale: f64 = (0..problem.particles.len()).map(|i| mass(&problem, &problem.particles, i) * 0.5).sum();
        let (after, steps) = run(&problem, 4);
        let drift = norm(minus(momentum(&problem, &after), momentum(&problem, &problem.particles))) / scale;
        let spin = norm(minus(angular_momentum(&problem, &after), angular_momentum(&problem, &problem.particles)));
        println!(
            "{dimension}D {kernel:?} {transfer:?} {precision:?}: {steps} steps, momentum {drift:.1e}, angular {:.1e}",
            spin / scale
        );
        let tolerance = if precision == Precision::F64 { 1e-13 } else { 2e-6 };
        assert!(drift < tolerance, "{dimension}D {kernel:?} {transfer:?} {precision:?}: momentum drifts by {drift:e}");
        // Angular momentum in units of m v × 1 m.
        assert!(
            transfer == Transfer::Pic || spin / scale < tolerance,
            "{dimension}D {kernel:?} {transfer:?} {precision:?}: angular momentum drifts by {:e}",
            spin / scale
        );
        assert!(after.x.iter().flatten().chain(after.f.iter().flatten()).all(|x| x.is_finite()));
    }
}

#[test]
fn grid_totals_are_the_particles() {
    for (dimension, kernel, transfer, precision) in all_combinations() {
        let problem = collision(dimension, kernel, transfer, precision);
        let mut solver = stages(&problem.setup, problem.particles.clone());
        solver.p2g(1e-3);
        let (nodes, grids) = (solver.nodes(), if kernel == Kernel::Compact { 2.0 } else { 1.0 });
        let total: f64 = problem.setup.bodies.iter().map(|b| b.mass * b.particles.len() as f64).sum();
        let on_grid: f64 = nodes.iter().map(|n| n.mass / grids).sum();
        let tolerance = if precision == Precision::F64 { 1e-14 } else { 1e-6 };
        assert!((on_grid / total - 1.0).abs() < tolerance, "{dimension}D {kernel:?}: mass {on_grid} of {total}");
        let momentum_of_grid: Vec3 = std::array::from_fn(|a| nodes.iter().map(|n| n.momentum[a] / grids).sum());
        let error = norm(minus(momentum_of_grid, momentum(&problem, &problem.particles))) / (0.5 * total);
        assert!(error < tolerance, "{dimension}D {kernel:?} {transfer:?}: momentum off by {error:e}");
        assert!(nodes.iter().all(|n| n.mass > 0.0));
    }
}

#[test]
fn free_fall_and_rigid_translation_are_exact_to_rounding() {
    for (dimension, kernel, transfer, precision) in all_combinations() {
        let mut problem = empty(dimension, [24.0, 24.0, if dimension == 3 { 24.0 } else { 1.0 }], 1.0 / 24.0);
        (problem.setup.kernel, problem.setup.transfer, problem.setup.precision) = (kernel, transfer, precision);
        let last = dimension - 1;
        problem.setup.gravity[last] = -9.81;
        // Equal steps, whatever the material.
        problem.setup.max_dt_s = Some(1e-3);
        // No round numbers: the linear kernel cannot cope with particles that lie on a node to
        // rounding.
        let mut v = [0.313737, 0.207131, 0.0];
        v[last] = 0.957713;
        let middle = if dimension == 3 { 0.5 } else { 0.0 };
        // Beside a node, a stiff particle of the linear kernel is unstable at every step.
        let stiffness = if kernel == Kernel::Linear { 1e-6 } else { 1e5 };
        fill(&mut problem, elastic(stiffness, 0.3, 1000.0), 2, in_ball([0.4, 0.5, middle], 0.12), uniform(v));
        let (after, _) = run(&problem, 6);
        let t = 6.0 * problem.setup.frame_s;
        let fall = -9.81 * t * t / 2.0;
        let rounding = if precision == Precision::F64 { 1e-12 } else { 3e-5 };
        // The linear kernel's slope does not decrease with its weight, so rounding on light nodes
        // reaches particles.
        let tolerance = rounding * if kernel == Kernel::Linear { 1e3 } else { 1.0 };
        for i in 0..after.len() {
            for a in 0..dimension {
                let gravity = if a == last { (fall, -9.81 * t) } else { (0.0, 0.0) };
                let x = problem.particles.x[i][a] + v[a] * t + gravity.0;
                let error = (after.x[i][a] - x).abs() + (after.v[i][a] - v[a] - gravity.1).abs();
                assert!(error < tolerance, "{dimension}D {kernel:?} {transfer:?} {precision:?}: off by {error:e}");
            }
            let strain = (0..9).map(|k| (after.f[i][k] - [1.0, 0.0][(k % 4 != 0) as usize]).abs()).fold(0.0, f64::max);
            assert!(strain < tolerance, "{dimension}D {kernel:?} {transfer:?} {precision:?}: strain {strain:e}");
        }
    }
}

/// Two spheres (CK-MPM §6.1): r = 10 dx, dx = 1/256, E = 1e6, ν = 0.4, ρ = 1e3. Here r = 5 dx, to
/// keep the suite fast.
#[test]
fn colliding_spheres_keep_momentum_for_a_thousand_steps() {
    let dx = 1.0 / 256.0;
    let mut problem = empty(3, [36.0, 20.0, 20.0], dx);
    let (left, right, r) = ([10.3 * dx, 10.0 * dx, 10.0 * dx], [22.0 * dx, 10.7 * dx, 10.2 * dx], 5.0 * dx);
    fill(&mut problem, elastic(1e6, 0.4, 1e3), 2, in_ball(left, r), uniform([0.5, 0.0, 0.0]));
    fill(&mut problem, elastic(1e6, 0.4, 1e3), 2, in_ball(right, r), uniform([-0.5, 0.0, 0.0]));
    let one: f64 = 0.5 * problem.setup.bodies[0].mass * problem.setup.bodies[0].particles.len() as f64;
    let arm = norm(angular_momentum(&problem, &problem.particles)).max(one * 5.0 * dx);
    let mut engine = CpuEngine::new(&problem.setup, problem.particles.clone()).unwrap();
    let mut steps = 0;
    let (mut worst, mut worst_spin) = (0.0f64, 0.0f64);
    while steps < 1000 {
        steps += engine.advance_frame(1.0 / 480.0, &NoControl).unwrap().steps;
        let p = engine.snapshot().unwrap();
        worst = worst.max(norm(minus(momentum(&problem, &p), momentum(&problem, &problem.particles))) / one);
        let spin = minus(angular_momentum(&problem, &p), angular_momentum(&problem, &problem.particles));
        worst_spin = worst_spin.max(norm(spin) / arm);
    }
    let p = engine.snapshot().unwrap();
    let bounced = centre(&p, problem.setup.bodies[0].particles.clone())[0] - left[0];
    println!(
        "{steps} steps: momentum {worst:.1e}, angular momentum {worst_spin:.1e}, left sphere moved {bounced:.4} m"
    );
    assert!(worst < 1e-12, "momentum drifts by {worst:e} of one sphere's");
    assert!(worst_spin < 1e-10, "angular momentum drifts by {worst_spin:e}");
    let v = p.v[..problem.setup.bodies[0].particles.len()].iter().map(|v| v[0]).sum::<f64>();
    assert!(v < 0.0, "the spheres did not bounce");
}

/// A rod rotating about its middle, with its ends at ±1 m/s (CK-MPM §6.1).
#[test]
fn a_rotating_rod_keeps_angular_momentum_for_a_thousand_steps() {
    for (kernel, transfer) in
        [(Kernel::Compact, Transfer::Mls), (Kernel::Compact, Transfer::Apic), (Kernel::Quadratic, Transfer::Mls)]
    {
        let dx = 1.0 / 64.0;
        let mut problem = empty(3, [32.0, 32.0, 12.0], dx);
        (problem.setup.kernel, problem.setup.transfer) = (kernel, transfer);
        let (center, half) = ([16.1 * dx, 16.0 * dx, 6.05 * dx], 10.0 * dx);
        let w = 1.0 / half;
        let spin = [[0.0, -w, 0.0], [w, 0.0, 0.0], [0.0; 3]];
        let rod = |x: Vec3| (x[0] - center[0]).abs() < half && (x[1] - center[1]).hypot(x[2] - center[2]) < 2.0 * dx;
        fill(&mut problem, elastic(1e6, 0.4, 1e3), 2, rod, linear([0.0; 3], spin, center));
        let before = angular_momentum(&problem, &problem.particles);
        let mut engine = CpuEngine::new(&problem.setup, problem.particles.clone()).unwrap();
        let (mut steps, mut worst) = (0, 0.0f64);
        while steps < 1000 {
            steps += engine.advance_frame(1.0 / 48.0, &NoControl).unwrap().steps;
            let p = engine.snapshot().unwrap();
            worst = worst.max(norm(minus(angular_momentum(&problem, &p), before)) / norm(before));
        }
        println!("{kernel:?} {transfer:?}: {steps} steps, angular momentum {worst:.1e}");
        assert!(worst < 1e-10, "{kernel:?} {transfer:?}: angular momentum drifts by {worst:e}");
    }
}

#[test]
fn results_do_not_depend_on_the_number_of_threads() {
    for precision in PRECISIONS {
        let problem = collision(3, Kernel::Compact, Transfer::Mls, precision);
        let with = |threads: usize| -> Particles {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| run(&problem, 3).0)
        };
        let one = with(1);
        for threads in [2, 3] {
            let many = with(threads);
            let bits = |p: &Particles| -> Vec<u64> { p.x.iter().chain(&p.v).flatten().map(|x| x.to_bits()).collect() };
            assert!(bits(&one) == bits(&many), "{precision:?}: {threads} threads differ from one");
        }
    }
}

/// A body that crosses a periodic boundary behaves as it does in the middle. The number of cells
/// along the axis is not a multiple of a block's.
#[test]
fn periodic_axes_are_invariant_under_translation() {
    for (kernel, dimension) in [(Kernel::Compact, 3), (Kernel::Quadratic, 3), (Kernel::Cubic, 2), (Kernel::Linear, 2)] {
        let (n, dx) = (10.0, 0.1);
        let at = |shift: f64| {
            let mut problem = empty(dimension, [n, n, if dimension == 3 { n } else { 1.0 }], dx);
            problem.setup.kernel = kernel;
            problem.setup.axes = [Axis::Periodic; 3];
            let wrap = |x: Vec3| -> Vec3 {
                std::array::from_fn(|a| if a < dimension { (x[a] - shift).rem_euclid(n * dx) } else { x[a] })
            };
            let z = if dimension == 3 { 0.5 } else { 0.0 };
            let inside = move |x: Vec3| in_ball([0.5, 0.5, z], 0.25)(wrap(x));
            let swirl = move |x: Vec3| {
                let y = wrap(x);
                ([y[1] - 0.3, 0.2 - y[0], 0.0], [[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0; 3]])
            };
            fill(&mut problem, elastic(1e4, 0.3, 1000.0), 2, inside, swirl);
            run(&problem, 4).0
        };
        // The sampling order differs between the two, so particles are compared by position.
        let key = |x: Vec3, shift: f64| -> [i64; 3] {
            std::array::from_fn(|a| ((x[a] - shift).rem_euclid(n * dx) * 1e7).round() as i64)
        };
        let sorted = |p: &Particles, shift: f64| {
            let mut keys: Vec<_> = (0..p.len())
                .map(|i| {
                    let mut k = key(p.x[i], shift);
                    k[2] *= (dimension == 3) as i64;
                    (k, p.v[i].map(|v| (v * 1e7).round() as i64))
                })
                .collect();
            keys.sort_unstable();
            keys
        };
        let (middle, shifted) = (at(0.0), at(0.6));
        let (a, b) = (sorted(&middle, 0.0), sorted(&shifted, 0.6));
        assert_eq!(a.len(), b.len());
        let close = |x: &[i64; 3], y: &[i64; 3]| x.iter().zip(y).all(|(x, y)| (x - y).abs() <= 1);
        assert!(a.iter().zip(&b).all(|(a, b)| close(&a.0, &b.0) && close(&a.1, &b.1)), "{kernel:?} {dimension}D");
    }
}
