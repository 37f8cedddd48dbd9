//! What sticky walls hold: flows and layers between them, which shear and keep their volume ("MLS on
//! two grids" and "Walls" in docs/NUMERICS.md).

use std::f64::consts::PI;

use serde_json::{Value, json};

use super::Case;
use super::report::Rule;
use super::session::Session;
use super::setup::{Scheme, elastic, problem};
use gridfall_core::maths::linalg::determinant;
use gridfall_core::sim::particles::Particles;
use gridfall_core::sim::setup::{Kernel, Problem, Transfer};
use gridfall_engine::{EngineError, NoControl};

/// Distance of the walls (m).
const HEIGHT_M: f64 = 0.2;
/// Cells between them.
const CELLS: f64 = 16.0;
const DX_M: f64 = HEIGHT_M / CELLS;
const DENSITY: f64 = 1000.0;

/// A layer that fills the room between two sticky walls, y in 2D and z in 3D, and repeats itself
/// along the others. It is driven along x.
fn layer(session: &Session, scheme: Scheme, material: Value, drive_m_s2: f64) -> Problem {
    let three = scheme.dimension == 3;
    let far = if three { vec![8.0 * DX_M, 4.0 * DX_M, HEIGHT_M] } else { vec![8.0 * DX_M, HEIGHT_M] };
    let sticky = json!({ "contact": "sticky" });
    let boundary = if three {
        json!({ "x": "periodic", "y": "periodic", "z": sticky })
    } else {
        json!({ "x": "periodic", "y": sticky })
    };
    let mut gravity = vec![0.0; scheme.dimension];
    gravity[0] = drive_m_s2;
    let zero = vec![0.0; scheme.dimension];
    problem(
        session,
        scheme,
        json!({
            "domain": { "min": zero, "max": far, "dx": DX_M, "boundary": boundary },
            "gravity": gravity,
            "materials": { "layer": material },
            "bodies": [ { "name": "layer", "material": "layer", "shape": { "box": { "min": zero, "max": far } } } ],
        }),
    )
}

/// Water of viscosity 10 Pa·s.
fn syrup(bulk_modulus_pa: f64) -> Value {
    json!({ "model": "weakly-compressible-fluid", "density": DENSITY, "bulk_modulus": bulk_modulus_pa,
            "viscosity": VISCOSITY })
}

const VISCOSITY: f64 = 10.0;

/// Largest |J − 1|.
fn volume_error(particles: &Particles) -> f64 {
    particles.f.iter().map(|f| (determinant(f) - 1.0).abs()).fold(0.0, f64::max)
}

/// Largest |J − 1| that counts as none. The fill of a regular lattice, which J follows slowly, moves it
/// by 1.4e-3; where MLS locks it is 0.1.
const NO_VOLUME: f64 = 5e-3;

pub const POISEUILLE: Case = Case {
    name: "poiseuille",
    claim: "a viscous fluid between sticky walls flows as fast as the closed form, and no volume changes in it",
    source: "plane Poiseuille flow that starts from rest; 16 cells across",
    gpu: true,
    quick: true,
    run: poiseuille,
};

/// Speed (m/s) of plane Poiseuille flow at a height, a time after it started from rest.
fn poiseuille_speed(drive_m_s2: f64, y: f64, time_s: f64) -> f64 {
    let h = HEIGHT_M;
    let scale = DENSITY * drive_m_s2 / VISCOSITY;
    let late = 0.5 * scale * y * (h - y);
    let early = (0..40).map(|n| {
        let k = f64::from(2 * n + 1);
        let decay = (-(k * PI / h).powi(2) * VISCOSITY / DENSITY * time_s).exp();
        4.0 * scale * h * h / (k * PI).powi(3) * (k * PI * y / h).sin() * decay
    });
    late - early.sum::<f64>()
}

fn poiseuille(session: &mut Session) -> Result<(), EngineError> {
    let (drive, end_s) = (1.0, session.pick(0.6, 1.2));
    let two = |kernel, transfer| Scheme::new(2, kernel, transfer);
    let mls = |kernel| two(kernel, Transfer::Mls);
    let (compact, three) = (mls(Kernel::Compact), Scheme::new(3, Kernel::Compact, Transfer::Mls));
    let variants = match (session.quick(), session.on(true, false)) {
        (true, true) => vec![(compact, 2e5)],
        (_, false) => vec![(three, 2e4)],
        (false, true) => vec![
            (compact, 2e4),
            (compact, 2e5),
            (two(Kernel::Compact, Transfer::Apic), 2e5),
            (two(Kernel::Compact, Transfer::MlsPublished), 2e5),
            (mls(Kernel::Quadratic), 2e5),
            (mls(Kernel::Cubic), 2e5),
            (three, 2e5),
        ],
    };
    for (scheme, bulk_modulus) in variants {
        let problem = layer(session, scheme, syrup(bulk_modulus), drive);
        let up = scheme.dimension - 1;
        let mut engine = session.engine(&problem)?;
        for _ in 0..12 {
            engine.advance_frame(end_s / 12.0, &NoControl)?;
        }
        let p = engine.snapshot()?;
        // Means of the layers of half a cell.
        let layers = 2 * CELLS as usize;
        let (mut count, mut height, mut speed) = (vec![0.0; layers], vec![0.0; layers], vec![0.0; layers]);
        for (x, v) in p.x.iter().zip(&p.v) {
            let at = ((x[up] / DX_M * 2.0) as usize).min(layers - 1);
            count[at] += 1.0;
            height[at] += x[up];
            speed[at] += v[0];
        }
        let filled: Vec<usize> = (0..layers).filter(|&k| count[k] > 0.0).collect();
        let height: Vec<f64> = filled.iter().map(|&k| height[k] / count[k]).collect();
        let speed: Vec<f64> = filled.iter().map(|&k| speed[k] / count[k]).collect();
        let exact: Vec<f64> = height.iter().map(|&y| poiseuille_speed(drive, y, end_s)).collect();
        let middle: Vec<usize> =
            (0..height.len()).filter(|&k| (height[k] - 0.5 * HEIGHT_M).abs() < HEIGHT_M / 8.0).collect();
        let of_middle = |speeds: &[f64]| middle.iter().map(|&k| speeds[k]).sum::<f64>() / middle.len() as f64;
        let variant = format!("{scheme} K {bulk_modulus:.0e}");
        let got = of_middle(&speed) / of_middle(&exact);
        session.check(&variant, "speed in the middle / closed form", "", (Rule::Absolute, 1.0, 0.05), got);
        session.check(&variant, "largest |J - 1|", "", (Rule::AtMost, NO_VOLUME, 0.0), volume_error(&p));
        let curve = vec![("height_m", height), ("speed_m_s", speed), ("exact_m_s", exact)];
        session.curve(variant, curve);
    }
    Ok(())
}

pub const SHEARED_LAYER: Case = Case {
    name: "sheared-layer",
    claim: "an elastic layer between sticky walls, under a load along them, swings about its static shear as long as \
            it is watched",
    source: "a string under its own weight: amplitude ρ g H² / 8 G, period 2 H sqrt(ρ/G)",
    gpu: true,
    quick: true,
    run: sheared_layer,
};

fn sheared_layer(session: &mut Session) -> Result<(), EngineError> {
    let (young, nu, drive) = (1e5, 0.3, 0.5);
    let shear = young / (2.0 * (1.0 + nu));
    let period_s = 2.0 * HEIGHT_M * f64::sqrt(DENSITY / shear);
    let schemes = match (session.quick(), session.on(true, false)) {
        (true, true) => vec![Scheme::new(2, Kernel::Compact, Transfer::Mls)],
        (_, false) => vec![Scheme::new(3, Kernel::Compact, Transfer::Mls)],
        (false, true) => vec![
            Scheme::new(2, Kernel::Compact, Transfer::Mls),
            Scheme::new(2, Kernel::Compact, Transfer::Apic),
            Scheme::new(2, Kernel::Quadratic, Transfer::Mls),
            Scheme::new(3, Kernel::Compact, Transfer::Mls),
        ],
    };
    let periods = session.pick(2, 4);
    for scheme in schemes {
        let problem = layer(session, scheme, elastic("neo-hookean", young, nu), drive);
        let (up, around) = (scheme.dimension - 1, 8.0 * DX_M);
        let middle: Vec<usize> = (0..problem.particles.len())
            .filter(|&p| (problem.particles.x[p][up] - 0.5 * HEIGHT_M).abs() < DX_M)
            .collect();
        let mut engine = session.engine(&problem)?;
        let (mut before, mut way) = (problem.particles.x.clone(), 0.0);
        let (mut time, mut path) = (vec![0.0], vec![0.0]);
        let per_period = 40;
        for frame in 1..=periods * per_period {
            engine.advance_frame(period_s / f64::from(per_period), &NoControl)?;
            let x = engine.snapshot()?.x;
            // Over the seam, the shorter way.
            let step = |p: usize| {
                let d = x[p][0] - before[p][0];
                d - around * (d / around).round()
            };
            way += middle.iter().map(|&p| step(p)).sum::<f64>() / middle.len() as f64;
            before = x;
            time.push(period_s * f64::from(frame) / f64::from(per_period));
            path.push(way);
        }
        let fixed = DENSITY * drive * HEIGHT_M * HEIGHT_M / (8.0 * shear);
        let last = &path[path.len() - per_period as usize..];
        let largest = last.iter().fold(0.0f64, |a, &b| a.max(b));
        session.check(
            scheme,
            "last swing / twice the static shear",
            "",
            (Rule::Relative, 1.0, 0.03),
            largest / (2.0 * fixed),
        );
        session.curve(scheme, vec![("time_s", time), ("way_m", path)]);
    }
    Ok(())
}
