//! Bodies with `"sampling": "conforming"`: numbers, masses, walls, meshes and faults.

use std::path::Path;

use gridfall_core::sim::setup::Problem;
use gridfall_scene::assets::LocalFiles;
use gridfall_scene::{self as scene, Fault, Limits, estimate};
use serde_json::{Value, json};

const DX: f64 = 0.0625;

fn scene(dimension: usize, shape: Value) -> Value {
    json!({
        "gridfall": 1, "name": "layers", "dimension": dimension,
        "domain": { "min": vec![0; dimension], "max": vec![2; dimension], "dx": DX },
        "materials": { "m": { "model": "neo-hookean", "density": 2, "youngs_modulus": 1, "poissons_ratio": 0.3 } },
        "bodies": [ { "name": "b", "material": "m", "sampling": "conforming", "shape": shape } ],
        "time": { "end": 1 },
    })
}

fn judge(document: &Value, folder: &Path) -> Result<Problem, Vec<Fault>> {
    let files = LocalFiles { folder: folder.to_owned() };
    scene::problem_with(&scene::from_value(document)?, &Limits::default(), &files)
}

fn made(document: &Value) -> Problem {
    judge(document, Path::new("")).unwrap_or_else(|faults| panic!("{faults:#?}"))
}

fn codes(document: &Value, folder: &Path) -> Vec<(String, &'static str)> {
    judge(document, folder).unwrap_err().into_iter().map(|fault| (fault.pointer, fault.code)).collect()
}

#[test]
fn any_number_of_particles_per_cell_is_kept_and_the_estimate_knows_it() {
    for (dimension, shape, volume) in [
        (2, json!({ "sphere": { "center": [1, 1], "radius": 0.7 } }), std::f64::consts::PI * 0.49),
        (3, json!({ "cylinder": { "center": [1, 1, 1], "radius": 0.5, "height": 1 } }), std::f64::consts::PI * 0.25),
    ] {
        for per_cell in [1, 4, 5, 8, 12] {
            let mut document = scene(dimension, shape.clone());
            document["bodies"][0]["particles_per_cell"] = json!(per_cell);
            let problem = made(&document);
            let (count, body) = (problem.particles.len(), &problem.setup.bodies[0]);
            let expected = f64::from(per_cell) * volume / DX.powi(dimension as i32);
            assert!((count as f64 - expected).abs() < 0.5 + 1e-3 * expected, "{count} particles, {expected} expected");
            assert_eq!(estimate::estimate(&problem).particles, count as u64);
            let mass = count as f64 * body.mass;
            assert!((mass / (2.0 * volume) - 1.0).abs() < 1e-3, "{mass} kg, {} expected", 2.0 * volume);
            // What a particle stands for is what its spacing says.
            let share = DX.powi(dimension as i32) / f64::from(per_cell);
            assert!((body.volume0 / share - 1.0).abs() < 0.01, "{} m³ a particle, {share} expected", body.volume0);
        }
    }
}

#[test]
fn a_body_without_bounds_has_layers_along_the_walls_of_the_domain() {
    let mut document = scene(2, json!({ "half-space": { "point": [0, 0.53], "normal": [0, 1] } }));
    for boundary in [json!({}), json!({ "x": "periodic" })] {
        document["domain"]["boundary"] = boundary;
        let problem = made(&document);
        let h = 0.5 * DX;
        let x = &problem.particles.x;
        let depth = |x: &[f64; 3]| x[0].min(2.0 - x[0]).min(x[1]).min(0.53 - x[1]) / h;
        let first: Vec<f64> = x.iter().map(depth).filter(|d| *d < 0.9).collect();
        assert!(first.iter().all(|d| (d - 0.5).abs() < 0.01), "{first:?}");
        // All around, half a spacing from the walls and the surface.
        assert!(
            (first.len() as f64 - 2.0 * (2.0 - h + 0.53 - h) / h).abs() < 2.0,
            "{} in the first layer",
            first.len()
        );
        assert!((problem.setup.bodies[0].mass * x.len() as f64 / (2.0 * 2.0 * 0.53) - 1.0).abs() < 1e-3);
    }
}

#[test]
fn a_mesh_has_layers_below_its_sampled_surface() {
    // A box of triangles, turned: its faces lie anyhow on the grid.
    let corner = |k: usize| [0, 1, 2].map(|a| ([0.5, 0.6, 0.7][a] * (k >> a & 1) as f64).to_string()).join(" ");
    let vertices: String = (0..8).map(|k| format!("v {}\n", corner(k))).collect();
    let quads = ["1 3 4 2", "1 2 6 5", "2 4 8 6", "4 3 7 8", "3 1 5 7", "5 6 8 7"];
    let faces: String = quads.iter().map(|q| format!("f {q}\n")).collect();
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("box.obj"), vertices + &faces).unwrap();
    let turned = json!({ "rotate": { "axis": [1, 2, 3], "angle_degrees": 40, "center": [0.25, 0.3, 0.35],
                                     "shape": { "mesh": { "file": "box.obj" } } } });
    let mut document = scene(3, json!({ "translate": { "offset": [0.7, 0.7, 0.7], "shape": turned } }));
    // The shape is there as a collider too, whose distances are those that the body was filled by.
    document["colliders"] = json!([ { "name": "c", "contact": "slip", "shape": document["bodies"][0]["shape"] } ]);
    let problem = judge(&document, dir.path()).unwrap_or_else(|faults| panic!("{faults:#?}"));
    let (h, sdf) = (0.5 * DX, &problem.setup.colliders[0].sdf);
    let depths: Vec<f64> = problem.particles.x.iter().map(|x| -sdf.distance(*x) / h).collect();
    let first: Vec<&f64> = depths.iter().filter(|d| **d < 0.8).collect();
    let off = first.iter().filter(|d| (**d - 0.5).abs() > 0.01).count();
    println!("{} particles, {} in the first layer, {off} of them off it", depths.len(), first.len());
    assert!(first.len() > 1000 && off * 100 < first.len());
    let mass = problem.setup.bodies[0].mass * depths.len() as f64;
    assert!((mass / (2.0 * 0.21) - 1.0).abs() < 0.02, "{mass} kg");
}

#[test]
fn a_shape_without_room_for_a_layer_and_points_from_a_file_are_refused() {
    let sheet = json!({ "box": { "min": [0.5, 0.5, 0.5], "max": [1.5, 1.5, 0.52] } });
    assert_eq!(codes(&scene(3, sheet.clone()), Path::new("")), [("/bodies/0/shape".to_owned(), "too_thin")]);
    let mut finer = scene(3, sheet);
    finer["bodies"][0]["particles_per_cell"] = json!(64);
    made(&finer);

    let dir = tempfile::tempdir().unwrap();
    let rows = "ply\nformat ascii 1.0\nelement vertex 1\nproperty double x\nproperty double y\nproperty double z\n";
    std::fs::write(dir.path().join("points.ply"), format!("{rows}end_header\n1 1 1\n")).unwrap();
    let mut document = scene(3, json!(null));
    document["bodies"][0]["points"] = json!({ "file": "points.ply" });
    assert_eq!(codes(&document, dir.path()), [("/bodies/0/sampling".to_owned(), "needs_shape")]);
}
