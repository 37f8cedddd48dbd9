//! Open meshes as colliders: sheets of no thickness, which have two sides and let nothing through.

use std::path::Path;

use gridfall_core::sim::reaction::WALLS;
use gridfall_core::sim::setup::Problem;
use gridfall_engine::explicit::cpu::CpuEngine;
use gridfall_engine::{Engine, NoControl};
use gridfall_scene::{self as scene, Limits, assets::LocalFiles};

const WATER: &str = r#"{ "model": "weakly-compressible-fluid", "density": 1000, "bulk_modulus": 1e5, "viscosity": 1 }"#;
const SOLID: &str = r#"{ "model": "neo-hookean", "density": 1000, "youngs_modulus": 1e5, "poissons_ratio": 0.3 }"#;

fn problem(json: &str, folder: &Path) -> Problem {
    let scene = scene::parse(json).unwrap_or_else(|faults| panic!("{faults:#?}"));
    let files = LocalFiles { folder: folder.to_owned() };
    scene::problem_with(&scene, &Limits::default(), &files).unwrap_or_else(|faults| panic!("{faults:#?}"))
}

/// Sheets: a square, a valley of 90° along y, and a floor with a wall along y.
fn folder() -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| std::fs::write(dir.path().join(name), text).unwrap();
    write("square.obj", "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nf 1 2 3 4\n");
    write("valley.obj", "v -1 -1 1\nv 0 -1 0\nv 1 -1 1\nv -1 1 1\nv 0 1 0\nv 1 1 1\nf 1 2 5 4\nf 2 3 6 5\n");
    let tray = "v -1 -1 0\nv 0 -1 0\nv 1 -1 0\nv -1 1 0\nv 0 1 0\nv 1 1 0\nv 0 -1 1\nv 0 1 1\n\
        f 1 2 5 4\nf 2 3 6 5\nf 2 7 8 5\n";
    write("tray.obj", tray);
    dir
}

/// Blocks on both sides that are thrown at the sheet.
#[test]
fn nothing_gets_through_from_either_side() {
    let dir = folder();
    let cases = [
        ("compact", WATER, 0, 0.0, 0.5),
        ("compact", WATER, 12, 20.0, 0.52),
        ("quadratic", WATER, 30, 0.0, 0.45),
        ("compact", WATER, 30, 33.0, 0.5),
        ("quadratic", SOLID, 0, 20.0, 0.475),
        ("compact", SOLID, 12, 0.0, 0.53),
        ("quadratic", SOLID, 30, 20.0, 0.51),
        ("compact", SOLID, 30, 0.0, 0.5),
    ];
    for (kernel, material, speed, tilt, level) in cases {
        // Turned in the file, so that the lattice of its distances is not along it.
        let (s, c) = f64::to_radians(tilt).sin_cos();
        let n = [2.0 * s / 5f64.sqrt(), -s / 5f64.sqrt(), c];
        let rise = |x: f64, y: f64| -(x * n[0] + y * n[1]) / n[2];
        let corner = |x: f64, y: f64| format!("v {x} {y} {}\n", rise(x, y));
        let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(x, y)| corner(x, y)).concat();
        std::fs::write(dir.path().join("tilted.obj"), corners + "f 1 2 3 4\n").unwrap();
        let problem = problem(
            &format!(
                r#"{{ "gridfall": 1, "name": "sheet",
                "domain": {{ "min": [0, 0, 0], "max": [1, 1, 1], "dx": 0.1 }},
                "gravity": [0, 0, -9.81], "materials": {{ "m": {material} }},
                "bodies": [
                    {{ "name": "above", "material": "m", "velocity": [2, 1, -{speed}],
                        "shape": {{ "box": {{ "min": [0.3, 0.3, 0.65], "max": [0.6, 0.6, 0.9] }} }} }},
                    {{ "name": "below", "material": "m", "velocity": [-1, 2, {speed}],
                        "shape": {{ "box": {{ "min": [0.4, 0.4, 0.1], "max": [0.7, 0.7, 0.35] }} }} }} ],
                "colliders": [ {{ "name": "sheet", "contact": "separate", "friction": 0.2,
                    "shape": {{ "translate": {{ "offset": [0.5, 0.5, {level}], "shape": {{
                        "mesh": {{ "file": "tilted.obj", "fill": "sheet" }} }} }} }} }} ],
                "time": {{ "end": 0.4, "frame_rate": 10 }},
                "solver": {{ "kernel": "{kernel}", "integrator": "explicit" }} }}"#
            ),
            dir.path(),
        );
        let height = |x: &[f64; 3]| (x[0] - 0.5) * n[0] + (x[1] - 0.5) * n[1] + (x[2] - level) * n[2];
        let begun: Vec<f64> = problem.particles.x.iter().map(height).collect();
        let sheet = problem.setup.colliders[0].at(0.0);
        let off = problem.particles.x.iter().filter(|x| height(x).abs() < 0.08);
        let off = off.map(|x| (sheet.distance(*x) - height(x).abs()).abs()).fold(0.0, f64::max);
        println!("{tilt}°: distances off by {:.1e} cells", off / 0.1);
        assert!(off < 1e-6, "{off}");
        let mut engine = CpuEngine::new(&problem.setup, problem.particles.clone()).unwrap();
        for frame in 0..4 {
            engine.advance_frame(problem.setup.frame_s, &NoControl).unwrap();
            let now = engine.snapshot().unwrap();
            let sides = now.x.iter().zip(&begun).map(|(x, begun)| height(x) * begun.signum());
            let least = sides.fold(f64::MAX, f64::min);
            println!("{kernel} {speed} m/s, {tilt}°, frame {frame}: {:.5} cells from the sheet", least / 0.1);
            assert!(least > 0.0, "{kernel} {speed} m/s, {tilt}°: {least}");
        }
    }
}

/// A paddle that turns and rises through water takes along what is before it and leaves what is behind.
#[test]
fn a_sheet_that_moves_lets_nothing_through() {
    let dir = folder();
    for (kernel, material, rise, turn) in [("compact", WATER, 0, 8.0), ("quadratic", SOLID, 5, 3.0)] {
        let problem = problem(
            &format!(
                r#"{{ "gridfall": 1, "name": "paddle",
                "domain": {{ "min": [0, 0, 0], "max": [1, 1, 1], "dx": 0.1 }},
                "gravity": [0, 0, -9.81], "materials": {{ "m": {material} }},
                "bodies": [ {{ "name": "b", "material": "m",
                    "shape": {{ "box": {{ "min": [0.2, 0.2, 0.2], "max": [0.8, 0.8, 0.4] }} }} }} ],
                "colliders": [ {{ "name": "paddle", "contact": "separate",
                    "shape": {{ "translate": {{ "offset": [0.5, 0.5, 0.13], "shape": {{
                        "mesh": {{ "file": "square.obj", "fill": "sheet" }} }} }} }},
                    "motion": {{ "center": [0.5, 0.5, 0.13], "linear_velocity": [0, 0, {rise}],
                        "angular_velocity": [0, {turn}, 0] }} }} ],
                "time": {{ "end": 0.1, "frame_rate": 100 }},
                "solver": {{ "kernel": "{kernel}", "integrator": "explicit" }} }}"#
            ),
            dir.path(),
        );
        let mut engine = CpuEngine::new(&problem.setup, problem.particles.clone()).unwrap();
        for frame in 1..=10 {
            engine.advance_frame(problem.setup.frame_s, &NoControl).unwrap();
            let pose = problem.setup.colliders[0].motion.pose(f64::from(frame) * problem.setup.frame_s);
            let least =
                engine.snapshot().unwrap().x.iter().map(|x| pose.to_start(*x)[2] - 0.13).fold(f64::MAX, f64::min);
            println!("{kernel}, frame {frame}: {:.4} cells before the paddle", least / 0.1);
            assert!(least > 0.0, "{kernel}, frame {frame}: {least}");
        }
    }
}

/// What slides down one side of a valley does not slide through the other.
#[test]
fn a_fold_lets_nothing_through() {
    let dir = folder();
    for (kernel, material, speed) in [("compact", WATER, 20), ("quadratic", SOLID, 12), ("quadratic", WATER, 0)] {
        for turn in [0, 40] {
            let problem = problem(
                &format!(
                    r#"{{ "gridfall": 1, "name": "valley",
                    "domain": {{ "min": [0, 0, 0], "max": [1, 1, 1], "dx": 0.1 }},
                    "gravity": [0, 0, -9.81], "materials": {{ "m": {material} }},
                    "bodies": [ {{ "name": "b", "material": "m", "velocity": [{speed}, 0, -{speed}],
                            "shape": {{ "box": {{ "min": [0.25, 0.3, 0.65], "max": [0.6, 0.7, 0.9] }} }} }} ],
                    "colliders": [ {{ "name": "valley", "contact": "separate",
                        "shape": {{ "translate": {{ "offset": [0.47, 0.5, 0.22], "shape": {{ "rotate": {{
                            "axis": [0, 0, 1], "angle_degrees": {turn}, "shape": {{
                                "mesh": {{ "file": "valley.obj", "fill": "sheet" }} }} }} }} }} }} }} ],
                    "time": {{ "end": 0.5, "frame_rate": 10 }},
                    "solver": {{ "kernel": "{kernel}", "integrator": "explicit" }} }}"#
                ),
                dir.path(),
            );
            let (s, c) = f64::to_radians(f64::from(turn)).sin_cos();
            let height = |x: &[f64; 3]| (x[2] - 0.22 - ((x[0] - 0.47) * c + (x[1] - 0.5) * s).abs()) / 2f64.sqrt();
            assert!(problem.particles.x.iter().all(|x| height(x) > 0.0));
            let mut engine = CpuEngine::new(&problem.setup, problem.particles.clone()).unwrap();
            (0..5).for_each(|_| drop(engine.advance_frame(problem.setup.frame_s, &NoControl).unwrap()));
            let least = engine.snapshot().unwrap().x.iter().map(height).fold(f64::MAX, f64::min);
            println!("{kernel} {speed} m/s, turned by {turn}°: {:.4} cells from the valley", least / 0.1);
            // Its bottom is rounded by a share of half a cell.
            assert!(least > -0.02, "{kernel} {speed} m/s, {turn}°: {least}");
        }
    }
}

/// Nor does what falls into the corner of a floor and a wall on it, where three pieces meet.
#[test]
fn a_wall_on_a_floor_lets_nothing_through() {
    let dir = folder();
    for (kernel, material) in [("compact", WATER), ("quadratic", SOLID)] {
        let problem = problem(
            &format!(
                r#"{{ "gridfall": 1, "name": "tray",
                "domain": {{ "min": [0, 0, 0], "max": [1, 1, 1], "dx": 0.1 }},
                "gravity": [0, 0, -9.81], "materials": {{ "m": {material} }},
                "bodies": [ {{ "name": "b", "material": "m", "velocity": [15, 3, -15],
                        "shape": {{ "box": {{ "min": [0.1, 0.3, 0.5], "max": [0.45, 0.7, 0.8] }} }} }} ],
                "colliders": [ {{ "name": "tray", "contact": "separate",
                    "shape": {{ "translate": {{ "offset": [0.63, 0.5, 0.27],
                        "shape": {{ "mesh": {{ "file": "tray.obj", "fill": "sheet" }} }} }} }} }} ],
                "time": {{ "end": 0.5, "frame_rate": 10 }},
                "solver": {{ "kernel": "{kernel}", "integrator": "explicit" }} }}"#
            ),
            dir.path(),
        );
        let mut engine = CpuEngine::new(&problem.setup, problem.particles.clone()).unwrap();
        (0..5).for_each(|_| drop(engine.advance_frame(problem.setup.frame_s, &NoControl).unwrap()));
        let now = engine.snapshot().unwrap();
        let least = now.x.iter().map(|x| (x[2] - 0.27).min(0.63 - x[0])).fold(f64::MAX, f64::min);
        println!("{kernel}: {:.4} cells from the tray", least / 0.1);
        assert!(least > 0.0, "{kernel}: {least}");
    }
}

/// Water and a solid weigh what they weigh on either side, wherever the sheet lies in its cells.
#[test]
fn a_sheet_bears_the_weight_on_either_side() {
    let dir = folder();
    let cases = [
        ("compact", WATER, 0.33, -1.0),
        ("compact", SOLID, 0.3, 1.0),
        ("quadratic", WATER, 0.36, 1.0),
        ("quadratic", SOLID, 0.35, -1.0),
    ];
    for (kernel, material, level, down) in cases {
        let (low, high) = if down < 0.0 { (level, level + 0.2) } else { (level - 0.2, level) };
        let problem = problem(
            &format!(
                r#"{{ "gridfall": 1, "name": "weight",
                "domain": {{ "min": [0, 0, 0], "max": [0.3, 0.3, 0.7], "dx": 0.05,
                    "boundary": {{ "x": {{ "contact": "slip" }}, "y": {{ "contact": "slip" }} }} }},
                "gravity": [0, 0, {}], "materials": {{ "m": {material} }},
                "bodies": [ {{ "name": "b", "material": "m",
                    "shape": {{ "box": {{ "min": [0, 0, {low}], "max": [0.3, 0.3, {high}] }} }} }} ],
                "colliders": [ {{ "name": "floor", "contact": "separate", "friction": 0.3,
                    "shape": {{ "translate": {{ "offset": [0.1, 0.2, {level}],
                        "shape": {{ "mesh": {{ "file": "square.obj", "fill": "sheet" }} }} }} }} }} ],
                "time": {{ "end": 2.4, "frame_rate": 5 }},
                "solver": {{ "kernel": "{kernel}", "integrator": "explicit" }} }}"#,
                9.81 * down
            ),
            dir.path(),
        );
        let mut engine = CpuEngine::new(&problem.setup, problem.particles.clone()).unwrap();
        let mut forces = Vec::new();
        for _ in 0..12 {
            let stats = engine.advance_frame(problem.setup.frame_s, &NoControl).unwrap();
            forces.push(stats.reactions[WALLS].force[2] * down);
        }
        let weight = problem.particles.len() as f64 * problem.setup.bodies[0].mass * 9.81;
        let mean = forces[4..].iter().sum::<f64>() / 8.0 / weight;
        println!("{kernel} at {level}, down {down}: {mean:.4} of the weight");
        assert!((mean - 1.0).abs() < 0.03, "{forces:?}, weight {weight}");
    }
}
