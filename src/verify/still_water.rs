//! Weight: what the grid's wall nodes take from a column of water at rest.

use std::f64::consts::PI;

use serde_json::json;

use super::Case;
use super::forced::Forced;
use super::report::Rule;
use super::session::Session;
use super::setup::{Scheme, problem, vector};
use gridfall_core::maths::linalg::determinant;
use gridfall_core::sim::setup::{Kernel, Problem, Transfer};
use gridfall_core::sim::timestep::material_bound;
use gridfall_engine::EngineError;

pub const STILL_WATER: Case = Case {
    name: "still-water",
    claim: "the floor under a column of water between slip walls carries ρ V g, and the pressure at it is ρ g h",
    source: "hydrostatics",
    gpu: false,
    quick: true,
    run: still_water,
};

fn still_water(session: &mut Session) -> Result<(), EngineError> {
    let (g, dx, bulk_modulus) = (9.81, 1.0 / 16.0, 1e6);
    let schemes = match session.extent {
        super::Extent::Quick => vec![Scheme::new(2, Kernel::Compact, Transfer::Mls)],
        super::Extent::Full => session.schemes(&[2, 3]),
    };
    for scheme in schemes {
        let d = scheme.dimension;
        let size = |up: f64| if d == 2 { vec![8.0 * dx, up * dx] } else { vec![4.0 * dx, 4.0 * dx, up * dx] };
        let mut gravity = [0.0; 3];
        gravity[d - 1] = -g;
        let slip = json!({ "contact": "slip" });
        let mut boundary = json!({ "x": slip, "y": slip });
        if d == 3 {
            boundary["z"] = slip;
        }
        let problem = problem(
            session,
            scheme,
            json!({
                "domain": { "min": vec![0; d], "max": size(16.0), "dx": dx, "boundary": boundary },
                "gravity": vector(d, gravity),
                "materials": { "water": { "model": "weakly-compressible-fluid", "density": 1000,
                                          "bulk_modulus": bulk_modulus, "viscosity": 5 } },
                "bodies": [ { "name": "column", "material": "water",
                              "shape": { "box": { "min": vec![0; d], "max": size(12.0) } } } ],
            }),
        );
        // The water starts unstrained and oscillates about its rest state, so the mean covers many
        // of its periods, 4 h / c.
        let height = 12.0 * dx;
        let period_s = 4.0 * height / (bulk_modulus / 1000.0f64).sqrt();
        let layers = 6.0 * if d == 2 { 8.0 * dx * dx } else { 16.0 * dx * dx * dx };
        let mut simulation = Forced::new(&problem, material_bound(&problem.setup).0).watch_nodes();
        let end_s = session.pick(10.0, 20.0) * period_s;
        let (mut impulse, mut pressure, mut weight_s) = (0.0, 0.0, 0.0);
        while simulation.time_s() < end_s {
            let before = simulation.time_s();
            if !simulation.step().is_finite() {
                return Err(EngineError::Diverged { step: 0, time_s: before, what: "the water at rest".into() });
            }
            // Hann window: the mean does not depend on where in an oscillation it ends.
            let window = 1.0 - (2.0 * PI * before / end_s).cos();
            weight_s += window * simulation.dt_s();
            impulse += window * floor_impulse(&problem, &simulation);
            let particles = simulation.particles();
            // The mean over the room of six layers of cells, of the particles that are in it now:
            // stress times volume is what the grid balances. A particle's own pressure is noise and,
            // where particles stand looser than their J says, too high on the average. A single layer
            // is up to 4 % off either way, as particles happen to have come to rest in it.
            let volume0 = problem.setup.bodies[0].volume0;
            let mut sum = 0.0;
            for (x, f) in particles.x.iter().zip(&particles.f) {
                let above = x[d - 1] - 5.0 * dx;
                if above.abs() < 3.0 * dx {
                    let j = determinant(f);
                    sum += volume0 * j * (bulk_modulus / 7.15 * (j.powf(-7.15) - 1.0) + 1000.0 * g * above);
                }
            }
            pressure += window * simulation.dt_s() * sum / layers;
        }
        let weight = g * problem.setup.bodies[0].mass * problem.particles.len() as f64;
        session.check(scheme, "reaction of the floor", "N", (Rule::Relative, weight, 0.02), impulse / weight_s);
        let depth = height - 5.0 * dx;
        let expected = (Rule::Relative, 1000.0 * g * depth, 0.02);
        session.check(scheme, "mean pressure 2 to 8 dx above it", "Pa", expected, pressure / weight_s);
    }
    Ok(())
}

/// The impulse (N s) that the floor took in the last step from the nodes on it and beyond it: their
/// momentum with the step's forces and gravity, minus their momentum after the grid update. Both
/// grids of the compact kernel carry all momentum.
fn floor_impulse(problem: &Problem, simulation: &Forced) -> f64 {
    let up = problem.setup.dimension - 1;
    let grids = if problem.setup.kernel == Kernel::Compact { 2.0 } else { 1.0 };
    let taken = simulation.nodes().iter().map(|n| {
        let free = n.momentum[up] / n.mass + simulation.dt_s() * problem.setup.gravity[up];
        n.mass * (n.velocity[up] - free)
    });
    taken.sum::<f64>() / grids
}
