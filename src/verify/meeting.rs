//! Contact between bodies: a block that slides down a layer which is a body itself, and one that is pulled off.

use serde_json::json;

use super::Case;
use super::report::Rule;
use super::session::Session;
use super::setup::{Scheme, centre, elastic, momentum, problem, vector};
use gridfall_core::sim::setup::{Kernel, Transfer};
use gridfall_engine::{EngineError, NoControl};

pub const MEETING_BODIES: Case = Case {
    name: "meeting-bodies",
    claim: "a block slides down an elastic layer of 24° with g (sin θ − µ cos θ), and is pulled off without force",
    source: "Coulomb friction, exact for a rigid block; bodies that only touch do not hold each other",
    gpu: true,
    quick: true,
    run: meeting_bodies,
};

const DX: f64 = 1.0 / 32.0;

fn meeting_bodies(session: &mut Session) -> Result<(), EngineError> {
    let schemes = match session.extent {
        super::Extent::Quick => vec![Scheme::new(3, Kernel::Compact, Transfer::Mls)],
        super::Extent::Full => session.schemes(&[2, 3]),
    };
    for scheme in schemes {
        slide(session, scheme)?;
        pull(session, scheme)?;
    }
    Ok(())
}

/// A place in cells: along, up and, in 3D, across.
fn place(d: usize, [x, up, across]: [f64; 3]) -> Vec<f64> {
    if d == 2 { vec![x * DX, up * DX] } else { vec![x * DX, across * DX, up * DX] }
}

fn slide(session: &mut Session, scheme: Scheme) -> Result<(), EngineError> {
    let (slope, friction, g, d) = (24f64.to_radians(), 15f64.to_radians().tan(), 9.81, scheme.dimension);
    let mut gravity = [g * slope.sin(), 0.0, 0.0];
    gravity[d - 1] = -g * slope.cos();
    let boundary = if d == 2 { json!({}) } else { json!({ "y": "periodic" }) };
    let shape = |low: [f64; 3], high: [f64; 3]| json!({ "box": { "min": place(d, low), "max": place(d, high) } });
    let problem = problem(
        session,
        scheme,
        json!({
            "domain": { "min": vec![0; d], "max": place(d, [44.0, 14.0, 4.0]), "dx": DX, "boundary": boundary },
            "gravity": vector(d, gravity),
            "materials": { "layer": elastic("fixed-corotated", 2e6, 0.3),
                           "block": elastic("fixed-corotated", 1e6, 0.3) },
            "bodies": [
                { "name": "layer", "material": "layer", "shape": shape([0.0; 3], [44.0, 4.0, 4.0]) },
                { "name": "block", "material": "block", "contact": "separate", "friction": friction,
                  "shape": shape([6.0, 4.0, 0.0], [14.0, 8.0, 4.0]) } ],
        }),
    );
    let mut engine = session.engine(&problem)?;
    let mut way = Vec::new();
    for _ in 0..24 {
        engine.advance_frame(1.0 / 48.0, &NoControl)?;
        way.push(centre(&engine.snapshot()?, problem.setup.bodies[1].particles.clone())[0]);
    }
    // Once the block has settled: x = x0 + v t + ½ a t².
    let time = 8.0 / 48.0;
    let got = (way[23] - 2.0 * way[15] + way[7]) / (time * time);
    let exact = g * (slope.sin() - friction * slope.cos());
    session.check(scheme, "acceleration", "m/s²", (Rule::Relative, exact, 0.05), got);
    Ok(())
}

fn pull(session: &mut Session, scheme: Scheme) -> Result<(), EngineError> {
    let d = scheme.dimension;
    let boundary = if d == 2 { json!({}) } else { json!({ "y": "periodic" }) };
    let body = |name: &str, low: f64, speed: f64| {
        let mut velocity = [0.0; 3];
        velocity[d - 1] = speed;
        json!({ "name": name, "material": "block", "contact": "separate", "friction": 0.4,
                "velocity": vector(d, velocity),
                "shape": { "box": { "min": place(d, [5.0, low, 0.0]), "max": place(d, [11.0, low + 4.0, 4.0]) } } })
    };
    let problem = problem(
        session,
        scheme,
        json!({
            "domain": { "min": vec![0; d], "max": place(d, [16.0, 20.0, 4.0]), "dx": DX, "boundary": boundary },
            "materials": { "block": elastic("fixed-corotated", 1e5, 0.3) },
            "bodies": [body("lower", 6.0, -0.4), body("upper", 10.0, 0.4)],
        }),
    );
    let upper = problem.setup.bodies[1].particles.clone();
    let before = momentum(&problem, &problem.particles, upper.clone())[d - 1];
    let mut engine = session.engine(&problem)?;
    for _ in 0..2 {
        engine.advance_frame(1.0 / 48.0, &NoControl)?;
    }
    let after = momentum(&problem, &engine.snapshot()?, upper)[d - 1];
    let tolerance = session.on(1e-12, 1e-5);
    session.check(scheme, "momentum lost to the other", "", (Rule::Absolute, 0.0, tolerance), 1.0 - after / before);
    Ok(())
}
