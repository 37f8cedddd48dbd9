//! The implicit engine against the theory of implicit Euler, beam theory, and the explicit engine.

use std::f64::consts::PI;

use serde_json::json;

use super::Case;
use super::report::Rule;
use super::session::Session;
use super::setup::{Scheme, Vec3, elastic, problem, set_velocity};
use gridfall_core::sim::particles::Particles;
use gridfall_core::sim::setup::{ContactAt, Integrator, Kernel, Problem, Transfer};
use gridfall_engine::implicit::ImplicitEngine;
use gridfall_engine::{Engine, EngineError, NoControl};

/// MLS with the kernels that both the paper and this build support implicitly.
const SCHEMES: [Scheme; 2] =
    [Scheme::new(2, Kernel::Quadratic, Transfer::Mls), Scheme::new(2, Kernel::Compact, Transfer::Mls)];

/// ε of the solves: small, so that the integrator is measured and not the solver's stopping point.
const TOLERANCE: f64 = 1e-9;

fn implicitly(mut problem: Problem) -> Problem {
    (problem.setup.integrator, problem.setup.contact_at) = (Integrator::Implicit, ContactAt::Nodes);
    problem.setup.implicit.tolerance = Some(TOLERANCE);
    problem
}

/// A bar of E = 1e5 Pa, ν = 0 in its first longitudinal mode, with a speed at its ends of `speed`
/// times that of the waves; its ω is in 1/s.
pub(super) struct Bar {
    pub problem: Problem,
    low: f64,
    length: f64,
    pub omega: f64,
}

impl Bar {
    pub fn new(session: &Session, scheme: Scheme, speed: f64) -> Self {
        let (young, cells, dx) = (1e5, 32, 1.0 / 32.0);
        let (length, low) = (f64::from(cells) * dx, 6.0 * dx);
        let mut problem = problem(
            session,
            scheme,
            json!({
                "domain": { "min": [0, 0], "max": [length + 12.0 * dx, 16.0 * dx], "dx": dx },
                "materials": { "jelly": elastic("fixed-corotated", young, 0.0) },
                "bodies": [ { "name": "bar", "material": "jelly",
                              "shape": { "box": { "min": [low, low], "max": [low + length, low + 4.0 * dx] } } } ],
            }),
        );
        let waves = (young / 1000.0f64).sqrt();
        let (size, wave) = (speed * waves, PI / length);
        set_velocity(&mut problem, |x| {
            let mut c = [0.0; 9];
            c[0] = -size * wave * (wave * (x[0] - low)).sin();
            ([size * (wave * (x[0] - low)).cos(), 0.0, 0.0], c)
        });
        Self { problem, low, length, omega: wave * waves }
    }

    /// Σ v_x weighted by the mode at the rest positions.
    pub fn amplitude(&self, particles: &Particles) -> f64 {
        let mode = |x: &Vec3| (PI * (x[0] - self.low) / self.length).cos();
        particles.v.iter().zip(&self.problem.particles.x).map(|(v, x)| v[0] * mode(x)).sum()
    }
}

pub const IMPLICIT_BAR: Case = Case {
    name: "implicit-bar",
    claim: "a free bar swings with the period, and loses the amplitude, that implicit Euler gives its first mode",
    source: "x'' = -ω² x by implicit Euler: T = 2π dt/atan(ω dt), a factor of 1/sqrt(1 + ω² dt²) a step; ω = π \
             sqrt(E/ρ)/L",
    gpu: false,
    quick: true,
    run: implicit_bar,
};

fn implicit_bar(session: &mut Session) -> Result<(), EngineError> {
    for scheme in SCHEMES {
        let (mut steps_a_period, mut periods, mut damping) = (Vec::new(), Vec::new(), Vec::new());
        for count in session.pick(vec![24], vec![12, 24, 48, 96]) {
            let bar = Bar::new(session, scheme, 1e-4);
            let omega = bar.omega;
            let dt = 2.0 * PI / omega / f64::from(count);
            let problem = implicitly(bar.problem.clone());
            let mut engine = ImplicitEngine::new(&problem.setup, problem.particles)?;
            let mut values = Vec::new();
            for _ in 0..2 * count {
                engine.advance_frame(dt, &NoControl)?;
                values.push(bar.amplitude(&engine.snapshot()?));
            }
            let (angle, factor) = damped_swing(&values);
            let (period, expected) = (2.0 * PI * dt / angle, 2.0 * PI * dt / (omega * dt).atan());
            let variant = format!("{scheme}, {count} steps a period");
            session.check(&variant, "period", "s", (Rule::Relative, expected, 0.01), period);
            let rate = -(factor.ln()) / dt;
            let expected = 0.5 * (omega * dt).powi(2).ln_1p() / dt;
            session.check(&variant, "damping", "1/s", (Rule::Relative, expected, 0.05), rate);
            steps_a_period.push(f64::from(count));
            periods.push(period * omega / (2.0 * PI));
            damping.push(rate);
        }
        let columns =
            vec![("steps_a_period", steps_a_period), ("period_over_exact", periods), ("damping_1_s", damping)];
        session.curve(scheme, columns);
    }
    Ok(())
}

/// Angle per step and factor per step of a damped oscillation a' = 2 r cos φ a − r² a_before, by
/// least squares.
pub(super) fn damped_swing(a: &[f64]) -> (f64, f64) {
    let (mut m, mut rhs) = ([[0.0; 2]; 2], [0.0; 2]);
    for w in a.windows(3) {
        let row = [w[1], -w[0]];
        for i in 0..2 {
            rhs[i] += row[i] * w[2];
            (0..2).for_each(|j| m[i][j] += row[i] * row[j]);
        }
    }
    let det = m[0][0] * m[1][1] - m[0][1] * m[1][0];
    let (p, q) = ((m[1][1] * rhs[0] - m[0][1] * rhs[1]) / det, (m[0][0] * rhs[1] - m[1][0] * rhs[0]) / det);
    ((0.5 * p / q.sqrt()).acos(), q.sqrt())
}

pub const IMPLICIT_CONVERGENCE: Case = Case {
    name: "implicit-convergence",
    claim: "halving the step of an implicit run halves its distance from the explicit one",
    source: "implicit Euler is of first order; the explicit engine with 1536 steps",
    gpu: false,
    quick: false,
    run: implicit_convergence,
};

fn implicit_convergence(session: &mut Session) -> Result<(), EngineError> {
    for scheme in SCHEMES {
        // Strains of up to 10 %, for three eighths of a period.
        let Bar { mut problem, omega, length, .. } = Bar::new(session, scheme, 0.1);
        let end_s = 0.375 * 2.0 * PI / omega;
        problem.setup.max_dt_s = Some(end_s / 1536.0);
        let mut explicit = session.engine(&problem)?;
        explicit.advance_frame(end_s, &NoControl)?;
        let exact = explicit.snapshot()?;
        problem.setup.max_dt_s = None;
        let problem = implicitly(problem);
        let (mut steps, mut errors) = (Vec::new(), Vec::new());
        for count in [6, 12, 24, 48, 96] {
            let mut engine = ImplicitEngine::new(&problem.setup, problem.particles.clone())?;
            for _ in 0..count {
                engine.advance_frame(end_s / f64::from(count), &NoControl)?;
            }
            let got = engine.snapshot()?;
            let squares = got.x.iter().zip(&exact.x).map(|(a, b)| (a[0] - b[0]).powi(2) + (a[1] - b[1]).powi(2));
            let error = (squares.sum::<f64>() / exact.x.len() as f64).sqrt() / length;
            steps.push(f64::from(count));
            errors.push(error);
        }
        // In longer steps the damping goes beyond the first order.
        for k in 3..errors.len() {
            let variant = format!("{scheme}, {} and {} steps", steps[k - 1], steps[k]);
            session.check(&variant, "ratio of errors", "", (Rule::Relative, 2.0, 0.1), errors[k - 1] / errors[k]);
        }
        session.curve(scheme, vec![("steps", steps), ("position_error_over_length", errors)]);
    }
    Ok(())
}

pub const IMPLICIT_CANTILEVER: Case = Case {
    name: "implicit-cantilever",
    claim: "a cantilever let go comes to rest, by implicit Euler's damping, at its deflection under its own weight",
    source: "Timoshenko's beam, δ = q L⁴ / 8 E I + q L² / 2 κ G A = 0.368 + 0.012 m for 10 × 2 m (× 2 m), 100 MPa, \
             1000 kg/m³",
    gpu: false,
    quick: true,
    run: implicit_cantilever,
};

fn implicit_cantilever(session: &mut Session) -> Result<(), EngineError> {
    let (young, gravity, length, side) = (1e8, 9.81, 10.0, 2.0);
    // Three particles per axis, and two. With two, some of the compact kernel's nodes lie exactly
    // at the edge of the particles' reach.
    let mut variants: Vec<(Scheme, f64, u32)> = SCHEMES.iter().map(|&scheme| (scheme, 0.5, 9)).collect();
    if !session.quick() {
        variants.extend(SCHEMES.iter().flat_map(|&scheme| [(scheme, 0.25, 9), (scheme, 0.25, 4)]));
        variants.extend([Kernel::Quadratic, Kernel::Compact].map(|k| (Scheme::new(3, k, Transfer::Mls), 0.5, 27)));
    }
    for (scheme, dx, particles_per_cell) in variants {
        let three = scheme.dimension == 3;
        let point = |x: f64, y: f64, z: f64| if three { vec![x, y, z] } else { vec![x, z] };
        let problem = implicitly(problem(
            session,
            scheme,
            json!({
                "domain": { "min": point(0.0, 0.0, 0.0), "max": point(12.0, 4.0, 7.0), "dx": dx },
                "gravity": point(0.0, 0.0, -gravity),
                "materials": { "beam": elastic("fixed-corotated", young, 0.0) },
                "bodies": [ { "name": "beam", "material": "beam", "particles_per_cell": particles_per_cell,
                              "shape": { "box": { "min": point(0.0, 1.0, 2.5), "max": point(length, 3.0, 4.5) } } } ],
            }),
        ));
        let tip: Vec<usize> =
            (0..problem.particles.len()).filter(|&p| problem.particles.x[p][0] > length - 0.3 * dx).collect();
        let up = scheme.dimension - 1;
        let height = |p: &Particles| tip.iter().map(|&i| p.x[i][up]).sum::<f64>() / tip.len() as f64;
        let start = height(&problem.particles);
        let mut engine = ImplicitEngine::new(&problem.setup, problem.particles.clone())?;
        // A quarter of the first period.
        let frame_s = 0.25;
        let (mut time, mut deflection) = (vec![0.0], vec![0.0]);
        for frame in 1..=session.pick(16, 40) {
            engine.advance_frame(frame_s, &NoControl)?;
            time.push(f64::from(frame) * frame_s);
            deflection.push(start - height(&engine.snapshot()?));
        }
        let (last, before) = (deflection[deflection.len() - 1], deflection[deflection.len() - 2]);
        // The section's width cancels; ν = 0, κ = 5/6.
        let load = 1000.0 * gravity * side;
        let bending = load * f64::powi(length, 4) / (8.0 * young * f64::powi(side, 3) / 12.0);
        let shear = load * length * length / (2.0 * 5.0 / 6.0 * 0.5 * young * side);
        let expected = bending + shear;
        let variant = format!("{scheme} dx {dx}, {particles_per_cell} particles a cell");
        if scheme.kernel == Kernel::Compact && particles_per_cell == 4 {
            // Too few for this kernel: they lie on nodes and at the edge of the others' reach.
            let rule = (Rule::AtMost, 1.15 * expected, 0.0);
            session.check(&variant, "tip deflection, too soft by a tenth", "m", rule, last);
        } else {
            session.check(&variant, "tip deflection", "m", (Rule::Relative, expected, 0.05), last);
        }
        let creep = (last - before).abs() / (frame_s * expected);
        session.check(&variant, "creep", "1/s", (Rule::AtMost, session.pick(2e-2, 1e-3), 0.0), creep);
        session.curve(&variant, vec![("time_s", time), ("deflection_m", deflection)]);
    }
    Ok(())
}

pub const IMPLICIT_YIELD: Case = Case {
    name: "implicit-yield",
    claim: "a metal bar pulled apart by its ends flows at its yield stress",
    source: "von Mises in plane strain: the stretching stress is 2/√3 of the uniaxial yield stress",
    gpu: false,
    quick: true,
    run: implicit_yield,
};

fn implicit_yield(session: &mut Session) -> Result<(), EngineError> {
    let (young, yield_stress, dx) = (1e8, 1e6, 0.05);
    let (low, high, bottom, top) = (4.0 * dx, 28.0 * dx, 6.0 * dx, 12.0 * dx);
    for scheme in SCHEMES {
        for elasticity in ["hencky", "fixed-corotated"] {
            let grip = |name: &str, from: f64, to: f64, speed: f64| {
                json!({ "name": name, "contact": "sticky", "motion": { "linear_velocity": [speed, 0] },
                        "shape": { "box": { "min": [from, bottom - 2.0 * dx], "max": [to, top + 2.0 * dx] } } })
            };
            let problem = implicitly(problem(
                session,
                scheme,
                json!({
                    "domain": { "min": [0, 0], "max": [36.0 * dx, 18.0 * dx], "dx": dx },
                    "materials": { "metal": { "model": "von-mises", "density": 1000, "youngs_modulus": young,
                                              "poissons_ratio": 0.3, "yield_stress": yield_stress,
                                              "elasticity": elasticity } },
                    "bodies": [ { "name": "bar", "material": "metal", "particles_per_cell": 9,
                                  "shape": { "box": { "min": [low, bottom], "max": [high, top] } } } ],
                    "colliders": [ grip("left", low - dx, low + 3.0 * dx, -0.1),
                                   grip("right", high - 3.0 * dx, high + dx, 0.1) ],
                }),
            ));
            let mut engine = ImplicitEngine::new(&problem.setup, problem.particles.clone())?;
            let (mut strain, mut stress) = (Vec::new(), Vec::new());
            let (frame_s, free) = (0.002, high - low - 6.0 * dx);
            for frame in 1..=session.pick(40, 80) {
                let stats = engine.advance_frame(frame_s, &NoControl)?;
                let pull = 0.5 * (stats.reactions[6].force[0] - stats.reactions[7].force[0]);
                strain.push(2.0 * 0.1 * frame_s * f64::from(frame) / free);
                stress.push(pull.abs() / (top - bottom));
            }
            // The section has shrunk by the strain, because plastic flow preserves volume.
            let last = stress.len() - 1;
            let (got, stretch) = (stress[last] * (1.0 + strain[last]), 2.0 / 3.0f64.sqrt() * yield_stress);
            let variant = format!("{scheme}, {elasticity}");
            session.check(&variant, "stress while it flows", "Pa", (Rule::Relative, stretch, 0.05), got);
            session.curve(&variant, vec![("strain", strain), ("nominal_stress_pa", stress)]);
        }
    }
    Ok(())
}
