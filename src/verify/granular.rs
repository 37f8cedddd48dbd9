//! Sand that flows: the collapse of a column against experiments, and the slope on which a layer
//! comes to rest.

use std::collections::BTreeMap;

use serde_json::{Value, json};

use super::Case;
use super::report::Rule;
use super::session::Session;
use super::setup::{Scheme, problem};
use gridfall_core::material::lame;
use gridfall_core::sim::setup::{Kernel, Problem, Transfer};
use gridfall_engine::{EngineError, NoControl};

pub const GRANULAR_COLUMN: Case = Case {
    name: "granular-column",
    claim: "a column of sand that collapses on a rough floor runs out as far and stays as high as columns in channels",
    source: "Lube et al. 2005, Phys. Rev. E 72, 041301 (two dimensions), a = h0 / l0: Δl / l0 = 1.2 a below 2.3; \
             h / l0 = a below 1.15, else a^0.4",
    gpu: false,
    quick: true,
    run: granular_column,
};

/// Both kernels in a full run, else the compact one.
fn kernels(session: &Session) -> impl Iterator<Item = (&'static str, Kernel)> + use<> {
    [("compact", Kernel::Compact), ("quadratic", Kernel::Quadratic)].into_iter().take(session.pick(1, 2))
}

fn granular_column(session: &mut Session) -> Result<(), EngineError> {
    let aspects: &[f64] = session.pick(&[1.0], &[0.5, 1.0, 1.5, 2.0]);
    let runout = |aspect: f64| 1.2 * aspect;
    let height = |aspect: f64| if aspect < 1.15 { aspect } else { aspect.powf(0.4) };
    let expected = |of: &dyn Fn(f64) -> f64| aspects.iter().map(|&a| of(a)).collect::<Vec<f64>>();
    let mut runouts = vec![("aspect_ratio", aspects.to_vec()), ("expected", expected(&runout))];
    let mut heights = vec![("aspect_ratio", aspects.to_vec()), ("expected", expected(&height))];
    for (name, kernel) in kernels(session) {
        let scheme = Scheme::new(2, kernel, Transfer::Mls);
        let mut deposits = Vec::new();
        for &aspect in aspects {
            let deposit = collapse(session, scheme, aspect)?;
            let variant = format!("{scheme} a {aspect}");
            let rule = |expected| (Rule::Relative, expected, 0.25);
            session.check(&variant, "run-out / initial length", "", rule(runout(aspect)), deposit.0);
            session.check(&variant, "height / initial length", "", rule(height(aspect)), deposit.1);
            deposits.push(deposit);
        }
        runouts.push((name, deposits.iter().map(|d| d.0).collect()));
        heights.push((name, deposits.iter().map(|d| d.1).collect()));
    }
    session.curve("run-out", runouts);
    session.curve("height", heights);
    Ok(())
}

/// Angle of repose of the experiments' sand.
const REPOSE_DEGREES: f64 = 31.0;

/// Particles of a cell.
const A_CELL: usize = 4;

/// The angle of friction with which slopes stand up to an angle of repose: grains that shear at
/// constant volume resist with sin φ (Davis 1968).
fn friction_of_repose(degrees: f64) -> f64 {
    degrees.to_radians().tan().asin().to_degrees()
}

/// Run-out and height of a column's deposit, over the column's initial length. The column stands in
/// the lower left corner. The left wall is smooth; the floor holds.
fn collapse(session: &Session, scheme: Scheme, aspect: f64) -> Result<(f64, f64), EngineError> {
    // A short column's front is thin: with 32 cells over its length it ends 0.1 lengths early.
    let (width, cells) = (0.1, if aspect < 1.0 { 48.0 } else { 16.0 });
    let dx = width / cells;
    let slip = json!({ "contact": "slip" });
    let problem = problem(
        session,
        scheme,
        json!({
            "domain": { "min": [0, 0], "max": [(1.0 + (2.0 * aspect).ceil()) * width + 8.0 * dx,
                                                (aspect.ceil() + 0.5) * width],
                        "dx": dx, "boundary": { "x": slip, "y+": slip } },
            "gravity": [0, -9.81],
            "materials": { "sand": sand("mohr-coulomb", friction_of_repose(REPOSE_DEGREES)) },
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
    let particles = engine.snapshot()?;
    // Without the grains that went ahead: up to the first column of cells that does not fill one.
    let mut filled = BTreeMap::new();
    particles.x.iter().for_each(|x| *filled.entry((x[0] / dx).floor() as i64).or_insert(0) += 1);
    let ends = |column: &i64| filled.get(column).is_none_or(|count| *count < A_CELL);
    let front = (0..).find(ends).expect("grains end somewhere") as f64 * dx;
    let beside_the_wall = particles.x.iter().filter(|x| x[0] < 0.2 * width);
    let top = beside_the_wall.fold(0.0f64, |top, x| top.max(x[1]));
    Ok(((front - width) / width, top / width))
}

fn sand(model: &str, friction_angle_degrees: f64) -> Value {
    json!({ "model": model, "density": 1600, "youngs_modulus": 1e6, "poissons_ratio": 0.3,
            "friction_angle_degrees": friction_angle_degrees })
}

pub const ANGLE_OF_REPOSE: Case = Case {
    name: "angle-of-repose",
    claim: "a long layer of sand of 30° stays on slopes below tan β = sin φ, 26.6°, and flows down steeper ones",
    source: "Davis 1968: without dilatancy, sin φ of the pressure resists along a plane that shears; above it, \
             the layer accelerates by g (sin β − sin φ cos β)",
    gpu: false,
    quick: true,
    run: angle_of_repose,
};

/// A layer on a slope without end, turned so that the slope is level. It starts with the stress that
/// it has while it flows, or on a slope that is not steep enough, with the stress that holds it:
/// otherwise it would bounce, and slide whenever it weighs less.
fn layer(session: &Session, scheme: Scheme, cells: f64, slope: f64) -> Problem {
    let (height, dx, slope) = (0.2, 0.2 / cells, slope.to_radians());
    let mut problem = problem(
        session,
        scheme,
        json!({
            "domain": { "min": [0, 0], "max": [4.0 * dx, 0.3], "dx": dx,
                        "boundary": { "x": "periodic", "y-": { "contact": "sticky" }, "y+": { "contact": "slip" } } },
            "gravity": [9.81 * slope.sin(), -9.81 * slope.cos()],
            "materials": { "sand": sand("mohr-coulomb", 30.0) },
            "bodies": [ { "name": "layer", "material": "sand",
                          "shape": { "box": { "min": [0, 0], "max": [4.0 * dx, height] } } } ],
        }),
    );
    let (mu, lambda) = lame(&problem.setup.materials[0].elastic().expect("sand is elastic"));
    let particles = &mut problem.particles;
    for (f, x) in particles.f.iter_mut().zip(&particles.x) {
        let pressure = 1600.0 * 9.81 * slope.cos() * (height - x[1]);
        let stretch = 1.0 - pressure / (2.0 * (lambda + mu));
        (f[0], f[1], f[4]) = (stretch, slope.tan().min(0.5) * pressure / mu, stretch);
    }
    problem
}

fn angle_of_repose(session: &mut Session) -> Result<(), EngineError> {
    let cells = session.pick(20.0, 40.0);
    for (_, kernel) in kernels(session) {
        let scheme = Scheme::new(2, kernel, Transfer::Mls);
        for slope in session.pick(&[24.0f64, 36.0] as &[f64], &[22.0, 24.0, 30.0, 36.0, 42.0]) {
            let problem = layer(session, scheme, cells, *slope);
            let upper: Vec<usize> = (0..problem.particles.len()).filter(|&p| problem.particles.x[p][1] > 0.1).collect();
            let mut engine = session.engine(&problem)?;
            let mut speed = Vec::new();
            for _ in 0..20 {
                engine.advance_frame(0.03, &NoControl)?;
                let v = &engine.snapshot()?.v;
                speed.push(upper.iter().map(|&p| v[p][0]).sum::<f64>() / upper.len() as f64);
            }
            let variant = format!("{scheme}, slope {slope}°");
            let (sin, cos) = slope.to_radians().sin_cos();
            let acceleration = (speed[19] - speed[9]) / 0.3;
            if sin > 0.5 * cos {
                let friction = (9.81 * sin - acceleration) / (9.81 * cos);
                session.check(variant, "friction under the upper half", "", (Rule::Relative, 0.5, 0.12), friction);
            } else {
                session.check(variant, "speed after 0.6 s", "m/s", (Rule::Absolute, 0.0, 0.01), speed[19]);
            }
        }
    }
    Ok(())
}
