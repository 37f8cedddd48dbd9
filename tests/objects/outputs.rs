//! Outputs, wherever they were made.

use std::fs;
use std::path::Path;
use std::thread::sleep;
use std::time::Duration;

use serde_json::{Value, json};

use super::postgres;
use super::s3::S3;
use super::serve;
use super::support::{Server, short};
use super::work::{compare, outputs, scenes, undisturbed};

/// A run of many frames that ends with the same bytes wherever it is interrupted.
fn long() -> Value {
    let mut scene = scenes().remove(0);
    scene["time"] = json!({ "end": 6.0, "frame_rate": 200 });
    scene["output"] = json!({ "state": true });
    scene
}

/// The bytes of an address, and its status.
fn download(url: &str) -> (u16, Vec<u8>) {
    let agent: ureq::Agent = ureq::Agent::config_builder().http_status_as_error(false).proxy(None).build().into();
    let mut answer = agent.get(url).call().unwrap();
    (answer.status().as_u16(), answer.body_mut().read_to_vec().unwrap())
}

#[test]
fn a_machine_that_ran_nothing_has_all_outputs() {
    let (s3, dir) = (S3::start(), tempfile::tempdir().unwrap());
    let database = postgres::shared().database();
    let expected = undisturbed(&dir.path().join("undisturbed"));
    let at = |name: &str, more: &[&str]| {
        let more = [&["--database", &database], more].concat();
        serve(&s3, "here", &dir.path().join(name), &more)
    };
    let server = at("one", &[]);
    let jobs: Vec<String> = scenes().into_iter().map(|scene| server.submit(scene)).collect();
    for (job, expected) in jobs.iter().zip(&expected) {
        server.wait_for(job, "succeeded");
        compare(&server, job, expected);
    }
    let recording = format!("{}/recording.mcap", jobs[0]);
    let before = server.get(&recording);
    let log = server.get(&format!("{}/log", jobs[0])).body;
    assert!(server.terminate().success());
    // Only what was published is there.
    assert_eq!(s3.check_published("here"), jobs.len());
    for (path, _) in s3.objects("here/jobs") {
        assert!(!path.contains("parts") && !path.contains("checkpoint") && !path.contains("progress"), "{path}");
    }
    // A copy that is too large goes at once.
    let server = at("two", &["--cache-bytes", "0"]);
    for (job, expected) in jobs.iter().zip(&expected) {
        compare(&server, job, expected);
        for frame in ["frames", "frames/3/points", "frames/3/picture.png", "frames/3/export?format=ply"] {
            let answer = server.get(&format!("{job}/{frame}"));
            assert_eq!(answer.status, 200, "{job}/{frame}: {}", String::from_utf8_lossy(&answer.body));
        }
        assert!(server.file(job, "recording.mcap").exists());
    }
    let told = |log: &[u8]| String::from_utf8_lossy(log).lines().filter(|line| line.contains("attempt 1")).count();
    assert_eq!(told(&server.get(&format!("{}/log", jobs[0])).body), told(&log));
    let copy = server.file(&jobs[0], "recording.mcap");
    for _ in 0..2000 {
        if !copy.exists() {
            break;
        }
        sleep(Duration::from_millis(20));
    }
    assert!(!copy.exists(), "the copy stays");
    // By ranges from there, and the same to clients that have a part.
    let tag = before.header("etag").to_owned();
    let bytes = &before.body;
    let part = |range: &str, tag: &str| server.call("GET", &recording, &[("range", range), ("if-range", tag)], "");
    let answer = part("bytes=100-299", &tag);
    assert_eq!((answer.status, answer.header("etag")), (206, tag.as_str()));
    assert_eq!(answer.header("content-range"), format!("bytes 100-299/{}", bytes.len()));
    assert_eq!(answer.body, bytes[100..300]);
    assert_eq!(part("bytes=-7", &tag).body, bytes[bytes.len() - 7..]);
    assert_eq!(part("bytes=100-", "\"another\"").body, *bytes);
    assert_eq!(part(&format!("bytes={}-", bytes.len()), &tag).status, 416);
    assert_eq!(server.call("GET", &recording, &[("if-none-match", &tag)], "").status, 304);
    let head = server.call("HEAD", &recording, &[], "");
    assert_eq!((head.status, head.header("content-length")), (200, bytes.len().to_string().as_str()));
    assert!(!copy.exists(), "downloads leave no copy");
}

#[test]
fn links_are_good_for_a_while() {
    let (s3, dir) = (S3::start(), tempfile::tempdir().unwrap());
    let server = serve(&s3, "links", &dir.path().join("data"), &[]);
    let job = server.submit(short());
    server.wait_for(&job, "succeeded");
    let answer = server.get(&format!("{job}/links?expires_s=2"));
    assert_eq!((answer.status, answer.header("cache-control")), (200, "no-store"));
    let links = answer.json()["links"].as_array().unwrap().clone();
    let names: Vec<&str> = links.iter().map(|link| link["name"].as_str().unwrap()).collect();
    assert!(names.contains(&"recording.mcap") && names.contains(&"diagnostics.csv"), "{names:?}");
    for link in &links {
        let name = link["name"].as_str().unwrap();
        let (status, bytes) = download(link["url"].as_str().unwrap());
        assert_eq!((status, bytes.len() as u64), (200, link["bytes"].as_u64().unwrap()), "{name}");
        if name == "recording.mcap" {
            assert_eq!(bytes, server.get(&format!("{job}/recording.mcap")).body);
        }
    }
    sleep(Duration::from_secs(3));
    assert_eq!(download(links[0]["url"].as_str().unwrap()).0, 403);
    for (query, code) in [("expires_s=0", "invalid_query"), ("expires_s=999999", "invalid_query")] {
        assert_eq!(server.get(&format!("{job}/links?{query}")).json()["code"], code);
    }
    let without = Server::start(&dir.path().join("without"));
    let job = without.submit(short());
    without.wait_for(&job, "succeeded");
    assert_eq!(without.get(&format!("{job}/links")).json()["code"], "no_object_storage");
}

#[test]
fn what_is_deleted_is_gone_everywhere_and_uploads_are_for_all() {
    let (s3, dir) = (S3::start(), tempfile::tempdir().unwrap());
    let database = postgres::shared().database();
    let at = |name: &str| serve(&s3, "gone", &dir.path().join(name), &["--database", &database]);
    let server = at("one");
    let jobs: Vec<String> = (0..3).map(|_| server.submit(short())).collect();
    jobs.iter().for_each(|job| drop(server.wait_for(job, "succeeded")));
    assert_eq!(s3.check_published("gone"), 3);
    assert_eq!(server.call("DELETE", &jobs[0], &[], "").status, 204);
    assert_eq!(s3.check_published("gone"), 2);
    // Without the storage it is forgotten now, and removed when a server starts again.
    s3.kill();
    assert_eq!(server.call("DELETE", &jobs[1], &[], "").status, 204);
    assert_eq!(server.get(&jobs[1]).status, 404);
    s3.restart();
    assert_eq!(s3.check_published("gone"), 2);
    let mesh = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n".to_vec();
    let kept = server.call("PUT", "/v1/assets", &[("content-type", "application/octet-stream")], mesh.clone());
    assert_eq!(kept.status, 201, "{}", String::from_utf8_lossy(&kept.body));
    let asset = kept.header("location").to_owned();
    assert!(server.terminate().success());
    let server = at("one");
    assert_eq!(s3.check_published("gone"), 1);
    assert!(server.terminate().success());
    let server = at("two");
    assert_eq!(server.get("/v1/assets").json()["assets"].as_array().unwrap().len(), 1);
    assert_eq!(server.get(&asset).body, mesh);
    fs::remove_dir_all(dir.path().join("two/assets")).unwrap();
    fs::create_dir(dir.path().join("two/assets")).unwrap();
    let scene = json!({
        "gridfall": 1, "name": "mesh", "dimension": 3, "domain": { "min": [-1, -1, -1], "max": [2, 2, 2], "dx": 0.25 },
        "materials": { "jelly": { "model": "fixed-corotated", "density": 1000, "youngs_modulus": 1e5,
            "poissons_ratio": 0.3 } },
        "bodies": [{ "name": "mesh", "material": "jelly",
            "shape": { "mesh": { "asset": asset.rsplit('/').next().unwrap() } } }],
        "time": { "end": 0.02, "frame_rate": 100 }
    });
    server.wait_for(&server.submit(scene), "succeeded");
}

#[test]
fn a_job_goes_on_without_the_folder_that_it_began_in() {
    let (s3, dir) = (S3::start(), tempfile::tempdir().unwrap());
    let database = postgres::shared().database();
    let at = |name: &str| serve(&s3, "moved", &dir.path().join(name), &["--database", &database]);
    let calm = at("calm");
    let job = calm.submit(long());
    calm.wait_for(&job, "succeeded");
    let expected = outputs(&calm, &job);
    let state = calm.get(&format!("{job}/state.npz")).body;
    assert!(calm.terminate().success());
    let server = at("one");
    let job = server.submit(long());
    server.wait_until(&job, "a checkpoint", |_| s3.objects("moved").iter().any(|(path, _)| path.contains("progress")));
    server.wait_for_frames(&job, 200);
    server.kill();
    fs::remove_dir_all(dir.path().join("one")).unwrap();
    let server = at("two");
    let ended = server.wait_for(&job, "succeeded");
    assert_eq!(ended["attempt"], 2);
    let log = String::from_utf8(server.get(&format!("{job}/log")).body).unwrap();
    assert!(log.contains("attempt 1 runs from the start") && log.contains("attempt 2 runs after frame"), "{log}");
    compare(&server, &job, &expected);
    assert_eq!(server.get(&format!("{job}/state.npz")).body, state);
    // Its last state is what another job can begin with, on a third machine.
    assert!(server.terminate().success());
    let server = at("three");
    let next = json!({ "scene": long(), "start_from": job.rsplit('/').next() });
    assert_eq!(server.post_json("/v1/jobs", &next).status, 202);
}

#[test]
fn a_job_is_watched_from_another_machine() {
    let (s3, dir) = (S3::start(), tempfile::tempdir().unwrap());
    let database = postgres::shared().database();
    let at = |name: &str| serve(&s3, "watched", &dir.path().join(name), &["--database", &database]);
    let server = at("one");
    let mut scene = long();
    scene["time"]["end"] = 30.0.into();
    let job = server.submit(scene);
    server.wait_for_frames(&job, 50);
    // One that takes no jobs while another has this one.
    let other = at("two");
    let seen = |job: &Value| job["frames"].as_u64().unwrap();
    let list = other.wait_until(&format!("{job}/frames"), "frames", |list| seen(list) > 20);
    let last = seen(&list) - 1;
    let path = format!("{job}/frames/{last}/points");
    assert_eq!(other.get(&path).body, server.get(&path).body);
    other.wait_until(&format!("{job}/frames"), "more frames", |list| seen(list) > last + 50);
    let so_far = other.get(&format!("{job}/recording-so-far.mcap"));
    assert_eq!(so_far.status, 200);
    assert!(mcap::Summary::read(&so_far.body).unwrap().unwrap().stats.unwrap().message_count > 0);
    let log = String::from_utf8(other.get(&format!("{job}/log")).body).unwrap();
    assert!(log.contains("attempt 1 runs from the start"), "{log}");
    let tables = ["diagnostics?format=csv", "diagnostics?per=step&format=csv"];
    let before = tables.map(|table| other.get(&format!("{job}/{table}")).body);
    assert_eq!(other.post_json(&format!("{job}/cancel"), &json!({})).status, 202);
    server.wait_for(&job, "canceled");
    // Copies from when it ran are not what it has come to.
    for output in ["recording.mcap", "thumbnail.png", "log"].into_iter().chain(tables) {
        let path = format!("{job}/{output}");
        assert!(other.get(&path).body == server.get(&path).body, "{output}");
    }
    assert!(other.get(&format!("{job}/{}", tables[0])).body.len() > before[0].len());
}

/// An old copy of the database makes a server run again what has been published.
#[test]
fn what_is_published_stays_as_it_is() {
    let (s3, dir) = (S3::start(), tempfile::tempdir().unwrap());
    let (data, backup) = (dir.path().join("data"), dir.path().join("backup"));
    let copy = |from: &Path, to: &Path| {
        fs::create_dir_all(to).unwrap();
        for name in ["gridfall.sqlite", "gridfall.sqlite-wal", "gridfall.sqlite-shm"] {
            fs::copy(from.join(name), to.join(name)).unwrap();
        }
    };
    let server = serve(&s3, "kept", &data, &[]);
    let mut before = long();
    before["time"]["end"] = 400.0.into();
    let (before, job) = (server.submit(before), server.submit(short()));
    server.wait_for_frames(&before, 1);
    server.kill();
    copy(&data, &backup);
    let run = |status: &str| {
        let server = serve(&s3, "kept", &data, &[]);
        server.post_json(&format!("{before}/cancel"), &json!({}));
        (server.wait_for(&job, status), server)
    };
    let (_, server) = run("succeeded");
    let recording = server.get(&format!("{job}/recording.mcap"));
    let objects = || s3.objects(&format!("kept/jobs/{}/1", job.rsplit('/').next().unwrap()));
    // What only the run needed goes once the job has ended.
    let tidied = || objects().iter().all(|(path, _)| !path.contains(".parts/") && !path.contains("progress"));
    server.wait_until(&job, "the end of its checkpoints", |_| tidied());
    server.kill();
    let published = objects();
    copy(&backup, &data);
    let (ended, server) = run("failed");
    assert_eq!((&ended["attempt"], &ended["failure"]["code"]), (&json!(1), &json!("output")));
    let message = ended["failure"]["message"].as_str().unwrap();
    assert!(message.contains("published by another process"), "{message}");
    server.wait_until(&job, "the end of its checkpoints", |_| tidied());
    assert_eq!(objects(), published);
    fs::remove_dir_all(server.job_dir(&job)).unwrap();
    assert_eq!(server.get(&format!("{job}/recording.mcap")).body, recording.body);
}
