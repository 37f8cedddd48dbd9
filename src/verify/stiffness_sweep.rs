//! Iterations of the implicit solver as a part of a bar becomes stiffer, and what its tolerance is
//! worth.

use serde_json::json;

use super::Case;
use super::report::Rule;
use super::session::Session;
use super::setup::{Scheme, problem};
use gridfall_core::sim::particles::Particles;
use gridfall_core::sim::setup::{
    CoarseSolve, ContactAt, Implicit, Integrator, Kernel, Method, Problem, Smoother, Transfer,
};
use gridfall_engine::implicit::ImplicitEngine;
use gridfall_engine::{Engine, EngineError, NoControl};

pub const STIFFNESS_SWEEP: Case = Case {
    name: "stiffness-sweep",
    claim: "while the middle of a twisted bar goes from 1e5 to 1e10 Pa, the tolerance bounds the error of a step's Δv, \
            and iterations hardly grow; HOT as published takes as many iterations as an independent prototype",
    source: "Wang et al. 2020 (HOT), Fig. 20; each step repeated at a tolerance of 1e-9",
    gpu: false,
    quick: false,
    run: stiffness_sweep,
};

/// Young's modulus of the middle (Pa), and the prototype's mean outer iterations at ε = 1e-7.
const SWEEP: [(f64, f64); 6] = [(1e5, 5.2), (1e6, 5.8), (1e7, 6.4), (1e8, 9.6), (1e9, 11.8), (1e10, 18.0)];
/// Steps per second (1/s).
const RATE: f64 = 48.0;
/// Steps in a run.
const STEPS: u32 = 3;
/// A tolerance near the level of rounding.
const CONVERGED: f64 = 1e-9;

/// What a step took and left, on average.
#[derive(Default)]
struct Run {
    iterations: f64,
    /// V-cycles, or iterations of another linear solver.
    inner: f64,
    /// Largest relative error of a step's Δv.
    error: f64,
    /// Range of the solver's estimate over the error, where it stops.
    estimate: [f64; 2],
}

fn bar(session: &Session, kernel: Kernel, middle_pa: f64) -> Problem {
    let material = |young: f64| {
        json!({ "model": "fixed-corotated", "density": 2000,
                "youngs_modulus": young, "poissons_ratio": 0.3 })
    };
    let part = |name: &str, material: &str, from: f64, to: f64| {
        json!({ "name": name, "material": material, "sampling": "jittered",
                "shape": { "box": { "min": [0.14, from, 0.14], "max": [0.26, to, 0.26] } } })
    };
    let grip = |from: f64, to: f64, spin: f64| {
        json!({ "name": format!("grip at {from}"), "contact": "sticky",
                "shape": { "box": { "min": [0.1, from, 0.1], "max": [0.3, to, 0.3] } },
                "motion": { "angular_velocity": [0, spin, 0], "center": [0.2, 1, 0.2] } })
    };
    let mut problem = problem(
        session,
        Scheme::new(3, kernel, Transfer::Apic),
        json!({
            "domain": { "min": [0, 0, 0], "max": [0.4, 1.2, 0.4], "dx": 0.02 },
            "materials": { "soft": material(1e5), "middle": material(middle_pa) },
            "bodies": [ part("lower", "soft", 0.14, 0.44), part("middle", "middle", 0.44, 0.74),
                        part("upper", "soft", 0.74, 1.04) ],
            "colliders": [ grip(0.05, 0.19, 0.0), grip(0.99, 1.15, 2.0 * std::f64::consts::PI) ],
        }),
    );
    (problem.setup.integrator, problem.setup.cfl) = (Integrator::Implicit, 1.0);
    problem.setup.contact_at = ContactAt::Nodes;
    problem
}

/// Steps from rest. Each step is repeated from the same state to convergence.
fn run(problem: &Problem) -> Result<Run, EngineError> {
    let mut engine = ImplicitEngine::new(&problem.setup, problem.particles.clone())?;
    let mut before = problem.particles.clone();
    let mut run = Run { estimate: [f64::INFINITY, 0.0], ..Run::default() };
    for step in 0..STEPS {
        let stats = engine.advance_frame(1.0 / RATE, &NoControl)?;
        let after = engine.snapshot()?;
        let mut exact = Problem { particles: before.clone(), ..problem.clone() };
        exact.setup.implicit = Implicit { tolerance: Some(CONVERGED), ..Implicit::default() };
        let mut exact = ImplicitEngine::new(&exact.setup, exact.particles.clone())?.at(f64::from(step) / RATE);
        exact.advance_frame(1.0 / RATE, &NoControl)?;
        let exact = exact.snapshot()?;
        let error = distance(&after, &exact) / distance(&exact, &before);
        for solve in &stats.solves {
            run.iterations += f64::from(solve.iterations) / f64::from(STEPS);
            run.inner += f64::from(solve.inner_iterations) / f64::from(STEPS);
            run.estimate[0] = run.estimate[0].min(solve.residual / error);
            run.estimate[1] = run.estimate[1].max(solve.residual / error);
        }
        run.error = run.error.max(error);
        before = after;
    }
    Ok(run)
}

/// Root of the sum of squared differences of all velocities (m/s).
fn distance(a: &Particles, b: &Particles) -> f64 {
    let squared = |(a, b): (&[f64; 3], &[f64; 3])| (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>();
    a.v.iter().zip(&b.v).map(squared).sum::<f64>().sqrt()
}

fn stiffness_sweep(session: &mut Session) -> Result<(), EngineError> {
    for kernel in [Kernel::Quadratic, Kernel::Compact] {
        let name = if kernel == Kernel::Compact { "compact" } else { "quadratic" };
        let mut softest = [f64::NAN; 2];
        let mut columns = [const { Vec::new() }; 7];
        for (middle_pa, reference) in SWEEP {
            let mut problem = bar(session, kernel, middle_pa);
            columns[0].push(middle_pa);
            for (k, tolerance) in [(0, 1e-2), (1, 1e-4)] {
                problem.setup.implicit.tolerance = Some(tolerance);
                let ours = run(&problem)?;
                if softest[k].is_nan() {
                    softest[k] = ours.iterations;
                }
                let variant = format!("{name}, {middle_pa:.0e} Pa, tolerance {tolerance:.0e}");
                let ratio = ours.iterations / softest[k];
                session.check(&variant, "error of a step's Δv", "", (Rule::AtMost, tolerance, 0.0), ours.error);
                session.check(&variant, "estimate over error", "", (Rule::AtLeast, 0.5, 0.0), ours.estimate[0]);
                session.check(&variant, "iterations against the softest", "", (Rule::AtMost, 1.5, 0.0), ratio);
                columns[1 + 3 * k].push(ours.iterations);
                columns[2 + 3 * k].push(ours.inner);
                columns[3 + 3 * k].push(ours.error);
            }
            if kernel == Kernel::Quadratic {
                problem.setup.implicit = Implicit {
                    method: Method::Hot,
                    smoother: Smoother::GaussSeidel,
                    coarse_solve: CoarseSolve::Adaptive,
                    rebuild: false,
                    ..Implicit::default()
                };
                let published = run(&problem)?;
                let variant = format!("{name}, {middle_pa:.0e} Pa, HOT as published");
                let rule = (Rule::AtMost, reference, 0.0);
                session.check(&variant, "outer iterations a step", "", rule, published.iterations);
            }
        }
        let [young, loose, loose_cycles, loose_error, tight, tight_cycles, tight_error] = columns;
        session.curve(
            name,
            vec![
                ("youngs_modulus_pa", young),
                ("iterations_at_1e-2", loose),
                ("cycles_at_1e-2", loose_cycles),
                ("error_at_1e-2", loose_error),
                ("iterations_at_1e-4", tight),
                ("cycles_at_1e-4", tight_cycles),
                ("error_at_1e-4", tight_error),
            ],
        );
    }
    Ok(())
}
