//! Bodies whose boundaries, corners and fragments have few neighbours: how they respond to a step
//! from the speed of sound alone, and to the planned step.

use serde_json::{Value, json};

use super::Case;
use super::forced::Forced;
use super::report::Rule;
use super::session::Session;
use super::setup::{Scheme, elastic, problem};
use gridfall_core::sim::particles::Particles;
use gridfall_core::sim::setup::{Kernel, Problem, Transfer};
use gridfall_core::sim::timestep::{elastic_bounds_s, moduli};
use gridfall_engine::{EngineError, NoControl};

/// The scheme of the paper.
const PAPER: Scheme = Scheme::new(2, Kernel::Quadratic, Transfer::Apic);

/// Largest speed relative to `reference_m_s`, over `time_s` seconds at steps of `dt_s`; infinite if
/// it grows without bound.
fn forced_growth(problem: &Problem, dt_s: f64, time_s: f64, reference_m_s: f64) -> f64 {
    let mut simulation = Forced::new(problem, dt_s);
    let mut largest = 0.0f64;
    while simulation.time_s() < time_s && largest < 100.0 {
        largest = largest.max(simulation.step() / reference_m_s);
    }
    if largest < 100.0 { largest } else { f64::INFINITY }
}

/// The same at the engine's own steps; infinite if the run ends in an error.
fn planned_growth(session: &Session, problem: &Problem, time_s: f64, reference_m_s: f64) -> Result<f64, EngineError> {
    let mut engine = session.engine(problem)?;
    let frames = 200;
    let mut largest = 0.0f64;
    for _ in 0..frames {
        match engine.advance_frame(time_s / f64::from(frames), &NoControl) {
            Ok(_) => {}
            Err(EngineError::Diverged { .. } | EngineError::LeftDomain { .. }) => return Ok(f64::INFINITY),
            Err(other) => return Err(other),
        }
        let fastest = engine.snapshot()?.v.iter().map(|v| v.iter().map(|c| c * c).sum::<f64>()).fold(0.0, f64::max);
        largest = largest.max(fastest.sqrt() / reference_m_s);
    }
    Ok(largest)
}

/// Steps (s) of Courant number 1 by the speed of P waves, and of the single-particle bound, for a
/// problem with one material.
fn steps_s(problem: &Problem) -> (f64, f64) {
    let body = &problem.setup.bodies[0];
    let (lambda, mu, _) = moduli(&problem.setup.materials[body.material]);
    let rho = body.mass / body.volume0;
    (problem.setup.dx * (rho / (lambda + 2.0 * mu)).sqrt(), elastic_bounds_s(&problem.setup, lambda, mu, rho).1)
}

/// Keeps the particles of a problem with one body that satisfy `kept` (index, position).
fn prune(problem: &mut Problem, kept: impl Fn(usize, [f64; 3]) -> bool) {
    let all = std::mem::take(&mut problem.particles);
    let chosen: Vec<usize> = (0..all.len()).filter(|&p| kept(p, all.x[p])).collect();
    problem.particles = Particles {
        x: chosen.iter().map(|&p| all.x[p]).collect(),
        v: chosen.iter().map(|&p| all.v[p]).collect(),
        b: chosen.iter().map(|&p| all.b[p]).collect(),
        f: chosen.iter().map(|&p| all.f[p]).collect(),
        plastic: chosen.iter().map(|&p| all.plastic[p]).collect(),
        body: vec![0; chosen.len()],
        touch: Vec::new(),
    };
    problem.setup.bodies[0].particles = 0..chosen.len();
}

pub const SPINNING_DISK: Case = Case {
    name: "spinning-disk",
    claim: "a disk, its rim and single particles of the rim blow up at the paper's Courant numbers and not at the \
            planned step",
    source: "Bai & Schroeder, Fig. 2: 2D, r 0.3, E 1e3, ν 0.3, ω 0.4, neo-Hookean, APIC, quadratic",
    gpu: false,
    quick: true,
    run: spinning_disk,
};

/// The paper's disk: all of it, its outer 0.015, and every fifth of these particles, each alone on
/// its nodes.
#[derive(Clone, Copy)]
enum Disk {
    Full,
    Rim,
    Sparse,
}

/// A prescribed step.
#[derive(Clone, Copy)]
enum Step {
    /// Courant number by the speed of P waves.
    Courant(f64),
    /// Share of the single-particle bound.
    SingleParticle(f64),
}

fn disk(session: &Session, scheme: Scheme, part: Disk) -> Problem {
    let mut problem = problem(
        session,
        scheme,
        json!({
            "domain": { "min": [0, 0], "max": [1, 1], "dx": 1.0 / 32.0 },
            "materials": { "jelly": elastic("neo-hookean", 1e3, 0.3) },
            "bodies": [ { "name": "disk", "material": "jelly", "angular_velocity": [0.4],
                          "shape": { "sphere": { "center": [0.5, 0.5], "radius": 0.3 } } } ],
        }),
    );
    let on_rim = |x: [f64; 3]| (x[0] - 0.5).hypot(x[1] - 0.5) > 0.3 - 0.015;
    match part {
        Disk::Full => {}
        Disk::Rim => prune(&mut problem, |_, x| on_rim(x)),
        Disk::Sparse => {
            prune(&mut problem, |_, x| on_rim(x));
            prune(&mut problem, |p, _| p % 5 == 0);
        }
    }
    problem
}

fn spinning_disk(session: &mut Session) -> Result<(), EngineError> {
    let speed = 0.4 * 0.3;
    let grows = (Rule::AtLeast, 10.0, 0.0);
    let rests = (Rule::AtMost, 2.0, 0.0);
    let (quantity, time_s) = ("largest speed / initial", 100.0);
    // Part, Courant number or share of the single-particle bound, expected outcome, and whether the
    // quick run includes it.
    let forced = [
        ("rim", Disk::Rim, Step::Courant(0.9), grows, true),
        ("single particles", Disk::Sparse, Step::Courant(0.7), grows, true),
        ("single particles", Disk::Sparse, Step::SingleParticle(0.98), rests, true),
        ("disk", Disk::Full, Step::Courant(0.8), rests, false),
        ("rim", Disk::Rim, Step::Courant(0.8), grows, false),
        ("rim", Disk::Rim, Step::Courant(0.7), rests, false),
    ];
    for (name, part, step, rule, quick) in forced {
        if session.quick() && !quick {
            continue;
        }
        let problem = disk(session, PAPER, part);
        let (unit_s, single_s) = steps_s(&problem);
        let dt_s = match step {
            Step::Courant(number) => number * unit_s,
            Step::SingleParticle(share) => share * single_s,
        };
        let growth = forced_growth(&problem, dt_s, time_s, speed);
        session.check(format!("{name} at CFL {:.3}", dt_s / unit_s), quantity, "", rule, growth);
    }
    let schemes = [PAPER, Scheme::new(2, Kernel::Compact, Transfer::Mls)];
    let schemes = &schemes[..session.pick(1, 2)];
    for &scheme in schemes {
        for (name, part) in [("disk", Disk::Full), ("rim", Disk::Rim), ("single particles", Disk::Sparse)] {
            if session.quick() && matches!(part, Disk::Full) {
                continue;
            }
            let growth = planned_growth(session, &disk(session, scheme, part), time_s, speed)?;
            session.check(format!("{scheme} {name}, planned step"), quantity, "", rests, growth);
        }
    }
    Ok(())
}

pub const COLLISIONS: Case = Case {
    name: "boundary-stability",
    claim: "shells that collide, a ball on a block's corner and a sphere that breaks stay stable at the planned step",
    source: "Bai & Schroeder, Figs. 5, 6 and 8 (their sizes are not given; these are like them)",
    gpu: true,
    quick: true,
    run: collisions,
};

/// Name, scene, reference speed (m/s), time (s).
fn scenes() -> Vec<(&'static str, Value, f64, f64)> {
    let dx = 1.0 / 32.0;
    let at = |x: [f64; 3]| x.map(|c| c * dx);
    let material = json!({ "jelly": elastic("neo-hookean", 1e3, 0.3) });
    let shells = |thickness: f64| {
        let shell = |name: &str, x: f64, speed: f64| {
            let ball = json!({ "sphere": { "center": at([x, 12.0, 12.0]), "radius": 7.0 * dx } });
            let shape =
                if thickness > 0.0 { json!({ "shell": { "thickness": thickness * dx, "shape": ball } }) } else { ball };
            json!({ "name": name, "material": "jelly", "velocity": [speed, 0, 0], "shape": shape })
        };
        json!({
            "domain": { "min": [0, 0, 0], "max": at([40.0, 24.0, 24.0]), "dx": dx },
            "materials": material,
            "bodies": [ shell("left", 11.0, 0.2), shell("right", 27.0, -0.2) ],
        })
    };
    let block = json!({
        "domain": { "min": [0, 0, 0], "max": at([24.0, 24.0, 24.0]), "dx": dx,
                    "boundary": { "z-": { "contact": "separate", "friction": 0.3 } } },
        "gravity": [0, 0, -0.3],
        "materials": material,
        "bodies": [
            { "name": "block", "material": "jelly",
              "shape": { "box": { "min": at([7.0, 7.0, 0.0]), "max": at([17.0, 17.0, 8.0]) } } },
            { "name": "ball", "material": "jelly", "velocity": [0, 0, -0.2],
              "shape": { "sphere": { "center": at([12.3, 12.2, 15.0]), "radius": 4.0 * dx } } },
        ],
    });
    let wedge = json!({
        "domain": { "min": [0, 0, 0], "max": at([32.0, 32.0, 32.0]), "dx": dx,
                    "boundary": { "x": { "contact": "separate" }, "y": { "contact": "separate" },
                                  "z": { "contact": "separate" } } },
        "materials": material,
        "bodies": [ { "name": "sphere", "material": "jelly", "velocity": [0, 0, -0.8],
                      "shape": { "sphere": { "center": at([16.2, 16.1, 22.0]), "radius": 6.0 * dx } } } ],
        "colliders": [ { "name": "post", "contact": "separate",
                         "shape": { "box": { "min": at([14.5, 0.0, 0.0]), "max": at([17.5, 32.0, 14.0]) } } } ],
    });
    vec![
        ("filled balls", shells(0.0), 0.2, 3.0),
        ("shells 1 dx", shells(1.0), 0.2, 3.0),
        ("shells 0.5 dx", shells(0.5), 0.2, 3.0),
        ("ball on block", block, 0.3, 5.0),
        ("breaking sphere", wedge, 0.8, 1.5),
    ]
}

fn collisions(session: &mut Session) -> Result<(), EngineError> {
    let schemes = [Scheme::new(3, Kernel::Quadratic, Transfer::Apic), Scheme::new(3, Kernel::Compact, Transfer::Mls)];
    for (name, scene, speed, time_s) in scenes() {
        if session.quick() && name != "shells 0.5 dx" {
            continue;
        }
        for scheme in schemes {
            let problem = problem(session, scheme, scene.clone());
            let growth = planned_growth(session, &problem, time_s, speed)?;
            session.check(
                format!("{scheme} {name}, planned step"),
                "largest speed / approach",
                "",
                (Rule::AtMost, 3.0, 0.0),
                growth,
            );
        }
    }
    Ok(())
}
