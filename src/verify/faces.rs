//! Faces of colliders: where they are, whatever the cells.

use serde_json::json;

use super::Case;
use super::report::Rule;
use super::session::Session;
use super::setup::{Scheme, elastic, problem};
use gridfall_core::sim::reaction::WALLS;
use gridfall_core::sim::setup::{Kernel, Transfer};
use gridfall_engine::{EngineError, NoControl};

pub const SHEARED_BLOCK: Case = Case {
    name: "sheared-block",
    claim: "a block under a sticky lid that moves sideways answers with the force of simple shear, wherever between \
            nodes the lid is",
    source: "a neo-Hookean solid in simple shear γ bears the stress G γ",
    gpu: true,
    quick: true,
    run: sheared_block,
};

fn sheared_block(session: &mut Session) -> Result<(), EngineError> {
    let (dx, modulus, speed) = (0.05, 1e6, 0.05);
    let d = session.on(2, 3);
    let schemes = match session.quick() {
        true => vec![Scheme::new(d, Kernel::Compact, Transfer::Mls), Scheme::new(d, Kernel::Quadratic, Transfer::Mls)],
        false => session.schemes(&[2, 3]),
    };
    for scheme in schemes.into_iter().filter(|scheme| scheme.transfer != Transfer::Pic) {
        let d = scheme.dimension;
        for offset in session.pick(vec![0.3, 0.75], vec![0.0, 0.25, 0.5, 0.75]) {
            let height = (10.0 + offset) * dx;
            // Up along the last axis, sideways along x; a slice of four cells of an endless layer.
            let point = |up: f64| {
                let mut x = vec![4.0 * dx; d];
                x[d - 1] = up;
                x
            };
            let mut normal = vec![0.0; d];
            normal[d - 1] = -1.0;
            let mut velocity = vec![0.0; d];
            velocity[0] = speed;
            let boundary = match d {
                2 => json!({ "x": "periodic" }),
                _ => json!({ "x": "periodic", "y": "periodic" }),
            };
            let problem = problem(
                session,
                scheme,
                json!({
                    "domain": { "min": vec![0; d], "max": point(16.0 * dx), "dx": dx, "boundary": boundary },
                    "materials": { "solid": elastic("neo-hookean", modulus, 0.3) },
                    "bodies": [ { "name": "block", "material": "solid",
                                  "shape": { "box": { "min": vec![0; d], "max": point(height) } } } ],
                    "colliders": [ { "name": "lid", "contact": "sticky",
                                     "shape": { "half-space": { "point": point(height), "normal": normal } },
                                     "motion": { "linear_velocity": velocity } } ],
                }),
            );
            let mut engine = session.engine(&problem)?;
            let (frame_s, area) = (0.05, (4.0 * dx).powi(d as i32 - 1));
            let (mut force, mut right) = (0.0, 0.0);
            for frame in 0..16 {
                let stats = engine.advance_frame(frame_s, &NoControl)?;
                // The second half: whole periods of the waves that the start makes.
                if frame >= 8 {
                    let middle_s = (f64::from(frame) + 0.5) * frame_s;
                    force += stats.reactions[WALLS].force[0].abs() / 8.0;
                    right += modulus / 2.6 * speed * middle_s / height * area / 8.0;
                }
            }
            let variant = format!("{scheme}, lid {offset} cells above a node");
            session.check(&variant, "force on the lid", "N", (Rule::Relative, right, 0.05), force);
        }
    }
    Ok(())
}
