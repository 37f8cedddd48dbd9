//! Thin plates: what is on one side does not feel what is on the other.

use std::f64::consts::TAU;

use serde_json::json;

use super::Case;
use super::report::Rule;
use super::session::Session;
use super::setup::{Scheme, elastic, problem};
use gridfall_core::sim::reaction::WALLS;
use gridfall_core::sim::setup::{Kernel, Transfer};
use gridfall_engine::{EngineError, NoControl};

pub const SIDES_OF_A_PLATE: Case = Case {
    name: "sides-of-a-plate",
    claim: "what slides without friction on a plate much thinner than a cell keeps its speed, the plate carries its \
            weight, and what lies under the plate stays where it is",
    source: "conservation of momentum: no force acts along the plate",
    gpu: true,
    quick: true,
    run: sides_of_a_plate,
};

fn sides_of_a_plate(session: &mut Session) -> Result<(), EngineError> {
    let (dx, density, gravity, speed) = (0.05, 1000.0, 9.81, 1.0);
    let d = session.on(2, 3);
    let schemes = match session.quick() {
        true => vec![Scheme::new(d, Kernel::Compact, Transfer::Mls), Scheme::new(d, Kernel::Quadratic, Transfer::Mls)],
        false => session.schemes(&[2, 3]),
    };
    for scheme in schemes {
        let d = scheme.dimension;
        for (offset, thickness) in session.pick(vec![(0.55, 0.2)], vec![(0.3, 0.02), (0.55, 0.2), (0.8, 1.5)]) {
            let (top, bottom) = ((8.0 + offset) * dx, (8.0 + offset - thickness) * dx);
            // Up along the last axis, sideways along x; a slice of four cells of an endless layer.
            let point = |side: f64, up: f64| {
                let mut x = vec![side; d];
                x[d - 1] = up;
                x
            };
            let along = |a: usize, value: f64| (0..d).map(|k| if k == a { value } else { 0.0 }).collect::<Vec<_>>();
            let mut boundary = json!({ "x": "periodic" });
            if d == 3 {
                boundary["y"] = json!("periodic");
            }
            boundary[["y-", "z-"][d - 2]] = json!({ "contact": "slip" });
            let block = |name: &str, low: f64, high: f64, velocity: f64| {
                json!({ "name": name, "material": "solid", "velocity": along(0, velocity),
                        "shape": { "box": { "min": point(0.0, low), "max": point(4.0 * dx, high) } } })
            };
            let problem = problem(
                session,
                scheme,
                json!({
                    "domain": { "min": vec![0; d], "max": point(4.0 * dx, 18.0 * dx), "dx": dx, "boundary": boundary },
                    "gravity": along(d - 1, -gravity),
                    "materials": { "solid": elastic("neo-hookean", 1e5, 0.3) },
                    "bodies": [ block("above", top, top + 6.0 * dx, speed),
                                block("below", 0.0, bottom - 0.5 * dx, 0.0) ],
                    "colliders": [ { "name": "plate", "contact": "separate", "friction": 0,
                                     "shape": { "box": { "min": point(-10.0 * dx, bottom),
                                                         "max": point(20.0 * dx, top) } } } ],
                }),
            );
            let mut engine = session.engine(&problem)?;
            let (frames, frame_s) = (20, 0.025);
            let mut weight = 0.0;
            for frame in 0..frames {
                // The block bounces. Hann window: the mean does not depend on where in an oscillation it ends.
                let window = 1.0 - (TAU * (f64::from(frame) + 0.5) / f64::from(frames)).cos();
                let reactions = engine.advance_frame(frame_s, &NoControl)?.reactions;
                weight -= window * reactions[WALLS].force[d - 1] / f64::from(frames);
            }
            let after = engine.snapshot()?;
            let mean = |body: u32| {
                let of_body: Vec<f64> =
                    after.v.iter().zip(&after.body).filter(|(_, b)| **b == body).map(|(v, _)| v[0]).collect();
                of_body.iter().sum::<f64>() / of_body.len() as f64
            };
            let variant = format!("{scheme}, {thickness} dx thick, {offset} cells above a node");
            let right = density * gravity * 6.0 * dx * (4.0 * dx).powi(d as i32 - 1);
            session.check(&variant, "speed above", "m/s", (Rule::Relative, speed, 1e-3), mean(0));
            session.check(&variant, "speed below", "m/s", (Rule::Absolute, 0.0, 1e-3), mean(1));
            session.check(&variant, "weight on the plate", "N", (Rule::Relative, right, 0.03), weight);
        }
    }
    Ok(())
}
