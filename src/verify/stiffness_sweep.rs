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
            and iterations hardly grow; over the sweep, HOT as published takes no more iterations than an independent \
            prototype",
    source: "Wang et al. 2020 (HOT), Fig. 20; each step also taken at a tolerance of 1e-9",
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

/// What steps took at a tolerance, on average, and what they left.
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

/// Steps from rest, each taken to convergence and, from the same state, at each of the tolerances.
fn compare<const N: usize>(problem: &Problem, tolerances: [f64; N]) -> Result<[Run; N], EngineError> {
    let mut before = problem.particles.clone();
    let mut runs = tolerances.map(|_| Run { iterations: 0.0, inner: 0.0, error: 0.0, estimate: [f64::INFINITY, 0.0] });
    for step in 0..STEPS {
        let take = |tolerance: f64| {
            let mut setup = problem.setup.clone();
            setup.implicit = Implicit { tolerance: Some(tolerance), ..Implicit::default() };
            let mut engine = ImplicitEngine::new(&setup, before.clone())?.at(f64::from(step) / RATE);
            let stats = engine.advance_frame(1.0 / RATE, &NoControl)?;
            Ok::<_, EngineError>((engine.snapshot()?, stats.solves))
        };
        let (exact, _) = take(CONVERGED)?;
        for (run, tolerance) in runs.iter_mut().zip(tolerances) {
            let (after, solves) = take(tolerance)?;
            let error = distance(&after, &exact) / distance(&exact, &before);
            for solve in &solves {
                run.iterations += f64::from(solve.iterations) / f64::from(STEPS);
                run.inner += f64::from(solve.inner_iterations) / f64::from(STEPS);
                run.estimate[0] = run.estimate[0].min(solve.residual / error);
                run.estimate[1] = run.estimate[1].max(solve.residual / error);
            }
            run.error = run.error.max(error);
        }
        before = exact;
    }
    Ok(runs)
}

/// Outer iterations a step of HOT as published, from rest.
fn published(mut problem: Problem) -> Result<f64, EngineError> {
    problem.setup.implicit = Implicit {
        method: Method::Hot,
        smoother: Smoother::GaussSeidel,
        coarse_solve: CoarseSolve::Adaptive,
        rebuild: false,
        ..Implicit::default()
    };
    let mut engine = ImplicitEngine::new(&problem.setup, problem.particles)?;
    let mut iterations = 0;
    for _ in 0..STEPS {
        iterations += engine.advance_frame(1.0 / RATE, &NoControl)?.solves.iter().map(|s| s.iterations).sum::<u32>();
    }
    Ok(f64::from(iterations) / f64::from(STEPS))
}

/// Root of the sum of squared differences of all velocities (m/s).
fn distance(a: &Particles, b: &Particles) -> f64 {
    let squared = |(a, b): (&[f64; 3], &[f64; 3])| (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>();
    a.v.iter().zip(&b.v).map(squared).sum::<f64>().sqrt()
}

fn stiffness_sweep(session: &mut Session) -> Result<(), EngineError> {
    let mut of_hot = Vec::new();
    for kernel in [Kernel::Quadratic, Kernel::Compact] {
        let name = if kernel == Kernel::Compact { "compact" } else { "quadratic" };
        let mut softest = [f64::NAN; 2];
        let mut columns = [const { Vec::new() }; 7];
        for (middle_pa, _) in SWEEP {
            let problem = bar(session, kernel, middle_pa);
            columns[0].push(middle_pa);
            let tolerances = [1e-2, 1e-4];
            for (k, ours) in compare(&problem, tolerances)?.into_iter().enumerate() {
                if softest[k].is_nan() {
                    softest[k] = ours.iterations;
                }
                let tolerance = tolerances[k];
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
                of_hot.push(published(problem)?);
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
    let mean = |iterations: &[f64]| iterations.iter().sum::<f64>() / SWEEP.len() as f64;
    let (young, prototype): (Vec<f64>, Vec<f64>) = SWEEP.into_iter().unzip();
    let (rule, got) = ((Rule::AtMost, mean(&prototype), 0.0), mean(&of_hot));
    session.check("quadratic, HOT as published", "outer iterations a step, mean of the sweep", "", rule, got);
    let columns =
        vec![("youngs_modulus_pa", young), ("iterations", of_hot), ("iterations_of_the_prototype", prototype)];
    session.curve("published", columns);
    Ok(())
}
