//! Contact at the particles on the GPU does what it does on the CPU, stage by stage and over frames.

use gridfall_core::sim::setup::{ContactAt, Precision, Problem, Setup};
use gridfall_core::sim::touch::{self, Springs, Touch};
use gridfall_engine::explicit::cpu::CpuEngine;
use gridfall_engine::{Engine, NoControl};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::common;
use crate::explicit::{self, DT_S, ELASTIC, METALS, MIXED};

/// Colliders of all kinds of contact, that turn, come and go, act on particles.
fn scene(kernel: &str, transfer: &str, materials: [&str; 3]) -> Problem {
    let mut problem = explicit::scene(kernel, transfer, materials);
    problem.setup.contact_at = ContactAt::Particles;
    problem
}

/// Random states of particles and of what they remember.
fn random_scene(kernel: &str, transfer: &str, materials: [&str; 3], seed: u64) -> Problem {
    println!("{kernel} {transfer} seed {seed}");
    randomised(scene(kernel, transfer, materials), seed)
}

/// The scene with a sheet that has rims, a fold and three pieces at an edge, as it is and scaled.
fn scene_with_sheets(kernel: &str, transfer: &str, materials: [&str; 3]) -> Problem {
    let dir = tempfile::tempdir().unwrap();
    let sheet = "v 0 0 0\nv 0 0.6 0.1\nv 0.4 0 0.1\nv 0.4 0.6 0\nv -0.2 0 0.3\nv -0.2 0.6 0.3\nv 0 0 -0.3\n\
        v 0 0.6 -0.2\nf 1 3 4 2\nf 1 2 6 5\nf 1 2 8 7\n";
    std::fs::write(dir.path().join("sheet.obj"), sheet).unwrap();
    let sheets = common::problem_in(
        r#"{ "gridfall": 1, "name": "sheets",
        "domain": { "min": [-0.3, 0.1, 0.2], "max": [0.7, 1.1, 1.2], "dx": 0.0625 },
        "materials": { "m": { "model": "neo-hookean", "density": 1, "youngs_modulus": 1, "poissons_ratio": 0 } },
        "bodies": [ { "name": "b", "material": "m",
            "shape": { "box": { "min": [0, 0.4, 0.4], "max": [0.1, 0.5, 0.5] } } } ],
        "colliders": [
            { "name": "sheet", "contact": "separate", "friction": 0.3, "shape": { "rotate": { "axis": [1, -1, 2],
                "angle_degrees": 25, "center": [0.1, 0.6, 0.4], "shape": { "translate": { "offset": [0.05, 0.3, 0.45],
                "shape": { "mesh": { "file": "sheet.obj", "fill": "sheet" } } } } } },
              "motion": { "linear_velocity": [0.3, 0.1, 0.5], "angular_velocity": [0, 1, 2],
                "center": [0.1, 0.5, 0.5] } },
            { "name": "small", "contact": "slip", "shape": { "translate": { "offset": [0.4, 0.5, 0.8], "shape": {
                "scale": { "factor": 0.7, "shape": { "mesh": { "file": "sheet.obj", "fill": "sheet" } } } } } } } ],
        "time": { "end": 1 }, "solver": { "integrator": "explicit" } }"#,
        dir.path(),
    );
    let mut problem = scene(kernel, transfer, materials);
    problem.setup.colliders = sheets.setup.colliders;
    problem
}

fn randomised(mut problem: Problem, seed: u64) -> Problem {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    common::randomise(&mut problem, &mut rng);
    touch::begin(&problem.setup, &mut problem.particles, 0.0);
    let p = &mut problem.particles;
    for id in 0..p.len() {
        let springs = Springs::of(&problem.setup, &problem.setup.bodies[p.body[id] as usize]);
        let touch = &mut p.touch[id];
        if touch.with != 0 {
            touch.stretch = std::array::from_fn(|_| rng.random_range(-0.1..0.1) * springs.spacing);
        } else if touch.radius > 0.0 && touch.radius < 0.5 * springs.spacing {
            // As if it had come from farther away.
            touch.radius = rng.random_range(touch.radius..0.5 * springs.spacing);
        }
    }
    problem
}

/// Particles that touch something.
fn touching(problem: &Problem) -> usize {
    let p = &problem.particles;
    let rest = |id: usize| Touch::new(&Springs::of(&problem.setup, &problem.setup.bodies[p.body[id] as usize]));
    (0..p.len()).filter(|&id| p.touch[id] != rest(id)).count()
}

#[test]
fn stages_agree_on_random_states() {
    let cases = [
        ("compact", "mls", ELASTIC),
        ("compact", "apic", MIXED),
        ("quadratic", "mls", METALS),
        ("quadratic", "apic", ELASTIC),
        ("compact", "mls-published", METALS),
    ];
    for (seed, (kernel, transfer, materials)) in cases.into_iter().enumerate() {
        let problem = random_scene(kernel, transfer, materials, 171 + seed as u64);
        assert!(touching(&problem) > 300, "{} particles touch something", touching(&problem));
        let differences = explicit::step(&problem, &problem);
        explicit::say(&differences);
        assert!(explicit::agrees(differences), "{kernel} {transfer}: {differences:?}");
    }
}

/// Within h/100 of a sampled face, f32 knows the normal to 1e-4 only, and what is stopped there loses
/// its velocity along it.
const SHEET_TOLERANCE: [f64; 8] = [1e-6, 1e-5, 1e-6, 1e-5, 1e-6, 2e-4, 1e-5, 1e-5];

#[test]
fn sheets_are_where_they_are() {
    for (seed, (kernel, transfer)) in [("compact", "mls"), ("quadratic", "apic")].into_iter().enumerate() {
        let problem = randomised(scene_with_sheets(kernel, transfer, MIXED), 91 + seed as u64);
        assert!(touching(&problem) > 100, "{} particles touch something", touching(&problem));
        let differences = explicit::step(&problem, &problem);
        explicit::say(&differences);
        let agrees = |d: [f64; 8]| d.iter().zip(SHEET_TOLERANCE).all(|(d, t)| *d <= t);
        assert!(agrees(differences), "{kernel} {transfer}: {differences:?}");
        let mut wrong = problem.clone();
        wrong.setup.colliders[1].motion.linear_velocity[2] += 0.05;
        assert!(!agrees(explicit::step(&wrong, &problem)), "a sheet that moves otherwise is not caught");
    }
}

#[test]
fn planted_errors_are_caught() {
    let problem = random_scene("compact", "mls", ELASTIC, 81);
    assert!(explicit::agrees(explicit::step(&problem, &problem)));
    type Plant<'a> = &'a dyn Fn(&mut Problem);
    let planted: [(&str, Plant); 5] = [
        ("springs a hundredth of a cell longer", &|p| {
            p.particles
                .touch
                .iter_mut()
                .filter(|touch| touch.with != 0)
                .for_each(|t| t.stretch[0] += 0.01 * p.setup.dx);
        }),
        ("radii a hundredth larger", &|p| p.particles.touch.iter_mut().for_each(|touch| touch.radius *= 1.01)),
        ("friction of a collider", &|p| p.setup.colliders[0].contact.friction = 0.21),
        ("collider 0.01 dx away", &|p| p.setup.colliders[0].motion.linear_velocity[0] += 0.01),
        ("contact at nodes", &|p| p.setup.contact_at = ContactAt::Nodes),
    ];
    for (name, plant) in planted {
        let mut wrong = problem.clone();
        plant(&mut wrong);
        let differences = explicit::step(&wrong, &problem);
        println!("{name}: {differences:?}");
        assert!(!explicit::agrees(differences), "not caught: {name}");
    }
}

/// Springs are carried along, faces appear and vanish, and what is fast is stopped: over many steps.
#[test]
fn frames_follow_the_reference() {
    let cases =
        [("compact", "mls", ELASTIC, false), ("quadratic", "apic", METALS, false), ("compact", "mls", MIXED, true)];
    for (kernel, transfer, materials, sheets) in cases {
        let mut problem = if sheets { scene_with_sheets } else { scene }(kernel, transfer, materials);
        (problem.setup.max_dt_s, problem.setup.cfl) = (Some(DT_S), 1.0);
        let mut gpu = common::gpu_engine(&problem);
        let stats = gpu.advance_frame(40.0 * DT_S, &NoControl).unwrap();
        let setup = Setup { precision: Precision::F64, ..problem.setup.clone() };
        let mut cpu = CpuEngine::new(&setup, problem.particles.clone()).unwrap();
        let reference = cpu.advance_frame(40.0 * DT_S, &NoControl).unwrap();
        assert_eq!(stats.steps, reference.steps);
        let (a, b) = (gpu.snapshot().unwrap(), cpu.snapshot().unwrap());
        let d = explicit::compare_particles(&a, &b, problem.setup.dx);
        let mut apart = (0.0f64, 0usize);
        for (a, b) in a.touch.iter().zip(&b.touch) {
            let stretch = (0..3).map(|k| (a.stretch[k] - b.stretch[k]).abs() / problem.setup.dx).fold(0.0, f64::max);
            // One that just touches may do so a step later, and holds on to where it is then.
            let late = a.with != b.with || stretch > 1e-4;
            apart.1 += usize::from(late);
            apart.0 = apart.0.max(if late { 0.0 } else { stretch });
        }
        println!("{kernel} {transfer}, sheets {sheets}: {} steps, x v B F {d:?}, stretch {apart:?}", stats.steps);
        let holding = b.touch.iter().filter(|touch| touch.with != 0).count();
        // What a sheet has stopped slides on as f32 knows its normal.
        let [far, least] = if sheets { [1e-3, 100.0] } else { [1e-4, 500.0] };
        assert!(d[0] < far && d[1] < 1e-3 && d[3] < 1e-3, "{d:?}");
        assert!(holding as f64 > least && apart.0 < far && 500 * apart.1 < holding, "{apart:?} of {holding}");
        let largest = reference.reactions.iter().flat_map(|r| r.force).fold(0.0f64, |a, b| a.max(b.abs()));
        let worst = stats.reactions.iter().zip(&reference.reactions).flat_map(|(a, b)| {
            (0..3).map(|k| (a.force[k] - b.force[k]).abs().max(2.0 * (a.torque[k] - b.torque[k]).abs()))
        });
        let worst = worst.fold(0.0f64, f64::max);
        println!("largest force {largest:.3} N, worst difference {worst:.1e} N");
        assert!(worst < 2e-4 * largest, "{:?}\n{:?}", stats.reactions, reference.reactions);
    }
}
