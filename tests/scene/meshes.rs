//! Meshes and heightfields in scenes: files, fillings, sampled mass, and every fault of a file.

use std::path::Path;

use gridfall_core::sim::setup::Problem;
use gridfall_scene::assets::LocalFiles;
use gridfall_scene::{self as scene, Fault, Limits};
use serde_json::{Value, json};

/// An OBJ of the box from `min` to `max`, optionally without its top.
fn obj(min: [f64; 3], max: [f64; 3], open: bool) -> String {
    let corner = |k: usize| (0..3).map(|a| [min, max][k >> a & 1][a].to_string()).collect::<Vec<_>>().join(" ");
    let vertices: String = (0..8).map(|k| format!("v {}\n", corner(k))).collect();
    let quads = ["1 3 4 2", "1 2 6 5", "2 4 8 6", "4 3 7 8", "3 1 5 7", "5 6 8 7"];
    let faces: String = quads[..if open { 5 } else { 6 }].iter().map(|q| format!("f {q}\n")).collect();
    vertices + &faces
}

fn scene(shape: Value) -> Value {
    json!({
        "gridfall": 1, "name": "meshes", "domain": { "min": [-1, -1, -1], "max": [1, 1, 1], "dx": 0.0625 },
        "materials": { "m": { "model": "neo-hookean", "density": 2, "youngs_modulus": 1, "poissons_ratio": 0.3 } },
        "bodies": [ { "name": "b", "material": "m", "shape": shape } ],
        "time": { "end": 1 },
    })
}

fn judge(document: &Value, folder: &Path) -> Result<Problem, Vec<Fault>> {
    let files = LocalFiles { folder: folder.to_owned() };
    scene::problem_with(&scene::from_value(document)?, &Limits::default(), &files)
}

fn mass(problem: &Problem) -> f64 {
    problem.setup.bodies.iter().map(|b| b.mass * b.particles.len() as f64).sum()
}

#[test]
fn a_mesh_is_filled_placed_and_scaled() {
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("box.obj"), obj([0.0; 3], [1.0, 0.5, 0.25], false)).unwrap();
    std::fs::write(dir.path().join("open.obj"), obj([0.0; 3], [1.0, 0.5, 0.25], true)).unwrap();
    let mesh = json!({ "mesh": { "file": "box.obj" } });
    let turned = json!({ "rotate": { "axis": [1, 2, 3], "angle_degrees": 40, "shape": mesh } });
    for (name, shape, volume, tolerance) in [
        ("as it is", mesh.clone(), 0.125, 0.001),
        ("moved", json!({ "translate": { "offset": [-0.5, -0.5, -0.5], "shape": mesh } }), 0.125, 0.001),
        ("turned", turned, 0.125, 0.02),
        ("scaled", json!({ "scale": { "factor": 0.5, "center": [0.1, 0.2, 0.3], "shape": mesh } }), 0.015625, 0.03),
        ("shell", json!({ "shell": { "thickness": 0.0625, "shape": mesh } }), 0.125 - 0.875 * 0.375 * 0.125, 0.001),
        ("open", json!({ "mesh": { "file": "open.obj", "fill": "winding-number" } }), 0.125, 0.06),
    ] {
        let problem = judge(&scene(shape), dir.path()).unwrap_or_else(|faults| panic!("{name}: {faults:#?}"));
        let mass = mass(&problem);
        println!("{name}: {} particles, {mass} kg, {} expected", problem.particles.len(), 2.0 * volume);
        assert!((mass / (2.0 * volume) - 1.0).abs() < tolerance, "{name}: {mass} kg, {} expected", 2.0 * volume);
    }
}

#[test]
fn a_heightfield_is_filled_up_to_its_surface() {
    let heights: Vec<Vec<f64>> =
        (0..9).map(|j| (0..9).map(|i| -0.5 + 0.05 * f64::from(i) + 0.025 * f64::from(j)).collect()).collect();
    let hill = json!({ "heightfield": { "min": [-0.5, -0.5], "max": [0.5, 0.5], "base": -0.75, "heights": heights } });
    let problem = judge(&scene(hill), Path::new("")).unwrap();
    let expected = 2.0 * (0.25 + 0.2 + 0.1);
    assert!((mass(&problem) / expected - 1.0).abs() < 0.01, "{} kg, {expected} expected", mass(&problem));
    let surface = |x: [f64; 3]| -0.5 + 0.4 * (x[0] + 0.5) + 0.2 * (x[1] + 0.5);
    assert!(problem.particles.x.iter().all(|x| x[2] < surface(*x) + 1e-3), "a particle above the surface");

    let mut flat =
        scene(json!({ "heightfield": { "min": [-0.5], "max": [0.5], "base": -0.5, "heights": [[0.0, 0.5, 0.25]] } }));
    flat["dimension"] = json!(2);
    flat["domain"] = json!({ "min": [-1, -1], "max": [1, 1], "dx": 0.03125 });
    let problem = judge(&flat, Path::new("")).unwrap();
    let expected = 2.0 * (0.5 * 0.75 + 0.5 * 0.875);
    assert!((mass(&problem) / expected - 1.0).abs() < 0.01, "{} kg/m, {expected} expected", mass(&problem));
}

#[test]
fn a_mesh_may_grip_a_body() {
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("box.obj"), obj([0.0; 3], [0.5; 3], false)).unwrap();
    let mesh = json!({ "mesh": { "file": "box.obj" } });
    let mut document = scene(mesh.clone());
    document["bodies"][0]["grips"] = json!([{ "name": "hand", "shape": mesh }]);
    judge(&document, dir.path()).unwrap_or_else(|faults| panic!("{faults:#?}"));
    document["bodies"][0]["grips"][0]["shape"] = json!({ "mesh": { "file": "gone.obj" } });
    let faults = judge(&document, dir.path()).unwrap_err();
    assert_eq!((faults.len(), faults[0].pointer.as_str()), (1, "/bodies/0/grips/0/shape/mesh/file"));
}

#[test]
fn the_same_file_is_sampled_once() {
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("box.obj"), obj([0.0; 3], [0.5; 3], false)).unwrap();
    let mesh = json!({ "mesh": { "file": "box.obj" } });
    let mut document = scene(mesh.clone());
    let moved = json!({ "translate": { "offset": [-0.7, 0, 0], "shape": mesh } });
    for name in ["c", "d"] {
        let collider = json!({ "name": name, "shape": moved, "contact": "slip" });
        match &mut document["colliders"] {
            Value::Array(all) => all.push(collider),
            none => *none = json!([collider]),
        }
    }
    let problem = judge(&document, dir.path()).unwrap();
    let field = |n: usize| std::sync::Arc::as_ptr(problem.setup.colliders[n].sdf.fields().next().unwrap().0);
    assert_eq!(field(0), field(1));
}

#[test]
fn every_unusable_file_is_a_fault_that_says_what_to_do() {
    let dir = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| std::fs::write(dir.path().join(name), text).unwrap();
    write("box.obj", &obj([0.0; 3], [0.5; 3], false));
    write("open.obj", &obj([0.0; 3], [0.5; 3], true));
    write("long.obj", &obj([-500.0; 3], [500.0; 3], false));
    write("words.txt", "no mesh at all");
    let mesh = |fields: Value| json!({ "mesh": fields });
    let nowhere = format!("sha256:{}", "0".repeat(64));
    let cases = [
        (mesh(json!({ "file": "gone.obj" })), "mesh/file", "file_not_read", "gone.obj"),
        (mesh(json!({ "file": "words.txt" })), "mesh/file", "bad_mesh", "none of STL, OBJ, PLY and glTF"),
        (mesh(json!({ "asset": nowhere })), "mesh/asset", "asset_refused", "\"file\""),
        (mesh(json!({ "file": "open.obj" })), "mesh", "not_watertight", "4 of its 17 edges"),
        (mesh(json!({ "file": "open.obj" })), "mesh", "not_watertight", "\"fill\": \"winding-number\""),
        (mesh(json!({ "file": "long.obj" })), "mesh", "too_large", "raise dx"),
        (mesh(json!({})), "mesh", "not_one_source", "`asset`"),
        (mesh(json!({ "file": "box.obj", "asset": nowhere })), "mesh", "not_one_source", "`asset`"),
        (mesh(json!({ "file": "box.obj", "fill": "full" })), "mesh/fill", "unknown_value", "winding-number"),
    ];
    for (shape, at, code, part) in cases {
        // Alone, and deep inside another shape.
        for (shape, inside) in [
            (shape.clone(), ""),
            (json!({ "union": [{ "scale": { "factor": 1, "shape": shape } }] }), "/union/0/scale/shape"),
        ] {
            let faults = judge(&scene(shape), dir.path()).unwrap_err();
            assert_eq!(faults.len(), 1, "{faults:#?}");
            assert_eq!(
                (faults[0].pointer.as_str(), faults[0].code),
                (format!("/bodies/0/shape{inside}/{at}").as_str(), code)
            );
            assert!(faults[0].to_string().contains(part), "{}", faults[0]);
        }
    }
    // A bad file that is used twice is one fault; a scene that comes alone has no files.
    let bad = mesh(json!({ "file": "words.txt" }));
    assert_eq!(judge(&scene(json!({ "union": [bad, bad] })), dir.path()).unwrap_err().len(), 1);
    let alone =
        |fields| scene::problem(&scene::from_value(&scene(mesh(fields))).unwrap(), &Limits::default()).unwrap_err();
    assert_eq!(alone(json!({ "file": "box.obj" }))[0].code, "file_refused");
    assert_eq!(alone(json!({ "asset": nowhere }))[0].code, "unknown_asset");
    // Other faults are reported together with the mesh's.
    let mut two = scene(bad);
    two["materials"]["m"]["density"] = json!(-1);
    assert_eq!(judge(&two, dir.path()).unwrap_err().len(), 2);
    // A document with a fault of structure is judged without reading its files.
    two["solver"] = json!({ "kernel": 3 });
    let codes: Vec<&str> = judge(&two, dir.path()).unwrap_err().iter().map(|f| f.code).collect();
    assert_eq!(codes, ["wrong_type", "not_positive"]);
    let little = Limits { max_memory_bytes: 100 << 10, ..Limits::default() };
    let document = scene::from_value(&scene(mesh(json!({ "file": "box.obj" })))).unwrap();
    let files = LocalFiles { folder: dir.path().to_owned() };
    let roomy = Limits { max_memory_bytes: 1 << 30, ..little };
    assert!(scene::problem_with(&document, &roomy, &files).is_ok());
    let tight = Limits { max_memory_bytes: 30 << 10, ..little };
    assert_eq!(scene::problem_with(&document, &tight, &files).unwrap_err()[0].code, "too_much_memory");
}
