//! Recordings and live views in viewers that are not ours: the libraries of those on the web, and Rerun.
//! `tests/viewers` has what each is asked, and `tests/run` installs them.

use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

use serde_json::{Value, json};

use super::http::support::{Server, endless, scene, short};

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Where `tests/run` puts the viewers.
fn tools() -> PathBuf {
    Path::new(env!("CARGO_TARGET_TMPDIR")).parent().unwrap().join("viewers")
}

/// Runs the program on `tests/viewers/scene.json`.
fn record(folder: &Path, more: &[&str]) -> PathBuf {
    let recording = folder.join("out.mcap");
    let scene = root().join("tests/viewers/scene.json");
    let mut run = Command::new(env!("CARGO_BIN_EXE_gridfall"));
    run.arg("run").arg(scene).arg("-o").arg(&recording).args(["--backend", "cpu"]).args(more);
    said(&mut run);
    recording
}

/// What a command that succeeds prints.
fn said(command: &mut Command) -> String {
    let output = command.output().unwrap_or_else(|error| panic!("{command:?}: {error}"));
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{command:?}: {errors}");
    String::from_utf8(output.stdout).unwrap()
}

/// A script of `tests/viewers`, beside the packages that it imports.
fn node(folder: &Path, script: &str) -> Command {
    for file in std::fs::read_dir(root().join("tests/viewers")).unwrap().map(|file| file.unwrap().path()) {
        std::fs::copy(&file, folder.join(file.file_name().unwrap())).unwrap();
    }
    let packages = folder.join("node_modules");
    if !packages.exists() {
        std::os::unix::fs::symlink(tools().join("npm/node_modules"), packages).unwrap();
    }
    let mut node = Command::new("node");
    node.arg(folder.join(script));
    node
}

#[test]
fn viewers_on_the_web_read_recordings() {
    let folder = tempfile::tempdir().unwrap();
    let recording = record(folder.path(), &[]);
    let counts = said(node(folder.path(), "read.mjs").arg(&recording).arg("300"));
    assert_eq!(serde_json::from_str::<Value>(&counts).unwrap()["/particles"], 6);
}

#[test]
fn layouts_name_what_recordings_have() {
    let folder = tempfile::tempdir().unwrap();
    let recording = record(folder.path(), &[]);
    let mut layouts = 0;
    for layout in std::fs::read_dir(root().join("api/foxglove")).unwrap() {
        said(node(folder.path(), "layout.mjs").arg(layout.unwrap().path()).arg(&recording));
        layouts += 1;
    }
    assert!(layouts > 0);
}

/// Rerun's command line, which keeps to itself.
fn rerun(folder: &Path, arguments: &[&str]) -> String {
    let mut rerun = Command::new(tools().join("rerun/bin/rerun"));
    said(rerun.args(arguments).current_dir(folder).env("HOME", folder).env("RERUN", "off").env("NO_COLOR", "1"))
}

#[test]
fn rerun_reads_recordings() {
    let folder = tempfile::tempdir().unwrap();
    // So few that it prints all of them.
    record(folder.path(), &["--set", "output.preview_points=3"]);
    let checked = rerun(folder.path(), &["mcap", "check", "out.mcap"]);
    let sound: Vec<&str> = checked.lines().filter(|line| line.starts_with("ok ")).collect();
    assert_eq!(sound.len(), 9, "one for each topic: {checked}");
    rerun(folder.path(), &["mcap", "convert", "out.mcap", "-o", "out.rrd"]);

    let rows = |topic: &str, column: &str| -> Vec<Vec<String>> {
        let printed = rerun(folder.path(), &["rrd", "print", "-vvv", "--entity", topic, "out.rrd"]);
        let mut found = Vec::new();
        for chunk in printed.split("Chunk(").filter(|chunk| chunk.contains(column)) {
            let rows = chunk.lines().filter(|line| line.contains(" row_"));
            found.extend(rows.map(|line| line.split(['│', '┆']).map(|cell| cell.trim().to_owned()).collect()));
        }
        found
    };
    let clouds = rows("/particles", "Points3D:positions");
    assert_eq!(clouds.len(), 6);
    for (n, cloud) in clouds.iter().enumerate() {
        assert!(cloud.contains(&format!("1970-01-01T00:00:00.{:03}", 20 * n)) || n == 0, "{cloud:?}");
        assert!(cloud.contains(&"[world]".to_owned()), "{cloud:?}");
        assert!(cloud.contains(&"[[500000.0, 5000000.0, 100.0]]".to_owned()), "{cloud:?}");
        let points = cloud
            .iter()
            .filter_map(|cell| serde_json::from_str::<Vec<[f64; 3]>>(cell).ok())
            .find(|cell| cell.len() == 3 && cell.iter().flatten().all(|x| (0.25..0.85).contains(x)));
        assert!(points.is_some(), "three points in the block: {cloud:?}");
    }
    // What Rerun shows of each topic. Of a SceneUpdate and of our own messages it has the fields.
    for (topic, column, count) in [
        ("/camera", "EncodedImage:blob", 6),
        // Of the world and of the paddle.
        ("/tf", "Transform3D:translation", 12),
        ("/log", "TextLog:text", 3),
        ("/colliders", "foxglove.SceneUpdate:message", 1),
        ("/colliders/paddle", "Points3D:positions", 1),
        ("/colliders/ring", "Points3D:positions", 1),
        ("/diagnostics", "gridfall.Diagnostics:message", 6),
        ("/solver", "gridfall.SolverStep:message", 5),
    ] {
        assert_eq!(rows(topic, column).len(), count, "{topic}");
    }
    // Its views look from the domain's corner.
    let frames = rows("/tf", "Transform3D:translation");
    let world = frames.iter().filter(|row| row.contains(&"[tf#/]".to_owned()) && row.contains(&"[world]".to_owned()));
    assert!(world.clone().all(|row| row.contains(&"[[-500000.0, -5000000.0, -100.0]]".to_owned())), "{frames:?}");
    assert_eq!(world.count(), 6);
}

/// Foxglove's client, once it is connected.
fn watch(folder: &Path, server: &Server, job: &str) -> (Child, BufReader<std::process::ChildStdout>) {
    let mut command = node(folder, "live.mjs");
    let mut client = command.arg(&server.url).arg(job).stdout(Stdio::piped()).spawn().unwrap();
    let mut lines = BufReader::new(client.stdout.take().unwrap());
    let mut line = String::new();
    lines.read_line(&mut line).unwrap();
    assert_eq!(line, "open\n");
    (client, lines)
}

#[test]
fn a_live_view_has_every_message_of_the_recording() {
    let (data, folder) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let server = Server::start(data.path());
    // One is watched while it runs and is canceled, the other from the queue to its end.
    let (first, second) = (server.submit(endless()), server.submit(scene(1.5)));
    server.wait_for_frames(&first, 3);
    let (mut client, mut lines) = watch(folder.path(), &server, &first);
    let (mut waiting, mut more) = watch(folder.path(), &server, &second);
    let frames = server.job(&first)["progress"]["frames_written"].as_u64().unwrap();
    server.wait_for_frames(&first, frames + 20);
    server.call("POST", &format!("{first}/cancel"), &[], "");
    server.wait_for(&first, "canceled");
    finish(&mut client, &mut lines, frames + 20);
    finish(&mut waiting, &mut more, 151);
    server.wait_for(&second, "succeeded");
}

fn finish(client: &mut Child, lines: &mut impl BufRead, least: u64) {
    let mut line = String::new();
    lines.read_line(&mut line).unwrap();
    assert!(client.wait().unwrap().success());
    assert!(serde_json::from_str::<Value>(&line).unwrap()["frames"].as_u64() >= Some(least), "{line}");
}

#[test]
fn what_is_no_viewer_and_what_has_ended_is_told_so() {
    let data = tempfile::tempdir().unwrap();
    let server = Server::start(data.path());
    let (running, ended) = (server.submit(endless()), server.submit(short()));
    let upgrade = |protocol| {
        [
            ("connection", "upgrade"),
            ("upgrade", "websocket"),
            ("sec-websocket-version", "13"),
            ("sec-websocket-key", "dGhlIHNhbXBsZSBub25jZQ=="),
            ("sec-websocket-protocol", protocol),
        ]
    };
    let live = |job: &str, headers: &[(&str, &str)]| {
        let answer = server.call("GET", &format!("{job}/live"), headers, "");
        (answer.status, answer.json()["code"].clone())
    };
    assert_eq!(live(&running, &[]), (426, json!("websocket_expected")));
    assert_eq!(live(&running, &upgrade("graphql-ws")), (426, json!("websocket_expected")));
    let foreign = [&upgrade("foxglove.websocket.v1")[..], &[("origin", "https://evil.example")]].concat();
    assert_eq!(live(&running, &foreign), (403, json!("foreign_origin")));
    let unknown = "/v1/jobs/01890000-0000-7000-8000-000000000000";
    assert_eq!(live(unknown, &upgrade("foxglove.sdk.v1")), (404, json!("job_not_found")));
    server.call("POST", &format!("{running}/cancel"), &[], "");
    server.wait_for(&ended, "succeeded");
    assert_eq!(live(&ended, &upgrade("foxglove.sdk.v1")), (409, json!("job_ended")));
}
