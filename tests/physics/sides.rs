//! What lies on one side of a thin plate does not move with what lies on the other.

use crate::prescribed::problem;
use gridfall_core::sim::particles::Particles;
use gridfall_core::sim::reaction::WALLS;
use gridfall_engine::explicit::cpu::CpuEngine;
use gridfall_engine::{Engine, NoControl};

const WATER: &str = r#"{ "model": "weakly-compressible-fluid", "density": 1000, "bulk_modulus": 1e5 }"#;
const SOLID: &str = r#"{ "model": "neo-hookean", "density": 1000, "youngs_modulus": 1e5, "poissons_ratio": 0.3 }"#;

/// Momentum (kg m/s per metre) along `a` of all particles of a body over its mass.
fn speed(p: &Particles, body: u32, a: usize) -> f64 {
    let of_body: Vec<f64> = (0..p.len()).filter(|&i| p.body[i] == body).map(|i| p.v[i][a]).collect();
    of_body.iter().sum::<f64>() / of_body.len() as f64
}

/// A layer slides without friction on a plate, under which another lies still.
#[test]
fn what_slides_on_a_plate_does_not_drag_what_lies_under_it() {
    for (kernel, material) in [("compact", WATER), ("compact", SOLID), ("quadratic", WATER), ("cubic", SOLID)] {
        for (offset, thickness) in [(0.3, 0.02), (0.55, 0.2), (0.8, 1.5)] {
            let (top, bottom) = (0.4 + offset * 0.05, 0.4 + (offset - thickness) * 0.05);
            let problem = problem(&format!(
                r#"{{ "gridfall": 1, "name": "plate", "dimension": 2, "gravity": [0, -9.81],
                "domain": {{ "min": [0, 0], "max": [0.4, 0.9], "dx": 0.05,
                    "boundary": {{ "x": "periodic", "y-": {{ "contact": "slip" }} }} }},
                "materials": {{ "m": {material} }},
                "bodies": [
                    {{ "name": "above", "material": "m", "velocity": [1, 0],
                        "shape": {{ "box": {{ "min": [0, {top}], "max": [0.4, {}] }} }} }},
                    {{ "name": "below", "material": "m",
                        "shape": {{ "box": {{ "min": [0, 0], "max": [0.4, {}] }} }} }} ],
                "colliders": [ {{ "name": "plate", "contact": "separate", "friction": 0,
                    "shape": {{ "box": {{ "min": [-1, {bottom}], "max": [2, {top}] }} }} }} ],
                "time": {{ "end": 1, "frame_rate": 20 }},
                "solver": {{ "kernel": "{kernel}", "integrator": "explicit" }} }}"#,
                top + 0.3,
                bottom - 0.025
            ));
            let mut engine = CpuEngine::new(&problem.setup, problem.particles.clone()).unwrap();
            let mut weight = 0.0;
            for _ in 0..20 {
                let stats = engine.advance_frame(problem.setup.frame_s, &NoControl).unwrap();
                weight += stats.reactions[WALLS].force[1] / 20.0;
            }
            let after = engine.snapshot().unwrap();
            let [above, below] = [0, 1].map(|body| speed(&after, body, 0));
            let ratio = -weight / (0.3 * 0.4 * 1000.0 * 9.81);
            println!(
                "{kernel}, {thickness} dx at {offset}: above {above:.4} m/s, below {below:.1e}, weight {ratio:.3}"
            );
            assert!((above - 1.0).abs() < 1e-3 && below.abs() < 1e-3, "{kernel} {offset}: {above} {below}");
            assert!((ratio - 1.0).abs() < 0.03, "{kernel} {offset}: {ratio}");
        }
    }
}
