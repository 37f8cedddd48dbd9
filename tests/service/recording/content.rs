//! A recording contains what was simulated.

use std::collections::{BTreeMap, BTreeSet};

use gridfall_core::sim::setup::Integrator;
use gridfall_engine::{Control, Engine};
use gridfall_recording::run::Observer;
use gridfall_scene::schema::Scene;
use serde_json::{Value, json};

use super::fixture::{Ballistic, Watch, messages, numbers, outputs, problem, python, record, run, scene};

#[test]
fn a_recording_holds_what_was_simulated() {
    let directory = tempfile::tempdir().unwrap();
    let problem = problem(0.05);
    let out = record(&problem, directory.path());
    let recording = &python(&[], std::slice::from_ref(&out.recording))[0];

    // Points are at the particles' positions, with the requested fields.
    let mut engine = Ballistic::new(&problem, None);
    let clouds = messages(recording, "/particles");
    assert_eq!(clouds.len(), 6);
    for (frame, cloud) in clouds.into_iter().enumerate() {
        if frame > 0 {
            engine.advance_frame(problem.setup.frame_s, &Watch::new(u64::MAX)).unwrap();
        }
        let (state, points) = (&engine.state, &cloud["content"]["points"]);
        for a in 0..3 {
            let (position, velocity) = (numbers(&points[["x", "y", "z"][a]]), numbers(&points[["vx", "vy", "vz"][a]]));
            let corner = problem.setup.origin[a];
            assert_eq!(cloud["content"]["pose"]["position"][["x", "y", "z"][a]], corner);
            assert!(state.x.iter().map(|x| f64::from((x[a] - corner) as f32)).eq(position));
            assert!(state.v.iter().map(|v| f64::from(v[a] as f32)).eq(velocity));
        }
        let stretch = 1.001f64.powi(frame as i32);
        assert!(numbers(&points["J"]).iter().all(|j| (j - stretch).abs() < 1e-6));
        // Fixed corotated under uniaxial strain e: σ_xx − σ_yy = 2µ e (1 + e) / J, J = 1 + e. This
        // equals the von Mises stress exactly.
        let mu = 1e4 / 2.6;
        let expected = 2.0 * mu * (stretch - 1.0);
        let von_mises = numbers(&points["von_mises"]);
        assert!((von_mises[0] - expected).abs() <= 1e-5 * expected + 1e-9, "{} against {expected}", von_mises[0]);
        assert!(numbers(&points["alpha"]).iter().all(|&alpha| alpha == 255.0));
    }

    // All stamps are simulated time, and each channel counts its messages.
    let mut counts = BTreeMap::new();
    for message in recording["messages"].as_array().unwrap() {
        let (time, topic) = (message["log_time"].as_u64().unwrap(), message["topic"].as_str().unwrap());
        let sequence = counts.entry(topic).or_insert(0);
        assert_eq!(message["sequence"], *sequence, "{topic}");
        assert_eq!(time % 50_000_000, 0);
        assert!(topic != "/particles" || time == *sequence * 50_000_000);
        *sequence += 1;
        assert_eq!(message["publish_time"], time);
        assert_eq!(message["stamp"], time);
    }

    // Schemas are Foxglove's, frames are named, chunks are compressed.
    let schemas: BTreeSet<_> = recording["messages"]
        .as_array()
        .unwrap()
        .iter()
        .map(|m| (m["topic"].as_str().unwrap(), m["schema"].as_str().unwrap()))
        .collect();
    let expected = [
        ("/camera", "foxglove.CompressedImage"),
        ("/colliders", "foxglove.SceneUpdate"),
        ("/colliders/ball", "foxglove.PointCloud"),
        ("/colliders/bowl", "foxglove.PointCloud"),
        ("/colliders/paddle", "foxglove.PointCloud"),
        ("/colliders/post", "foxglove.PointCloud"),
        ("/colliders/ring", "foxglove.PointCloud"),
        ("/diagnostics", "gridfall.Diagnostics"),
        ("/log", "foxglove.Log"),
        ("/particles", "foxglove.PointCloud"),
        ("/tf", "foxglove.FrameTransforms"),
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
        "materials": { "jelly": { "model": "neo-hookean", "density": 1000,
                                  "youngs_modulus": 1e4, "poissons_ratio": 0.3 } },
        "bodies": [ { "name": "block", "material": "jelly",
                      "shape": { "box": { "min": [0.3, 0.5], "max": [0.7, 0.8] } },
                      "velocity": [0.5, 0] } ],
        "colliders": [ { "name": "stone", "shape": { "sphere": { "center": [0.5, 0.1], "radius": 0.1 } },
                         "contact": "sticky" } ],
        "time": { "end": 0.1, "frame_rate": 50 },
        "solver": { "precision": "f64" }
    });
    let scene = gridfall_scene::parse(&json.to_string()).unwrap();
    let problem = gridfall_scene::problem(&scene, &Default::default()).unwrap();
    let mut engine = gridfall_engine::explicit::cpu::CpuEngine::new(&problem.setup, problem.particles.clone()).unwrap();
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
    // Free fall: momentum m g t, and the energy stays.
    let rows = messages(recording, "/diagnostics");
    let value = |row: usize, name: &str| rows[row]["content"][name].as_f64().unwrap();
    let mass = 1000.0 * 0.4 * 0.3;
    assert!((value(5, "mass_kg") - mass).abs() < 1e-9 * mass);
    assert!((value(5, "momentum_y") + mass * 10.0 * 0.1).abs() < 1e-9 * mass);
    assert!((value(5, "momentum_x") - mass * 0.5).abs() < 1e-9 * mass);
    let energy =
        |row| ["kinetic_j", "affine_j", "strain_j", "gravity_j"].iter().map(|name| value(row, name)).sum::<f64>();
    assert!((energy(0) - energy(5)).abs() < 1e-9 * energy(0), "{} to {}", energy(0), energy(5));
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
        let reactions = row["content"]["reactions"].as_array().unwrap();
        let dynamic = reactions.iter().flat_map(|reaction| {
            let name = reaction["name"].as_str().unwrap();
            let kinds = if name.starts_with("wall_") { &["force"][..] } else { &["force", "torque"] };
            let quantities = kinds.iter().flat_map(|kind| ["x", "y", "z"].map(|axis| format!("{kind}_{axis}")));
            quantities.map(move |quantity| (format!("{name}.{quantity}"), reaction[&quantity].as_f64().unwrap()))
        });
        let dynamic: Vec<(String, f64)> = dynamic.collect();
        let fixed = row["content"].as_object().unwrap().len() - 1;
        assert_eq!(fixed + dynamic.len(), columns.len());
        for ((column, cell), (name, value)) in columns.iter().zip(line.split(',')).skip(fixed).zip(dynamic) {
            assert_eq!((*column, cell.parse::<f64>().unwrap()), (name.as_str(), value));
        }
        for (column, cell) in columns.iter().zip(line.split(',')).take(fixed) {
            // Protobuf's JSON writes 64-bit integers as strings.
            let value = &row["content"][column];
            let value = value.as_f64().unwrap_or_else(|| value.as_str().unwrap().parse().unwrap());
            assert_eq!(cell.parse::<f64>().unwrap(), value, "{column}");
        }
    }
}

#[test]
fn implicit_steps_are_recorded_at_their_time() {
    let directory = tempfile::tempdir().unwrap();
    let reason = "it is stiff".to_owned();
    let mut problem = problem(0.1);
    (problem.setup.integrator, problem.setup.integrator_reason) = (Integrator::Implicit, reason);
    let out = record(&problem, directory.path());
    let recording = &python(&[], std::slice::from_ref(&out.recording))[0];
    assert_eq!(recording["metadata"]["run"]["integrator"], "implicit");
    assert_eq!(recording["metadata"]["run"]["integrator_reason"], "it is stiff");
    let log: Vec<&str> =
        messages(recording, "/log").iter().map(|line| line["content"]["message"].as_str().unwrap()).collect();
    assert!(log.contains(&"implicit integration: it is stiff"), "{log:?}");
    let warnings: Vec<_> = log.iter().filter(|line| line.contains("did not converge")).collect();
    assert_eq!(warnings.len(), 5, "one for each frame of which a step did not converge");
    assert!(warnings[1].contains("1 of 4") && warnings[1].contains("0.100000 s") && warnings[1].contains("1.6e-7"));

    // The message, the CSV and the frame's row agree.
    let csv = std::fs::read_to_string(out.solver.unwrap()).unwrap();
    let mut lines = csv.lines();
    let columns: Vec<&str> = lines.next().unwrap().split(',').collect();
    let steps = messages(recording, "/solver");
    assert_eq!((steps.len(), lines.clone().count()), (20, 20));
    for ((n, step), line) in steps.iter().enumerate().zip(lines) {
        assert_eq!(step["schema"], "gridfall.SolverStep");
        assert_eq!(step["log_time"], 12_500_000 * (n + 1));
        assert_eq!(step["content"].as_object().unwrap().len(), columns.len());
        for (column, cell) in columns.iter().zip(line.split(',')) {
            let value = &step["content"][column];
            let text = value.as_str().map_or(value.to_string(), str::to_owned);
            let same = cell == text || cell.parse::<f64>().unwrap() == text.parse::<f64>().unwrap();
            assert!(same, "{column}: {cell} against {text}");
        }
        assert_eq!(step["content"]["step"], (n + 1).to_string());
        assert_eq!(step["content"]["frame"], (n / 4 + 1).to_string());
        assert_eq!(step["content"]["converged"], n % 4 != 3);
    }
    for (frame, row) in messages(recording, "/diagnostics").iter().enumerate() {
        let (iterations, residual, halvings) = if frame == 0 { ("0", 0.0, "0") } else { ("10", 1.6e-7, "2") };
        assert_eq!(row["content"]["iterations"], iterations);
        assert_eq!(row["content"]["residual"], residual);
        assert_eq!(row["content"]["halvings"], halvings);
    }
}

#[test]
fn colliders_are_drawn_and_move() {
    let directory = tempfile::tempdir().unwrap();
    let recording = &python(&[], &[record(&problem(0.1), directory.path()).recording])[0];
    // Frames are 0.05 s apart; the post exists from 0.05 to 0.15 s.
    let scenes = messages(recording, "/colliders");
    assert_eq!(scenes.len(), 3);
    let ids = |content: &Value, kind: &str| -> Vec<String> {
        content[kind].as_array().unwrap().iter().map(|item| item["id"].as_str().unwrap().into()).collect()
    };
    for (n, time) in [(0, 0), (2, 150_000_000)] {
        assert_eq!(ids(&scenes[n]["content"], "entities"), ["domain", "paddle", "ring", "ball", "bowl"]);
        assert_eq!(ids(&scenes[n]["content"], "deletions"), ["post"]);
        assert_eq!(scenes[n]["log_time"], time);
    }
    assert!(ids(&scenes[1]["content"], "deletions").is_empty());
    let entities = scenes[1]["content"]["entities"].as_array().unwrap().clone();
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

    // The same as points, sent when they come and go.
    let clouds = |name: &str| -> Vec<&Value> {
        messages(recording, &format!("/colliders/{name}")).iter().map(|message| &message["content"]).collect()
    };
    let sizes = clouds("post").iter().map(|cloud| numbers(&cloud["points"]["x"]).len()).collect::<Vec<_>>();
    assert!(sizes[0] == 0 && sizes[1] > 100 && sizes[2] == 0 && sizes.len() == 3, "{sizes:?}");
    let [ball] = clouds("ball")[..] else { panic!("it never goes") };
    assert_eq!(ball["frame_id"], "world");
    let [x, y, z] = ["x", "y", "z"].map(|axis| numbers(&ball["points"][axis]));
    for ((x, y), z) in x.iter().zip(&y).zip(&z) {
        let r = (x - 1.5).hypot(y - 0.5).hypot(z - 0.8);
        assert!((r - 0.1).abs() < 0.005, "{r}");
    }
    assert_eq!(clouds("paddle")[0]["frame_id"], "colliders/paddle");

    let transforms = messages(recording, "/tf");
    assert_eq!(transforms.len(), 6);
    let transforms = transforms[5]["content"]["transforms"].as_array().unwrap();
    assert_eq!(transforms.len(), 3);
    let anchor = &transforms[0];
    assert_eq!((anchor["parent_frame_id"].as_str(), anchor["child_frame_id"].as_str()), (Some("tf#/"), Some("world")));
    assert_eq!((anchor["translation"]["x"].as_f64(), anchor["rotation"]["w"].as_f64()), (Some(0.0), Some(1.0)));
    let last = &transforms[1];
    assert_eq!(
        (last["parent_frame_id"].as_str(), last["child_frame_id"].as_str()),
        (Some("world"), Some("colliders/paddle"))
    );
    // After 0.25 s: rotated by 0.25 rad about z, the centre moved by 0.05 m;
    // translation = centre + v t − R centre.
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
    let mut problem = problem(0.05);
    problem.setup.preview_points = 100;
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
