//! The bulk bound of the time step: periodic boxes with one particle per cell, bisected for the
//! largest stable step.

use std::f64::consts::FRAC_1_SQRT_2;

use serde_json::json;

use super::Case;
use super::forced::{Forced, add_noise};
use super::report::Rule;
use super::session::Session;
use super::setup::{Scheme, elastic, problem};
use gridfall_core::sim::particles::IDENTITY;
use gridfall_core::sim::setup::{Kernel, Problem, Transfer};
use gridfall_core::sim::timestep::{elastic_bounds_s, moduli};
use gridfall_engine::EngineError;

pub const VON_NEUMANN: Case = Case {
    name: "von-neumann",
    claim: "the largest stable step of a periodic box with one particle a cell is f dx / c",
    source: "Bai & Schroeder, Fig. 4 (their simulated columns, for PIC the analytic one); the compact kernel's are \
             our own",
    gpu: false,
    quick: true,
    run: von_neumann,
};

/// Fig. 4: spline and scheme, then the simulated factors in 2D and 3D. PIC's are the analytic ones:
/// its first unstable mode has no velocity at the particles, only strain, so that the paper, which
/// looks at speeds, finds its growth late (0.7133 and 0.7182, 1.4055 and 1.4130).
const FIGURE_4: [(Kernel, Transfer, [f64; 2]); 6] = [
    (Kernel::Quadratic, Transfer::Apic, [1.0007, 1.0017]),
    (Kernel::Quadratic, Transfer::Mls, [1.0011, 1.0029]),
    (Kernel::Quadratic, Transfer::Pic, [FRAC_1_SQRT_2; 2]),
    (Kernel::Cubic, Transfer::Apic, [1.7055, 1.7072]),
    (Kernel::Cubic, Transfer::Mls, [1.3993, 1.4028]),
    (Kernel::Cubic, Transfer::Pic, [1.4033; 2]),
];

/// Noise on v, C and F, as in the paper.
const NOISE: f64 = 1e-4;
/// Steps between looks at the strain.
const LOOK: u32 = 50;
/// The paper's boxes have 32 cells per axis; it gives neither their size nor the density. A side of
/// 1 m and 1000 kg/m³ reproduce its excess over the analytic bounds, which is due to the time that
/// a slow growth takes to show.
const DX_M: f64 = 1.0 / 32.0;
/// Simulated time of the paper (s).
const TIME_S: f64 = 10.0;
/// Time for testing the bounds themselves (s), long enough for slow growth.
const LONG_TIME_S: f64 = 40.0;

/// A periodic box with one particle per cell, at `place` in it (dx).
struct Bulk {
    scheme: Scheme,
    poissons_ratio: f64,
    cells: usize,
    place: [f64; 3],
}

fn von_neumann(session: &mut Session) -> Result<(), EngineError> {
    let dimensions: &[usize] = session.pick(&[2], &[2, 3]);
    for (kernel, transfer, factors) in FIGURE_4.into_iter().take(session.pick(1, FIGURE_4.len())) {
        for &dimension in dimensions {
            // Half the side in 3D: a mode does not depend on how often it is repeated.
            let cells = if dimension == 2 { 32 } else { 16 };
            let scheme = Scheme::new(dimension, kernel, transfer);
            // Midway between nodes.
            let bulk = Bulk { scheme, poissons_ratio: 0.3, cells, place: [0.5; 3] };
            let (problem, unit_s) = bulk.problem(session);
            let factor = factors[dimension - 2];
            let got = largest_stable_step_s(&problem, factor * unit_s, TIME_S) / unit_s;
            let rule = (Rule::Relative, factor, 0.01);
            session.check(format!("{scheme} {cells}^{dimension}"), "f, midway between nodes", "", rule, got);
        }
    }
    for &dimension in dimensions {
        let cells = if dimension == 2 { 16 } else { 8 };
        for transfer in
            session.pick(&[Transfer::Mls][..], &[Transfer::Pic, Transfer::Apic, Transfer::Mls, Transfer::MlsPublished])
        {
            for poissons_ratio in [0.0, 0.3] {
                // Midway on one axis and on nodes on the next. For MLS as published and without λ,
                // slightly beside them.
                let place = match (transfer, poissons_ratio) {
                    (Transfer::MlsPublished, 0.0) => [0.25, 0.05, 0.25],
                    _ => [0.25, 0.75, 0.25],
                };
                let scheme = Scheme::new(dimension, Kernel::Compact, *transfer);
                compact_bound(session, &Bulk { scheme, poissons_ratio, cells, place });
            }
        }
    }
    Ok(())
}

/// Checks the bound that steps are planned with.
fn compact_bound(session: &mut Session, bulk: &Bulk) {
    let (problem, unit_s) = bulk.problem(session);
    let body = &problem.setup.bodies[0];
    let (lambda, mu, _) = moduli(&problem.setup.materials[body.material]);
    let bound_s = elastic_bounds_s(&problem.setup, lambda, mu, body.mass / body.volume0).0;
    let got = largest_stable_step_s(&problem, bound_s, LONG_TIME_S) / unit_s;
    let variant = format!("{} {}^{} nu {}", bulk.scheme, bulk.cells, bulk.scheme.dimension, bulk.poissons_ratio);
    session.check(variant, "f = largest stable dt c / dx", "", (Rule::Relative, bound_s / unit_s, 0.01), got);
}

impl Bulk {
    /// The box with noise, and dx / c (s), c the speed of P waves.
    fn problem(&self, session: &Session) -> (Problem, f64) {
        let d = self.scheme.dimension;
        let side = self.cells as f64 * DX_M;
        let mut boundary = json!({ "x": "periodic", "y": "periodic" });
        if d == 3 {
            boundary["z"] = json!("periodic");
        }
        let mut problem = problem(
            session,
            self.scheme,
            json!({
                "domain": { "min": vec![0; d], "max": vec![side; d], "dx": DX_M, "boundary": boundary },
                "materials": { "jelly": elastic("neo-hookean", 1e3, self.poissons_ratio) },
                "bodies": [ { "name": "bulk", "material": "jelly", "particles_per_cell": 1,
                              "shape": { "box": { "min": vec![0; d], "max": vec![side; d] } } } ],
            }),
        );
        for x in &mut problem.particles.x {
            (0..d).for_each(|a| x[a] += (self.place[a] - 0.5) * DX_M);
        }
        add_noise(&mut problem, NOISE, 4);
        let (lambda, mu, _) = moduli(&problem.setup.materials[0]);
        let body = &problem.setup.bodies[0];
        let c = ((lambda + 2.0 * mu) * body.volume0 / body.mass).sqrt();
        (problem, DX_M / c)
    }
}

/// Bisects between 0.98 and 1.02 of `near_s`, to 1/2000 of it. Returns the end of the bracket if
/// the answer lies outside.
fn largest_stable_step_s(problem: &Problem, near_s: f64, time_s: f64) -> f64 {
    let (mut stable, mut unstable) = (0.98, 1.02);
    while unstable - stable > 5e-4 {
        let middle = 0.5 * (stable + unstable);
        if is_stable(problem, middle * near_s, time_s) { stable = middle } else { unstable = middle }
    }
    0.5 * (stable + unstable) * near_s
}

/// The largest speed must not grow tenfold, as in the paper, nor the largest strain.
fn is_stable(problem: &Problem, dt_s: f64, time_s: f64) -> bool {
    let speed = |v: &[f64; 3]| v.iter().map(|c| c * c).sum::<f64>().sqrt();
    let limit = 10.0 * problem.particles.v.iter().map(speed).fold(0.0, f64::max);
    let strain = |f: &[[f64; 9]]| {
        let entries = f.iter().flat_map(|f| f.iter().zip(IDENTITY).map(|(f, i)| (f - i).abs()));
        entries.fold(0.0, f64::max)
    };
    let largest = 10.0 * strain(&problem.particles.f);
    let mut simulation = Forced::new(problem, dt_s);
    for step in 1u32.. {
        if simulation.step() > limit || (step % LOOK == 0 && strain(&simulation.particles().f) > largest) {
            return false;
        }
        if simulation.time_s() >= time_s {
            break;
        }
    }
    true
}
