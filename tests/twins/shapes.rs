//! The GPU's signed distances and normals are the CPU's: every shape as a slippery collider in a
//! body with random velocities.

use std::collections::BTreeMap;

use gridfall_core::sim::setup::{Precision, Problem, Setup};
use gridfall_engine::explicit::cpu::stages;
use gridfall_engine::explicit::gpu::Staged;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use serde_json::{Value, json};

use crate::common;

const DT_S: f64 = 1e-4;

/// Every primitive and operation, turned so that no axis is special.
fn shapes() -> Vec<(&'static str, Value)> {
    let ball = json!({ "sphere": { "center": [0.1, 0, 0], "radius": 0.3 } });
    let block = json!({ "box": { "min": [-0.2, -0.3, -0.1], "max": [0.3, 0.2, 0.25] } });
    vec![
        ("box", block.clone()),
        ("sphere", ball.clone()),
        (
            "cylinder",
            json!({ "cylinder": { "center": [0, 0, 0.05], "axis": [1, 2, 3], "radius": 0.2, "height": 0.5 } }),
        ),
        ("capsule", json!({ "capsule": { "center": [0, 0, 0], "axis": [2, -1, 1], "radius": 0.15, "height": 0.3 } })),
        ("cone", json!({ "cone": { "base": [0.1, -0.1, -0.3], "axis": [-1, 1, 3], "radius": 0.3, "height": 0.6 } })),
        (
            "truncated cone",
            json!({ "cone": { "base": [0, 0, -0.2], "axis": [1, 1, 3], "radius": 0.1, "top_radius": 0.3,
                "height": 0.5 } }),
        ),
        (
            "torus",
            json!({ "torus": { "center": [0, 0, 0], "axis": [1, 2, 2], "major_radius": 0.3, "minor_radius": 0.1 } }),
        ),
        ("half-space", json!({ "half-space": { "point": [0.1, 0, 0], "normal": [1, 2, 3] } })),
        (
            "heightfield",
            json!({ "heightfield": { "min": [-0.4, -0.3], "max": [0.3, 0.4], "base": -0.25,
                                     "heights": [[0.1, 0.3, -0.1], [0.2, 0.0, 0.1], [-0.2, 0.1, 0.3]] } }),
        ),
        (
            "scaled heightfield",
            json!({ "scale": { "factor": 0.7, "shape": { "heightfield": {
                "min": [-0.4, -0.3], "max": [0.3, 0.4], "base": -0.25, "heights": [[0.1, 0.3], [0.2, 0.0]] } } } }),
        ),
        ("union", json!({ "union": [ball, block] })),
        ("intersection", json!({ "intersection": [ball, block] })),
        ("difference", json!({ "difference": [ball, block] })),
        ("shell", json!({ "shell": { "thickness": 0.12, "shape": block } })),
        ("scale", json!({ "scale": { "factor": 1.5, "center": [0.1, 0.2, 0.3], "shape": block } })),
    ]
}

/// A block of jelly that fills the domain, with one collider.
fn problem(shape: &Value) -> Problem {
    let turned = json!({ "translate": { "offset": [0.1, 0.7, 0.5], "shape": {
        "rotate": { "axis": [3, -1, 2], "angle_degrees": 50, "shape": shape } } } });
    common::problem(
        &json!({
            "gridfall": 1, "name": "shapes",
            "domain": { "min": [-0.4, 0.2, 0], "max": [0.6, 1.2, 1], "dx": 0.0625 },
            "materials": { "m": { "model": "neo-hookean", "density": 1000, "youngs_modulus": 1,
                "poissons_ratio": 0.3 } },
            "bodies": [ { "name": "b", "material": "m", "sampling": "jittered",
                          "shape": { "box": { "min": [-0.4, 0.2, 0], "max": [0.6, 1.2, 1] } } } ],
            "solver": { "contact": "nodes" },
            "colliders": [ { "name": "c", "contact": "slip", "shape": turned,
                             "motion": { "center": [0.1, 0.7, 0.5], "linear_velocity": [0.1, 0.2, -0.3],
                                 "angular_velocity": [1, -1, 2] } } ],
            "time": { "end": 1 },
        })
        .to_string(),
    )
}

/// By grid and node: mass and velocity after the grid update.
type Nodes = BTreeMap<(i32, [i32; 3]), (f64, [f64; 3])>;

fn on_gpu(problem: &Problem) -> Nodes {
    let mut engine = common::gpu_engine(problem);
    let (mut gpu, _) = Staged::p2g(&mut engine, DT_S).unwrap();
    gpu.grid_update().unwrap().iter().map(|n| ((n.grid, n.node), (n.mass, n.value))).collect()
}

fn on_cpu(problem: &Problem) -> Nodes {
    let setup = Setup { precision: Precision::F64, ..problem.setup.clone() };
    let mut cpu = stages(&setup, problem.particles.clone());
    cpu.start_frame();
    cpu.p2g(DT_S);
    cpu.grid_update(DT_S, 0.0, DT_S);
    cpu.nodes().into_iter().map(|n| (([1, -1][n.grid], n.index), (n.mass, n.velocity))).collect()
}

/// Number of nodes of some mass whose velocities differ by more than 1e-3 m/s.
fn differing(a: &Nodes, b: &Nodes, full: f64) -> usize {
    let heavy = a.iter().filter(|(_, (mass, _))| *mass > 0.1 * full);
    let differs = heavy.filter(|(key, (_, v))| {
        let w = b.get(key).map_or([f64::NAN; 3], |(_, w)| *w);
        !(0..3).all(|k| (v[k] - w[k]).abs() < 1e-3)
    });
    differs.count()
}

#[test]
fn every_shape_acts_the_same_on_gpu_and_cpu() {
    let mut bare = problem(&shapes()[0].1);
    for (seed, (name, shape)) in shapes().into_iter().enumerate() {
        let mut problem = problem(&shape);
        common::randomise(&mut problem, &mut ChaCha8Rng::seed_from_u64(seed as u64));
        bare.particles = problem.particles.clone();
        bare.setup.colliders.clear();
        let full = 1000.0 * problem.setup.dx.powi(3);
        let (gpu, cpu, free) = (on_gpu(&problem), on_cpu(&problem), on_cpu(&bare));
        let (wrong, held) = (differing(&gpu, &cpu, full), differing(&cpu, &free, full));
        println!("{name}, seed {seed}: {held} nodes of {} held, {wrong} differ", cpu.len());
        assert!(held > 100, "{name} holds only {held} nodes");
        // On a surface or where two faces meet, rounding decides for a node.
        assert!(wrong <= 2, "{name}: {wrong} nodes differ");
    }
}
