//! The implicit engine: what must be exact, what implicit Euler conserves and damps, and lagged
//! plasticity.
//!
//! Forces at the step's end, P(Fⁿ⁺¹) Fⁿᵀ, conserve linear momentum, and energy never grows. The
//! transfers conserve angular momentum. The step changes it by dt Σ m vⁿ⁺¹ × vⁿ, which slows a
//! rigid body that rotates by θ in a step to about θ − θ³ in the next.

use std::f64::consts::PI;

use crate::problems::*;
use gridfall_core::material::Law;
use gridfall_core::material::parameters::{Elasticity, VonMises};
use gridfall_core::maths::linalg::{Matrix, identity, to_row_major};
use gridfall_core::sim::diagnostics::Row;
use gridfall_core::sim::moments::moment_matrix;
use gridfall_core::sim::particles::Particles;
use gridfall_core::sim::setup::{Axis, Problem};
use gridfall_core::sim::setup::{Kernel, Material, Transfer};
use gridfall_engine::implicit::ImplicitEngine;
use gridfall_engine::{Engine, FrameStats, NoControl};

const KERNELS: [Kernel; 2] = [Kernel::Quadratic, Kernel::Compact];

/// Like [`empty`], but integrated implicitly, with one step per frame while nothing moves further
/// than ½ dx.
fn implicit(dimension: usize, cells: Vec3, dx: f64, kernel: Kernel) -> Problem {
    let mut problem = empty(dimension, cells, dx);
    problem.setup.kernel = kernel;
    problem.setup.implicit.tolerance = Some(1e-9);
    problem
}

/// Runs frames of one step each, checks that every solve converged, and calls `each` after every
/// frame.
fn run_steps(problem: &Problem, steps: usize, mut each: impl FnMut(&Particles, &FrameStats)) {
    let mut engine = ImplicitEngine::new(&problem.setup, problem.particles.clone()).unwrap();
    for step in 1..=steps {
        let stats = engine.advance_frame(problem.setup.frame_s, &NoControl).unwrap();
        assert_eq!(stats.steps, 1, "step {step} was to take one step");
        assert!(stats.solves.iter().all(|solve| solve.converged), "step {step}: {:?}", stats.solves);
        each(&engine.snapshot().unwrap(), &stats);
    }
}

fn sums(problem: &Problem, particles: &Particles) -> Row {
    Row::measure(&problem.setup, particles, 0, 0.0, &FrameStats::default())
}

fn total_energy(problem: &Problem, particles: &Particles) -> f64 {
    let row = sums(problem, particles);
    row.kinetic_j + row.affine_j + row.strain_j
}

/// Largest difference of two arrays; NaN is kept as the worst.
fn farthest<const N: usize>(a: &[f64; N], b: &[f64; N]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, |m, d| if d > m || d.is_nan() { d } else { m })
}

#[test]
fn homogeneous_stress_is_in_equilibrium() {
    for (dimension, kernel) in
        [(2, Kernel::Quadratic), (2, Kernel::Compact), (3, Kernel::Quadratic), (3, Kernel::Compact)]
    {
        let dx = 0.1;
        let mut problem = implicit(dimension, [4.0, 4.0, if dimension == 3 { 4.0 } else { 1.0 }], dx, kernel);
        problem.setup.axes = [Axis::Periodic; 3];
        problem.setup.frame_s = 0.05;
        let drift = if dimension == 3 { [0.3, -0.2, 0.1] } else { [0.3, -0.2, 0.0] };
        fill(&mut problem, neo_hookean(1e6, 0.3, 1000.0), 2, |_| true, uniform(drift));
        let mut f: Matrix<f64, 3> = [[1.1, 0.2, 0.0], [-0.1, 0.9, 0.1], [0.0, 0.05, 1.2]];
        if dimension == 2 {
            f = [[1.1, 0.2, 0.0], [-0.1, 0.9, 0.0], [0.0, 0.0, 1.0]];
        }
        let f = to_row_major(&f, 1.0);
        problem.particles.f.fill(f);
        run_steps(&problem, 4, |p, _| {
            let strain = p.f.iter().map(|now| farthest(now, &f)).fold(0.0, f64::max);
            let speed = p.v.iter().map(|v| farthest(v, &drift)).fold(0.0, f64::max);
            assert!(strain < 1e-9 && speed < 1e-9, "{dimension}D {kernel:?}: strain {strain:e}, speed {speed:e} m/s");
        });
    }
}

#[test]
fn an_affine_velocity_field_deforms_a_body_uniformly() {
    for (kernel, transfer) in
        KERNELS.into_iter().flat_map(|k| [Transfer::Apic, Transfer::Mls, Transfer::MlsPublished].map(|t| (k, t)))
    {
        let dx = 0.1;
        let mut problem = implicit(2, [16.0, 16.0, 1.0], dx, kernel);
        problem.setup.transfer = transfer;
        problem.setup.frame_s = 0.02;
        let gradient = [[0.7, -0.4, 0.0], [0.9, 0.5, 0.0], [0.0; 3]];
        // So soft that the surface, where stress is not in equilibrium, has no effect three cells
        // inside it.
        let block = in_box([0.4, 0.4, 0.0], [1.2, 1.2, 0.0]);
        fill(&mut problem, elastic(1.0, 0.3, 1000.0), 2, block, linear([0.1, 0.2, 0.0], gradient, [0.8, 0.8, 0.0]));
        let inside = in_box([0.7, 0.7, 0.0], [0.9, 0.9, 0.0]);
        let start = problem.particles.x.clone();
        let mut expected: Matrix<f64, 3> = identity();
        for i in 0..2 {
            for j in 0..2 {
                expected[i][j] += problem.setup.frame_s * gradient[i][j];
            }
        }
        let expected = to_row_major(&expected, 1.0);
        run_steps(&problem, 1, |p, _| {
            let strains = p.f.iter().zip(&start).filter(|(_, x)| inside(**x)).map(|(f, _)| farthest(f, &expected));
            let error = strains.fold(0.0, f64::max);
            assert!(error < 1e-9, "{kernel:?} {transfer:?}: {error:e}");
        });
    }
}

#[test]
fn a_thrown_body_falls_without_strain() {
    for (dimension, kernel) in [(2, Kernel::Quadratic), (2, Kernel::Compact), (3, Kernel::Compact)] {
        let dx = 0.05;
        let mut problem = implicit(dimension, [20.0, 20.0, if dimension == 3 { 20.0 } else { 1.0 }], dx, kernel);
        problem.setup.gravity = [0.0, -9.81, 0.0];
        problem.setup.frame_s = 0.01;
        let v = [0.8, 1.3, 0.0];
        fill(
            &mut problem,
            elastic(1e8, 0.3, 1000.0),
            2,
            in_ball([0.4, 0.4, if dimension == 3 { 0.4 } else { 0.0 }], 0.12),
            uniform(v),
        );
        let start = problem.particles.clone();
        let steps = 8;
        let mut after = start.clone();
        run_steps(&problem, steps, |p, _| after = p.clone());
        let (dt, n) = (problem.setup.frame_s, steps as f64);
        let fall = -9.81 * dt * dt * 0.5 * n * (n + 1.0);
        for p in 0..start.len() {
            let expected = [start.x[p][0] + v[0] * n * dt, start.x[p][1] + v[1] * n * dt + fall, start.x[p][2]];
            let error = norm(minus(after.x[p], expected)) / dx;
            let strain = farthest(&after.f[p], &start.f[p]);
            assert!(error < 1e-11 && strain < 1e-11, "{dimension}D {kernel:?}: {error:e} dx, strain {strain:e}");
        }
    }
}

/// A block that is released stretched, rotating and flying.
fn released(dimension: usize, kernel: Kernel, transfer: Transfer, material: Material) -> Problem {
    let dx = 1.0 / 16.0;
    let three = dimension == 3;
    let mut problem = implicit(dimension, [16.0, 16.0, if three { 16.0 } else { 1.0 }], dx, kernel);
    problem.setup.transfer = transfer;
    problem.setup.frame_s = 0.01;
    // Momentum is conserved up to the sum of the residuals.
    problem.setup.implicit.tolerance = Some(1e-11);
    let high = if three { 9.0 * dx } else { 0.0 };
    let low = if three { 5.0 * dx } else { 0.0 };
    let spin =
        [[0.0, -2.0, 0.0], [2.0, 0.0, if three { 0.5 } else { 0.0 }], [0.0, if three { -0.5 } else { 0.0 }, 0.0]];
    let block = in_box([5.0 * dx, 5.0 * dx, low], [11.0 * dx, 9.0 * dx, high]);
    fill(&mut problem, material, 2, block, linear([0.3, -0.2, 0.0], spin, [8.0 * dx, 7.0 * dx, 0.5 * (low + high)]));
    let f = if three {
        [1.1, 0.1, 0.0, 0.0, 0.95, 0.0, 0.0, 0.05, 0.9]
    } else {
        [1.1, 0.1, 0.0, 0.0, 0.9, 0.0, 0.0, 0.0, 1.0]
    };
    problem.particles.f.fill(f);
    problem
}

#[test]
fn a_free_body_keeps_its_momentum_and_never_gains_energy() {
    for dimension in [2, 3] {
        for (kernel, transfer) in
            KERNELS.into_iter().flat_map(|k| [Transfer::Apic, Transfer::Mls, Transfer::MlsPublished].map(|t| (k, t)))
        {
            for material in [elastic(2e4, 0.3, 1000.0), neo_hookean(2e6, 0.4, 1000.0)] {
                if dimension == 3 && (transfer == Transfer::Apic || matches!(material, Material::NeoHookean(_))) {
                    continue;
                }
                let problem = released(dimension, kernel, transfer, material);
                let before = momentum(&problem, &problem.particles);
                let (first, mut last) = (total_energy(&problem, &problem.particles), f64::INFINITY);
                let spin = norm(angular_momentum(&problem, &problem.particles));
                let (mut drift, mut spin_last) = (0.0f64, spin);
                run_steps(&problem, if dimension == 2 { 20 } else { 8 }, |p, _| {
                    let now = total_energy(&problem, p);
                    assert!(
                        now <= last.min(first) * (1.0 + 1e-12),
                        "{dimension}D {kernel:?} {transfer:?}: {now} J after {last} J"
                    );
                    drift = drift.max(norm(minus(momentum(&problem, p), before)) / norm(before));
                    (last, spin_last) = (now, norm(angular_momentum(&problem, p)));
                });
                println!(
                    "{dimension}D {kernel:?} {transfer:?}: momentum drift {drift:e}, energy {first:.4} → {last:.4} \
                     J, angular momentum {:.5} of its start",
                    spin_last / spin
                );
                assert!(drift < 1e-7, "{dimension}D {kernel:?} {transfer:?}: {drift:e}");
            }
        }
    }
}

#[test]
fn implicit_euler_slows_a_spinning_body_by_its_law() {
    for kernel in KERNELS {
        let dx = 1.0 / 16.0;
        let mut problem = implicit(2, [20.0, 20.0, 1.0], dx, kernel);
        problem.setup.frame_s = 0.02;
        problem.setup.implicit.tolerance = Some(1e-12);
        let (center, omega) = ([10.0 * dx, 10.0 * dx, 0.0], 5.0);
        let spin = [[0.0, -omega, 0.0], [omega, 0.0, 0.0], [0.0; 3]];
        fill(&mut problem, elastic(1e8, 0.3, 1000.0), 2, in_ball(center, 5.0 * dx), linear([0.0; 3], spin, center));
        // Moments of inertia of the particles' positions and of their affine parts.
        let (mut places, mut affine) = (0.0, 0.0);
        for x in &problem.particles.x {
            places += minus(*x, center).iter().map(|c| c * c).sum::<f64>();
            let moment = moment_matrix(kernel, x.map(|x| x / dx), dx, 2);
            affine += moment[0] + moment[4];
        }
        // v is ω × x at first, so tan θ = ω dt in the first step. After that, v = A x at the
        // positions at the step's start with A = (R − I)/dt, and the particles, which have moved
        // on, carry A: I_x (2 sin θ' − sin(θ' + θ)) = I_D sin(θ − θ').
        let mut angle = (omega * problem.setup.frame_s).atan();
        let start = angular_momentum(&problem, &problem.particles)[2];
        let (mut found, mut expected) = (Vec::new(), Vec::new());
        run_steps(&problem, 20, |p, _| {
            expected.push(angle.sin() / (omega * problem.setup.frame_s));
            found.push(angular_momentum(&problem, p)[2] / start);
            let before = angle;
            for _ in 0..8 {
                let value = places * (2.0 * angle.sin() - (angle + before).sin()) - affine * (before - angle).sin();
                let slope = places * (2.0 * angle.cos() - (angle + before).cos()) + affine * (before - angle).cos();
                angle -= value / slope;
            }
        });
        let (got, law) = (found[19], expected[19]);
        println!("{kernel:?}: angular momentum after 20 steps {got:.5}, implicit Euler of a rigid body {law:.5}");
        assert!(law < 0.9 && ((1.0 - got) / (1.0 - law) - 1.0).abs() < 0.01, "{kernel:?}: {found:?} {expected:?}");
    }
}

/// The first longitudinal mode of a free–free bar with ν = 0 has ω = π √(E/ρ)/L. Implicit Euler
/// makes the period T = 2π dt/atan(ω dt) and multiplies the amplitude by 1/√(1 + ω² dt²) per step.
#[test]
fn a_free_bar_swings_and_is_damped_as_implicit_euler_has_it() {
    for (kernel, transfer) in
        [(Kernel::Quadratic, Transfer::Mls), (Kernel::Compact, Transfer::Mls), (Kernel::Compact, Transfer::Apic)]
    {
        let (cells, dx) = (32, 1.0 / 32.0);
        let length = cells as f64 * dx;
        let mut problem = implicit(2, [cells as f64 + 8.0, 10.0, 1.0], dx, kernel);
        problem.setup.transfer = transfer;
        let low = 4.0 * dx;
        let mode = move |x: f64| (PI * (x - low) / length).cos();
        let slope = move |x: f64| -PI / length * (PI * (x - low) / length).sin();
        let swing =
            move |x: Vec3| ([1e-3 * mode(x[0]), 0.0, 0.0], [[1e-3 * slope(x[0]), 0.0, 0.0], [0.0; 3], [0.0; 3]]);
        fill(
            &mut problem,
            elastic(1e4, 0.0, 1000.0),
            2,
            in_box([low, low, 0.0], [low + length, low + 3.0 * dx, 0.0]),
            swing,
        );
        let omega = PI * (1e4f64 / 1000.0).sqrt() / length;
        problem.setup.frame_s = 2.0 * PI / omega / 24.0;
        let start = problem.particles.x.clone();
        let amplitude = |p: &Particles| p.v.iter().zip(&start).map(|(v, x)| v[0] * mode(x[0])).sum::<f64>();
        let mut values = vec![amplitude(&problem.particles)];
        run_steps(&problem, 48, |p, _| values.push(amplitude(p)));
        let dt = problem.setup.frame_s;
        let (angle, decay) = fit(&values[1..]);
        let (expected, shrink) = ((omega * dt).atan(), 1.0 / (1.0 + (omega * dt).powi(2)).sqrt());
        println!(
            "{kernel:?} {transfer:?}: T = {:.5} s, implicit Euler {:.5} s, continuum {:.5} s; a step leaves \
             {decay:.5}, implicit Euler {shrink:.5}",
            2.0 * PI * dt / angle,
            2.0 * PI * dt / expected,
            2.0 * PI / omega
        );
        assert!((angle / expected - 1.0).abs() < 0.01, "{kernel:?} {transfer:?}");
        assert!(((1.0 - decay) / (1.0 - shrink) - 1.0).abs() < 0.05, "{kernel:?} {transfer:?}");
    }
}

/// Angle and factor per step of a damped oscillation: a_{n+1} = 2 r cos φ a_n − r² a_{n−1}, by
/// least squares.
fn fit(a: &[f64]) -> (f64, f64) {
    let (mut m, mut rhs) = ([[0.0; 2]; 2], [0.0; 2]);
    for w in a.windows(3) {
        let row = [w[1], -w[0]];
        for i in 0..2 {
            rhs[i] += row[i] * w[2];
            for j in 0..2 {
                m[i][j] += row[i] * row[j];
            }
        }
    }
    let det = m[0][0] * m[1][1] - m[0][1] * m[1][0];
    let (p, q) = ((m[1][1] * rhs[0] - m[0][1] * rhs[1]) / det, (m[0][0] * rhs[1] - m[1][0] * rhs[0]) / det);
    ((0.5 * p / q.sqrt()).acos(), q.sqrt())
}

#[test]
fn a_metal_bar_pulled_beyond_yield_ends_on_the_yield_surface() {
    for elasticity in [Elasticity::Hencky, Elasticity::FixedCorotated] {
        for kernel in KERNELS {
            let dx = 0.05;
            let mut problem = implicit(2, [24.0, 12.0, 1.0], dx, kernel);
            problem.setup.frame_s = 1e-3;
            let yield_stress = 5e4;
            let metal = Material::VonMises(VonMises {
                density: 1000.0,
                youngs_modulus: 1e8,
                poissons_ratio: 0.3,
                yield_stress,
                elasticity,
                damping: 0.0,
            });
            let law = Law::<f64>::new(&metal);
            // It flies apart: inertia alone stretches it to several times the yield strain.
            let stretch = [[5.0, 0.0, 0.0], [0.0, -5.0, 0.0], [0.0; 3]];
            let center = [12.0 * dx, 6.0 * dx, 0.0];
            fill(
                &mut problem,
                metal,
                2,
                in_box([8.0 * dx, 4.0 * dx, 0.0], [16.0 * dx, 8.0 * dx, 0.0]),
                linear([0.0; 3], stretch, center),
            );
            let mut worst = 0.0f64;
            let mut most = 0;
            run_steps(&problem, 4, |p, _| {
                let mut on_surface = 0;
                for f in &p.f {
                    let f2: Matrix<f64, 2> = [[f[0], f[1]], [f[3], f[4]]];
                    let (tau, _) = law.kirchhoff(&f2, 0.0);
                    let mean = 0.5 * (tau[0][0] + tau[1][1]);
                    let deviator =
                        ((tau[0][0] - mean).powi(2) + (tau[1][1] - mean).powi(2) + 2.0 * tau[0][1].powi(2)).sqrt();
                    let excess = deviator / ((2.0f64 / 3.0).sqrt() * yield_stress) - 1.0;
                    worst = worst.max(excess);
                    on_surface += usize::from(excess.abs() < 1e-9);
                }
                most = most.max(on_surface);
            });
            println!(
                "{elasticity:?} {kernel:?}: {most} of {} particles on the yield surface, none beyond by more than \
                 {worst:e}",
                problem.particles.len()
            );
            assert!(worst < 1e-9 && 2 * most > problem.particles.len(), "{elasticity:?} {kernel:?}");
        }
    }
}
