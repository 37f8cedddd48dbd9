//! Particles from files: what a body takes from them, and every fault of a file.

use std::path::Path;

use gridfall_core::sim::setup::Problem;
use gridfall_scene::assets::LocalFiles;
use gridfall_scene::{self as scene, Fault, Limits};
use serde_json::{Value, json};

/// A PLY of points, with velocities if a row has six numbers.
fn ply(rows: &[&[f64]]) -> String {
    let names = ["x", "y", "z", "vx", "vy", "vz"];
    let properties: String = names[..rows[0].len()].iter().map(|n| format!("property double {n}\n")).collect();
    let line = |row: &&[f64]| row.iter().map(f64::to_string).collect::<Vec<_>>().join(" ") + "\n";
    let rows_text: String = rows.iter().map(line).collect();
    format!("ply\nformat ascii 1.0\nelement vertex {}\n{properties}end_header\n{rows_text}", rows.len())
}

fn scene() -> Value {
    json!({
        "gridfall": 1, "name": "points", "domain": { "min": [0, 0, 0], "max": [1, 1, 1], "dx": 0.125 },
        "materials": { "m": { "model": "neo-hookean", "density": 2, "youngs_modulus": 1, "poissons_ratio": 0.3 } },
        "bodies": [ { "name": "b", "material": "m", "points": { "file": "points.ply" } } ],
        "time": { "end": 1 },
    })
}

fn judge(document: &Value, folder: &Path) -> Result<Problem, Vec<Fault>> {
    let files = LocalFiles { folder: folder.to_owned() };
    scene::problem_with(&scene::from_value(document)?, &Limits::default(), &files)
}

#[test]
fn a_body_has_the_points_of_its_file() {
    let dir = tempfile::tempdir().unwrap();
    let rows: [&[f64]; 2] = [&[0.25, 0.5, 0.75, 1.0, 2.0, 3.0], &[0.75, 0.5, 0.25, -1.0, 0.0, 0.0]];
    std::fs::write(dir.path().join("points.ply"), ply(&rows)).unwrap();
    let mut document = scene();
    document["bodies"][0]["velocity"] = json!([0, 0, 10]);
    document["bodies"][0]["angular_velocity"] = json!([0, 0, 2]);
    document["bodies"][0]["particles_per_cell"] = json!(5);
    document["bodies"][0]["J"] = json!(0.512);
    let problem = judge(&document, dir.path()).unwrap_or_else(|faults| panic!("{faults:#?}"));
    let p = &problem.particles;
    assert_eq!(p.x, [[0.25, 0.5, 0.75], [0.75, 0.5, 0.25]]);
    // The file's velocity, the body's, and the spin about the middle of the points.
    assert_eq!(p.v, [[1.0, 2.0 - 0.5, 13.0], [-1.0, 0.5, 10.0]]);
    assert!((p.f[1][0] - 0.8).abs() < 1e-12);
    let volume = 0.125f64.powi(3) / 5.0;
    assert!((problem.setup.bodies[0].volume0 / volume - 1.0).abs() < 1e-12);
    assert!((problem.setup.bodies[0].mass / (2.0 * volume) - 1.0).abs() < 1e-12);
}

#[test]
fn every_fault_of_points_is_found() {
    let dir = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| std::fs::write(dir.path().join(name), text).unwrap();
    write("points.ply", &ply(&[&[0.5; 3]]));
    write("far.ply", &ply(&[&[0.5; 3], &[1.5, 0.5, 0.5], &[0.5, -0.1, 0.5]]));
    write("nan.ply", &ply(&[&[0.5, f64::NAN, 0.5]]));
    write("words.txt", "1 2 3");
    let ball = json!({ "sphere": { "center": [0.5, 0.5, 0.5], "radius": 0.2 } });
    for (points, shape, at, code, part) in [
        (json!({ "file": "far.ply" }), Value::Null, "points", "outside_domain", "2 of 3 points"),
        (json!({ "file": "nan.ply" }), Value::Null, "points/file", "bad_points", "the PLY is broken: Line 8"),
        (json!({ "file": "words.txt" }), Value::Null, "points/file", "bad_points", "neither PLY nor npz"),
        (json!({ "file": "gone.npz" }), Value::Null, "points/file", "file_not_read", "gone.npz"),
        (json!({ "asset": "sha256:0" }), Value::Null, "points/asset", "asset_refused", "\"file\""),
        (json!({}), Value::Null, "points", "not_one_source", "`asset`"),
        (json!({ "file": "points.ply" }), ball, "shape", "not_one_source", "beside `points`"),
        (Value::Null, Value::Null, "shape", "not_one_source", "neither `shape` nor `points`"),
    ] {
        let mut document = scene();
        let body = document["bodies"][0].as_object_mut().unwrap();
        body.remove("points");
        body.extend(
            [("points", points), ("shape", shape)].into_iter().filter(|f| !f.1.is_null()).map(|f| (f.0.into(), f.1)),
        );
        let faults = judge(&document, dir.path()).unwrap_err();
        let found: Vec<(&str, &str)> = faults.iter().map(|f| (f.pointer.as_str(), f.code)).collect();
        assert_eq!(found, [(format!("/bodies/0/{at}").as_str(), code)], "{faults:#?}");
        assert!(faults[0].to_string().contains(part), "{}", faults[0]);
    }
    let few = Limits { max_particles: 0, ..Limits::default() };
    let files = LocalFiles { folder: dir.path().to_owned() };
    let document = scene::from_value(&scene()).unwrap();
    assert_eq!(scene::problem_with(&document, &few, &files).unwrap_err()[0].code, "too_many_particles");
}
