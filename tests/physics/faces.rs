//! Contact at the particles: faces are where they are, whatever the cells, and nothing passes through.

use crate::prescribed::problem;
use gridfall_core::sim::reaction::WALLS;
use gridfall_engine::explicit::cpu::CpuEngine;
use gridfall_engine::{Engine, NoControl};

const KERNELS: [&str; 2] = ["compact", "quadratic"];

/// A block of height `h` between a sticky floor and a sticky lid that moves at 0.05 m/s: neo-Hookean solids answer
/// simple shear γ with G γ.
#[test]
fn a_sheared_block_pulls_alike_at_any_place_of_the_lid() {
    for kernel in KERNELS {
        for offset in [0.0, 0.3, 0.5, 0.75] {
            let h = 0.5 + offset * 0.05;
            let problem = problem(&format!(
                r#"{{ "gridfall": 1, "name": "sheared", "dimension": 2,
                "domain": {{ "min": [0, 0], "max": [0.4, 0.8], "dx": 0.05, "boundary": {{ "x": "periodic" }} }},
                "materials": {{ "m": {{ "model": "neo-hookean", "density": 1000, "youngs_modulus": 1e6,
                    "poissons_ratio": 0.3 }} }},
                "bodies": [ {{ "name": "b", "material": "m",
                    "shape": {{ "box": {{ "min": [0, 0], "max": [0.4, {h}] }} }} }} ],
                "colliders": [ {{ "name": "lid", "contact": "sticky",
                    "shape": {{ "half-space": {{ "point": [0, {h}], "normal": [0, -1] }} }},
                    "motion": {{ "linear_velocity": [0.05, 0] }} }} ],
                "time": {{ "end": 1, "frame_rate": 20 }},
                "solver": {{ "kernel": "{kernel}", "integrator": "explicit" }} }}"#
            ));
            let mut engine = CpuEngine::new(&problem.setup, problem.particles.clone()).unwrap();
            let mut ratios = Vec::new();
            for frame in 0..16 {
                let stats = engine.advance_frame(problem.setup.frame_s, &NoControl).unwrap();
                let middle_s = (f64::from(frame) + 0.5) * problem.setup.frame_s;
                let right = 1e6 / 2.6 * (0.05 * middle_s / h) * 0.4;
                ratios.push(-stats.reactions[WALLS].force[0] / right);
            }
            // Over whole periods of the waves that the start has made.
            let ratio = ratios[8..].iter().sum::<f64>() / 8.0;
            println!("{kernel}, lid {offset} cells above a node: {ratio:.3}");
            assert!((ratio.abs() - 1.0).abs() < 0.05, "{kernel} {offset}: {ratios:?}");
        }
    }
}

/// Water, sand and a solid that fall fast on plates much thinner than a cell.
#[test]
fn thin_plates_let_nothing_through() {
    let materials = [
        r#"{ "model": "weakly-compressible-fluid", "density": 1000, "bulk_modulus": 1e5 }"#,
        r#"{ "model": "drucker-prager", "density": 1000, "youngs_modulus": 1e5, "poissons_ratio": 0.3,
            "friction_angle_degrees": 30 }"#,
        r#"{ "model": "neo-hookean", "density": 1000, "youngs_modulus": 1e5, "poissons_ratio": 0.3 }"#,
    ];
    for (kernel, material) in KERNELS.iter().flat_map(|k| materials.iter().map(move |m| (k, m))) {
        for (offset, contact, speed) in [(0.0, "slip", 0), (0.4, "separate", 20), (0.75, "sticky", 8)] {
            let top = 0.4 + offset * 0.05;
            let bottom = top - 0.0125;
            let problem = problem(&format!(
                r#"{{ "gridfall": 1, "name": "plate", "dimension": 2,
                "domain": {{ "min": [0, 0], "max": [0.8, 1], "dx": 0.05 }},
                "gravity": [0, -9.81], "materials": {{ "m": {material} }},
                "bodies": [ {{ "name": "b", "material": "m", "velocity": [0, -{speed}],
                    "shape": {{ "box": {{ "min": [0.2, 0.5], "max": [0.6, 0.8] }} }} }} ],
                "colliders": [ {{ "name": "plate", "contact": "{contact}",
                    "shape": {{ "box": {{ "min": [-0.1, {bottom}], "max": [0.9, {top}] }} }} }} ],
                "time": {{ "end": 0.4, "frame_rate": 10 }},
                "solver": {{ "kernel": "{kernel}", "integrator": "explicit" }} }}"#
            ));
            let mut engine = CpuEngine::new(&problem.setup, problem.particles.clone()).unwrap();
            (0..4).for_each(|_| drop(engine.advance_frame(problem.setup.frame_s, &NoControl).unwrap()));
            let lowest = engine.snapshot().unwrap().x.iter().map(|x| x[1]).fold(f64::MAX, f64::min);
            println!("{kernel} {contact} {speed} m/s: {:.4} cells above the plate", (lowest - top) / 0.05);
            assert!(lowest > top, "{kernel} {contact} {speed} m/s: {lowest} under {top}");
        }
    }
}

/// What holds on to a turning face goes around with it, and not outwards.
#[test]
fn what_sticks_to_a_turning_hub_stays_on_its_circle() {
    for kernel in KERNELS {
        let problem = problem(&format!(
            r#"{{ "gridfall": 1, "name": "hub", "dimension": 2,
            "domain": {{ "min": [0, 0], "max": [1, 1], "dx": 0.05 }},
            "materials": {{ "m": {{ "model": "neo-hookean", "density": 1000, "youngs_modulus": 1e5,
                "poissons_ratio": 0.3 }} }},
            "bodies": [ {{ "name": "disc", "material": "m",
                "shape": {{ "sphere": {{ "center": [0.5, 0.5], "radius": 0.3 }} }},
                "grips": [ {{ "name": "hub", "shape": {{ "sphere": {{ "center": [0.5, 0.5], "radius": 0.2 }} }},
                    "motion": {{ "center": [0.5, 0.5], "angular_velocity": [6.283185307179586] }} }} ] }} ],
            "time": {{ "end": 2, "frame_rate": 10 }},
            "solver": {{ "kernel": "{kernel}", "integrator": "explicit" }} }}"#
        ));
        let radius = |x: &[f64; 3]| (x[0] - 0.5).hypot(x[1] - 0.5);
        let held: Vec<usize> =
            (0..problem.particles.len()).filter(|&i| radius(&problem.particles.x[i]) < 0.1).collect();
        let mut engine = CpuEngine::new(&problem.setup, problem.particles.clone()).unwrap();
        (0..20).for_each(|_| drop(engine.advance_frame(problem.setup.frame_s, &NoControl).unwrap()));
        let now = engine.snapshot().unwrap();
        let worst = held.iter().map(|&i| (radius(&now.x[i]) / radius(&problem.particles.x[i]) - 1.0).abs());
        let worst = worst.fold(0.0, f64::max);
        println!("{kernel}: {} particles, radii off by {worst:.1e} after two turns", held.len());
        assert!(held.len() > 20 && worst < 1e-4, "{worst}");
    }
}

/// A block and water at rest on a face between nodes weigh what they weigh.
#[test]
fn a_face_between_nodes_bears_the_weight() {
    let materials = [
        r#"{ "model": "weakly-compressible-fluid", "density": 1000, "bulk_modulus": 1e5, "viscosity": 1 }"#,
        r#"{ "model": "neo-hookean", "density": 1000, "youngs_modulus": 1e5, "poissons_ratio": 0.3 }"#,
    ];
    for (kernel, material) in KERNELS.iter().flat_map(|k| materials.iter().map(move |m| (k, m))) {
        let problem = problem(&format!(
            r#"{{ "gridfall": 1, "name": "weight", "dimension": 2,
            "domain": {{ "min": [0, 0], "max": [0.4, 0.8], "dx": 0.05,
                "boundary": {{ "x": {{ "contact": "slip" }} }} }},
            "gravity": [0, -9.81], "materials": {{ "m": {material} }},
            "bodies": [ {{ "name": "b", "material": "m",
                "shape": {{ "box": {{ "min": [0, 0.18], "max": [0.4, 0.48] }} }} }} ],
            "colliders": [ {{ "name": "floor", "contact": "separate", "friction": 0.3,
                "shape": {{ "half-space": {{ "point": [0, 0.18], "normal": [0, 1] }} }} }} ],
            "time": {{ "end": 4, "frame_rate": 4 }},
            "solver": {{ "kernel": "{kernel}", "integrator": "explicit" }} }}"#
        ));
        let mut engine = CpuEngine::new(&problem.setup, problem.particles.clone()).unwrap();
        let mut forces = Vec::new();
        for _ in 0..16 {
            let stats = engine.advance_frame(problem.setup.frame_s, &NoControl).unwrap();
            forces.push(-stats.reactions[WALLS].force[1]);
        }
        let weight = problem.particles.len() as f64 * problem.setup.bodies[0].mass * 9.81;
        let mean = forces[4..].iter().sum::<f64>() / 12.0 / weight;
        println!("{kernel}: {mean:.4} of the weight");
        assert!((mean.abs() - 1.0).abs() < 0.03, "{forces:?}, weight {weight}");
    }
}
