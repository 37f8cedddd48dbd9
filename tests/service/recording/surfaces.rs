//! Surfaces as meshes: another reader finds them closed, with the volume, place and velocities of the bodies.

use std::path::Path;
use std::process::{Command, Output};

use serde_json::{Value, json};

use super::fixture::{problem, record};
use super::pictures::gridfall;

fn surface(recording: &Path, to: &Path, arguments: &[&str]) -> Output {
    gridfall(&[&["surface"], arguments].concat(), &[("", recording), ("-o", to)])
}

/// What trimesh sees of a mesh, by body.
fn seen(mesh: &Path) -> Value {
    let interpreter = std::env::var("GRIDFALL_PYTHON").unwrap_or("python3".into());
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/python/read_surfaces.py");
    let output = Command::new(interpreter).arg(script).arg(mesh).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

fn numbers(value: &Value) -> [f64; 3] {
    std::array::from_fn(|a| value[a].as_f64().unwrap())
}

#[test]
fn other_readers_find_closed_surfaces() {
    let folder = tempfile::tempdir().unwrap();
    let problem = problem(0.025);
    let recording = record(&problem, folder.path()).recording;
    // After 0.1 s of flight.
    let (frame, time) = (2, 0.1);
    for format in ["ply", "glb", "obj"] {
        let to = folder.path().join("meshes");
        let output = surface(&recording, &to, &["-f", format, "--frames", "1..=2"]);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        assert!(to.join(format!("out.0001.{format}")).exists());
        let seen = seen(&to.join(format!("out.{frame:04}.{format}")));
        assert_eq!(seen.as_object().unwrap().len(), 2, "{format}");
        for (index, (name, body)) in
            [("cube", [[0.2, 0.2, 0.5], [0.5, 0.5, 0.8]]), ("pool", [[0.8, 0.1, 0.1], [1.8, 0.9, 0.4]])]
                .into_iter()
                .enumerate()
        {
            let mesh = &seen[name];
            assert_eq!((&mesh["closed"], &mesh["normals_outwards"]), (&json!(true), &json!(true)), "{format} {name}");
            let volume: f64 = (0..3).map(|a| body[1][a] - body[0][a]).product();
            let ratio = mesh["volume"].as_f64().unwrap() / volume;
            // The flight shears the pool, and keeps its volume. Edges are rounded off.
            assert!((ratio - 1.0).abs() < 0.05, "{format} {name}: {ratio}");
            // Free fall, and a drift that grows with height along x and with x along z.
            let ends = [0, 1].map(|end| numbers(&mesh["bounds"][end]));
            let fall = 2.0 * 0.05 * 0.05 * 9.81 / 2.0 * (frame as f64 - 1.0);
            for (end, side) in ends.iter().zip([0, 1]) {
                assert!((end[1] - body[side][1]).abs() < 0.02, "{format} {name}: {end:?}");
                let x = body[side][0] + 0.1 * time * body[side][2];
                assert!((end[0] - x).abs() < 0.02, "{format} {name}: {end:?} and {x}");
                let z = body[side][2] + 0.3 * time * index as f64 * body[side][0] - fall;
                assert!((end[2] - z).abs() < 0.02, "{format} {name}: {end:?} and {z}");
            }
            if format == "obj" {
                continue;
            }
            // v = (0.1 z₀, 0, 0.3 x₀ i − g t): of the centre, as all is linear.
            let center: [f64; 3] = std::array::from_fn(|a| (body[0][a] + body[1][a]) / 2.0);
            let expected = [0.1 * center[2], 0.0, 0.3 * index as f64 * center[0] - 9.81 * time];
            let velocity = numbers(&mesh["mean_velocity"]);
            (0..3).for_each(|a| assert!((velocity[a] - expected[a]).abs() < 0.02, "{name}: {velocity:?} {expected:?}"));
            let spread = numbers(&mesh["velocity_range"]);
            assert!((spread[0] - 0.1 * (body[1][2] - body[0][2])).abs() < 0.012, "{name}: {spread:?}");
            assert!(spread[1].abs() < 1e-6);
        }
    }
    let one = folder.path().join("one.ply");
    let output = surface(&recording, &one, &["--frames", "0", "--body", "cube"]);
    assert!(output.status.success() && seen(&one).as_object().unwrap().len() == 1);
    // A tenth of the points makes the same body, coarser.
    let output = surface(&recording, &one, &["--frames", "0", "--body", "pool", "--max-points", "1536"]);
    assert!(output.status.success());
    let ratio = seen(&one)["pool"]["volume"].as_f64().unwrap() / 0.24;
    assert!((ratio - 1.0).abs() < 0.15, "{ratio}");
    for (arguments, said) in [
        (&["--body", "pond", "--frames", "0"][..], "no body or source \"pond\"; there are cube, pool"),
        (&["--frames", "6"], "no frame 6"),
        (&["-f", "stl"], "possible values"),
        (&[], "is the file of one frame, and 6 are to be written"),
    ] {
        let output = surface(&recording, &one, arguments);
        let errors = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.code() == Some(2) && errors.contains(said), "{arguments:?}: {errors}");
    }
}

#[test]
fn the_plane_has_no_surface() {
    let folder = tempfile::tempdir().unwrap();
    let scene = json!({
        "gridfall": 1, "name": "disc", "dimension": 2,
        "domain": { "min": [0, 0], "max": [1, 1], "dx": 0.05 },
        "materials": { "jelly": { "model": "neo-hookean", "density": 1000, "youngs_modulus": 1e4,
                                  "poissons_ratio": 0.3 } },
        "bodies": [ { "name": "disc", "material": "jelly",
                      "shape": { "sphere": { "center": [0.5, 0.5], "radius": 0.2 } } } ],
        "time": { "end": 0.05, "frame_rate": 20 }
    });
    let recording = super::pictures::simulated(&scene, folder.path(), "cpu");
    let output = surface(&recording, folder.path(), &[]);
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.code() == Some(2) && errors.contains("2D scenes have no surface"), "{errors}");
}
