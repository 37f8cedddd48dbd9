//! Bodies with contact of their own: what the GPU makes of nodes that several have is what the CPU does.

use gridfall_core::sim::setup::{Contact, ContactKind, Problem};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use crate::common;
use crate::explicit::{ELASTIC, agrees, frame, say, step};

const GUM: &str = r#"{ "model": "neo-hookean", "density": 1500, "youngs_modulus": 2e4, "poissons_ratio": 0.4 }"#;

/// Bodies that lie in each other, at walls and at a collider: two without contact of their own, one that
/// separates, one of water that separates, and one that slips.
fn scene(kernel: &str, transfer: &str) -> Problem {
    let ([jelly, _, water], gum) = (ELASTIC, GUM);
    common::problem(&format!(
        r#"{{ "gridfall": 1, "name": "meeting",
        "domain": {{ "min": [-0.3, 0.1, 0.2], "max": [0.7, 1.1, 1.2], "dx": 0.0625,
                     "boundary": {{ "x-": {{"contact":"slip"}}, "x+": {{"contact":"separate","friction":0.3}},
                         "y": "periodic", "z-": {{"contact":"sticky"}}, "z+": {{"contact":"sticky"}} }} }},
        "gravity": [0.5, -1, -9.81],
        "materials": {{ "jelly": {jelly}, "gum": {gum}, "water": {water} }},
        "bodies": [
            {{ "name": "a", "material": "jelly", "sampling": "jittered",
                "shape": {{ "box": {{ "min": [-0.3, 0.1, 0.2], "max": [0.5, 1.0, 0.55] }} }} }},
            {{ "name": "b", "material": "gum", "sampling": "jittered",
                "shape": {{ "sphere": {{ "center": [0.4, 0.8, 0.9], "radius": 0.2 }} }} }},
            {{ "name": "c", "material": "gum", "sampling": "jittered", "contact": "separate", "friction": 0.3,
                "shape": {{ "box": {{ "min": [-0.3, 0.1, 0.48], "max": [0.2, 1.1, 0.8] }} }} }},
            {{ "name": "d", "material": "water", "sampling": "jittered", "contact": "separate", "friction": 0.1,
                "shape": {{ "box": {{ "min": [0.1, 0.3, 0.2], "max": [0.7, 1.1, 0.7] }} }} }},
            {{ "name": "e", "material": "jelly", "sampling": "jittered", "contact": "slip",
                "shape": {{ "sphere": {{ "center": [0.1, 0.6, 0.8], "radius": 0.2 }} }} }} ],
        "colliders": [
            {{ "name": "bar", "contact": "separate", "friction": 0.2,
               "shape": {{ "cylinder": {{ "center": [0.2, 0.5, 0.3], "radius": 0.2, "height": 0.5 }} }},
               "motion": {{ "linear_velocity": [0.3, 0.1, 0] }} }} ],
        "time": {{ "end": 0.1, "frame_rate": 50 }},
        "solver": {{ "kernel": "{kernel}", "transfer": "{transfer}", "contact": "nodes" }} }}"#
    ))
}

fn random(kernel: &str, transfer: &str, seed: u64) -> Problem {
    println!("{kernel} {transfer} seed {seed}");
    let mut problem = scene(kernel, transfer);
    common::randomise(&mut problem, &mut ChaCha8Rng::seed_from_u64(seed));
    problem
}

#[test]
fn pairs_agree_on_random_states() {
    for (seed, (kernel, transfer)) in [("compact", "mls"), ("quadratic", "apic")].into_iter().enumerate() {
        let problem = random(kernel, transfer, 61 + seed as u64);
        let differences = step(&problem, &problem);
        say(&differences);
        assert!(agrees(differences), "{kernel} {transfer}: {differences:?}");
    }
}

#[test]
fn planted_errors_of_pairs_are_caught() {
    let problem = random("compact", "mls", 71);
    type Plant<'a> = &'a dyn Fn(&mut Problem);
    let contact = |kind, friction| Some(Contact { kind, friction });
    let planted: [(&str, Plant); 4] = [
        ("friction", &|p| p.setup.bodies[2].contact = contact(ContactKind::Separate, 0.31)),
        ("slip that separates", &|p| p.setup.bodies[4].contact = contact(ContactKind::Separate, 0.0)),
        ("a body without contact", &|p| p.setup.bodies[4].contact = None),
        ("a body a thousandth of a metre away", &|p| {
            p.particles.x.iter_mut().zip(&p.particles.body).filter(|(_, b)| **b == 3).for_each(|(x, _)| x[2] += 1e-3);
        }),
    ];
    for (name, plant) in planted {
        let mut wrong = problem.clone();
        plant(&mut wrong);
        let differences = step(&wrong, &problem);
        println!("{name}: {differences:?}");
        assert!(!agrees(differences), "not caught: {name}");
    }
}

/// Frames of 40 steps follow the CPU and repeat to the bit.
#[test]
fn frames_of_bodies_that_meet_follow_the_reference() {
    for (kernel, transfer) in [("compact", "mls"), ("quadratic", "apic")] {
        let (steps, d) = frame(&scene(kernel, transfer));
        println!("{kernel} {transfer}: {steps} steps, x {:.1e} dx, v {:.1e} m/s, F {:.1e}", d[0], d[1], d[3]);
        assert!(d[0] < 1e-4 && d[1] < 1e-3 && d[3] < 1e-3, "{d:?}");
    }
}
