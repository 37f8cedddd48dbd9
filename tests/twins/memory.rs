//! Device memory: what the estimate says before anything is allocated is what a run takes, and the size of the domain
//! costs nothing.

use gridfall_core::sim::setup::Problem;
use gridfall_engine::{Engine, NoControl};
use gridfall_scene::estimate::estimate;

use crate::common;

/// A body of some cells in a domain of others.
fn scene(domain: [u32; 3], body: [u32; 3], material: &str, more: &str) -> Problem {
    let dx = 0.01;
    let metres = |cells: [u32; 3]| cells.map(|n| f64::from(n) * dx);
    let max = std::array::from_fn(|a| 4 + body[a]);
    common::problem(&format!(
        r#"{{ "gridfall": 1, "name": "memory",
        "domain": {{ "min": [0, 0, 0], "max": {:?}, "dx": {dx} }},
        "materials": {{ "matter": {{ "density": 1000, {material} }} }},
        "bodies": [ {{ "name": "body", "material": "matter",
            "shape": {{ "box": {{ "min": {:?}, "max": {:?} }} }} }} ],
        "time": {{ "end": 1e-4, "frame_rate": 1e4 }} {more} }}"#,
        metres(domain),
        metres([4; 3]),
        metres(max),
    ))
}

const FLUID: &str = r#""model": "weakly-compressible-fluid", "bulk_modulus": 1e5"#;
const JELLY: &str = r#""model": "fixed-corotated", "youngs_modulus": 1e5, "poissons_ratio": 0.3"#;
const SAND: &str =
    r#""model": "drucker-prager", "youngs_modulus": 1e6, "poissons_ratio": 0.3, "friction_angle_degrees": 35"#;

#[test]
fn estimates_are_what_runs_take() {
    let quadratic = r#", "solver": { "kernel": "quadratic" }"#;
    let post = r#", "colliders": [ { "name": "post", "contact": "slip",
        "shape": { "sphere": { "center": [0.4, 0.4, 0.4], "radius": 0.05 } } } ]"#;
    let cases = [
        ("fluid", scene([48; 3], [13; 3], FLUID, "")),
        ("fluid, quadratic", scene([48; 3], [16, 9, 20], FLUID, quadratic)),
        ("jelly", scene([48; 3], [13; 3], JELLY, "")),
        ("jelly and a post", scene([48; 3], [15; 3], JELLY, post)),
        ("sand in a thin layer", scene([96, 96, 16], [60, 60, 1], SAND, "")),
    ];
    for (name, problem) in cases {
        let said = estimate(&problem).device_memory_bytes.expect("a GPU can run it") as f64;
        let taken = common::gpu_engine(&problem).device_bytes() as f64;
        println!("{name}: {:.3} MB said, {:.3} MB taken", said / 1e6, taken / 1e6);
        assert!((said / taken - 1.0).abs() < 0.05, "{name}");
    }
}

#[test]
fn a_large_domain_costs_nothing() {
    let problem = scene([2048, 1024, 1024], [9; 3], JELLY, "");
    let mut engine = common::gpu_engine(&problem);
    println!("{:.1} MB", engine.device_bytes() as f64 / 1e6);
    assert!(engine.device_bytes() < 64 << 20);
    engine.advance_frame(problem.setup.frame_s, &NoControl).expect("a frame runs");
}
