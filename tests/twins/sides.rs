//! Sides of plates: whose nodes are shared on the GPU is what it is on the CPU.

use gridfall_core::sim::setup::Problem;
use gridfall_core::sim::side::{self, Plates};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use crate::common;
use crate::explicit::{DT_S, ELASTIC, agrees, frame, say, step};

/// Water and solids above and below plates: a tilted one that moves, and one that is a cell and a half thick and ends
/// within the material.
fn scene(kernel: &str, transfer: &str) -> Problem {
    let [jelly, _, water] = ELASTIC;
    common::problem(&format!(
        r#"{{ "gridfall": 1, "name": "sides",
        "domain": {{ "min": [-0.3, 0.1, 0.2], "max": [0.7, 1.1, 1.2], "dx": 0.0625,
                     "boundary": {{ "x": {{"contact":"slip"}}, "y": "periodic", "z-": {{"contact":"sticky"}} }} }},
        "gravity": [0.5, -1, -9.81],
        "materials": {{ "jelly": {jelly}, "water": {water} }},
        "bodies": [
            {{ "name": "a", "material": "water", "sampling": "jittered",
                "shape": {{ "box": {{ "min": [-0.3, 0.1, 0.2], "max": [0.5, 1.1, 0.3] }} }} }},
            {{ "name": "b", "material": "water", "sampling": "jittered",
                "shape": {{ "box": {{ "min": [-0.3, 0.1, 0.42], "max": [0.4, 1.1, 0.54] }} }} }},
            {{ "name": "c", "material": "jelly", "sampling": "jittered",
                "shape": {{ "box": {{ "min": [-0.2, 0.3, 0.76], "max": [0.6, 0.9, 1.0] }} }} }} ],
        "colliders": [
            {{ "name": "leaf", "contact": "separate", "friction": 0.2,
               "shape": {{ "rotate": {{ "axis": [0.3, 1, 0], "angle_degrees": 10, "center": [0.2, 0.6, 0.64],
                   "shape": {{ "box": {{ "min": [-0.4, 0.2, 0.631], "max": [0.63, 0.97, 0.643] }} }} }} }},
               "motion": {{ "linear_velocity": [0.3, 0.1, 0.2] }} }},
            {{ "name": "plank", "contact": "slip",
               "shape": {{ "box": {{ "min": [-0.4, -0.2, 0.31], "max": [0.12, 1.27, 0.405] }} }} }} ],
        "time": {{ "end": 0.1, "frame_rate": 50 }},
        "solver": {{ "kernel": "{kernel}", "transfer": "{transfer}", "integrator": "explicit" }} }}"#
    ))
}

fn random(kernel: &str, transfer: &str, seed: u64) -> Problem {
    println!("{kernel} {transfer} seed {seed}");
    let mut problem = scene(kernel, transfer);
    common::randomise(&mut problem, &mut ChaCha8Rng::seed_from_u64(seed));
    problem
}

/// Particles by layer.
fn layers(problem: &Problem) -> [usize; side::LAYERS] {
    let plates = Plates::new(&problem.setup, 0.0);
    let mut count = [0; side::LAYERS];
    problem.particles.x.iter().for_each(|&x| count[plates.layer(x) as usize] += 1);
    count
}

#[test]
fn sides_agree_on_random_states() {
    for (seed, (kernel, transfer)) in [("compact", "mls"), ("quadratic", "apic")].into_iter().enumerate() {
        let problem = random(kernel, transfer, 91 + seed as u64);
        let count = layers(&problem);
        assert!(count.iter().filter(|&&n| n > 100).count() >= 3, "particles by layer: {count:?}");
        let differences = step(&problem, &problem);
        say(&differences);
        assert!(agrees(differences), "{kernel} {transfer}: {differences:?}");
    }
}

#[test]
fn planted_errors_of_sides_are_caught() {
    let problem = random("compact", "mls", 93);
    type Plant<'a> = &'a dyn Fn(&mut Problem);
    let planted: [(&str, Plant); 2] = [
        ("a plate 0.02 dx away", &|p| {
            let dx = p.setup.dx;
            p.setup.colliders[1].motion.keyframes.clear();
            p.setup.colliders[1].motion.linear_velocity = [0.0, 0.0, 0.02 * dx / DT_S];
        }),
        ("a plate that is not there", &|p| p.setup.colliders[1].present_s = [1.0, 2.0]),
    ];
    for (name, plant) in planted {
        let mut wrong = problem.clone();
        plant(&mut wrong);
        let differences = step(&wrong, &problem);
        println!("{name}: {differences:?}");
        assert!(!agrees(differences), "not caught: {name}");
    }
}

/// Frames of 40 steps, in which particles are asked again for their sides, follow the CPU and repeat to the bit.
#[test]
fn frames_with_sides_follow_the_reference() {
    for (kernel, transfer) in [("compact", "mls"), ("quadratic", "apic")] {
        let mut problem = scene(kernel, transfer);
        problem.particles.v.iter_mut().for_each(|v| v[2] = 4.0);
        let asked = side::steps_between(&problem.setup, 4.0, DT_S);
        println!("asked every {asked} steps");
        let (steps, d) = frame(&problem);
        assert!(asked < steps, "{asked} of {steps}");
        println!("{kernel} {transfer}: {steps} steps, x {:.1e} dx, v {:.1e} m/s, F {:.1e}", d[0], d[1], d[3]);
        assert!(d[0] < 1e-4 && d[1] < 1e-3 && d[3] < 1e-3, "{d:?}");
    }
}
