//! Contact at the particles in implicit steps on the GPU does what it does on the CPU, stage by stage on random
//! states; planted errors are caught.
//!
//! Reference: `implicit` in f64. Forces in themselves and that of a spring which is a hundredth of a spacing longer,
//! stiffness in springs, velocities in that of the fastest body.

use std::collections::BTreeMap;

use gridfall_core::sim::setup::{ContactKind, Problem};
use gridfall_core::sim::touch::{self, Springs, Touch};
use gridfall_engine::implicit::gpu::interface::Evaluate;
use gridfall_engine::implicit::gpu::{DeviceStep, LinkReading};
use gridfall_engine::implicit::physics::transfer::grid_to_particles;
use gridfall_engine::implicit::solver::objective::{NodeVectors, Objective};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::common;
use crate::implicit::{DT_S, Differences, Reference, TIME_S, compare_system, distance, larger, norm, put};

/// Of the body that meets a plate (m/s).
const SPEED: f64 = 8.0;

/// Bodies at faces of all kinds, which stand, move and turn: a rough floor that rises into a body, a thin plate that a
/// fast body meets, a rough sphere, a slippery lid, a sticky bar; a grip and walls beside them. One face goes, another
/// comes.
fn scene(kernel: &str, transfer: &str, seed: u64) -> Problem {
    println!("{kernel} {transfer} seed {seed}");
    let mut problem = common::problem(&format!(
        r#"{{ "gridfall": 1, "name": "touching",
        "domain": {{ "min": [-0.3, 0.1, 0.2], "max": [0.7, 0.6, 0.7], "dx": 0.0625,
                     "boundary": {{ "x-": {{"contact":"slip"}}, "y": "periodic",
                                    "z-": {{"contact":"separate","friction":0.4}} }} }},
        "gravity": [0.5, -1, -9.81],
        "materials": {{
            "a": {{ "model": "fixed-corotated", "density": 1000, "youngs_modulus": 1e5, "poissons_ratio": 0.3 }},
            "b": {{ "model": "stvk-hencky", "density": 1500, "youngs_modulus": 2e5, "poissons_ratio": 0.3 }} }},
        "bodies": [
            {{ "name": "a", "material": "a", "sampling": "jittered",
                "shape": {{ "box": {{ "min": [-0.3, 0.15, 0.25], "max": [0, 0.4, 0.5] }} }},
                "grips": [ {{ "name": "grip",
                    "shape": {{ "sphere": {{ "center": [-0.3, 0.15, 0.5], "radius": 0.07 }} }},
                    "motion": {{ "linear_velocity": [0, 0.3, 0] }} }} ] }},
            {{ "name": "b", "material": "b", "sampling": "jittered",
                "shape": {{ "sphere": {{ "center": [0.2, 0.4, 0.5], "radius": 0.13 }} }} }},
            {{ "name": "c", "material": "a", "sampling": "jittered", "shape": {{ "box": {{ "min": [0.4, 0.3, 0.3],
                "max": [0.65, 0.55, 0.5] }} }} }} ],
        "colliders": [
            {{ "name": "floor", "contact": "separate", "friction": 0.4,
               "shape": {{ "half-space": {{ "point": [0, 0.3, 0.27], "normal": [0.1, -0.05, 1] }} }},
               "motion": {{ "linear_velocity": [0.2, 0.1, 0.4], "angular_velocity": [0.5, 0, 1],
                   "center": [-0.1, 0.3, 0.3] }} }},
            {{ "name": "plate", "contact": "separate", "friction": 0.2,
               "shape": {{ "rotate": {{ "axis": [1, 1, 0], "angle_degrees": 10, "center": [0.5, 0.4, 0.4],
                   "shape": {{ "box": {{ "min": [0.35, 0.25, 0.395], "max": [0.68, 0.58, 0.405] }} }} }} }},
               "motion": {{ "linear_velocity": [0, 0.1, 1] }} }},
            {{ "name": "ball", "contact": "separate", "friction": 0.6,
               "shape": {{ "sphere": {{ "center": [0.05, 0.45, 0.5], "radius": 0.08 }} }},
               "motion": {{ "center": [0.05, 0.45, 0.5], "angular_velocity": [3, 0, 5] }} }},
            {{ "name": "lid", "contact": "slip",
               "shape": {{ "box": {{ "min": [-0.25, 0.1, 0.49], "max": [0.05, 0.3, 0.6] }} }} }},
            {{ "name": "bar", "contact": "sticky",
               "shape": {{ "rotate": {{ "axis": [1, 0.2, 0], "angle_degrees": 70, "center": [0.27, 0.4, 0.52],
                   "shape": {{ "capsule": {{ "center": [0.27, 0.4, 0.52], "radius": 0.03, "height": 0.25 }} }} }} }},
               "motion": {{ "center": [0.3, 0.4, 0.5], "angular_velocity": [0, 3, 1],
                   "linear_velocity": [0, 0, -0.5] }} }},
            {{ "name": "gone", "contact": "sticky", "until": 0.004,
                "shape": {{ "box": {{ "min": [0.41, 0.31, 0.25], "max": [0.69, 0.58, 0.31] }} }} }},
            {{ "name": "next", "contact": "slip", "from": 0.006,
                "shape": {{ "box": {{ "min": [0.38, 0.28, 0.25], "max": [0.5, 0.58, 0.34] }} }} }} ],
        "time": {{ "end": 0.1, "frame_rate": 50 }},
        "solver": {{ "kernel": "{kernel}", "transfer": "{transfer}", "integrator": "implicit",
            "implicit": {{ "method": "newton" }}, "contact": "particles" }} }}"#
    ));
    let rng = &mut ChaCha8Rng::seed_from_u64(seed);
    common::randomise(&mut problem, rng);
    for id in problem.setup.bodies[2].particles.clone() {
        problem.particles.v[id][2] -= SPEED;
    }
    touch::begin(&problem.setup, &mut problem.particles, 0.0);
    let p = &mut problem.particles;
    for id in 0..p.len() {
        let springs = Springs::of(&problem.setup, &problem.setup.bodies[p.body[id] as usize]);
        let touch = &mut p.touch[id];
        if touch.with == 0 && rng.random_range(0.0..1.0) < 0.3 {
            // Some hold on to what they rub against.
            touch.with = [1, 2, 3][rng.random_range(0..3)];
        }
        if touch.with != 0 {
            touch.stretch = std::array::from_fn(|_| rng.random_range(-0.1..0.1) * springs.spacing);
        }
        touch.radius = touch.radius.max(0.0) * rng.random_range(0.8..1.0);
    }
    // The others have met nothing yet.
    p.touch.truncate(p.len() * 2 / 3);
    // States as f32 has them.
    let known = p.touch.len();
    problem.particles = DeviceStep::new(common::gpu(), &problem.setup, &problem.particles).unwrap().snapshot().unwrap();
    assert_eq!(problem.particles.touch.len(), known);
    problem
}

fn springs(problem: &Problem, id: usize) -> Springs {
    Springs::of(&problem.setup, &problem.setup.bodies[problem.particles.body[id] as usize])
}

fn compare_touches(gpu: &[Touch], cpu: &[Touch], problem: &Problem) -> Differences {
    let (mut with, mut radius, mut stretch) = (gpu.len().abs_diff(cpu.len()) as f64, 0.0, 0.0);
    for (id, (a, b)) in gpu.iter().zip(cpu).enumerate() {
        let spacing = springs(problem, id).spacing;
        with += f64::from(u8::from(a.with != b.with));
        larger(&mut radius, (a.radius - b.radius).abs() / spacing);
        larger(&mut stretch, distance(&a.stretch, &b.stretch) / spacing);
    }
    vec![("holds on to", with), ("radius", radius), ("stretch", stretch)]
}

/// Force and stiffness by particle.
fn by_particle(links: &[LinkReading]) -> BTreeMap<u32, ([f64; 3], [[f64; 3]; 3])> {
    let mut sums: BTreeMap<u32, ([f64; 3], [[f64; 3]; 3])> = BTreeMap::new();
    for link in links {
        let (force, stiffness) = sums.entry(link.id).or_default();
        for a in 0..3 {
            force[a] += link.force[a];
            (0..3).for_each(|b| stiffness[a][b] += link.stiffness[a][b]);
        }
    }
    sums
}

/// What faces do to particles at the Δv that was evaluated last.
fn compare_responses(
    stepper: &DeviceStep,
    cpu: &Reference,
    potential: &impl Fn(&NodeVectors<3>) -> Vec<Option<([f64; 3], [[f64; 3]; 3])>>,
    dv: &NodeVectors<3>,
) -> Differences {
    let gpu = by_particle(&stepper.links().unwrap());
    let (mut near, mut force, mut stiffness) = (0.0, 0.0, 0.0);
    for (p, response) in potential(dv).into_iter().enumerate() {
        let id = cpu.step.topology.order[p];
        match (gpu.get(&id), response) {
            (None, None) => {}
            (Some(found), Some(response)) => {
                let Springs { stiffness: k, spacing, .. } = springs(cpu.problem, id as usize);
                larger(&mut force, distance(&found.0, &response.0) / (norm(&response.0) + 0.01 * k * spacing));
                (0..3).for_each(|a| larger(&mut stiffness, distance(&found.1[a], &response.1[a]) / k));
            }
            _ => near += 1.0,
        }
    }
    vec![("near", near), ("force", force), ("stiffness", stiffness)]
}

/// The step's end with the Δv on the device.
fn compare_end(stepper: &mut DeviceStep, cpu: &Reference, limits: &[f64], dv: &NodeVectors<3>) -> Differences {
    let problem = cpu.problem;
    let moved = stepper.finish().unwrap();
    let mut potential = cpu.potential();
    potential.renew(dv);
    let velocities = cpu.step.velocities(dv);
    let (_, impulses) = potential.energy_and_forces(dv);
    let share = cpu.step.topology.interpolation.shape.share;
    let mut reactions = cpu.step.boundary.reactions(&problem.setup, share, &impulses);
    let (mut state, _) =
        grid_to_particles(&problem.setup, &cpu.step.topology, &cpu.step.state, &cpu.bodies, &velocities, DT_S);
    let free = state.x.clone();
    cpu.step.faces(&problem.setup).limited(limits).settle(&cpu.bodies, &mut state, &mut reactions);
    let stopped = free.iter().zip(&state.x).filter(|(a, b)| a != b).count();
    let mut after = problem.particles.clone();
    state.store(&cpu.step.topology, &mut after);
    let gpu = stepper.snapshot().unwrap();
    let [mut x, mut v] = [0.0; 2];
    for id in 0..after.len() {
        larger(&mut x, distance(&gpu.x[id], &after.x[id]) / problem.setup.dx);
        larger(&mut v, distance(&gpu.v[id], &after.v[id]) / SPEED);
    }
    let mut found = vec![("x", x), ("v", v)];
    found.extend(compare_touches(&gpu.touch, &after.touch, problem));
    let largest = reactions.iter().map(|r| norm(&r.force)).fold(0.0, f64::max);
    let (mut reaction, mut touched) = (0.0, 0);
    for (a, b) in moved.impulses.iter().zip(&reactions) {
        touched += usize::from(b.force != [0.0; 3]);
        larger(&mut reaction, distance(&a.force, &b.force) / largest);
        larger(&mut reaction, distance(&a.torque, &b.torque) / largest);
    }
    found.push(("reactions", reaction));
    // What comes next is met before the next step.
    stepper.begin(TIME_S + DT_S, DT_S, false).unwrap();
    touch::appear(&problem.setup, &mut after, TIME_S, TIME_S + DT_S);
    let appeared = compare_touches(&stepper.before().unwrap().touch, &after.touch, problem);
    found.extend(
        appeared.into_iter().zip(["holds then", "radius then", "stretch then"]).map(|((_, d), name)| (name, d)),
    );
    println!("{touched} surfaces, {stopped} particles stopped, largest impulse {largest:.3} N s");
    assert!(touched >= 7 && stopped > 3);
    found
}

/// One step of `gpu` and of `cpu`, stage by stage.
fn step(gpu: &Problem, cpu: &Problem, seed: u64) -> Differences {
    let mut cpu = cpu.clone();
    touch::begin(&cpu.setup, &mut cpu.particles, TIME_S);
    let reference = Reference::new(&cpu);
    let rng = &mut ChaCha8Rng::seed_from_u64(seed);
    let [first, second, third] = [0; 3].map(|_| reference.somewhere(rng));
    let mut stepper = DeviceStep::new(common::gpu(), &gpu.setup, &gpu.particles).unwrap();
    stepper.begin(TIME_S, DT_S, false).unwrap();
    let mut found = compare_touches(&stepper.before().unwrap().touch, &cpu.particles.touch, &cpu);
    let mut potential = reference.potential();
    let mut faces = reference.step.faces(&cpu.setup);
    let holding = |stepper: &DeviceStep, expected: f64| (stepper.sharpness() / expected - 1.0).abs();
    found.push(("sharpness", holding(&stepper, potential.sharpness())));
    for (at, renewed) in [(&first, &second), (&second, &third)] {
        found.extend(compare_system(&stepper, &reference, &potential, at, &potential.hessian(at)));
        let responses = |dv: &NodeVectors<3>| {
            let found = faces.responses(&reference.step.velocities(dv));
            let of = |p: usize| faces.of(&found, p).map(|response| (response.force, response.stiffness));
            (0..cpu.particles.len()).map(of).collect()
        };
        found.extend(compare_responses(&stepper, &reference, &responses, at));
        println!("{} links", stepper.links().unwrap().len());
        put(&stepper, &reference, renewed);
        let (mine, theirs) = (stepper.renew().unwrap(), potential.renew(renewed));
        faces.renew(&reference.step.velocities(renewed));
        found.push(("renewed", f64::from(u8::from(mine != theirs))));
        found.push(("sharpness", holding(&stepper, potential.sharpness())));
    }
    found.extend(compare_system(&stepper, &reference, &potential, &third, &potential.hessian(&third)));
    found.extend(compare_end(&mut stepper, &reference, potential.limits(), &third));
    for (name, difference) in &found {
        print!("{name} {difference:.1e}  ");
    }
    println!();
    found
}

/// What depends on normals: near a face they are differences over dx/256 in f32, and off by 1e-4. The stiffness across
/// what slides turns with a stretch that may be short.
const NORMALS: [(&str, f64); 5] =
    [("force", 1e-4), ("stiffness", 5e-4), ("v", 1e-4), ("stretch", 5e-5), ("stretch then", 5e-5)];

fn agrees(differences: &Differences) -> bool {
    let tolerance = |name: &str| NORMALS.iter().find(|(known, _)| *known == name).map_or(2e-5, |known| known.1);
    differences.iter().all(|(name, difference)| *difference <= tolerance(name))
}

#[test]
fn stages_agree_on_random_states() {
    let cases = [("quadratic", "mls"), ("quadratic", "apic"), ("compact", "mls"), ("compact", "apic")];
    for (seed, (kernel, transfer)) in (71..).zip(cases) {
        let problem = scene(kernel, transfer, seed);
        let differences = step(&problem, &problem, seed);
        assert!(agrees(&differences), "{kernel} {transfer}: {differences:?}");
    }
}

#[test]
fn planted_errors_are_caught() {
    let problem = scene("compact", "mls", 73);
    assert!(agrees(&step(&problem, &problem, 73)));
    type Plant<'a> = &'a dyn Fn(&mut Problem);
    let planted: [(&str, Plant); 6] = [
        ("springs a hundredth of a cell longer", &|p| {
            let longer = 0.01 * p.setup.dx;
            p.particles.touch.iter_mut().filter(|touch| touch.with != 0).for_each(|t| t.stretch[0] += longer);
        }),
        ("radii a hundredth larger", &|p| p.particles.touch.iter_mut().for_each(|touch| touch.radius *= 1.01)),
        ("friction of a collider", &|p| p.setup.colliders[0].contact.friction = 0.41),
        ("a collider that is faster", &|p| p.setup.colliders[1].motion.linear_velocity[2] += 0.01),
        ("a collider that turns faster", &|p| p.setup.colliders[2].motion.angular_velocity[2] += 0.1),
        ("a collider that separates", &|p| p.setup.colliders[3].contact.kind = ContactKind::Separate),
    ];
    for (name, plant) in planted {
        let mut wrong = problem.clone();
        plant(&mut wrong);
        assert!(!agrees(&step(&wrong, &problem, 73)), "not caught: {name}");
    }
}
