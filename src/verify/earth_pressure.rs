//! Earth pressure on a wall that moves: whether a friction angle means what it says.

use serde_json::{Value, json};

use super::Case;
use super::report::Rule;
use super::session::{Session, Target};
use super::setup::{Scheme, problem, vector};
use gridfall_core::sim::reaction::WALLS;
use gridfall_core::sim::setup::{Kernel, Transfer};
use gridfall_engine::{EngineError, NoControl};

pub const EARTH_PRESSURE: Case = Case {
    name: "earth-pressure",
    claim: "sand of 30° resists a smooth wall with 3 times its weight's pressure, and follows one that yields with 1/3",
    source: "Rankine 1857: (1 + sin φ)/(1 − sin φ) for a wall that pushes, its inverse for one that yields",
    gpu: true,
    quick: true,
    run: earth_pressure,
};

/// Sand between smooth walls, one of which moves once the sand has come to rest. In three
/// dimensions it is periodic along y.
fn sand(dimension: usize, cells: f64, law: &Value, travel: f64) -> Value {
    let (height, dx) = (0.5, 0.5 / cells);
    let place = |x: f64, up: f64| if dimension == 2 { vec![x, up] } else { vec![x, -1.0, up] };
    let extent = |x: f64, up: f64| if dimension == 2 { vec![x, up] } else { vec![x, 4.0 * dx, up] };
    let slip = json!({ "contact": "slip" });
    let mut boundary = json!({ "x": slip, "y": slip });
    if dimension == 3 {
        boundary = json!({ "x": slip, "y": "periodic", "z": slip });
    }
    let mut gravity = [0.0; 3];
    gravity[dimension - 1] = -9.81;
    let mut material =
        json!({ "density": 1600, "youngs_modulus": 1e6, "poissons_ratio": 0.3, "friction_angle_degrees": 30 });
    for (name, value) in law.as_object().expect("a law is an object") {
        material[name] = value.clone();
    }
    let offset = vector(dimension, [travel, 0.0, 0.0]);
    let end = if dimension == 2 { vec![1.25, 2.0] } else { vec![1.25, 2.0, 2.0] };
    json!({
        "domain": { "min": vec![0; dimension], "max": extent(1.5, 1.0), "dx": dx, "boundary": boundary },
        "gravity": vector(dimension, gravity),
        "materials": { "sand": material },
        "bodies": [ { "name": "fill", "material": "sand",
                      "shape": { "box": { "min": vec![0; dimension], "max": extent(1.0, height) } } } ],
        "colliders": [ {
            "name": "wall", "contact": "slip", "shape": { "box": { "min": place(1.0, -1.0), "max": end } },
            "motion": { "keyframes": [ { "time": 0 }, { "time": 0.4 }, { "time": 1, "offset": offset } ] },
        } ],
    })
}

fn earth_pressure(session: &mut Session) -> Result<(), EngineError> {
    let dimensions: &[usize] = match session.target {
        Target::Cpu => session.pick(&[2], &[2, 3]),
        Target::Gpu => &[3],
    };
    let laws = [
        ("mohr-coulomb", json!({ "model": "mohr-coulomb" })),
        ("plane-strain cone", json!({ "model": "drucker-prager", "cone": "plane-strain" })),
    ];
    for &dimension in dimensions {
        let scheme = Scheme::new(dimension, Kernel::Quadratic, Transfer::Mls);
        let cells = if dimension == 2 { 20.0 } else { 12.0 };
        for (name, law) in laws.iter().take(session.pick(1, 2)) {
            let (mut time, mut curves) = (Vec::new(), Vec::new());
            for (quantity, travel, expected) in [("pushed", -0.036, 3.0), ("yielding", 0.036, 1.0 / 3.0)] {
                let problem = problem(session, scheme, sand(dimension, cells, law, travel));
                let mut engine = session.engine(&problem)?;
                // Half of the weight's pressure at the bottom, on the wall's area.
                let width = if dimension == 2 { 1.0 } else { 4.0 * problem.setup.dx };
                let hydrostatic = 0.5 * 1600.0 * 9.81 * 0.5 * 0.5 * width;
                let mut ratio = Vec::new();
                for _ in 0..20 {
                    let stats = engine.advance_frame(0.05, &NoControl)?;
                    ratio.push(stats.reactions[WALLS].force[0] / hydrostatic);
                }
                time = (1..=20).map(|frame| 0.05 * f64::from(frame)).collect();
                let last = &ratio[14..];
                let mean = last.iter().sum::<f64>() / last.len() as f64;
                let rule = (Rule::Relative, expected, 0.12);
                session.check(
                    format!("{scheme}, {name}"),
                    &format!("pressure of a wall that is {quantity}"),
                    "",
                    rule,
                    mean,
                );
                curves.push((quantity, ratio));
            }
            let mut columns = vec![("time_s", time)];
            columns.append(&mut curves);
            session.curve(format!("{scheme} {name}"), columns);
        }
    }
    Ok(())
}
