//! The compact kernel compared with the quadratic one: vibration on a sticky floor, contact across
//! a gap.

use serde_json::json;

use super::Case;
use super::report::Rule;
use super::session::Session;
use super::setup::{Scheme, centre, elastic, problem, sums};
use gridfall_core::sim::setup::{Kernel, Transfer};
use gridfall_engine::{EngineError, NoControl};

const COMPACT: Scheme = Scheme::new(3, Kernel::Compact, Transfer::Mls);
const QUADRATIC: Scheme = Scheme::new(3, Kernel::Quadratic, Transfer::Mls);

pub const STICKY_FLOOR: Case = Case {
    name: "sticky-floor",
    claim: "a jelly cube that stands on a sticky floor vibrates as long with either kernel; one that lands on it keeps \
            less energy with the compact kernel, contrary to the paper",
    source: "CK-MPM section 6.2.2, Fig. 14, where the compact kernel's cube vibrates longer",
    gpu: true,
    quick: false,
    run: sticky_floor,
};

fn sticky_floor(session: &mut Session) -> Result<(), EngineError> {
    let dx = 1.0 / 48.0;
    let (frames, frame_s) = (192, 1.0 / 96.0);
    // Height of the cube (m) at each frame, and the mechanical energy of its vibration in the
    // second half.
    let run = |scheme: Scheme, from: f64, speed: f64| -> Result<(Vec<f64>, f64), EngineError> {
        let problem = problem(
            session,
            scheme,
            json!({
                "domain": { "min": [0, 0, 0], "max": [0.75, 0.75, 0.75], "dx": dx },
                "gravity": [0, 0, -9.81],
                "materials": { "jelly": elastic("fixed-corotated", 5e4, 0.4) },
                "bodies": [ { "name": "cube", "material": "jelly", "velocity": [0, 0, -speed],
                              "shape": { "box": { "min": [0.25, 0.25, from], "max": [0.5, 0.5, from + 0.25] } } } ],
            }),
        );
        let top = problem.particles.x.iter().map(|x| x[2]).fold(0.0, f64::max);
        let roof: Vec<usize> =
            (0..problem.particles.len()).filter(|&p| problem.particles.x[p][2] > top - 0.1 * dx).collect();
        let mut engine = session.engine(&problem)?;
        let (mut heights, mut kinetic) = (Vec::new(), 0.0);
        for frame in 0..frames {
            engine.advance_frame(frame_s, &NoControl)?;
            let p = engine.snapshot()?;
            heights.push(roof.iter().map(|&i| p.x[i][2]).sum::<f64>() / roof.len() as f64);
            if frame >= frames / 2 {
                let sums = sums(&problem, &p);
                kinetic += (sums.kinetic_j + sums.affine_j) / f64::from(frames / 2);
            }
        }
        Ok((heights, kinetic))
    };
    let (standing, quadratic_standing) = (run(COMPACT, 0.0, 0.0)?.1, run(QUADRATIC, 0.0, 0.0)?.1);
    let (compact, compact_j) = run(COMPACT, 0.125, 1.0)?;
    let (quadratic, quadratic_j) = run(QUADRATIC, 0.125, 1.0)?;
    let kinetic = "kinetic energy in the second half";
    let rule = (Rule::Absolute, 1.0, 0.1);
    session.check("standing, compact / quadratic", kinetic, "", rule, standing / quadratic_standing);
    session.check("landing, compact / quadratic", kinetic, "", (Rule::AtMost, 1.0, 0.0), compact_j / quadratic_j);
    let time = (1..=frames).map(|n| f64::from(n) * frame_s).collect();
    session.curve("roof", vec![("time_s", time), ("compact_m", compact), ("quadratic_m", quadratic)]);
    Ok(())
}

pub const HOLLOW_CYLINDER: Case = Case {
    name: "hollow-cylinder",
    claim: "with the compact kernel a ball falls freely through a tube 1.5 dx wider, where the supports of their \
            particles end, and sticks at 1.25 dx; with the quadratic it sticks at both",
    source: "CK-MPM section 6.2.2, Fig. 13; the paper's ball gets through at 1.25 dx, as ours does with E = 1e5",
    gpu: true,
    quick: false,
    run: hollow_cylinder,
};

fn hollow_cylinder(session: &mut Session) -> Result<(), EngineError> {
    let dx = 1.0 / 64.0;
    let inner = 7.5 * dx;
    let middle = 12.0 * dx;
    let (frames, frame_s) = (16, 1.0 / 80.0);
    let mut time = vec![0.0];
    time.extend((1..=frames).map(|n| f64::from(n) * frame_s));
    let mut columns = vec![("free_m", time.iter().map(|t| 0.5 * 9.81 * t * t).collect::<Vec<f64>>())];
    let variants = [
        ("compact_1.5_dx_m", COMPACT, 1.5, (Rule::AtLeast, 0.9, 0.0)),
        // The supports of particles on both sides meet, and this ball is stiff enough to stick.
        ("compact_1.25_dx_m", COMPACT, 1.25, (Rule::AtMost, 0.25, 0.0)),
        ("quadratic_1.5_dx_m", QUADRATIC, 1.5, (Rule::AtMost, 0.25, 0.0)),
        ("quadratic_1.25_dx_m", QUADRATIC, 1.25, (Rule::AtMost, 0.25, 0.0)),
    ];
    for (name, scheme, gap, rule) in variants {
        let tube = |radius: f64, height: f64| {
            json!({ "cylinder": { "center": [middle, middle, 12.0 * dx],
                                  "radius": radius, "height": height * dx } })
        };
        let problem = problem(
            session,
            scheme,
            json!({
                "domain": { "min": [0, 0, 0], "max": [24.0 * dx, 24.0 * dx, 36.0 * dx], "dx": dx },
                "gravity": [0, 0, -9.81],
                "materials": { "rubber": elastic("fixed-corotated", 1e6, 0.4) },
                "bodies": [
                    { "name": "ball", "material": "rubber",
                      "shape": { "sphere": { "center": [middle, middle, 22.0 * dx], "radius": inner - gap * dx } } },
                    { "name": "tube", "material": "rubber",
                      "shape": { "difference": [ tube(inner + 2.0 * dx, 24.0), tube(inner, 30.0) ] } },
                ],
            }),
        );
        let ball = problem.setup.bodies[0].particles.clone();
        let start = centre(&problem.particles, ball.clone())[2];
        let mut engine = session.engine(&problem)?;
        let mut fallen = vec![0.0];
        for _ in 0..frames {
            engine.advance_frame(frame_s, &NoControl)?;
            fallen.push(start - centre(&engine.snapshot()?, ball.clone())[2]);
        }
        let free = *columns[0].1.last().expect("frames were run");
        session.check(
            format!("{scheme} gap {gap} dx"),
            "way fallen / free fall",
            "",
            rule,
            fallen[fallen.len() - 1] / free,
        );
        columns.push((name, fallen));
    }
    columns.insert(0, ("time_s", time));
    session.curve("fall", columns);
    Ok(())
}
