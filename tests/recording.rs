//! Recordings are valid, complete, true to the particles, and survive crashes: read back with the official Python library.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::atomic::{AtomicU64, Ordering};

use gridfall::engine::{Backend, Control, Engine, EngineError, FrameStats};
use gridfall::recording;
use gridfall::run::{FrameReport, Observer, Outputs, RunError, Summary, run};
use gridfall::scene::schema::Scene;
use gridfall::sim::collider::{Collider, Motion, Primitive, Sdf, SdfOp};
use gridfall::sim::particles::{IDENTITY, Particles};
use gridfall::sim::problem::{Axis, Body, Contact, ContactKind, Field, Problem};
use serde_json::{Value, json};

/// A stand-in for an engine: particles fly freely and stretch a little.
struct Ballistic {
    backend: Backend,
    problem: Problem,
    state: Particles,
    time_s: f64,
    frame: u64,
    /// Fails when it is to compute this frame.
    fails_at: Option<u64>,
}

const STEPS: u64 = 4;

impl Ballistic {
    fn new(problem: &Problem, fails_at: Option<u64>) -> Self {
        let backend = Backend {
            kind: "cpu".into(),
            device: "paper and pencil".into(),
            driver: String::new(),
            software: false,
            reason: "it is a test".into(),
        };
        Self { backend, problem: problem.clone(), state: problem.particles.clone(), time_s: 0.0, frame: 0, fails_at }
    }
}

impl Engine for Ballistic {
    fn backend(&self) -> &Backend {
        &self.backend
    }

    fn advance_frame(&mut self, frame_s: f64, control: &dyn Control) -> Result<FrameStats, EngineError> {
        if control.canceled() {
            return Err(EngineError::Canceled);
        }
        self.frame += 1;
        if Some(self.frame) == self.fails_at {
            return Err(EngineError::Diverged { step: 4 * self.frame, time_s: self.time_s, what: "as ordered".into() });
        }
        for p in 0..self.state.len() {
            for a in 0..3 {
                self.state.x[p][a] += frame_s * self.state.v[p][a];
                self.state.v[p][a] += frame_s * self.problem.gravity[a];
            }
            self.state.f[p][0] *= 1.001;
        }
        self.time_s += frame_s;
        Ok(FrameStats { steps: STEPS, dt_s: frame_s / STEPS as f64, isolated_reset: self.frame % 2 })
    }

    fn snapshot(&mut self) -> Result<Particles, EngineError> {
        Ok(self.state.clone())
    }
}

/// Counts frames; cancels once it has seen enough.
struct Watch {
    frames: AtomicU64,
    cancel_after: u64,
}

impl Watch {
    fn new(cancel_after: u64) -> Self {
        Self { frames: AtomicU64::new(0), cancel_after }
    }
}

impl Control for Watch {
    fn canceled(&self) -> bool {
        self.frames.load(Ordering::SeqCst) >= self.cancel_after
    }
}

impl Observer for Watch {
    fn frame(&self, report: &FrameReport) {
        assert_eq!(report.frame, self.frames.fetch_add(1, Ordering::SeqCst));
        assert_eq!(report.steps, STEPS * report.frame);
        assert_eq!(report.row.frame, report.frame);
    }
}

fn scene() -> Scene {
    serde_json::from_value(json!({
        "gridfall": 1, "name": "recording test",
        "domain": { "min": [0, 0, 0], "max": [2, 1, 1], "dx": 0.05 },
        "gravity": [0, 0, -9.81],
        "materials": {
            "jelly": { "model": "fixed-corotated", "density": 1000, "youngs_modulus": 1e4, "poissons_ratio": 0.3 },
            "water": { "model": "weakly-compressible-fluid", "density": 1000, "bulk_modulus": 1e5 }
        },
        "bodies": [
            { "name": "cube", "material": "jelly", "shape": { "box": { "min": [0.2, 0.2, 0.5], "max": [0.5, 0.5, 0.8] } } },
            { "name": "pool", "material": "water", "shape": { "box": { "min": [0.8, 0.1, 0.1], "max": [1.8, 0.9, 0.4] } } }
        ],
        "time": { "end": 0.25, "frame_rate": 20 },
        "output": { "fields": ["velocity", "J", "von_mises", "pressure"] }
    }))
    .unwrap()
}

/// The scene as a problem, with a lattice of `spacing` in the two boxes.
fn problem(spacing: f64) -> Problem {
    let scene = scene();
    let mut particles = Particles::default();
    let mut bodies = Vec::new();
    let boxes = [("cube", [0.2, 0.2, 0.5], [0.5, 0.5, 0.8]), ("pool", [0.8, 0.1, 0.1], [1.8, 0.9, 0.4])];
    for (index, (name, min, max)) in boxes.into_iter().enumerate() {
        let first = particles.len();
        let count: [usize; 3] = std::array::from_fn(|a| ((max[a] - min[a]) / spacing).round() as usize);
        for k in 0..count.iter().product() {
            let i = [k % count[0], k / count[0] % count[1], k / (count[0] * count[1])];
            let x = std::array::from_fn(|a| min[a] + (i[a] as f64 + 0.5) * spacing);
            particles.x.push(x);
            particles.v.push([0.1 * x[2], 0.0, 0.3 * index as f64 * x[0]]);
            particles.b.push([0.0; 9]);
            particles.f.push(IDENTITY);
            particles.body.push(index as u32);
        }
        let volume0 = spacing.powi(3);
        let particles = first..particles.len();
        bodies.push(Body { name: name.into(), material: index, particles, volume0, mass: 1000.0 * volume0 });
    }
    let solid = |primitive, translation| SdfOp::Primitive { primitive, rotation: IDENTITY, translation };
    let contact = Contact { kind: ContactKind::Slip, friction: 0.0 };
    let collider = |name: &str, ops, motion| Collider { name: name.into(), sdf: Sdf { ops }, contact, motion };
    let spinning =
        Motion { center: [1.0, 0.5, 0.5], linear_velocity: [0.2, 0.0, 0.0], angular_velocity: [0.0, 0.0, 1.0] };
    let still = Motion::default();
    Problem {
        name: scene.name.clone(),
        dimension: 3,
        origin: [0.0; 3],
        dx: scene.domain.dx,
        cells: [40, 20, 20],
        axes: [Axis::Walls([contact; 2]); 3],
        gravity: [0.0, 0.0, -9.81],
        materials: scene.materials.values().cloned().collect(),
        bodies,
        colliders: vec![
            collider("paddle", vec![solid(Primitive::Box([0.1, 0.02, 0.2]), [1.0, 0.5, 0.5])], spinning),
            collider("ring", vec![solid(Primitive::Torus(0.2, 0.05), [0.5, 0.5, 0.2])], still),
            collider("post", vec![solid(Primitive::Cylinder(0.05, 0.5), [0.7, 0.2, 0.5])], still),
            collider("ball", vec![solid(Primitive::Sphere(0.1), [1.5, 0.5, 0.8])], still),
            collider(
                "bowl",
                vec![solid(Primitive::Sphere(0.3), [0.4, 0.4, 0.5]), SdfOp::Shell(0.02)],
                Motion { linear_velocity: [0.0, 0.0, 0.1], ..still },
            ),
        ],
        particles,
        kernel: scene.solver.kernel,
        transfer: scene.solver.transfer,
        precision: scene.solver.precision,
        cfl: 0.5,
        max_dt_s: None,
        frames: 5,
        frame_s: 0.05,
        fields: vec![Field::Velocity, Field::J, Field::VonMises, Field::Pressure],
        preview_points: 200_000,
        seed: 1,
    }
}

fn outputs(directory: &Path) -> Outputs {
    Outputs {
        recording: directory.join("out.mcap"),
        thumbnail: Some(directory.join("out.png")),
        diagnostics: Some(directory.join("out.csv")),
    }
}

fn record(problem: &Problem, directory: &Path) -> Outputs {
    let out = outputs(directory);
    let mut engine = Ballistic::new(problem, None);
    run(&scene(), problem, &mut engine, &out, &Watch::new(u64::MAX)).unwrap();
    out
}

/// What Python says about recordings; `GRIDFALL_PYTHON` names an interpreter with mcap, mcap-protobuf-support and numpy.
fn python(arguments: &[&str], paths: &[PathBuf]) -> Vec<Value> {
    let interpreter = std::env::var("GRIDFALL_PYTHON").unwrap_or("python3".into());
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/python/read_recording.py");
    let output = Command::new(&interpreter).arg(script).args(arguments).args(paths).output();
    let output = output.unwrap_or_else(|error| panic!("cannot start {interpreter}: {error}"));
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "the Python reader refused the recording:\n{errors}");
    assert!(errors.is_empty(), "the Python reader warned:\n{errors}");
    let lines = String::from_utf8(output.stdout).unwrap();
    let recordings: Vec<Value> = lines.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!(recordings.len(), paths.len());
    recordings
}

fn messages<'a>(recording: &'a Value, topic: &str) -> Vec<&'a Value> {
    recording["messages"].as_array().unwrap().iter().filter(|message| message["topic"] == topic).collect()
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|number| number.as_f64().unwrap()).collect()
}

#[test]
fn a_recording_holds_what_was_simulated() {
    let directory = tempfile::tempdir().unwrap();
    let problem = problem(0.05);
    let out = record(&problem, directory.path());
    let recording = &python(&[], std::slice::from_ref(&out.recording))[0];

    // Points are where the particles are, with the fields that were asked for.
    let mut engine = Ballistic::new(&problem, None);
    let clouds = messages(recording, "/particles");
    assert_eq!(clouds.len(), 6);
    for (frame, cloud) in clouds.into_iter().enumerate() {
        if frame > 0 {
            engine.advance_frame(problem.frame_s, &Watch::new(u64::MAX)).unwrap();
        }
        let (state, points) = (&engine.state, &cloud["content"]["points"]);
        for a in 0..3 {
            let (position, velocity) = (numbers(&points[["x", "y", "z"][a]]), numbers(&points[["vx", "vy", "vz"][a]]));
            assert!(state.x.iter().map(|x| f64::from(x[a] as f32)).eq(position));
            assert!(state.v.iter().map(|v| f64::from(v[a] as f32)).eq(velocity));
        }
        let stretch = 1.001f64.powi(frame as i32);
        assert!(numbers(&points["J"]).iter().all(|j| (j - stretch).abs() < 1e-6));
        // Fixed corotated under uniaxial strain e: σ_xx − σ_yy = 2µ e (1 + e) / J, J = 1 + e; exactly von Mises' measure.
        let mu = 1e4 / 2.6;
        let expected = 2.0 * mu * (stretch - 1.0);
        let von_mises = numbers(&points["von_mises"]);
        assert!((von_mises[0] - expected).abs() <= 1e-5 * expected + 1e-9, "{} against {expected}", von_mises[0]);
        assert!(numbers(&points["alpha"]).iter().all(|&alpha| alpha == 255.0));
    }

    // All stamps are simulated time.
    for message in recording["messages"].as_array().unwrap() {
        let time = message["log_time"].as_u64().unwrap();
        assert_eq!(time, message["sequence"].as_u64().unwrap() * 50_000_000);
        assert_eq!(message["publish_time"], time);
        assert_eq!(message["stamp"], time);
    }

    // Schemas are Foxglove's, frames are named, chunks are compressed.
    let schemas: std::collections::BTreeSet<_> = recording["messages"]
        .as_array()
        .unwrap()
        .iter()
        .map(|m| (m["topic"].as_str().unwrap(), m["schema"].as_str().unwrap()))
        .collect();
    let expected = [
        ("/camera", "foxglove.CompressedImage"),
        ("/colliders", "foxglove.SceneUpdate"),
        ("/diagnostics", "gridfall.Diagnostics"),
        ("/log", "foxglove.Log"),
        ("/particles", "foxglove.PointCloud"),
        ("/tf", "foxglove.FrameTransform"),
    ];
    assert_eq!(schemas.into_iter().collect::<Vec<_>>(), expected);
    assert!(messages(recording, "/particles").iter().all(|message| message["content"]["frame_id"] == "world"));
    assert!(recording["chunks"].as_array().unwrap().iter().all(|chunk| chunk[0] == "zstd"));
}

#[test]
fn a_scene_runs_on_the_cpu_engine_and_is_recorded() {
    let json = json!({
        "gridfall": 1, "name": "falling block", "dimension": 2,
        "domain": { "min": [0, 0], "max": [1, 1], "dx": 0.05 },
        "gravity": [0, -10],
        "materials": { "jelly": { "model": "neo-hookean", "density": 1000, "youngs_modulus": 1e4, "poissons_ratio": 0.3 } },
        "bodies": [ { "name": "block", "material": "jelly", "shape": { "box": { "min": [0.3, 0.5], "max": [0.7, 0.8] } },
                      "velocity": [0.5, 0] } ],
        "colliders": [ { "name": "stone", "shape": { "sphere": { "center": [0.5, 0.1], "radius": 0.1 } }, "contact": "sticky" } ],
        "time": { "end": 0.1, "frame_rate": 50 },
        "solver": { "precision": "f64" }
    });
    let scene = gridfall::scene::parse(&json.to_string()).unwrap();
    let problem = gridfall::scene::problem(&scene, &Default::default()).unwrap();
    let mut engine = gridfall::cpu::CpuEngine::new(&problem).unwrap();
    let directory = tempfile::tempdir().unwrap();
    let out = outputs(directory.path());
    struct Nobody;
    impl Control for Nobody {}
    impl Observer for Nobody {}
    let summary = run(&scene, &problem, &mut engine, &out, &Nobody).unwrap();
    assert_eq!(summary.frames_written, 6);

    let recording = &python(&[], &[out.recording])[0];
    let attached = recording["attachments"]["scene.json"].as_str().unwrap();
    assert_eq!(serde_json::from_str::<Scene>(attached).unwrap(), scene);
    let last = engine.snapshot().unwrap();
    let points = &messages(recording, "/particles")[5]["content"]["points"];
    assert!(last.x.iter().map(|x| f64::from(x[0] as f32)).eq(numbers(&points["x"])));
    assert!(numbers(&points["z"]).iter().all(|&z| z == 0.0), "2D scenes lie at z = 0");
    // Free fall: momentum m g t, and the energy that symplectic Euler steps lose exactly, ½ m g² t dt.
    let rows = messages(recording, "/diagnostics");
    let value = |row: usize, name: &str| rows[row]["content"][name].as_f64().unwrap();
    let mass = 1000.0 * 0.4 * 0.3;
    assert!((value(5, "mass_kg") - mass).abs() < 1e-9 * mass);
    assert!((value(5, "momentum_y") + mass * 10.0 * 0.1).abs() < 1e-9 * mass);
    assert!((value(5, "momentum_x") - mass * 0.5).abs() < 1e-9 * mass);
    let energy =
        |row| ["kinetic_j", "affine_j", "strain_j", "gravity_j"].iter().map(|name| value(row, name)).sum::<f64>();
    let lost = 0.5 * mass * 100.0 * 0.1 * value(5, "dt_s");
    assert!((energy(0) - energy(5) - lost).abs() < 1e-9 * energy(0), "{} to {}", energy(0), energy(5));
}

#[test]
fn diagnostics_agree_in_protobuf_and_csv() {
    let directory = tempfile::tempdir().unwrap();
    let out = record(&problem(0.1), directory.path());
    let recording = &python(&[], &[out.recording])[0];
    let csv = std::fs::read_to_string(out.diagnostics.unwrap()).unwrap();
    let mut lines = csv.lines();
    let columns: Vec<_> = lines.next().unwrap().split(',').collect();
    let rows = messages(recording, "/diagnostics");
    assert_eq!(lines.clone().count(), rows.len());
    for (line, row) in lines.zip(rows) {
        assert_eq!(row["content"].as_object().unwrap().len(), columns.len());
        for (column, cell) in columns.iter().zip(line.split(',')) {
            // 64-bit integers are strings in protobuf's JSON.
            let value = &row["content"][column];
            let value = value.as_f64().unwrap_or_else(|| value.as_str().unwrap().parse().unwrap());
            assert_eq!(cell.parse::<f64>().unwrap(), value, "{column}");
        }
    }
}

#[test]
fn colliders_are_drawn_and_move() {
    let directory = tempfile::tempdir().unwrap();
    let recording = &python(&[], &[record(&problem(0.1), directory.path()).recording])[0];
    let entities = messages(recording, "/colliders")[0]["content"]["entities"].as_array().unwrap().clone();
    let kinds = |kind: &str| -> Vec<&str> {
        let drawn = entities.iter().filter(|entity| !entity[kind].as_array().unwrap().is_empty());
        drawn.map(|entity| entity["id"].as_str().unwrap()).collect()
    };
    assert_eq!(kinds("lines"), ["domain"]);
    assert_eq!(kinds("cubes"), ["paddle"]);
    assert_eq!(kinds("cylinders"), ["post"]);
    assert_eq!(kinds("spheres"), ["ball"]);
    assert_eq!(kinds("triangles"), ["ring", "bowl"]);
    let frames: Vec<_> = entities.iter().map(|entity| entity["frame_id"].as_str().unwrap()).collect();
    assert_eq!(frames, ["world", "colliders/paddle", "world", "world", "world", "colliders/bowl"]);

    let transforms = messages(recording, "/tf");
    assert_eq!(transforms.len(), 12);
    let last = &transforms[10]["content"];
    assert_eq!(
        (last["parent_frame_id"].as_str(), last["child_frame_id"].as_str()),
        (Some("world"), Some("colliders/paddle"))
    );
    // After 0.25 s: turned by 0.25 rad about z, the centre moved by 0.05 m; translation = centre + v t − R centre.
    let (s, c) = 0.25f64.sin_cos();
    let expected = [1.0 + 0.05 - (c * 1.0 - s * 0.5), 0.5 - (s * 1.0 + c * 0.5), 0.0];
    for (axis, expected) in ["x", "y", "z"].into_iter().zip(expected) {
        assert!((last["translation"][axis].as_f64().unwrap() - expected).abs() < 1e-12);
    }
    assert!((last["rotation"]["z"].as_f64().unwrap() - 0.125f64.sin()).abs() < 1e-12);
    assert!((last["rotation"]["w"].as_f64().unwrap() - 0.125f64.cos()).abs() < 1e-12);
}

#[test]
fn provenance_is_inside() {
    let directory = tempfile::tempdir().unwrap();
    let problem = Problem { preview_points: 100, ..problem(0.05) };
    let recording = &python(&[], &[record(&problem, directory.path()).recording])[0];
    let attached = recording["attachments"]["scene.json"].as_str().unwrap();
    assert_eq!(serde_json::from_str::<Scene>(attached).unwrap(), scene());

    let metadata = &recording["metadata"];
    assert_eq!(metadata["build"]["version"], env!("CARGO_PKG_VERSION"));
    assert_ne!(metadata["build"]["target"], "");
    assert_eq!(metadata["run"]["name"], "recording test");
    let count = problem.particles.len();
    assert_eq!(metadata["run"]["particles"], count.to_string());
    assert_eq!(metadata["run"]["decimation"], (100.0 / count as f64).to_string());
    assert_eq!(numbers(&messages(recording, "/particles")[0]["content"]["points"]["x"]).len(), 100);
    assert_eq!(metadata["hardware"]["adapter"], "paper and pencil");
    assert_eq!(metadata["hardware"]["reason"], "it is a test");
    assert_eq!(metadata["hardware"]["software"], "false");
    assert_eq!(metadata["hardware"]["precision"], "f32");
    assert_eq!(metadata["hardware"]["seed"], "1");
    assert_eq!(metadata["hardware"]["scene_sha256"].as_str().unwrap().len(), 64);
    assert_eq!(metadata["result"]["status"], "complete");
    assert_eq!(metadata["result"]["frames"], "6");
    assert_eq!(metadata["result"]["steps"], "20");
    assert_eq!(metadata["result"]["dt_s"].as_str().unwrap().parse::<f64>().unwrap(), 0.0125);
}

#[test]
fn the_same_run_gives_the_same_bytes() {
    let (first, second) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let problem = problem(0.05);
    let first = record(&problem, first.path());
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let second_out = pool.install(|| record(&problem, second.path()));
    assert!(std::fs::read(&first.recording).unwrap() == std::fs::read(&second_out.recording).unwrap());
    assert!(std::fs::read(first.thumbnail.unwrap()).unwrap() == std::fs::read(second_out.thumbnail.unwrap()).unwrap());
}

#[test]
fn nothing_has_its_final_name_before_it_is_complete() {
    struct Look(PathBuf);
    impl Control for Look {}
    impl Observer for Look {
        fn frame(&self, report: &FrameReport) {
            assert!(!self.0.exists());
            let snapshot = recording::snapshot(&recording::partial_path(&self.0)).unwrap();
            assert_eq!(snapshot.frames, report.frame + 1);
        }
    }
    let directory = tempfile::tempdir().unwrap();
    let (problem, out) = (problem(0.1), outputs(directory.path()));
    run(&scene(), &problem, &mut Ballistic::new(&problem, None), &out, &Look(out.recording.clone())).unwrap();
    let mut names: Vec<_> =
        std::fs::read_dir(directory.path()).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    names.sort();
    assert_eq!(names, ["out.csv", "out.mcap", "out.png"]);
}

#[test]
fn failed_and_canceled_runs_keep_what_they_have() {
    let problem = problem(0.1);
    let failed = tempfile::tempdir().unwrap();
    let out = outputs(failed.path());
    let error =
        run(&scene(), &problem, &mut Ballistic::new(&problem, Some(3)), &out, &Watch::new(u64::MAX)).unwrap_err();
    assert!(matches!(error, RunError::Engine(EngineError::Diverged { .. })));
    assert_eq!(error.code(), "diverged");
    let recording = &python(&[], &[out.recording])[0];
    assert_eq!(messages(recording, "/diagnostics").len(), 3);
    assert_eq!(recording["metadata"]["result"]["status"], "failed");
    let last = messages(recording, "/log").last().unwrap()["content"].clone();
    assert_eq!(last["level"], "ERROR");
    assert!(last["message"].as_str().unwrap().contains("as ordered"));
    assert!(out.thumbnail.unwrap().exists());

    let canceled = tempfile::tempdir().unwrap();
    let out = outputs(canceled.path());
    let error = run(&scene(), &problem, &mut Ballistic::new(&problem, None), &out, &Watch::new(2)).unwrap_err();
    assert!(matches!(error, RunError::Engine(EngineError::Canceled)));
    let recording = &python(&[], &[out.recording])[0];
    assert_eq!(messages(recording, "/diagnostics").len(), 2);
    assert_eq!(recording["metadata"]["result"]["status"], "canceled");
}

#[test]
fn a_summary_is_returned_and_a_missing_folder_is_a_clear_error() {
    let directory = tempfile::tempdir().unwrap();
    let problem = problem(0.1);
    let summary =
        run(&scene(), &problem, &mut Ballistic::new(&problem, None), &outputs(directory.path()), &Watch::new(u64::MAX));
    assert_eq!(summary.unwrap(), Summary { frames_written: 6, steps: 20, time_s: 0.25 });
    let nowhere = outputs(&directory.path().join("missing"));
    let error =
        run(&scene(), &problem, &mut Ballistic::new(&problem, None), &nowhere, &Watch::new(u64::MAX)).unwrap_err();
    assert_eq!(error.code(), "output");
    assert!(error.to_string().contains("missing"), "{error}");
}

/// Where each frame of a recording ends on disk, and the bytes as a crash right behind the last frame leaves them.
fn unfinished(problem: &Problem, directory: &Path) -> (Vec<u8>, Vec<u64>) {
    struct Lengths(PathBuf, std::sync::Mutex<Vec<u64>>);
    impl Control for Lengths {}
    impl Observer for Lengths {
        fn frame(&self, _: &FrameReport) {
            self.1.lock().unwrap().push(std::fs::metadata(&self.0).unwrap().len());
        }
    }
    let out = outputs(directory);
    let lengths = Lengths(recording::partial_path(&out.recording), Default::default());
    run(&scene(), problem, &mut Ballistic::new(problem, None), &out, &lengths).unwrap();
    let ends = lengths.1.into_inner().unwrap();
    let mut bytes = std::fs::read(&out.recording).unwrap();
    bytes.truncate(*ends.last().unwrap() as usize);
    (bytes, ends)
}

#[test]
fn a_recording_cut_anywhere_keeps_every_flushed_frame() {
    let directory = tempfile::tempdir().unwrap();
    let (bytes, ends) = unfinished(&problem(0.1), directory.path());
    let whole = &python(&["--frames-only"], &[directory.path().join("out.mcap")])[0];
    // Around each frame's end, and evenly in between.
    let around = ends.iter().flat_map(|&end| [end - 1, end, end + 1]);
    let mut cuts: Vec<u64> = around.chain((1..40).map(|k| 60 + k * bytes.len() as u64 / 40)).collect();
    cuts.retain(|&cut| cut <= bytes.len() as u64);
    let mut paths = Vec::new();
    for &cut in &cuts {
        let partial = directory.path().join(format!("{cut}.mcap.partial"));
        let target = directory.path().join(format!("{cut}.mcap"));
        std::fs::write(&partial, &bytes[..cut as usize]).unwrap();
        let snapshot = recording::snapshot(&partial).unwrap();
        let frames = recording::recover(&partial, &target).unwrap();
        assert!(!partial.exists());
        let recovered = std::fs::read(&target).unwrap();
        // A snapshot is the same recording without touching the file.
        assert_eq!(frames, snapshot.frames);
        assert_eq!(recovered.len() as u64, snapshot.length());
        assert_eq!(&recovered[..snapshot.prefix as usize], &bytes[..snapshot.prefix as usize]);
        assert_eq!(&recovered[snapshot.prefix as usize..], snapshot.tail);
        paths.push(target);
    }
    for (cut, recovered) in cuts.iter().zip(python(&["--frames-only"], &paths)) {
        let flushed = ends.iter().filter(|&&end| end <= *cut).count();
        assert_eq!(recovered["frames"], flushed, "cut at {cut}, frames end at {ends:?}");
        let hashes = recovered["hashes"].as_array().unwrap();
        // The last frame of the whole recording has a closing line in its log.
        let comparable = flushed.min(ends.len() - 1);
        assert_eq!(hashes[..comparable], whole["hashes"].as_array().unwrap()[..comparable]);
        assert_eq!(hashes.len(), flushed);
    }
}

#[test]
fn recovery_cuts_off_damaged_chunks_and_refuses_other_files() {
    let directory = tempfile::tempdir().unwrap();
    let (mut bytes, ends) = unfinished(&problem(0.1), directory.path());
    let middle = (ends[2] + ends[3]) / 2;
    bytes[middle as usize] ^= 0xff;
    let (partial, target) = (directory.path().join("d.mcap.partial"), directory.path().join("d.mcap"));
    std::fs::write(&partial, &bytes).unwrap();
    assert_eq!(recording::recover(&partial, &target).unwrap(), 3);
    assert_eq!(python(&["--frames-only"], &[target])[0]["frames"], 3);

    for other in [&b""[..], b"\x89MCAP0\r\n", b"not a recording at all, but long enough to be one"] {
        std::fs::write(&partial, other).unwrap();
        let error = recording::recover(&partial, &directory.path().join("e.mcap")).unwrap_err();
        assert!(error.to_string().contains("not a recording"), "{error}");
        assert!(partial.exists(), "what cannot be recovered stays");
    }
}
