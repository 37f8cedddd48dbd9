//! The GPU's stages do what the CPU's stages of the same names do, on random states; a planted error is caught.
//!
//! Reference: the CPU engine in f64. Differences are in units of a full node's mass and of the
//! scene's speed scale: momentum is compared by momentum and node velocity weighted by mass,
//! because a node that is nearly empty has no meaningful velocity.

use std::collections::BTreeMap;

use gridfall_core::sim::particles::Particles;
use gridfall_core::sim::setup::{Kernel, Material, Precision, Problem, Setup, Transfer};
use gridfall_engine::explicit::cpu::{CpuEngine, Stages, stages};
use gridfall_engine::explicit::gpu::{GridNode, Staged};
use gridfall_engine::{Engine, NoControl};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use crate::common;

pub const DT_S: f64 = 4e-4;

/// Three materials at a time.
pub const ELASTIC: [&str; 3] = [
    r#"{ "model": "fixed-corotated", "density": 1000, "youngs_modulus": 1e4, "poissons_ratio": 0.3 }"#,
    r#"{ "model": "neo-hookean", "density": 1500, "youngs_modulus": 2e4, "poissons_ratio": 0.4,
        "damping": 0.01 }"#,
    r#"{ "model": "weakly-compressible-fluid", "density": 1000, "bulk_modulus": 1e4, "viscosity": 2 }"#,
];
pub const SOILS: [&str; 3] = [
    r#"{ "model": "drucker-prager", "density": 1000, "youngs_modulus": 1e4, "poissons_ratio": 0.3,
        "friction_angle_degrees": 30 }"#,
    r#"{ "model": "nacc", "density": 1500, "youngs_modulus": 2e4, "poissons_ratio": 0.3, "M": 2.36, "beta": 0.5,
        "xi": 3, "alpha0": -0.01 }"#,
    r#"{ "model": "snow", "density": 400, "youngs_modulus": 1e4, "poissons_ratio": 0.2 }"#,
];
pub const GRAINS: [&str; 3] = [
    r#"{ "model": "mohr-coulomb", "density": 1000, "youngs_modulus": 1e4, "poissons_ratio": 0.3,
        "friction_angle_degrees": 30, "cohesion": 200, "dilatancy_angle_degrees": 10 }"#,
    r#"{ "model": "drucker-prager", "density": 1500, "youngs_modulus": 2e4, "poissons_ratio": 0.3,
        "friction_angle_degrees": 35, "cone": "plane-strain" }"#,
    r#"{ "model": "mohr-coulomb", "density": 1000, "youngs_modulus": 1e4, "poissons_ratio": 0.3,
        "friction_angle_degrees": 40 }"#,
];
/// A fluid beside grains and a solid.
pub const MIXED: [&str; 3] = [GRAINS[1], ELASTIC[2], ELASTIC[0]];
pub const WATER: [&str; 3] = [ELASTIC[2]; 3];
pub const SAND: [&str; 3] = [GRAINS[0]; 3];
pub const METALS: [&str; 3] = [
    r#"{ "model": "von-mises", "density": 1000, "youngs_modulus": 1e4, "poissons_ratio": 0.3, "yield_stress": 500,
        "damping": 0.005 }"#,
    r#"{ "model": "von-mises", "density": 1500, "youngs_modulus": 2e4, "poissons_ratio": 0.4, "yield_stress": 800,
        "elasticity": "fixed-corotated" }"#,
    r#"{ "model": "stvk-hencky", "density": 1000, "youngs_modulus": 1e4, "poissons_ratio": 0.3 }"#,
];

/// All wall kinds and contacts, at nodes; a turned, moving, composite collider; a periodic axis.
pub fn scene(kernel: &str, transfer: &str, [jelly, gum, water]: [&str; 3]) -> Problem {
    common::problem(&format!(
        r#"{{ "gridfall": 1, "name": "twins",
        "domain": {{ "min": [-0.3, 0.1, 0.2], "max": [0.7, 1.1, 1.2], "dx": 0.0625,
                     "boundary": {{ "x-": {{"contact":"slip"}}, "x+": {{"contact":"separate","friction":0.3}},
                         "y": "periodic",
                                    "z-": {{"contact":"separate","friction":0.4}}, "z+": {{"contact":"sticky"}} }} }},
        "gravity": [0.5, -1, -9.81],
        "materials": {{
            "jelly": {jelly}, "gum": {gum}, "water": {water} }},
        "bodies": [
            {{ "name": "a", "material": "jelly", "sampling": "jittered",
                "shape": {{ "box": {{ "min": [-0.3, 0.1, 0.2], "max": [0.1, 0.6, 0.6] }} }} }},
            {{ "name": "b", "material": "gum", "sampling": "jittered",
                "shape": {{ "sphere": {{ "center": [0.4, 0.8, 0.9], "radius": 0.25 }} }} }},
            {{ "name": "c", "material": "water", "sampling": "jittered",
                "shape": {{ "box": {{ "min": [0.2, 0.3, 0.2], "max": [0.7, 1.1, 0.5] }} }} }} ],
        "colliders": [
            {{ "name": "bar", "contact": "separate", "friction": 0.2,
               "shape": {{ "rotate": {{ "axis": [1, 1, 0], "angle_degrees": 35, "shape": {{ "difference": [
                    {{ "cylinder": {{ "center": [0.2, 0.5, 0.3], "radius": 0.2, "height": 0.5 }} }},
                    {{ "box": {{ "min": [0.1, 0.3, 0.2], "max": [0.3, 0.5, 0.4] }} }} ] }} }} }},
               "motion": {{ "linear_velocity": [0.3, 0.1, 0], "angular_velocity": [0, 1, 2] }} }},
            {{ "name": "ring", "contact": "slip", "shape": {{ "torus": {{ "center": [0.4, 0.8, 0.9],
                "major_radius": 0.2, "minor_radius": 0.07 }} }} }},
            {{ "name": "key", "contact": "sticky", "shape": {{ "sphere": {{ "center": [-0.1, 0.3, 0.4],
                "radius": 0.1 }} }}, "from": 0.004,
               "motion": {{ "center": [-0.2, 0.3, 0.4], "axis": [0, 1, 1], "keyframes": [
                    {{ "time": 0.002 }}, {{ "time": 0.008, "offset": [0.01, 0, 0], "angle_degrees": 3 }},
                        {{ "time": 0.012, "angle_degrees": -3 }} ] }} }},
            {{ "name": "gone", "contact": "sticky", "until": 0.004,
                "shape": {{ "box": {{ "min": [0.51, 0.31, 0.15], "max": [0.69, 1.08, 0.31] }} }} }} ],
        "time": {{ "end": 0.1, "frame_rate": 50 }},
        "solver": {{ "kernel": "{kernel}", "transfer": "{transfer}", "contact": "nodes" }} }}"#
    ))
}

fn random_scene(kernel: &str, transfer: &str, materials: [&str; 3], seed: u64) -> Problem {
    println!("{kernel} {transfer} seed {seed}");
    let mut problem = scene(kernel, transfer, materials);
    common::randomise(&mut problem, &mut ChaCha8Rng::seed_from_u64(seed));
    problem
}

/// Bodies with more particles than room: squeezed towards walls, into a corner and around the ring.
/// `one`: all of one material; `tight`: 1 for about twice of what there is room for, 0 for no more
/// than that.
fn crowded(kernel: &str, transfer: &str, materials: [&str; 3], one: bool, tight: f64) -> Problem {
    let mut problem = scene(kernel, transfer, materials);
    if one {
        (1..3).for_each(|k| problem.setup.bodies[k].material = problem.setup.bodies[0].material);
    }
    let towards =
        [([-0.3, 0.3, 0.2], [0.7, 0.8, 0.75]), ([0.4, 0.8, 0.9], [0.8; 3]), ([0.7, 0.7, 0.2], [0.9, 1.0, 0.5])];
    let p = &mut problem.particles;
    for id in 0..p.len() {
        let (middle, shrink): ([f64; 3], [f64; 3]) = towards[p.body[id] as usize];
        p.x[id] = std::array::from_fn(|a| middle[a] + shrink[a].powf(tight) * (p.x[id][a] - middle[a]));
    }
    problem
}

fn f64_stages(problem: &Problem) -> Box<dyn Stages> {
    let setup = Setup { precision: Precision::F64, ..problem.setup.clone() };
    let mut cpu = stages(&setup, problem.particles.clone());
    cpu.start_frame();
    cpu
}

/// Mass, momentum, velocity by (field, grid sign, node).
type Nodes = BTreeMap<(u32, i32, [i32; 3]), (f64, [f64; 3], [f64; 3])>;

fn cpu_nodes(cpu: &dyn Stages, problem: &Problem) -> Nodes {
    let sign = if problem.setup.kernel == Kernel::Compact { [1, -1] } else { [0, 0] };
    let mut nodes = Nodes::new();
    for n in cpu.nodes() {
        let mut index = n.index;
        index[1] = index[1].rem_euclid(16); // the periodic axis
        let old = nodes.insert((n.field, sign[n.grid], index), (n.mass, n.momentum, n.velocity));
        assert!(old.is_none(), "node {index:?} twice");
    }
    nodes
}

/// Largest difference of mass (full nodes) and of momentum or mass-weighted velocity (full nodes × m/s).
fn compare(gpu: &[GridNode], cpu: &Nodes, problem: &Problem, velocities: bool) -> (f64, f64) {
    let full = 1500.0 * problem.setup.dx.powi(3);
    let mut seen: Nodes = cpu.clone();
    let (mut mass, mut value) = (0.0f64, 0.0f64);
    for n in gpu {
        let (m, p, v) = seen.remove(&(n.field, n.grid, n.node)).unwrap_or_default();
        mass = mass.max((n.mass - m).abs() / full);
        for a in 0..3 {
            let difference = if velocities { (n.value[a] - v[a]) * n.mass.min(m) } else { n.value[a] - p[a] };
            value = value.max(difference.abs() / full);
        }
    }
    for (m, p, _) in seen.values() {
        mass = mass.max(m / full);
        value = value.max(p.iter().fold(0.0f64, |a, b| a.max(b.abs())) / full);
    }
    (mass, value)
}

/// Largest differences of x (dx), v (m/s), B (dx m/s) and F or the plastic state.
pub fn compare_particles(a: &Particles, b: &Particles, dx: f64) -> [f64; 4] {
    let mut d = [0.0f64; 4];
    for id in 0..a.len() {
        for k in 0..3 {
            d[0] = d[0].max((a.x[id][k] - b.x[id][k]).abs() / dx);
            d[1] = d[1].max((a.v[id][k] - b.v[id][k]).abs());
        }
        for k in 0..9 {
            d[2] = d[2].max((a.b[id][k] - b.b[id][k]).abs() / dx);
            d[3] = d[3].max((a.f[id][k] - b.f[id][k]).abs());
        }
        d[3] = d[3].max((a.plastic[id] - b.plastic[id]).abs());
    }
    d
}

/// Differences after each stage of one step: mass and momentum, mass and velocity, then x, v, B, F.
pub fn step(gpu_problem: &Problem, cpu_problem: &Problem) -> [f64; 8] {
    let mut cpu = f64_stages(cpu_problem);
    let mut engine = common::gpu_engine(gpu_problem);
    let (mut gpu, nodes) = Staged::p2g(&mut engine, DT_S).unwrap();
    cpu.p2g(DT_S);
    let (mass, momentum) = compare(&nodes, &cpu_nodes(cpu.as_ref(), cpu_problem), cpu_problem, false);
    let nodes = gpu.grid_update().unwrap();
    cpu.grid_update(DT_S, 0.0, DT_S);
    let (mass_again, velocity) = compare(&nodes, &cpu_nodes(cpu.as_ref(), cpu_problem), cpu_problem, true);
    let after = gpu.g2p().unwrap();
    cpu.g2p(DT_S);
    let [x, v, b, f] = compare_particles(&after, &cpu.particles(), cpu_problem.setup.dx);
    [mass, momentum, mass_again, velocity, x, v, b, f]
}

/// A frame of 40 steps on the GPU, which must repeat to the bit, and in f64 on the CPU: its steps, and how far
/// particles are apart.
pub fn frame(problem: &Problem) -> (u64, [f64; 4]) {
    let mut problem = problem.clone();
    (problem.setup.max_dt_s, problem.setup.cfl) = (Some(DT_S), 1.0);
    let run = || {
        let mut gpu = common::gpu_engine(&problem);
        let stats = gpu.advance_frame(40.0 * DT_S, &NoControl).unwrap();
        (stats.steps, gpu.snapshot().unwrap())
    };
    let (steps, after) = run();
    assert!(run() == (steps, after.clone()), "not repeatable");
    let setup = Setup { precision: Precision::F64, ..problem.setup.clone() };
    let mut cpu = CpuEngine::new(&setup, problem.particles.clone()).unwrap();
    assert_eq!(steps, cpu.advance_frame(40.0 * DT_S, &NoControl).unwrap().steps);
    (steps, compare_particles(&after, &cpu.snapshot().unwrap(), problem.setup.dx))
}

/// What f32 states and fixed-point sums with a quantum of 1.5e-8 full nodes can differ by in a
/// step, with the speeds above.
pub const TOLERANCE: [f64; 8] = [1e-6, 1e-5, 1e-6, 1e-5, 1e-6, 1e-5, 1e-5, 1e-5];
/// Beside a tip of NACC's surface the deviator goes with the root of the distance to the tip: among
/// a few thousand states some amplify a rounding of J tenfold and more. The law by itself is
/// compared in `gpu::law_tests`.
const SOIL_TOLERANCE: [f64; 8] = [1e-6, 1e-5, 1e-6, 1e-5, 1e-6, 1e-5, 1e-5, 1e-4];

pub fn agrees(differences: [f64; 8]) -> bool {
    differences.iter().zip(TOLERANCE).all(|(d, t)| *d <= t)
}

#[test]
fn stages_agree_on_random_states() {
    let cases = [
        ("compact", "mls", ELASTIC),
        ("compact", "mls-published", ELASTIC),
        ("compact", "apic", ELASTIC),
        ("quadratic", "mls", ELASTIC),
        ("quadratic", "apic", ELASTIC),
        ("compact", "mls", SOILS),
        ("compact", "mls", METALS),
        ("quadratic", "apic", SOILS),
        ("compact", "mls", GRAINS),
    ];
    for (seed, (kernel, transfer, materials)) in cases.into_iter().enumerate() {
        let problem = random_scene(kernel, transfer, materials, 11 + seed as u64);
        let differences = step(&problem, &problem);
        say(&differences);
        let tolerance = if materials == SOILS { SOIL_TOLERANCE } else { TOLERANCE };
        let agrees = differences.iter().zip(tolerance).all(|(d, t)| *d <= t);
        assert!(agrees, "{kernel} {transfer}: {differences:?}");
    }
}

pub fn say(differences: &[f64; 8]) {
    let [mass, momentum, again, velocity, x, v, b, f] = differences;
    println!(
        "mass {mass:.1e} momentum {momentum:.1e} | mass {again:.1e} velocity {velocity:.1e} \
         | x {x:.1e} v {v:.1e} B {b:.1e} F {f:.1e}"
    );
}

/// The volume of fluids and grains follows what fills the room around them.
#[test]
fn crowded_stages_agree_on_random_states() {
    let cases = [
        ("compact", "mls", MIXED, false),
        ("compact", "apic", ELASTIC, false),
        ("quadratic", "mls", MIXED, false),
        ("quadratic", "apic", GRAINS, false),
        ("compact", "mls", WATER, true),
        ("compact", "mls-published", SAND, true),
        ("quadratic", "mls", SAND, true),
    ];
    for (seed, (kernel, transfer, materials, one)) in cases.into_iter().enumerate() {
        println!("{kernel} {transfer} seed {}", 31 + seed);
        let mut problem = crowded(kernel, transfer, materials, one, 1.0);
        common::randomise(&mut problem, &mut ChaCha8Rng::seed_from_u64(31 + seed as u64));
        let differences = step(&problem, &problem);
        say(&differences);
        assert!(agrees(differences), "{kernel} {transfer}: {differences:?}");
    }
}

/// Without strain nothing but the volume tells of the fill, so an error there changes F alone.
#[test]
fn planted_errors_of_the_fill_are_caught() {
    type Plant<'a> = &'a dyn Fn(&mut Setup);
    let planted: [(&str, Plant); 4] = [
        ("rate of the water", &|s| {
            let Material::WeaklyCompressibleFluid(m) = &mut s.materials[s.bodies[1].material] else { panic!() };
            m.bulk_modulus *= 1.2;
        }),
        ("rate of the grains", &|s| {
            let Material::DruckerPrager(m) = &mut s.materials[s.bodies[0].material] else { panic!() };
            m.youngs_modulus *= 1.2;
        }),
        ("a collider that takes no room", &|s| s.colliders[1].grip = true),
        ("rest volume off by a hundredth", &|s| s.bodies[0].volume0 *= 1.01),
    ];
    for kernel in ["compact", "quadratic"] {
        println!("{kernel} seed 41");
        let mut problem = crowded(kernel, "mls", MIXED, false, 1.0);
        let (f, plastic) = (problem.particles.f.clone(), problem.particles.plastic.clone());
        common::randomise(&mut problem, &mut ChaCha8Rng::seed_from_u64(41));
        (problem.particles.f, problem.particles.plastic) = (f, plastic);
        assert!(agrees(step(&problem, &problem)));
        for (name, plant) in &planted {
            let mut wrong = problem.clone();
            plant(&mut wrong.setup);
            let differences = step(&wrong, &problem);
            println!("{name}: F {:.1e}", differences[7]);
            assert!(differences[7] > TOLERANCE[7], "not caught: {name}");
            let elsewhere = differences.iter().zip(TOLERANCE).take(7).all(|(d, t)| *d <= t);
            assert!(elsewhere, "{name} shows elsewhere: {differences:?}");
        }
    }
}

#[test]
fn planted_errors_are_caught() {
    let problem = random_scene("compact", "mls", ELASTIC, 21);
    assert!(agrees(step(&problem, &problem)));
    type Plant<'a> = &'a dyn Fn(&mut Problem);
    let planted: [(&str, Plant); 8] = [
        ("stiffness off by a thousandth", &|p| {
            let Material::FixedCorotated(e) = &mut p.setup.materials[p.setup.bodies[0].material] else { panic!() };
            e.youngs_modulus *= 1.001;
        }),
        ("damping off by a hundredth", &|p| {
            let Material::NeoHookean(e) = &mut p.setup.materials[p.setup.bodies[1].material] else { panic!() };
            e.damping *= 1.01;
        }),
        ("one particle's F", &|p| p.particles.f[100][1] += 1e-3),
        ("one particle's B", &|p| p.particles.b[200][5] += 1e-3 * p.setup.dx),
        ("friction of a collider", &|p| p.setup.colliders[0].contact.friction = 0.21),
        ("collider 0.01 dx away", &|p| p.setup.colliders[0].motion.linear_velocity[0] += 0.01),
        ("force through gradients instead of moments", &|p| p.setup.transfer = Transfer::Apic),
        ("moments about the particle", &|p| p.setup.transfer = Transfer::MlsPublished),
    ];
    for (name, plant) in planted {
        let mut wrong = problem.clone();
        plant(&mut wrong);
        let differences = step(&wrong, &problem);
        println!("{name}: {differences:?}");
        assert!(!agrees(differences), "not caught: {name}");
    }
}

/// Crowded bodies on their way: the speed sets a scale that the sums do not outgrow, for a new plan
/// has one more transfer than the reference.
fn moving(kernel: &'static str, materials: [&str; 3], one: bool) -> (&'static str, &'static str, Problem) {
    let mut problem = crowded(kernel, "mls", materials, one, 0.4);
    problem.particles.v.fill([0.6, -0.4, 0.9]);
    (kernel, "mls", problem)
}

/// Fused steps are the separate ones: many steps in one frame against the CPU's engine stages.
#[test]
fn fused_steps_follow_the_reference() {
    use gridfall_engine::{Engine, NoControl};
    for (kernel, transfer, mut problem) in [
        ("compact", "mls", ELASTIC),
        ("quadratic", "apic", ELASTIC),
        ("compact", "mls", SOILS),
        ("compact", "mls", METALS),
        ("quadratic", "mls", GRAINS),
    ]
    .map(|(kernel, transfer, materials)| (kernel, transfer, scene(kernel, transfer, materials)))
    .into_iter()
    .chain([moving("compact", MIXED, false), moving("quadratic", WATER, true)])
    {
        (problem.setup.max_dt_s, problem.setup.cfl) = (Some(DT_S), 1.0);
        let mut gpu = common::gpu_engine(&problem);
        let stats = gpu.advance_frame(40.0 * DT_S, &NoControl).unwrap();
        let setup = Setup { precision: Precision::F64, ..problem.setup.clone() };
        let mut cpu = CpuEngine::new(&setup, problem.particles.clone()).unwrap();
        let reference = cpu.advance_frame(40.0 * DT_S, &NoControl).unwrap();
        assert_eq!(stats.steps, reference.steps);
        let d = compare_particles(&gpu.snapshot().unwrap(), &cpu.snapshot().unwrap(), problem.setup.dx);
        println!(
            "{kernel} {transfer}: {} steps, x {:.1e} dx, v {:.1e} m/s, B {:.1e}, F {:.1e}",
            stats.steps, d[0], d[1], d[2], d[3]
        );
        assert!(d[0] < 1e-4 && d[1] < 1e-3 && d[3] < 1e-3, "{d:?}");
        // Forces in shares of the largest, torques at an arm of half a metre.
        let largest = reference.reactions.iter().flat_map(|r| r.force).fold(0.0f64, |a, b| a.max(b.abs()));
        let (mut worst, mut touched) = (0.0f64, 0);
        for (a, b) in stats.reactions.iter().zip(&reference.reactions) {
            touched += usize::from(b.force != [0.0; 3]);
            for k in 0..3 {
                worst = worst.max((a.force[k] - b.force[k]).abs()).max(2.0 * (a.torque[k] - b.torque[k]).abs());
            }
        }
        println!(
            "{kernel} {transfer}: {touched} surfaces, largest force {largest:.3} N, worst difference {worst:.1e} N"
        );
        assert!(touched >= 7 && worst < 2e-4 * largest, "{:?}\n{:?}", stats.reactions, reference.reactions);
    }
}
