//! What implicit steps do at their default settings: stiff bodies turn, roll and tip over, metal
//! yields.

use serde_json::{Value, json};

use super::Case;
use super::report::Rule;
use super::session::Session;
use super::setup::{Scheme, centre, elastic, problem};
use gridfall_core::sim::particles::Particles;
use gridfall_core::sim::setup::{Integrator, Kernel, Problem, Transfer};
use gridfall_engine::explicit::cpu::CpuEngine;
use gridfall_engine::implicit::ImplicitEngine;
use gridfall_engine::{Engine, EngineError, NoControl};

const KERNELS: [(Kernel, Transfer); 2] = [(Kernel::Quadratic, Transfer::Apic), (Kernel::Compact, Transfer::Mls)];
const GRAVITY: f64 = 9.81;

/// How far a range of particles has turned in the plane of x and y (rad), by least squares.
fn turned(start: &Particles, now: &Particles, range: std::ops::Range<usize>) -> f64 {
    let (from, to) = (centre(start, range.clone()), centre(now, range.clone()));
    let (mut sin, mut cos) = (0.0, 0.0);
    for p in range {
        let (a, b) = (start.x[p], now.x[p]);
        let (a, b) = ([a[0] - from[0], a[1] - from[1]], [b[0] - to[0], b[1] - to[1]]);
        sin += a[0] * b[1] - a[1] * b[0];
        cos += a[0] * b[0] + a[1] * b[1];
    }
    sin.atan2(cos)
}

fn implicitly(mut problem: Problem) -> Result<(Problem, ImplicitEngine), EngineError> {
    problem.setup.integrator = Integrator::Implicit;
    let engine = ImplicitEngine::new(&problem.setup, problem.particles.clone())?;
    Ok((problem, engine))
}

pub const STIFF_BAR: Case = Case {
    name: "stiff-bar-turns",
    claim: "a stiff part between two soft ones that twist it turns as far at the default tolerance as at ever smaller \
            ones",
    source: "Wang et al. 2020 (HOT), Fig. 20; angles of the same scheme at a tolerance of 1e-5",
    gpu: false,
    quick: true,
    run: stiff_bar,
};

/// Angle of the middle after a quarter of a second (degrees), by its modulus (Pa).
const ANGLES: [[(f64, f64); 3]; 2] =
    [[(1e9, 47.4), (1e7, 47.4), (1e10, 47.4)], [(1e9, 45.2), (1e7, 45.2), (1e10, 45.2)]];

fn stiff_bar(session: &mut Session) -> Result<(), EngineError> {
    for ((kernel, transfer), angles) in KERNELS.into_iter().zip(ANGLES).take(session.pick(1, 2)) {
        for (middle_pa, right) in angles.into_iter().take(session.pick(1, 3)) {
            let scheme = Scheme::new(3, kernel, transfer);
            let (mut problem, _) = implicitly(bar(session, scheme, middle_pa))?;
            problem.setup.cfl = 1.0;
            let mut engine = ImplicitEngine::new(&problem.setup, problem.particles.clone())?;
            let mut effort = [0.0; 2];
            for _ in 0..12 {
                for solve in engine.advance_frame(1.0 / 48.0, &NoControl)?.solves {
                    effort[0] += f64::from(solve.iterations) / 12.0;
                    effort[1] += f64::from(solve.inner_iterations) / 12.0;
                }
            }
            let middle = problem.setup.bodies[1].particles.clone();
            let got = turned(&problem.particles, &engine.snapshot()?, middle).to_degrees();
            let variant = format!("{scheme}, {middle_pa:.0e} Pa");
            session.check(&variant, "angle of the middle", "°", (Rule::Absolute, right, 1.0), got);
            session.check(&variant, "iterations a frame", "", (Rule::AtMost, 4.0, 0.0), effort[0]);
            session.curve(&variant, vec![("iterations", vec![effort[0]]), ("cycles", vec![effort[1]])]);
        }
    }
    Ok(())
}

/// Soft, stiff, soft along z; held below, and turned above once a second.
fn bar(session: &Session, scheme: Scheme, middle_pa: f64) -> Problem {
    let material = |young: f64| {
        let mut material = elastic("fixed-corotated", young, 0.3);
        material["density"] = json!(2000);
        material
    };
    let part = |name: &str, material: &str, from: f64, to: f64, grips: Value| {
        json!({ "name": name, "material": material, "sampling": "jittered", "grips": grips,
                "shape": { "box": { "min": [0.2, 0.2, from], "max": [0.32, 0.32, to] } } })
    };
    let grip = |name: &str, from: f64, to: f64, spin: f64| {
        json!([{ "name": name, "motion": { "angular_velocity": [0, 0, spin] },
                 "shape": { "box": { "min": [0.18, 0.18, from], "max": [0.34, 0.34, to] } } }])
    };
    let spin = 2.0 * std::f64::consts::PI;
    problem(
        session,
        scheme,
        json!({
            "domain": { "min": [0, 0, -0.12], "max": [0.64, 0.64, 1.16], "dx": 0.02 },
            "materials": { "soft": material(1e5), "middle": material(middle_pa) },
            "bodies": [ part("bottom", "soft", 0.0, 0.3, grip("held", -0.05, 0.05, 0.0)),
                        part("middle", "middle", 0.3, 0.6, json!([])),
                        part("top", "soft", 0.6, 0.9, grip("turned", 0.85, 0.95, spin)) ],
        }),
    )
}

pub const ROLLS_AND_TIPS: Case = Case {
    name: "rolls-and-tips",
    claim: "a disc rolls down a slope of 30° and a tall box tips over, in implicit steps, however stiff they are; at \
            15° the box stands",
    source: "a rigid disc: g sin θ/(1.5 R); a rigid box that turns about the particle at its corner",
    gpu: false,
    quick: true,
    run: rolls_and_tips,
};

fn rolls_and_tips(session: &mut Session) -> Result<(), EngineError> {
    for (kernel, transfer) in KERNELS.into_iter().take(session.pick(1, 2)) {
        let scheme = Scheme::new(2, kernel, transfer);
        for young in session.pick(vec![1e9], vec![1e6, 1e7, 1e9]) {
            let variant = format!("{scheme}, {young:.0e} Pa");
            let rolls = roll(session, scheme, young)?;
            let right = -GRAVITY * 0.5 / (1.5 * 0.2);
            session.check(&variant, "angular acceleration of the disc", "1/s²", (Rule::Relative, right, 0.03), rolls);
            if young < 1e7 {
                // A soft box leans until it falls.
                continue;
            }
            let tips = tip(session, scheme, young, 30.0)?;
            let right = rigid_tip(30.0).to_degrees();
            session.check(&variant, "the box at 30° has turned", "°", (Rule::Relative, right, 0.15), tips);
            let stands = tip(session, scheme, young, 15.0)?;
            session.check(&variant, "the box at 15° has turned", "°", (Rule::Absolute, 0.0, 1.0), stands);
        }
    }
    Ok(())
}

/// A body on a floor at 0.1 m, under gravity of a slope.
fn on_a_slope(session: &Session, scheme: Scheme, young: f64, degrees: f64, body: Value) -> Problem {
    let (sin, cos) = degrees.to_radians().sin_cos();
    let mut body = body;
    body["name"] = json!("body");
    body["material"] = json!("m");
    body["particles_per_cell"] = json!(9);
    let slip = json!({ "x": { "contact": "slip" }, "y": { "contact": "slip" } });
    problem(
        session,
        scheme,
        json!({
            "domain": { "min": [0, 0], "max": [2.0, 0.8], "dx": 0.01, "boundary": slip },
            "gravity": [GRAVITY * sin, -GRAVITY * cos],
            "materials": { "m": { "model": "neo-hookean", "density": 1000, "youngs_modulus": young,
                                  "poissons_ratio": 0.3 } },
            "bodies": [ body ],
            "colliders": [ { "name": "floor", "contact": "separate", "friction": 1.0,
                             "shape": { "box": { "min": [-1, -1], "max": [5, 0.1] } } } ],
        }),
    )
}

/// Angular acceleration (1/s²) of a disc on 30°, from 0.2 to 0.4 s.
fn roll(session: &Session, scheme: Scheme, young: f64) -> Result<f64, EngineError> {
    let disc = json!({ "sampling": "conforming", "shape": { "sphere": { "center": [0.6, 0.3], "radius": 0.2 } } });
    let (problem, mut engine) = implicitly(on_a_slope(session, scheme, young, 30.0, disc))?;
    let mut angles = Vec::new();
    for _ in 0..8 {
        engine.advance_frame(0.05, &NoControl)?;
        angles.push(turned(&problem.particles, &engine.snapshot()?, 0..problem.particles.len()));
    }
    Ok((angles[7] - 2.0 * angles[5] + angles[3]) / 0.1f64.powi(2))
}

/// Angle (degrees), downhill, of a box of 0.1 × 0.3 m after 0.3 s.
fn tip(session: &Session, scheme: Scheme, young: f64, degrees: f64) -> Result<f64, EngineError> {
    let tall = json!({ "shape": { "box": { "min": [0.4, 0.1], "max": [0.5, 0.4] } } });
    let (problem, mut engine) = implicitly(on_a_slope(session, scheme, young, degrees, tall))?;
    for _ in 0..12 {
        engine.advance_frame(0.025, &NoControl)?;
    }
    Ok(-turned(&problem.particles, &engine.snapshot()?, 0..problem.particles.len()).to_degrees())
}

/// The same (rad) of a rigid box that turns about its corner particle, half a spacing inside.
fn rigid_tip(degrees: f64) -> f64 {
    let (width, height, inside) = (0.1, 0.3, 0.005 / 3.0);
    let (along, up) = (0.5 * width - inside, 0.5 * height - inside);
    let inertia = (width * width + height * height) / 12.0 + along * along + up * up;
    let (mut angle, mut rate, steps) = (0.0f64, 0.0, 3000);
    let dt = 0.3 / f64::from(steps);
    for _ in 0..steps {
        let lean = angle + degrees.to_radians();
        rate += dt * GRAVITY * (up * lean.sin() - along * lean.cos()) / inertia;
        angle += dt * rate;
    }
    angle
}

pub const IMPLICIT_METAL: Case = Case {
    name: "implicit-metal",
    claim: "a metal bar that is pulled beyond yield resists implicit steps as it does explicit ones",
    source: "the explicit engine; a bar in plane strain yields at 2/√3 of the yield stress times its section, which is \
             a tenth thinner by then",
    gpu: false,
    quick: false,
    run: implicit_metal,
};

fn implicit_metal(session: &mut Session) -> Result<(), EngineError> {
    for (kernel, transfer) in KERNELS {
        let scheme = Scheme::new(2, kernel, transfer);
        let pulled = metal(session, scheme);
        let force = |engine: &mut dyn Engine| -> Result<f64, EngineError> {
            let mut force = 0.0;
            for _ in 0..5 {
                force = engine.advance_frame(0.02, &NoControl)?.reactions[7].force[1].abs();
            }
            Ok(force)
        };
        let explicit = force(&mut CpuEngine::new(&pulled.setup, pulled.particles.clone())?)?;
        let implicit = force(&mut implicitly(pulled)?.1)?;
        if kernel == Kernel::Quadratic {
            let section = 2.0 / 3.0f64.sqrt() * 1e6 * 0.1;
            session.check(scheme, "force of the metal", "N/m", (Rule::Relative, 0.9 * section, 0.06), implicit);
        }
        session.check(scheme, "the same over the explicit one", "", (Rule::Absolute, 1.0, 0.05), implicit / explicit);
    }
    Ok(())
}

/// A bar of 1e6 Pa that is pulled apart at 0.2 m/s.
fn metal(session: &Session, scheme: Scheme) -> Problem {
    let grip = |name: &str, from: f64, to: f64, speed: f64| {
        json!({ "name": name, "motion": { "linear_velocity": [0, speed] },
                "shape": { "box": { "min": [0.1, from], "max": [0.3, to] } } })
    };
    problem(
        session,
        scheme,
        json!({
            "domain": { "min": [0, 0], "max": [0.4, 0.8], "dx": 0.0125 },
            "gravity": [0, 0],
            "materials": { "m": { "model": "von-mises", "density": 2000, "youngs_modulus": 1e8, "poissons_ratio": 0.3,
                                  "yield_stress": 1e6 } },
            "bodies": [ { "name": "bar", "material": "m",
                          "shape": { "box": { "min": [0.15, 0.2], "max": [0.25, 0.6] } },
                          "grips": [ grip("low", 0.1, 0.25, 0.0), grip("high", 0.55, 0.7, 0.2) ] } ],
        }),
    )
}
