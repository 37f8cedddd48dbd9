//! Frames as files of other programs: other readers find in them what the recording has, and stress and strain are
//! those of the law.

use std::path::Path;
use std::process::{Command, Output};

use gridfall_core::sim::setup::{OutputField, Problem};
use gridfall_recording::partial_path;
use gridfall_scene::assets::LocalFiles;
use gridfall_scene::{self as scene, Limits};
use serde_json::{Value, json};

use super::fixture::{Ballistic, Watch, messages, numbers, outputs, problem, python, run};

const FIELDS: [OutputField; 9] = [
    OutputField::Velocity,
    OutputField::J,
    OutputField::VonMises,
    OutputField::Pressure,
    OutputField::Stress,
    OutputField::Strain,
    OutputField::PlasticStrain,
    OutputField::Body,
    OutputField::Id,
];

fn export(recording: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_gridfall")).arg("export").arg(recording).args(arguments).output().unwrap()
}

fn exported(recording: &Path, arguments: &[&str]) {
    let output = export(recording, arguments);
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
}

/// What other readers see of the exported frames, once they have compared them with the recording.
fn readers(recording: &Path, folder: &Path) -> Vec<Value> {
    let interpreter = std::env::var("GRIDFALL_PYTHON").unwrap_or("python3".into());
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/python/read_exports.py");
    let output = Command::new(interpreter).arg(script).args([recording, folder]).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

/// A plate in plane strain, far from the origin.
fn plate() -> (scene::Scene, Problem) {
    let document = json!({
        "gridfall": 1, "name": "plate", "dimension": 2,
        "domain": { "min": [500000, 5000000], "max": [500002, 5000001], "dx": 0.1 },
        "materials": { "jelly": { "model": "fixed-corotated", "density": 1000, "youngs_modulus": 1e4,
                                  "poissons_ratio": 0.3 } },
        "bodies": [ { "name": "plate", "material": "jelly",
                      "shape": { "box": { "min": [500000.3, 5000000.3], "max": [500000.9, 5000000.7] } } } ],
        "time": { "end": 0.25, "frame_rate": 20 }
    });
    let document = scene::from_value(&document).unwrap();
    let files = LocalFiles { folder: ".".into() };
    let problem = scene::problem_with(&document, &Limits::default(), &files).unwrap();
    (document, problem)
}

#[test]
fn other_readers_find_what_was_recorded() {
    let directory = tempfile::tempdir().unwrap();
    let far = plate();
    for (name, (scene, mut problem)) in [("near", (super::fixture::scene(), problem(0.1))), ("far", far)] {
        problem.setup.fields = FIELDS.to_vec();
        let dimension = problem.setup.dimension;
        let folder = directory.path().join(name);
        std::fs::create_dir(&folder).unwrap();
        let out = outputs(&folder);
        run(&scene, &problem, &mut Ballistic::new(&problem, None), &out, &Watch::new(u64::MAX)).unwrap();
        let exports = folder.join("exports");
        for format in ["ply", "vtp", "npz", "csv"] {
            exported(&out.recording, &["-f", format, "-o", exports.to_str().unwrap()]);
        }
        let frames = readers(&out.recording, &exports);
        assert_eq!(frames.len(), problem.setup.frames as usize + 1);
        for (frame, seen) in frames.iter().enumerate() {
            assert_eq!(seen["points"], problem.particles.len());
            let value = |name: &str| seen["first"][name].as_f64().unwrap();
            // Uniaxial strain e: τ = 2µ e (1 + e) + λ (J − 1) J along it, λ (J − 1) J across, J = 1 + e; also across
            // the plane of two dimensions.
            let stretch = 1.001f64.powi(frame as i32);
            let (mu, lambda) = (1e4 / 2.6, 1e4 * 0.3 / (1.3 * 0.4));
            let e = stretch - 1.0;
            let close = |name: &str, expected: f64| {
                assert!(
                    (value(name) - expected).abs() < 1e-5 * expected.abs() + 1e-7,
                    "{name} {} {expected}",
                    value(name)
                );
            };
            close("stress_xx", (2.0 * mu + lambda) * e);
            ["stress_yy", "stress_zz"].iter().for_each(|name| close(name, lambda * e));
            close("strain_xx", stretch.ln());
            for name in ["stress_xy", "stress_yz", "stress_xz", "strain_yy", "strain_zz", "strain_xy", "strain_xz"] {
                close(name, 0.0);
            }
            close("plastic_strain", 0.0);
            assert_eq!((value("body"), value("id")), (0.0, 0.0), "{dimension} dimensions");
        }
    }
}

#[test]
fn particles_keep_their_numbers_and_bodies_their_names() {
    let directory = tempfile::tempdir().unwrap();
    let mut problem = problem(0.05);
    problem.setup.fields = vec![OutputField::Body, OutputField::Id];
    problem.setup.preview_points = 300;
    let out = outputs(directory.path());
    run(&super::fixture::scene(), &problem, &mut Ballistic::new(&problem, None), &out, &Watch::new(u64::MAX)).unwrap();
    let recording = &python(&[], std::slice::from_ref(&out.recording))[0];
    assert_eq!(recording["metadata"]["bodies"], json!({ "0": "cube", "1": "pool" }));
    let clouds = messages(recording, "/particles");
    let points = |frame: usize| &clouds[frame]["content"]["points"];
    let ids: Vec<usize> = numbers(&points(0)["id"]).iter().map(|id| *id as usize).collect();
    assert_eq!(points(0)["id"], points(5)["id"]);
    assert!(ids.len() == 300 && ids.windows(2).all(|pair| pair[0] < pair[1]) && ids[299] > 300);
    let x = numbers(&points(0)["x"]);
    for ((id, body), x) in ids.iter().zip(numbers(&points(0)["body"])).zip(x) {
        assert_eq!(f64::from(problem.particles.x[*id][0] as f32), x);
        assert_eq!(f64::from(problem.particles.body[*id]), body);
    }

    // Bodies by name, some of the points, and some of the frames.
    let folder = directory.path().join("exports");
    let to = folder.to_str().unwrap();
    let rows = |frame: u64| {
        let text = std::fs::read_to_string(folder.join(format!("out.{frame:04}.csv"))).unwrap();
        let lines = text.lines().skip(1).map(|line| line.split(',').map(|cell| cell.parse().unwrap()).collect());
        lines.collect::<Vec<Vec<f64>>>()
    };
    let of_pool = ids.iter().filter(|id| problem.particles.body[**id] == 1).count();
    exported(&out.recording, &["-f", "csv", "-o", to, "--frames", "1..=5", "--every", "2", "--body", "pool"]);
    let mut names: Vec<_> = std::fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    names.sort();
    assert_eq!(names, ["out.0001.csv", "out.0003.csv", "out.0005.csv"]);
    assert!(rows(3).len() == of_pool && rows(3).iter().all(|row| row[4] == 1.0 && row[0] == 0.15));
    exported(&out.recording, &["-f", "csv", "-o", to, "--frames", "4", "--max-points", "10"]);
    assert_eq!(rows(4).len(), 10);
    // One file, whose form its name says.
    let file = directory.path().join("one.npz");
    exported(&out.recording, &["-o", file.to_str().unwrap(), "--frames", "2"]);
    assert!(std::fs::read(&file).unwrap().starts_with(b"PK"));

    // A recording that a crash cut short has the frames that are whole.
    let cut = directory.path().join("cut.mcap");
    let bytes = std::fs::read(&out.recording).unwrap();
    std::fs::write(partial_path(&cut), &bytes[..bytes.len() / 2]).unwrap();
    for name in [&cut, &partial_path(&cut)] {
        exported(name, &["-f", "csv", "-o", to]);
        assert!(folder.join("cut.0000.csv").exists() && !folder.join("cut.0005.csv").exists());
        std::fs::remove_file(folder.join("cut.0000.csv")).unwrap();
    }
    assert_eq!(std::fs::read_to_string(folder.join("out.0003.csv")).unwrap().lines().count(), of_pool + 1);

    for (arguments, said) in [
        (vec!["--body", "pond", "-o", to], "no body or source \"pond\"; there are cube, pool"),
        (vec!["--frames", "6", "-o", to], "no frame 6; the recording has the frames 0 to 5"),
        (vec!["--frames", "2..9", "-o", to], "no frame 8"),
        (vec!["--frames", "2..2", "-o", to], "there is no frame in 2..2"),
        (vec!["-o", file.to_str().unwrap()], "is the file of one frame, and 6 are to be written"),
        (vec!["-f", "xls", "-o", to], "possible values"),
    ] {
        let output = export(&out.recording, &arguments);
        let errors = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {errors}");
        assert!(errors.contains(said), "{errors}");
    }
    let none = export(&directory.path().join("none.mcap"), &[]);
    assert!(none.status.code() == Some(2) && String::from_utf8_lossy(&none.stderr).contains("none.mcap"));
}

#[test]
fn bodies_are_refused_where_the_recording_does_not_say_them() {
    let directory = tempfile::tempdir().unwrap();
    let out = super::fixture::record(&problem(0.1), directory.path());
    let output = export(&out.recording, &["--body", "cube", "-o", directory.path().to_str().unwrap()]);
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.code() == Some(2) && errors.contains("\"body\" in output.fields"), "{errors}");
}
