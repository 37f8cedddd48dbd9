//! The single-particle bound of the time step, bracketed: lone particles at many places in a cell,
//! just below and just above the bound.

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
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

pub const SINGLE_PARTICLE: Case = Case {
    name: "single-particle",
    claim: "no lone particle grows at 0.98 of the single-particle bound, wherever it is; at 1.05 one does",
    source: "Bai & Schroeder, section 3.2, eq. 4; the compact kernel's bound is our own",
    gpu: false,
    quick: true,
    run: single_particle,
};

/// Cells between lone particles, so that no node has two.
const APART: usize = 6;
const NOISE: f64 = 1e-9;
/// Growth that counts as unstable; the ellipse of a stable orbit stays far below it.
const GROWTH: f64 = 1e3;
const STEPS: usize = 600;

fn single_particle(session: &mut Session) -> Result<(), EngineError> {
    let schemes = match session.extent {
        super::Extent::Quick => {
            vec![Scheme::new(2, Kernel::Quadratic, Transfer::Apic), Scheme::new(2, Kernel::Compact, Transfer::Mls)]
        }
        super::Extent::Full => {
            let published = [2, 3].map(|d| Scheme::new(d, Kernel::Compact, Transfer::MlsPublished));
            session.schemes(&[2, 3]).into_iter().chain(published).collect()
        }
    };
    for scheme in schemes {
        // The splines' bound is sharp for every material, the compact kernel's for the worst one.
        let ratios: &[f64] = session.pick(&[0.0, 0.3], &[0.0, 0.3, 0.45]);
        let (mut below, mut above) = (0.0f64, 0.0f64);
        for &poissons_ratio in ratios {
            let problem = lone_particles(session, scheme, poissons_ratio);
            let body = &problem.setup.bodies[0];
            let (lambda, mu, _) = moduli(&problem.setup.materials[body.material]);
            let bound_s = elastic_bounds_s(&problem.setup, lambda, mu, body.mass / body.volume0).1;
            below = below.max(growth(&problem, 0.98 * bound_s));
            above = above.max(growth(&problem, 1.05 * bound_s));
        }
        session.check(scheme, "growth at 0.98 of the bound", "", (Rule::AtMost, GROWTH, 0.0), below);
        session.check(scheme, "growth at 1.05 of the bound", "", (Rule::AtLeast, GROWTH, 0.0), above);
    }
    Ok(())
}

/// Particles too far apart to share nodes, each at its own place in its cell: symmetric points,
/// points beside them (the spline's worst case is a supremum beside the midplane, where a node
/// drops out), and random ones.
fn lone_particles(session: &Session, scheme: Scheme, poissons_ratio: f64) -> Problem {
    let d = scheme.dimension;
    let per_axis = if d == 2 { 10 } else { 4 };
    let side = per_axis * APART;
    let mut problem = problem(
        session,
        scheme,
        json!({
            "domain": { "min": vec![0; d], "max": vec![side; d], "dx": 1 },
            "materials": { "jelly": elastic("neo-hookean", 1e3, poissons_ratio) },
            "bodies": [ { "name": "lone", "material": "jelly", "particles_per_cell": 1,
                          "shape": { "box": { "min": vec![0; d], "max": vec![per_axis; d] } } } ],
        }),
    );
    let mut random = ChaCha8Rng::seed_from_u64(20);
    for (n, x) in problem.particles.x.iter_mut().enumerate() {
        // The same distance from the symmetric point on all axes of a particle.
        let beside = 10f64.powf(random.random_range(-9.0..-2.0));
        for x in &mut x[..d] {
            let place = match n % 4 {
                0 => [0.0, 0.5][random.random_range(0..2)] + beside,
                1 => [0.0, 0.25, 0.5, 0.75][random.random_range(0..4)] + beside,
                2 => 0.5 + beside,
                _ => random.random::<f64>(),
            };
            *x = APART as f64 * x.floor() + 2.0 + place;
        }
    }
    add_noise(&mut problem, NOISE, 5);
    // At rest as a whole: a lone particle keeps only strain and affine velocity.
    problem.particles.v.iter_mut().for_each(|v| *v = [0.0; 3]);
    problem
}

/// Growth of the largest strain of any particle after many steps.
fn growth(problem: &Problem, dt_s: f64) -> f64 {
    // The symmetric part, because particles may rotate.
    let strain = |f: &[f64; 9]| {
        let of = |k: usize| 0.5 * (f[k] + f[3 * (k % 3) + k / 3]) - IDENTITY[k];
        (0..9).map(|k| of(k).abs()).fold(0.0, f64::max)
    };
    let largest = |f: &[[f64; 9]]| f.iter().map(strain).fold(0.0, f64::max);
    let before = largest(&problem.particles.f);
    let mut simulation = Forced::new(problem, dt_s);
    for _ in 0..STEPS {
        if !simulation.step().is_finite() {
            return f64::INFINITY;
        }
    }
    let after = largest(&simulation.particles().f) / before;
    if after.is_nan() { f64::INFINITY } else { after }
}
