//! Newton's matrices, and laws that flow within the step, are on the device what they are on the CPU, on random
//! states; planted errors are caught.

use gridfall_core::maths::linalg::{add_scaled, identity, mul, to_row_major};
use gridfall_core::maths::svd::svd;
use gridfall_core::sim::setup::{Plasticity, Problem};
use gridfall_engine::implicit::gpu::{DeviceStep, Tangent};
use gridfall_engine::implicit::solver::objective::Objective;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::implicit::{
    DT_S, Differences, ELASTIC, Reference, TIME_S, agrees, compare_end, compare_system, put, round, scene,
};
use crate::common;

const METAL_AND_SAND: [&str; 3] = [
    r#"{ "model": "von-mises", "density": 1000, "youngs_modulus": 1e5, "poissons_ratio": 0.3, "yield_stress": 2000,
        "elasticity": "hencky" }"#,
    r#"{ "model": "von-mises", "density": 1500, "youngs_modulus": 1e5, "poissons_ratio": 0.3, "yield_stress": 3000,
        "elasticity": "fixed-corotated" }"#,
    r#"{ "model": "drucker-prager", "density": 1000, "youngs_modulus": 1e5, "poissons_ratio": 0.3,
        "friction_angle_degrees": 30, "cohesion": 1000, "dilatancy_angle_degrees": 10 }"#,
];
const SOIL_CLAY_AND_SNOW: [&str; 3] = [
    r#"{ "model": "mohr-coulomb", "density": 1000, "youngs_modulus": 1e5, "poissons_ratio": 0.3,
        "friction_angle_degrees": 30, "cohesion": 1000, "dilatancy_angle_degrees": 10 }"#,
    r#"{ "model": "nacc", "density": 1500, "youngs_modulus": 1e5, "poissons_ratio": 0.3,
        "M": 2.36, "beta": 0.5, "xi": 3, "alpha0": -0.03 }"#,
    r#"{ "model": "snow", "density": 400, "youngs_modulus": 1e5, "poissons_ratio": 0.2 }"#,
];

/// A scene whose bodies flow within the step, in states on both sides of their yield surfaces.
fn flowing(kernel: &str, transfer: &str, materials: [&str; 3], seed: u64) -> Problem {
    let mut problem = scene(kernel, transfer, materials, seed);
    problem.setup.implicit.plasticity = Some(Plasticity::Flowing);
    let rng = &mut ChaCha8Rng::seed_from_u64(seed);
    for f in &mut problem.particles.f {
        let strain = [1e-3, 0.01, 0.1][rng.random_range(0..3)];
        let mut random = || std::array::from_fn(|_| std::array::from_fn(|_| rng.random_range(-1.0..1.0)));
        let turn = svd::<f64, 3>(&random()).u;
        *f = to_row_major(&mul(&turn, &add_scaled(&identity(), strain, &random())), 1.0);
    }
    round(&mut problem);
    problem
}

/// What the stages differ by, and how many particles flow in the step, and do not.
struct Found {
    differences: Differences,
    flown: usize,
    elastic: usize,
}

/// Those that the CPU's `tangent` has for elastic bodies and for bodies that flow.
const TANGENTS: [Tangent; 2] = [Tangent::Turned, Tangent::Flowing];

/// Newton's matrices, with energies and gradients at the same Δv, how far a direction may reach, and the step's end.
fn step(gpu: &Problem, cpu: &Problem, seed: u64, tangents: [Tangent; 2]) -> Found {
    let reference = Reference::new(cpu);
    let potential = reference.potential();
    let rng = &mut ChaCha8Rng::seed_from_u64(seed);
    let (dv, direction) = (reference.somewhere(rng), reference.somewhere(rng));
    let mut stepper = DeviceStep::new(common::gpu(), &gpu.setup, &gpu.particles).unwrap();
    stepper.begin(TIME_S, DT_S, false).unwrap();
    let mut differences = Vec::new();
    for (tangent, elastic) in tangents.into_iter().zip([true, false]) {
        stepper.set_tangent(tangent);
        differences.extend(compare_system(&stepper, &reference, &potential, &dv, &potential.tangent(&dv, elastic)));
    }
    // So long that it may not be gone to its end.
    let direction = direction.iter().map(|p| p.map(|x| 100.0 * x)).collect();
    put(&stepper, &reference, &direction);
    let expected = potential.reach(&direction);
    differences.push(("reach", (stepper.reach_along_dv().unwrap() / expected - 1.0).abs()));
    put(&stepper, &reference, &dv);
    differences.extend(compare_end(&mut stepper, &reference, &dv));
    let found: Vec<String> = differences.iter().map(|(name, d)| format!("{name} {d:.1e}")).collect();
    println!("{}", found.join("  "));
    let (mut flown, mut elastic) = (0, 0);
    for (p, trial) in potential.splitting().deformations(&dv).iter().enumerate() {
        let state = &reference.step.state;
        let (mut after, mut plastic) = (*trial, state.plastic[p]);
        reference.bodies[state.body[p] as usize].law.return_map(&mut after, &mut plastic);
        *(if after == *trial { &mut elastic } else { &mut flown }) += 1;
    }
    println!("{flown} particles flow, {elastic} do not");
    Found { differences, flown, elastic }
}

#[test]
fn matrices_of_turned_particles_agree() {
    for (seed, (kernel, transfer)) in (71..).zip([("quadratic", "mls"), ("compact", "apic")]) {
        let problem = scene(kernel, transfer, ELASTIC, seed);
        let differences = step(&problem, &problem, seed, TANGENTS).differences;
        assert!(agrees(&differences), "{kernel} {transfer}: {differences:?}");
    }
}

#[test]
fn stages_agree_where_bodies_flow() {
    let cases = [
        ("quadratic", "mls", METAL_AND_SAND),
        ("compact", "mls", SOIL_CLAY_AND_SNOW),
        ("compact", "apic", METAL_AND_SAND),
        ("quadratic", "apic", SOIL_CLAY_AND_SNOW),
    ];
    for (seed, (kernel, transfer, materials)) in (81..).zip(cases) {
        let problem = flowing(kernel, transfer, materials, seed);
        let found = step(&problem, &problem, seed, TANGENTS);
        assert!(agrees(&found.differences), "{kernel} {transfer}: {:?}", found.differences);
        assert!(found.flown > 300 && found.elastic > 300, "{} flow, {} do not", found.flown, found.elastic);
    }
}

#[test]
fn planted_errors_of_flow_are_caught() {
    type Plant<'a> = &'a dyn Fn(&mut Problem);
    let parameter = |name: &'static str, factor: f64| {
        move |p: &mut Problem| {
            for material in &mut p.setup.materials {
                let mut json = serde_json::to_value(&*material).unwrap();
                if let Some(value) = json[name].as_f64() {
                    json[name] = (value * factor).into();
                    *material = serde_json::from_value(json).unwrap();
                }
            }
        }
    };
    let metal: [(&str, Plant); 6] = [
        ("yield stress", &parameter("yield_stress", 1.003)),
        ("friction", &parameter("friction_angle_degrees", 1.003)),
        ("dilatancy", &parameter("dilatancy_angle_degrees", 1.003)),
        ("cohesion", &parameter("cohesion", 1.003)),
        ("lagged", &|p| p.setup.implicit.plasticity = Some(Plasticity::Lagged)),
        ("apart", &|p| *p.particles.plastic.last_mut().unwrap() += 1e-3),
    ];
    let soil: [(&str, Plant); 6] = [
        ("friction", &parameter("friction_angle_degrees", 1.003)),
        ("slope of the clay's surface", &parameter("M", 1.003)),
        ("tension of the clay", &parameter("beta", 1.003)),
        ("hardening", &parameter("xi", 1.003)),
        ("hardening of the snow", &parameter("hardening", 1.003)),
        ("compression of the snow", &parameter("critical_compression", 1.003)),
    ];
    for (materials, planted, seed) in [(METAL_AND_SAND, metal, 82), (SOIL_CLAY_AND_SNOW, soil, 83)] {
        let problem = flowing("quadratic", "mls", materials, seed);
        assert!(agrees(&step(&problem, &problem, seed, TANGENTS).differences));
        for tangents in [[Tangent::Trial, Tangent::Flowing], [Tangent::Turned, Tangent::Turned]] {
            assert!(!agrees(&step(&problem, &problem, seed, tangents).differences), "not caught: {tangents:?}");
        }
        for (name, plant) in planted {
            let mut wrong = problem.clone();
            plant(&mut wrong);
            assert!(!agrees(&step(&wrong, &problem, seed, TANGENTS).differences), "not caught: {name}");
        }
    }
}
