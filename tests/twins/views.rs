//! What is recorded of a frame: the sums that the device takes are those that the host takes of the same states, and
//! the states of chosen particles are theirs to the bit.

use std::sync::Arc;

use gridfall_core::material::{Law, energy_density};
use gridfall_core::sim::diagnostics::Row;
use gridfall_core::sim::excerpt::Choice;
use gridfall_core::sim::particles::Particles;
use gridfall_core::sim::setup::{Problem, Setup};
use gridfall_engine::explicit::gpu::GpuEngine;
use gridfall_engine::gpu::Gpu;
use gridfall_engine::{Engine, FrameStats, NoControl};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::common;
use crate::explicit::{ELASTIC, GRAINS, METALS, SAND, SOILS, WATER, scene};

/// Unit roundoff of f32.
const U: f64 = 1.0 / 16_777_216.0;

/// A random problem, and the same moved far away.
fn random(kernel: &str, materials: [&str; 3], seed: u64, far: [f64; 3]) -> Problem {
    println!("{kernel} seed {seed} at {far:?}");
    let mut problem = scene(kernel, "mls", materials);
    common::randomise(&mut problem, &mut ChaCha8Rng::seed_from_u64(seed));
    // Turns and flows as a whole too, so that sums are not only what is left of what cancels.
    let Problem { setup, particles } = &mut problem;
    for (x, v) in particles.x.iter_mut().zip(&mut particles.v) {
        v[0] += 0.5 - x[2];
        v[2] += x[0];
        (0..3).for_each(|a| x[a] += far[a]);
    }
    (0..3).for_each(|a| setup.origin[a] += far[a]);
    problem
}

fn minus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|k| a[k] - b[k])
}

fn norm(a: &[f64]) -> f64 {
    a.iter().map(|a| a * a).sum::<f64>().sqrt()
}

/// Angular momentum about the domain's corner, and the work of gravity from there.
fn from_corner(setup: &Setup, row: &Row) -> ([f64; 3], f64) {
    let (o, p) = (setup.origin, [row.momentum_x, row.momentum_y, row.momentum_z]);
    let orbit = [o[1] * p[2] - o[2] * p[1], o[2] * p[0] - o[0] * p[2], o[0] * p[1] - o[1] * p[0]];
    let spin = minus([row.angular_momentum_x, row.angular_momentum_y, row.angular_momentum_z], orbit);
    let work: f64 = (0..3).map(|a| setup.gravity[a] * o[a]).sum();
    (spin, -row.gravity_j - row.mass_kg * work)
}

/// What the terms of the sums add up to without their signs: momentum, angular momentum, kinetic, affine, strain and
/// gravity's energy. That of the strain is V √(2ψ (λ + 2μ)) a particle, its stress times its volume, for a rounded
/// strain is an error of the energy in proportion to the stress.
fn scales(setup: &Setup, particles: &Particles) -> [f64; 6] {
    let mut scales = [0.0; 6];
    for p in 0..particles.len() {
        let body = &setup.bodies[particles.body[p] as usize];
        let material = &setup.materials[body.material];
        let (x, v) = (norm(&minus(particles.x[p], setup.origin)), norm(&particles.v[p]));
        let (b, m) = (norm(&particles.b[p]), body.mass);
        let psi = energy_density(material, 3, &particles.f[p], particles.plastic[p]);
        let stiffness = Law::<f64>::new(material).stiffness_at_rest();
        // D is at least dx²/10 along each axis.
        let terms = [m * v, m * (x * v + b), m * v * v, m * 10.0 * (b / setup.dx).powi(2)];
        let strain = body.volume0 * (2.0 * psi * stiffness).sqrt();
        let terms = terms.into_iter().chain([strain, m * norm(&setup.gravity) * x]);
        scales.iter_mut().zip(terms).for_each(|(scale, term)| *scale += term);
    }
    scales
}

/// Largest differences from the row of the same states in f64, in roundoffs of the scales: of the mass (in roundoffs
/// of f64), the six sums, the largest speed and the least J.
fn differences(setup: &Setup, row: &Row, exact: &Row, scales: &[f64; 6]) -> [f64; 9] {
    let momentum = |row: &Row| [row.momentum_x, row.momentum_y, row.momentum_z];
    let ((spin, work), (exact_spin, exact_work)) = (from_corner(setup, row), from_corner(setup, exact));
    let sums = [
        norm(&minus(momentum(row), momentum(exact))),
        norm(&minus(spin, exact_spin)),
        row.kinetic_j - exact.kinetic_j,
        row.affine_j - exact.affine_j,
        row.strain_j - exact.strain_j,
        work - exact_work,
    ];
    let [p, l, k, a, s, g] = std::array::from_fn(|k| sums[k].abs() / scales[k] / U);
    let mass = (row.mass_kg / exact.mass_kg - 1.0).abs() / f64::EPSILON;
    [mass, p, l, k, a, s, g, (row.max_speed / exact.max_speed - 1.0).abs() / U, (row.min_J - exact.min_J).abs() / U]
}

/// Roundings that a term goes through, each of at most one roundoff: mass and product for the momentum; also two
/// products and a difference, and the position from the corner, for the angular momentum; and so on. Strains come from
/// FᵀF - I or F - R, of about four roundoffs. In truth roundings are random, and sums are far better. f64 has its own
/// order of summation, here of some ten thousand terms.
const TOLERANCE: [f64; 9] = [16.0, 2.0, 6.0, 4.0, 16.0, 8.0, 6.0, 4.0, 8.0];

fn agrees(differences: [f64; 9]) -> bool {
    differences.iter().zip(TOLERANCE).all(|(difference, tolerance)| *difference <= tolerance)
}

fn measured(engine: &mut GpuEngine, setup: &Setup) -> Row {
    let view = engine.view(setup, &[]).unwrap().arrive().unwrap();
    view.totals.row(setup, 0, 0.0, &FrameStats::default())
}

fn exact(setup: &Setup, particles: &Particles) -> Row {
    Row::measure(setup, particles, 0, 0.0, &FrameStats::default())
}

/// Positions in metres have an ulp of 1e-10 m there, which is in both.
const FAR: [f64; 3] = [5e5, 4.6e6, 300.0];

#[test]
fn totals_agree_on_random_states() {
    let sets = [ELASTIC, SOILS, GRAINS, METALS, WATER, SAND];
    for (seed, materials) in (71..).zip(sets) {
        for (kernel, far) in [("compact", [0.0; 3]), ("quadratic", FAR)] {
            let problem = random(kernel, materials, seed, far);
            let mut engine = common::gpu_engine(&problem);
            let (row, states) = (measured(&mut engine, &problem.setup), engine.snapshot().unwrap());
            let scales = scales(&problem.setup, &states);
            let differences = differences(&problem.setup, &row, &exact(&problem.setup, &states), &scales);
            println!("{differences:.2?} roundoffs");
            assert!(agrees(differences), "{kernel} {far:?}: {differences:?}");
        }
    }
}

#[test]
fn planted_errors_of_totals_are_caught() {
    let sets = [ELASTIC, SOILS, GRAINS, METALS];
    type Plant<'a> = &'a dyn Fn(&mut Setup, &mut Particles);
    let planted: [(&str, Plant); 7] = [
        ("stiffness off by a thousandth", &|setup, _| {
            use gridfall_core::sim::setup::Material::*;
            for material in &mut setup.materials {
                match material {
                    FixedCorotated(m) | NeoHookean(m) | StvkHencky(m) => m.youngs_modulus *= 1.001,
                    WeaklyCompressibleFluid(m) => m.bulk_modulus *= 1.001,
                    DruckerPrager(m) => m.youngs_modulus *= 1.001,
                    MohrCoulomb(m) => m.youngs_modulus *= 1.001,
                    Nacc(m) => m.youngs_modulus *= 1.001,
                    VonMises(m) => m.youngs_modulus *= 1.001,
                    Snow(m) => m.youngs_modulus *= 1.001,
                }
            }
        }),
        ("one particle's v", &|_, p| p.v[100][1] += 0.1),
        ("one particle a tenth of a cell away", &|s, p| p.x[200][0] += 0.1 * s.dx),
        ("one particle's B", &|s, p| p.b[300] = p.b[300].map(|b| b + 0.1 * s.dx)),
        ("one particle's F", &|_, p| p.f[400][0] += 0.1),
        ("one particle's body", &|_, p| p.body[0] = 1),
        ("no affine part", &|s, _| s.transfer = gridfall_core::sim::setup::Transfer::Pic),
    ];
    for (seed, materials) in (81..).zip(sets) {
        let problem = random("compact", materials, seed, [0.0; 3]);
        let setup = &problem.setup;
        let mut engine = common::gpu_engine(&problem);
        let (row, states) = (measured(&mut engine, setup), engine.snapshot().unwrap());
        let scales = scales(setup, &states);
        assert!(agrees(differences(setup, &row, &exact(setup, &states), &scales)));
        for (name, plant) in &planted {
            let (mut setup, mut states) = (setup.clone(), states.clone());
            plant(&mut setup, &mut states);
            let differences = differences(&setup, &row, &exact(&setup, &states), &scales);
            println!("{name}: {differences:.1?}");
            assert!(!agrees(differences), "not caught: {name}");
        }
    }
}

fn choose(count: usize, seed: u64, deformation: bool) -> Choice {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let ids: Vec<u32> = (0..count as u32).filter(|_| rng.random_range(0..3) == 0).collect();
    Choice { ids: ids.into(), deformation }
}

/// Whether excerpts are the chosen ones of these particles.
fn are_those(
    engine: &mut GpuEngine,
    problem: &Problem,
    choices: &[Choice],
    check: impl Fn(&Particles, &mut GpuEngine),
) {
    let pending = engine.view(&problem.setup, choices).unwrap();
    let states = engine.snapshot().unwrap();
    // What the engine does now is not in the view.
    check(&states, engine);
    let excerpts = pending.arrive().unwrap().excerpts;
    assert_eq!(excerpts.len(), choices.len());
    for (excerpt, choice) in excerpts.iter().zip(choices) {
        let ids: Vec<usize> = choice.ids.iter().map(|&id| id as usize).filter(|&id| id < states.len()).collect();
        assert_eq!((excerpt.selected, excerpt.x.len()), (choice.ids.len(), ids.len()));
        let of = |deformed: bool| ids.iter().filter(move |_| deformed);
        assert!(excerpt.x.iter().eq(of(true).map(|&id| &states.x[id])));
        assert!(excerpt.v.iter().eq(of(true).map(|&id| &states.v[id])));
        assert!(excerpt.body.iter().eq(of(true).map(|&id| &states.body[id])));
        assert!(excerpt.f.iter().eq(of(choice.deformation).map(|&id| &states.f[id])));
        assert!(excerpt.plastic.iter().eq(of(choice.deformation).map(|&id| &states.plastic[id])));
    }
}

/// With both numbers of lanes, of frames while the next one is computed, of the states of all and of some.
#[test]
fn excerpts_are_the_particles() {
    for (seed, (lanes, materials)) in (91..).zip([(64, SOILS), (128, ELASTIC), (128, WATER)]) {
        println!("{lanes} lanes, seed {seed}");
        let mut problem = scene("compact", "mls", materials);
        common::randomise(&mut problem, &mut ChaCha8Rng::seed_from_u64(seed));
        problem.particles.v.iter_mut().flatten().for_each(|v| *v *= 0.1);
        let name = std::env::var("GRIDFALL_TEST_ADAPTER").unwrap_or_else(|_| "llvmpipe".into());
        let mut gpu = Gpu::open(Some(&name)).unwrap();
        gpu.workgroup = lanes;
        let mut engine = GpuEngine::new(Arc::new(gpu), &problem.setup, problem.particles.clone(), "test").unwrap();
        let n = problem.particles.len();
        let choices = [choose(n, seed, true), choose(n, seed + 100, false), Choice::default()];
        let advance = |before: &Particles, engine: &mut GpuEngine| {
            engine.advance_frame(0.002, &NoControl).unwrap();
            assert_ne!(before.x, engine.snapshot().unwrap().x);
        };
        are_those(&mut engine, &problem, &choices, advance);
        are_those(&mut engine, &problem, &choices[..2], advance);
        are_those(&mut engine, &problem, &choices[1..], |_, _| ());
    }
}

#[test]
fn sources_add_to_views() {
    let mut problem = common::problem(
        r#"{ "gridfall": 1, "name": "stream",
        "domain": { "min": [0, 0, 0], "max": [1, 1, 1], "dx": 0.0625 }, "gravity": [0, 0, -9.81],
        "materials": { "water": { "model": "weakly-compressible-fluid", "density": 1000, "bulk_modulus": 1e5 } },
        "bodies": [{ "name": "pool", "material": "water",
            "shape": { "box": { "min": [0, 0, 0], "max": [1, 1, 0.2] } } }],
        "sources": [{ "name": "tap", "material": "water", "velocity": [0, 0, -1], "until": 0.1,
            "shape": { "box": { "min": [0.4, 0.4, 0.7], "max": [0.6, 0.6, 0.8] } } }],
        "time": { "end": 0.2, "frame_rate": 50 } }"#,
    );
    println!("seed 98");
    common::randomise(&mut problem, &mut ChaCha8Rng::seed_from_u64(98));
    let setup = &problem.setup;
    let mut engine = common::gpu_engine(&problem);
    let choice = choose(setup.total_particles(), 99, true);
    let before = problem.particles.len();
    for frame in 0..4 {
        let n = engine.snapshot().unwrap().len();
        assert!(n < setup.total_particles());
        are_those(&mut engine, &problem, std::slice::from_ref(&choice), |states, engine| {
            let row = measured(engine, setup);
            let differences = differences(setup, &row, &exact(setup, states), &scales(setup, states));
            assert!(agrees(differences), "{differences:?}");
        });
        let mut positions = (Vec::new(), Vec::new());
        let mut take = |x: &[[f64; 3]], body: &[u32]| {
            positions.0.extend_from_slice(x);
            positions.1.extend_from_slice(body);
        };
        engine.positions(setup, &mut take).unwrap();
        let states = engine.snapshot().unwrap();
        assert_eq!(positions, (states.x, states.body));
        engine.append(setup.emission(frame)).unwrap();
        engine.advance_frame(setup.frame_s, &NoControl).unwrap();
    }
    assert!(engine.snapshot().unwrap().len() > before);
}
