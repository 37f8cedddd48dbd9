//! A run that goes on from a saved state is the run that was saved, to the bit, on every engine.

use gridfall_core::sim::particles::Particles;
use gridfall_core::sim::setup::Problem;
use gridfall_engine::explicit::cpu::CpuEngine;
use gridfall_engine::implicit::ImplicitEngine;
use gridfall_engine::{Engine, FrameStats, NoControl};
use gridfall_recording::run::advance;

use crate::common;

/// Whatever has a memory: a source that opens later, colliders that move, appear and are thin, sticky walls, friction
/// at particles, bodies with contact of their own, a damped solid, a plastic one, grains, water that relaxes.
/// Implicit engines run all but the damping, the contact between bodies, and the water.
fn everything(dimension: usize, rate: f64, solver: &str) -> Problem {
    let explicit = solver.contains("explicit");
    let water = r#", "water": { "model": "weakly-compressible-fluid", "density": 1000, "bulk_modulus": 2e4,
        "viscosity": 0.1 }"#;
    let [damping, contact, tap, water] = if explicit {
        [r#", "damping": 1e-3"#, r#""contact": "separate", "friction": 0.2,"#, "water", water]
    } else {
        ["", "", "gum", ""]
    };
    let v = |x: f64, y: f64, z: f64| if dimension == 2 { format!("[{x}, {z}]") } else { format!("[{x}, {y}, {z}]") };
    let solid = |min: String, max: String| format!(r#"{{ "box": {{ "min": {min}, "max": {max} }} }}"#);
    let (floor, gravity) = if dimension == 2 { ("y-", "[0, -9.8]") } else { ("z-", "[0, 0, -9.8]") };
    let turning = if dimension == 2 { "[3]" } else { "[0, 3, 0]" };
    common::problem(&format!(
        r#"{{ "gridfall": 1, "name": "everything", "dimension": {dimension}, "gravity": {gravity},
        "domain": {{ "min": {}, "max": {}, "dx": 0.0625,
            "boundary": {{ "x-": {{ "contact": "slip" }}, "{floor}": {{ "contact": "separate", "friction": 0.4 }} }} }},
        "materials": {{
            "gum": {{ "model": "fixed-corotated", "density": 1000, "youngs_modulus": 5e4, "poissons_ratio": 0.3
                {damping} }},
            "tin": {{ "model": "von-mises", "density": 2000, "youngs_modulus": 2e5, "poissons_ratio": 0.3,
                "yield_stress": 2e3 }},
            "sand": {{ "model": "drucker-prager", "density": 1600, "youngs_modulus": 1e5, "poissons_ratio": 0.3,
                "friction_angle_degrees": 30 }} {water} }},
        "bodies": [
            {{ "name": "block", "material": "gum", "sampling": "jittered", "velocity": {}, {contact}
                "shape": {} }},
            {{ "name": "slab", "material": "tin", "velocity": {}, "shape": {} }},
            {{ "name": "heap", "material": "sand", "sampling": "jittered", "shape": {} }} ],
        "sources": [ {{ "name": "tap", "material": "{tap}", "velocity": {}, "from": {}, "until": {},
            "shape": {} }} ],
        "colliders": [
            {{ "name": "paddle", "contact": "separate", "friction": 0.3, "shape": {},
               "motion": {{ "center": {}, "angular_velocity": {turning}, "linear_velocity": {} }} }},
            {{ "name": "plate", "contact": "slip", "shape": {}, "from": {}, "until": {} }},
            {{ "name": "glue", "contact": "sticky", "shape": {} }} ],
        "time": {{ "end": {}, "frame_rate": {rate} }}, "seed": 3, "solver": {solver} }}"#,
        v(0.0, 0.0, 0.0),
        v(1.0, 0.375, 0.75),
        v(1.0, 0.0, -1.0),
        solid(v(0.2, 0.1, 0.15), v(0.35, 0.25, 0.3)),
        v(0.5, 0.0, -1.5),
        solid(v(0.2, 0.1, 0.34), v(0.4, 0.25, 0.45)),
        solid(v(0.62, 0.1, 0.02), v(0.8, 0.25, 0.2)),
        v(0.0, 0.0, -1.0),
        1.8 / rate,
        3.6 / rate,
        solid(v(0.65, 0.1, 0.5), v(0.8, 0.25, 0.6)),
        solid(v(0.42, 0.05, 0.1), v(0.5, 0.3, 0.3)),
        v(0.46, 0.2, 0.2),
        v(-0.3, 0.0, 0.0),
        solid(v(0.6, 0.0, 0.28), v(0.9, 0.375, 0.29)),
        2.0 / rate,
        4.4 / rate,
        solid(v(0.15, 0.05, 0.0), v(0.3, 0.3, 0.1)),
        6.0 / rate,
    ))
}

fn frames(engine: &mut dyn Engine, problem: &Problem, range: std::ops::Range<u32>) -> Vec<FrameStats> {
    range.map(|frame| advance(&problem.setup, engine, frame, &NoControl).unwrap_or_else(|e| panic!("{e}"))).collect()
}

fn saved(engine: &mut dyn Engine) -> Vec<u8> {
    let mut state = Vec::new();
    engine.save(&mut state).unwrap_or_else(|e| panic!("{e}"));
    state
}

/// Interrupts a run after each of the frames `at`.
fn check(problem: &Problem, at: &[u32], load: &dyn Fn() -> Box<dyn Engine>) {
    let all = problem.setup.frames;
    let mut engine = load();
    let whole = frames(engine.as_mut(), problem, 0..all);
    let (end, particles): (Vec<u8>, Particles) = (saved(engine.as_mut()), engine.snapshot().unwrap());
    assert!(whole.iter().all(|frame| frame.steps > 0) && !particles.is_empty());
    for &at in at {
        let mut first = load();
        frames(first.as_mut(), problem, 0..at);
        let state = saved(first.as_mut());
        // To save disturbs nothing.
        assert_eq!(frames(first.as_mut(), problem, at..all), whole[at as usize..], "after frame {at}");
        assert!(saved(first.as_mut()) == end, "the run that was saved after frame {at} ends otherwise");
        drop(first);
        let mut second = load();
        second.restore(&mut state.as_slice()).unwrap_or_else(|e| panic!("{e}"));
        assert!(saved(second.as_mut()) == state, "what was restored after frame {at} is not what was saved");
        assert_eq!(frames(second.as_mut(), problem, at..all), whole[at as usize..], "after frame {at}");
        assert!(second.snapshot().unwrap() == particles, "particles of the run resumed after frame {at}");
        assert!(saved(second.as_mut()) == end, "the run resumed after frame {at} ends otherwise");
        // A state that is cut off is refused, wherever.
        for part in [0, 1, state.len() / 2, state.len() - 1] {
            assert!(load().restore(&mut &state[..part]).is_err(), "{part} of {} bytes", state.len());
        }
    }
}

fn on_cpu(problem: &Problem) -> Box<dyn Engine> {
    Box::new(CpuEngine::new(&problem.setup, problem.particles.clone()).unwrap_or_else(|e| panic!("{e}")))
}

#[test]
fn the_explicit_cpu_engine_goes_on() {
    for (dimension, solver) in [
        (3, r#"{ "integrator": "explicit" }"#),
        (3, r#"{ "integrator": "explicit", "kernel": "quadratic", "transfer": "apic", "contact": "nodes" }"#),
        (2, r#"{ "integrator": "explicit", "precision": "f64" }"#),
        (2, r#"{ "integrator": "explicit", "kernel": "cubic", "transfer": "pic" }"#),
    ] {
        println!("{dimension}D, {solver}");
        let problem = everything(dimension, 40.0, solver);
        check(&problem, &[1, 2, 3, 5], &|| on_cpu(&problem));
    }
}

#[test]
fn the_explicit_gpu_engine_goes_on() {
    for solver in [
        r#"{ "integrator": "explicit" }"#,
        r#"{ "integrator": "explicit", "kernel": "quadratic", "transfer": "apic", "contact": "nodes" }"#,
    ] {
        println!("{solver}");
        let problem = everything(3, 40.0, solver);
        check(&problem, &[2, 4], &|| Box::new(common::gpu_engine(&problem)));
    }
}

#[test]
fn the_implicit_cpu_engine_goes_on() {
    for (dimension, solver) in [
        (2, r#"{ "integrator": "implicit" }"#),
        (
            2,
            r#"{ "integrator": "implicit", "kernel": "quadratic", "transfer": "apic", "contact": "nodes",
                "implicit": { "method": "hot" } }"#,
        ),
    ] {
        println!("{dimension}D, {solver}");
        let problem = everything(dimension, 40.0, solver);
        check(&problem, &[1, 3, 5], &|| {
            Box::new(ImplicitEngine::new(&problem.setup, problem.particles.clone()).unwrap())
        });
    }
}

#[test]
fn the_implicit_gpu_engine_goes_on() {
    // Short frames: the software GPU takes seconds a step.
    let mut problem =
        everything(3, 250.0, r#"{ "integrator": "implicit", "kernel": "quadratic", "transfer": "apic" }"#);
    problem.setup.frames = 3;
    check(&problem, &[2], &|| {
        Box::new(ImplicitEngine::on_gpu(common::gpu(), &problem.setup, problem.particles.clone(), "test").unwrap())
    });
}
