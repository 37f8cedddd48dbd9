//! Volume: water at rest, and water that has come to rest, stands as high as its volume says.

use std::collections::BTreeMap;

use serde_json::json;

use super::Case;
use super::report::Rule;
use super::session::{Extent, Session};
use super::setup::{Scheme, centre, norm, problem, vector};
use gridfall_core::sim::setup::{Kernel, Transfer};
use gridfall_engine::{EngineError, NoControl};

pub const WATER_LEVEL: Case = Case {
    name: "water-level",
    claim: "still water keeps its level, a broken dam settles at its volume over the floor, and no cell is crowded",
    source: "incompressibility, less what the water's own weight compresses it by",
    gpu: false,
    quick: true,
    run: water_level,
};

const G: f64 = 9.81;
/// Of the water's equation of state.
const GAMMA: f64 = 7.15;
const DX: f64 = 0.04;
/// Cells of the block of water along each axis that it does not fill.
const BLOCK: f64 = 10.0;

fn water_level(session: &mut Session) -> Result<(), EngineError> {
    let schemes = match session.extent {
        Extent::Quick => {
            vec![Scheme::new(2, Kernel::Compact, Transfer::Mls), Scheme::new(2, Kernel::Quadratic, Transfer::Mls)]
        }
        Extent::Full => session.schemes(&[2]).into_iter().filter(|s| s.transfer != Transfer::Pic).collect(),
    };
    for scheme in schemes {
        for bulk_modulus_pa in session.pick(vec![1e5], vec![1e5, 1e6]) {
            settle(session, scheme, bulk_modulus_pa, "still", BLOCK)?;
            settle(session, scheme, bulk_modulus_pa, "dam", 2.0 * BLOCK)?;
        }
    }
    if !session.quick() {
        for kernel in [Kernel::Compact, Kernel::Quadratic] {
            settle(session, Scheme::new(3, kernel, Transfer::Mls), 1e5, "dam", 2.0 * BLOCK)?;
        }
    }
    Ok(())
}

/// A block of water in a basin `length` cells long.
fn settle(session: &mut Session, scheme: Scheme, k: f64, name: &str, length: f64) -> Result<(), EngineError> {
    let d = scheme.dimension;
    let size = |x: f64, up: f64| {
        let cells = if d == 2 { vec![x, up] } else { vec![x, 5.0, up] };
        cells.into_iter().map(|n| n * DX).collect::<Vec<_>>()
    };
    let slip = json!({ "contact": "slip" });
    let mut boundary = json!({ "x": slip, "y": slip });
    if d == 3 {
        boundary["z"] = slip;
    }
    let mut gravity = [0.0; 3];
    gravity[d - 1] = -G;
    let problem = problem(
        session,
        scheme,
        json!({
            "domain": { "min": vec![0; d], "max": size(length, 15.0), "dx": DX, "boundary": boundary },
            "gravity": vector(d, gravity),
            "materials": { "water": { "model": "weakly-compressible-fluid", "density": 1000, "bulk_modulus": k,
                                      "gamma": GAMMA } },
            "bodies": [ { "name": "water", "material": "water",
                          "shape": { "box": { "min": vec![0; d], "max": size(BLOCK, BLOCK) } } } ],
        }),
    );
    let mut engine = session.engine(&problem)?;
    // What still stirs varies from moment to moment: its speed is a mean over the last quarter.
    let frames = session.pick(20, 40);
    let (mut square, mut looks) = (0.0, 0.0);
    let mut after = engine.snapshot()?;
    for frame in 1..=frames {
        engine.advance_frame(0.5, &NoControl)?;
        if 4 * frame > 3 * frames {
            after = engine.snapshot()?;
            square += after.v.iter().map(|v| norm(*v).powi(2)).sum::<f64>() / after.len() as f64;
            looks += 1.0;
        }
    }
    let depth = BLOCK * BLOCK / length * DX;
    let expected = depth * pressed(1000.0 * G * depth / k);
    let variant = format!("{scheme} {name} K {k:.0e}");
    // Where it is five cells deep, the surface is a tenth of the depth.
    let tolerance = if name == "dam" { 0.05 } else { 0.03 };
    let level = 2.0 * centre(&after, 0..after.len())[d - 1];
    session.check(&variant, "level", "m", (Rule::Relative, expected, tolerance), level);

    let mut cells: BTreeMap<[i64; 3], usize> = BTreeMap::new();
    for x in after.x.iter().filter(|x| x[d - 1] < depth - DX) {
        *cells.entry(x.map(|x| (x / DX).floor() as i64)).or_default() += 1;
    }
    let fullest = cells.values().copied().max().unwrap_or(0) as f64 / f64::from(1 << d);
    session.check(&variant, "particles in the fullest cell / at rest", "", (Rule::AtMost, 2.5, 0.0), fullest);

    if name == "dam" {
        // It sloshes for longer.
        return Ok(());
    }
    let speed = (square / looks / (G * depth)).sqrt();
    // Softer water than c = 10 √(g h), the usual bound for one that stands for an incompressible fluid, stirs a little
    // for ever. It is the method's: no rate of the relaxation and no viscosity calms it (docs/VALIDATION.md).
    let limit = if k < 100.0 * 1000.0 * G * depth { 0.02 } else { 0.01 };
    session.check(&variant, "rms speed / sqrt(g h)", "", (Rule::AtMost, limit, 0.0), speed);
    Ok(())
}

/// Twice the mean height of a column of water under its own weight, over its depth without weight. With `strain` =
/// ρ g h / K, the pressure under a share s of the mass is s strain K, and J(s) = (1 + γ strain s)^(−1/γ) (Tait).
/// A layer lifts the share s that is above it, so this is 2 ∫ J(s) s ds over s from 0 to 1.
fn pressed(strain: f64) -> f64 {
    let (a, q) = (GAMMA * strain, 1.0 / GAMMA);
    let part = |n: f64| ((1.0 + a).powf(n) - 1.0) / n;
    2.0 * (part(2.0 - q) - part(1.0 - q)) / (a * a)
}
