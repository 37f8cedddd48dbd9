//! Coulomb friction: a block that slides down a slope.

use serde_json::json;

use super::Case;
use super::report::Rule;
use super::session::Session;
use super::setup::{Scheme, centre, elastic, problem, vector};
use gridfall_core::sim::setup::{Kernel, Transfer};
use gridfall_engine::{EngineError, NoControl};

pub const SLIDING_BLOCK: Case = Case {
    name: "sliding-block",
    claim: "a block on a slope of 24° with friction tan 15° slides x = ½ g t² (sin θ − µ cos θ)",
    source: "Coulomb friction, exact for a rigid block",
    gpu: true,
    quick: true,
    run: sliding_block,
};

fn sliding_block(session: &mut Session) -> Result<(), EngineError> {
    let (slope, friction, g, dx) = (24f64.to_radians(), 15f64.to_radians().tan(), 9.81, 1.0 / 32.0);
    let schemes = match session.extent {
        super::Extent::Quick => vec![Scheme::new(3, Kernel::Compact, Transfer::Mls)],
        super::Extent::Full => session.schemes(&[2, 3]),
    };
    for scheme in schemes {
        let d = scheme.dimension;
        // Up is y in 2D and z in 3D, where the block fills a periodic y.
        let place = |x: f64, up: f64| if d == 2 { vec![x * dx, up * dx] } else { vec![x * dx, 0.0, up * dx] };
        let high = |x: f64, up: f64| if d == 2 { vec![x * dx, up * dx] } else { vec![x * dx, 4.0 * dx, up * dx] };
        let floor = json!({ "contact": "separate", "friction": friction });
        let boundary = if d == 2 { json!({ "y-": floor }) } else { json!({ "y": "periodic", "z-": floor }) };
        let mut gravity = [g * slope.sin(), 0.0, 0.0];
        gravity[d - 1] = -g * slope.cos();
        let problem = problem(
            session,
            scheme,
            json!({
                "domain": { "min": vec![0; d], "max": high(40.0, 10.0), "dx": dx, "boundary": boundary },
                "gravity": vector(d, gravity),
                "materials": { "block": elastic("fixed-corotated", 1e6, 0.3) },
                "bodies": [ { "name": "block", "material": "block",
                              "shape": { "box": { "min": place(3.0, 0.0), "max": high(11.0, 4.0) } } } ],
            }),
        );
        let all = 0..problem.particles.len();
        let start = centre(&problem.particles, all.clone())[0];
        let mut engine = session.engine(&problem)?;
        let frames = 28;
        let (mut time, mut path, mut exact) = (vec![0.0], vec![0.0], vec![0.0]);
        for frame in 1..=frames {
            engine.advance_frame(1.0 / 48.0, &NoControl)?;
            let t = f64::from(frame) / 48.0;
            time.push(t);
            path.push(centre(&engine.snapshot()?, all.clone())[0] - start);
            exact.push(0.5 * g * t * t * (slope.sin() - friction * slope.cos()));
        }
        let n = path.len() - 1;
        session.check(scheme, "way", "m", (Rule::Relative, exact[n], 0.02), path[n]);
        if scheme.transfer == Transfer::Mls {
            session.curve(scheme, vec![("time_s", time), ("way_m", path), ("exact_m", exact)]);
        }
    }
    Ok(())
}
