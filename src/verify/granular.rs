//! Collapse of a granular column: its run-out against experiments.

use serde_json::json;

use super::Case;
use super::report::Rule;
use super::session::Session;
use super::setup::{Scheme, problem};
use gridfall_core::sim::setup::{Kernel, Transfer};
use gridfall_engine::{EngineError, NoControl};

pub const GRANULAR_COLUMN: Case = Case {
    name: "granular-column",
    claim: "a column of sand that collapses on a rough floor runs out by 1.2 of its height, as channels of sand do",
    source: "Lube et al. 2005, Phys. Rev. E 72, 041301 (two dimensions): Δl / l0 = 1.2 a for a = h0 / l0 below 2.3",
    gpu: false,
    quick: true,
    run: granular_column,
};

fn granular_column(session: &mut Session) -> Result<(), EngineError> {
    let (width, cells) = (0.1, session.pick(8.0, 16.0));
    let dx = width / cells;
    let aspects: &[f64] = session.pick(&[1.0], &[0.5, 1.0, 1.5, 2.0]);
    let kernels = [("compact", Kernel::Compact), ("quadratic", Kernel::Quadratic)];
    let mut columns =
        vec![("aspect_ratio", aspects.to_vec()), ("expected_m", aspects.iter().map(|a| 1.2 * a).collect())];
    for (name, kernel) in kernels.into_iter().take(session.pick(1, 2)) {
        let scheme = Scheme::new(2, kernel, Transfer::Mls);
        let mut runout = Vec::new();
        for &aspect in aspects {
            let slip = json!({ "contact": "slip" });
            let problem = problem(
                session,
                scheme,
                json!({
                    // The column stands in the lower left corner. The left wall is smooth; the
                    // floor holds.
                    "domain": { "min": [0, 0], "max": [(1.0 + (2.0 * aspect).ceil()) * width + 8.0 * dx,
                                                        (aspect.ceil() + 0.5) * width],
                                "dx": dx, "boundary": { "x": slip, "y+": slip } },
                    "gravity": [0, -9.81],
                    "materials": { "sand": { "model": "drucker-prager", "density": 1600, "youngs_modulus": 1e6,
                                             "poissons_ratio": 0.3, "friction_angle_degrees": 31 } },
                    "bodies": [ { "name": "column", "material": "sand",
                                  "shape": { "box": { "min": [0, 0], "max": [width, aspect * width] } } } ],
                }),
            );
            let mut engine = session.engine(&problem)?;
            // It comes to rest after about three times sqrt(h / g).
            let end_s = 5.0 * (aspect * width / 9.81).sqrt();
            for _ in 0..20 {
                engine.advance_frame(end_s / 20.0, &NoControl)?;
            }
            let mut reach: Vec<f64> = engine.snapshot()?.x.iter().map(|x| x[0]).collect();
            reach.sort_by(f64::total_cmp);
            // Without the grains that jumped ahead.
            let front = reach[reach.len() * 99 / 100];
            runout.push((front - width) / width);
            let rule = (Rule::Relative, 1.2 * aspect, 0.25);
            session.check(
                format!("{scheme} a {aspect}"),
                "run-out / initial length",
                "",
                rule,
                (front - width) / width,
            );
        }
        columns.push((name, runout));
    }
    session.curve("run-out", columns);
    Ok(())
}
