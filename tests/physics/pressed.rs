//! Contact at the particles in implicit steps: what lies on a face, slides, rolls, tips over, falls on it or sticks.

use crate::prescribed::problem;
use gridfall_core::sim::particles::Particles;
use gridfall_core::sim::reaction::WALLS;
use gridfall_core::sim::setup::Problem;
use gridfall_engine::implicit::ImplicitEngine;
use gridfall_engine::{Engine, FrameStats, NoControl};

const KERNELS: [&str; 2] = ["compact", "quadratic"];

/// A body on a floor that ends at 0.107 m, between nodes 0.02 m apart, under gravity on a slope.
struct Scene<'a> {
    kernel: &'a str,
    slope_degrees: f64,
    youngs_modulus: f64,
    shape: &'a str,
    sampling: &'a str,
    floor: &'a str,
    velocity: [f64; 2],
    frame_rate: u32,
}

const BLOCK: &str = r#"{ "box": { "min": [0.3, 0.107], "max": [0.5, 0.227] } }"#;
const ROUGH: &str =
    r#""contact": "separate", "friction": 0.3, "shape": { "box": { "min": [-1, -1], "max": [5, 0.107] } }"#;

const ON_A_SLOPE: Scene = Scene {
    kernel: "compact",
    slope_degrees: 30.0,
    youngs_modulus: 1e6,
    shape: BLOCK,
    sampling: "regular",
    floor: ROUGH,
    velocity: [0.0; 2],
    frame_rate: 40,
};

impl Scene<'_> {
    fn problem(&self) -> Problem {
        let Self { kernel, youngs_modulus, shape, sampling, floor, velocity, frame_rate, .. } = self;
        let (sin, cos) = self.slope_degrees.to_radians().sin_cos();
        problem(&format!(
            r#"{{ "gridfall": 1, "name": "pressed", "dimension": 2,
            "domain": {{ "min": [0, 0], "max": [2, 0.8], "dx": 0.02, "boundary": {{ "x": {{ "contact": "slip" }} }} }},
            "gravity": [{}, {}],
            "materials": {{ "m": {{ "model": "neo-hookean", "density": 1000, "youngs_modulus": {youngs_modulus},
                "poissons_ratio": 0.3 }} }},
            "bodies": [ {{ "name": "b", "material": "m", "shape": {shape}, "sampling": "{sampling}",
                "velocity": {velocity:?} }} ],
            "colliders": [ {{ "name": "floor", {floor} }} ],
            "time": {{ "end": 2, "frame_rate": {frame_rate} }},
            "solver": {{ "kernel": "{kernel}", "integrator": "implicit", "implicit": {{ "tolerance": 1e-9 }} }} }}"#,
            9.81 * sin,
            -9.81 * cos
        ))
    }

    /// Particles and what came of each frame up to `end_s`.
    fn run(&self, end_s: f64) -> (Problem, Vec<Particles>, Vec<FrameStats>) {
        let problem = self.problem();
        let mut engine = ImplicitEngine::new(&problem.setup, problem.particles.clone()).unwrap();
        let (mut states, mut stats) = (vec![problem.particles.clone()], Vec::new());
        for _ in 0..(end_s / problem.setup.frame_s).round() as usize {
            stats.push(engine.advance_frame(problem.setup.frame_s, &NoControl).unwrap_or_else(|e| panic!("{e}")));
            states.push(engine.snapshot().unwrap());
        }
        (problem, states, stats)
    }
}

fn centre(p: &Particles) -> [f64; 2] {
    [0, 1].map(|a| p.x.iter().map(|x| x[a]).sum::<f64>() / p.len() as f64)
}

fn velocity(p: &Particles) -> [f64; 2] {
    [0, 1].map(|a| p.v.iter().map(|v| v[a]).sum::<f64>() / p.len() as f64)
}

fn lowest(p: &Particles) -> f64 {
    p.x.iter().map(|x| x[1]).fold(f64::MAX, f64::min)
}

/// How far a body has turned since it was `start` (rad).
fn turned(start: &Particles, now: &Particles) -> f64 {
    let (c0, c) = (centre(start), centre(now));
    let (mut sin, mut cos) = (0.0, 0.0);
    for (a, b) in start.x.iter().zip(&now.x) {
        let (a, b) = ([a[0] - c0[0], a[1] - c0[1]], [b[0] - c[0], b[1] - c[1]]);
        sin += a[0] * b[1] - a[1] * b[0];
        cos += a[0] * b[0] + a[1] * b[1];
    }
    sin.atan2(cos)
}

#[test]
fn a_block_slides_as_friction_lets_it_and_rests_where_friction_holds_it() {
    for kernel in KERNELS {
        let sliding = Scene { kernel, ..ON_A_SLOPE };
        let (problem, states, stats) = sliding.run(0.5);
        let right = 9.81 * (0.5 - 0.3 * 0.75f64.sqrt());
        let got = (velocity(&states[20])[0] - velocity(&states[10])[0]) / (10.0 * problem.setup.frame_s);
        let [along, across] = [0, 1].map(|a| stats[10..].iter().map(|s| s.reactions[WALLS].force[a]).sum::<f64>());
        println!("{kernel}: {got:.4} of {right:.4} m/s², {:.4} of the pressure", along / -across);
        assert!((got / right - 1.0).abs() < 0.01 && (along / -across - 0.3).abs() < 0.003);

        let floor = ROUGH.replace("0.3", "0.7");
        let (_, states, _) = Scene { floor: &floor, ..sliding }.run(1.0);
        let moved = centre(&states[40])[0] - centre(&states[20])[0];
        println!("{kernel}: holds to {moved:.1e} m");
        assert!(moved.abs() < 2e-4, "{kernel}: {moved}");
    }
}

/// I α = m g R sin θ about the line of contact, of discs whose particles lie in layers along the rim.
#[test]
fn a_disc_rolls() {
    for (kernel, youngs_modulus) in KERNELS.into_iter().flat_map(|k| [1e6, 1e7].map(|e| (k, e))) {
        let floor = ROUGH.replace("0.3", "1.0");
        let shape = r#"{ "sphere": { "center": [0.5, 0.307], "radius": 0.2 } }"#;
        let disc = Scene {
            kernel,
            youngs_modulus,
            shape,
            sampling: "conforming",
            floor: &floor,
            frame_rate: 20,
            ..ON_A_SLOPE
        };
        let (_, states, _) = disc.run(0.4);
        let angle = |frame: usize| turned(&states[0], &states[frame]);
        let got = (angle(8) - 2.0 * angle(6) + angle(4)) / 0.1f64.powi(2);
        let right = -2.0 / 3.0 * 9.81 * 0.5 / 0.2;
        println!("{kernel} {youngs_modulus:.0e} Pa: {got:.2} of {right:.2} rad/s²");
        assert!((got / right - 1.0).abs() < 0.05, "{kernel} {youngs_modulus:e}: {got}");
    }
}

/// Three times as high as wide: stands up to 18.4°. A rigid one whose corner is its corner particle turns by 37.4°
/// here, somewhat faster in long steps. It begins where the floor presses without force.
#[test]
fn a_tall_box_tips_over_on_a_steep_slope_and_stands_on_a_gentle_one() {
    for kernel in KERNELS {
        let floor = ROUGH.replace("0.3", "1.0").replace("0.107", "0.11");
        let shape = r#"{ "box": { "min": [0.4, 0.11], "max": [0.5, 0.41] } }"#;
        let tall = Scene { kernel, shape, floor: &floor, youngs_modulus: 1e7, frame_rate: 160, ..ON_A_SLOPE };
        let fall = |slope_degrees: f64| {
            let (_, states, _) = Scene { slope_degrees, ..tall }.run(0.3);
            -turned(&states[0], &states[48]).to_degrees()
        };
        let (steep, gentle) = (fall(30.0), fall(15.0));
        println!("{kernel}: {steep:.2}° and {gentle:.2}°");
        assert!((steep / 37.4 - 1.0).abs() < 0.1 && gentle.abs() < 1.0, "{kernel}: {steep}, {gentle}");
    }
}

/// No pull is kept when a block leaves a floor that only pushes, and it bears no more than the weight at rest.
#[test]
fn a_block_that_falls_on_a_floor_leaves_it_freely() {
    for kernel in KERNELS {
        let shape = r#"{ "box": { "min": [0.3, 0.207], "max": [0.5, 0.327] } }"#;
        let falling = Scene { kernel, shape, slope_degrees: 0.0, youngs_modulus: 1e5, frame_rate: 200, ..ON_A_SLOPE };
        let (problem, states, stats) = falling.run(0.3);
        let pull = stats.iter().map(|s| s.reactions[WALLS].force[1]).fold(0.0, f64::max);
        let up = states.iter().map(|p| velocity(p)[1]).fold(0.0, f64::max);
        println!("{kernel}: leaves at {up:.2} m/s, pulled with {pull:.1e} N/m");
        assert!(pull == 0.0 && up > 0.2, "{kernel}: {pull}, {up}");

        let rests = Scene { velocity: [0.0; 2], shape: BLOCK, frame_rate: 40, youngs_modulus: 1e6, ..falling };
        let weight = problem.particles.len() as f64 * problem.setup.bodies[0].mass * 9.81;
        let (_, _, stats) = rests.run(0.75);
        let pressed = stats[20..].iter().map(|s| -s.reactions[WALLS].force[1]).sum::<f64>() / 10.0;
        println!("{kernel}: {:.5} of the weight", pressed / weight);
        assert!((pressed / weight - 1.0).abs() < 2e-3, "{kernel}: {pressed} of {weight} N/m");
    }
}

/// Plates of a tenth of a cell and sheets stop what would cross them in a step.
#[test]
fn thin_plates_let_nothing_through() {
    for kernel in KERNELS {
        for (top, thick, contact) in [(0.2, 0.002, "separate"), (0.212, 0.02, "slip"), (0.206, 0.002, "sticky")] {
            let floor = format!(
                r#""contact": "{contact}", "shape": {{ "box": {{ "min": [-1, {}], "max": [5, {top}] }} }}"#,
                top - thick
            );
            let shape = r#"{ "box": { "min": [0.3, 0.3], "max": [0.5, 0.42] } }"#;
            let scene = Scene { kernel, shape, floor: &floor, velocity: [0.3, -5.0], ..ON_A_SLOPE };
            let (problem, states, _) = scene.run(0.2);
            let depth = states.iter().map(lowest).fold(f64::MAX, f64::min) - top;
            println!("{kernel} {contact} {thick} m thick: {:.3} dx above", depth / problem.setup.dx);
            assert!(depth > 0.0, "{kernel} {contact} {thick}: {depth}");
        }
    }
}

/// What sticks to a face goes where that goes, and the face gives what momentum the body gets.
#[test]
fn a_sticky_face_carries_a_block_and_gives_it_its_momentum() {
    for kernel in KERNELS {
        let floor = r#""contact": "sticky", "shape": { "box": { "min": [-1, -1], "max": [5, 0.107] } },
            "motion": { "linear_velocity": [0.2, -0.1] }"#;
        let scene = Scene { kernel, slope_degrees: 0.0, floor, shape: BLOCK, ..ON_A_SLOPE };
        let (problem, states, stats) = scene.run(0.5);
        let v = velocity(&states[20]);
        println!("{kernel}: {v:?} m/s");
        assert!((v[0] - 0.2).abs() < 0.01 && (v[1] + 0.1).abs() < 0.01, "{kernel}: {v:?}");
        let mass = problem.particles.len() as f64 * problem.setup.bodies[0].mass;
        for a in 0..2 {
            let given: f64 = stats.iter().map(|s| -s.reactions[WALLS].force[a] * problem.setup.frame_s).sum();
            let fallen = if a == 1 { -9.81 * 0.5 * mass } else { 0.0 };
            let error = (mass * v[a] - given - fallen) / mass;
            // As far as the solves have converged.
            assert!(error.abs() < 1e-4, "{kernel}: momentum {error:e} m/s from nowhere");
        }
    }
}
