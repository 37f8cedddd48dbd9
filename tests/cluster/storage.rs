//! Nodes that share nothing with the server but the database and an object storage.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Stdio;

use serde_json::{Value, json};

use super::kubernetes::Kubernetes;
use super::s3::S3;
use super::support::Server;
use super::work::{compare, outputs, scenes};
use super::{life, on_kubernetes_by, postgres, slurm, undisturbed};

/// The folders of processes in a node's folder.
fn folders(scratch: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(scratch).unwrap().map(|entry| entry.unwrap().path());
    entries.filter(|path| path.is_dir()).collect()
}

#[test]
fn nodes_need_no_shared_directory() {
    let (slurm, s3, dir) = (slurm::shared(), S3::start(), tempfile::tempdir().unwrap());
    let (scratch, database) = (dir.path().join("scratch"), postgres::shared().database());
    fs::create_dir(&scratch).unwrap();
    let expected = undisturbed(&dir.path().join("undisturbed"));
    let serve = |name: &str| {
        let mut command = slurm.command(env!("CARGO_BIN_EXE_gridfall"));
        command.envs(s3.environment()).env("GRIDFALL_LOG", "warn").env("GRIDFALL_CLUSTER_SCRATCH", &scratch);
        let url = s3.url("slurm");
        let arguments = ["--executor", "slurm", "--database", &database, "--files", &url, "--cluster-seconds", "0.3"];
        let arguments = [&arguments[..], &["--checkpoint-seconds", "0.2"]].concat();
        Server::launch(command, &dir.path().join(name), &arguments, Stdio::inherit())
    };
    let server = serve("server");
    let jobs: Vec<String> = scenes().into_iter().map(|scene| server.submit(scene)).collect();
    for (job, expected) in jobs.iter().zip(&expected) {
        server.wait_for(job, "succeeded");
        compare(&server, job, expected);
        let log = String::from_utf8(server.get(&format!("{job}/log")).body).unwrap();
        assert!(log.contains("was handed to Slurm") && log.contains("attempt 1 runs from the start"), "{log}");
    }
    // What is lost with its node goes on from where the storage has it.
    let calm = server.submit(life::long());
    server.wait_for(&calm, "succeeded");
    let expected = outputs(&server, &calm);
    let job = server.submit(life::long());
    let with_checkpoint = |server: &Server, job: &str| {
        let folder = format!("slurm/jobs/{}", job.rsplit('/').next().unwrap());
        let saved = || s3.objects(&folder).iter().any(|(path, _)| path.ends_with("progress.json"));
        server.wait_until(job, "a checkpoint", |_| saved())
    };
    with_checkpoint(&server, &job);
    // Its frames are seen while it runs, and after the server has lost its folder.
    server.wait_until(&format!("{job}/frames"), "frames", |list| list["frames"].as_u64() > Some(0));
    assert!(life::signal(&job, "-KILL"), "it runs");
    assert_eq!(folders(&scratch).len(), 1);
    folders(&scratch).iter().for_each(|folder| fs::remove_dir_all(folder).unwrap());
    server.kill();
    let server = serve("another");
    let ended = server.wait_for(&job, "succeeded");
    assert_eq!(ended["attempt"], 2);
    compare(&server, &job, &expected);
    let log = String::from_utf8(server.get(&format!("{job}/log")).body).unwrap();
    assert!(log.contains("attempt 2 runs after frame"), "{log}");
    // A canceled job leaves what it came to.
    let job = server.submit(endless());
    with_checkpoint(&server, &job);
    server.wait_until(&format!("{job}/frames"), "frames", |list| list["frames"].as_u64() > Some(5));
    assert_eq!(server.post_json(&format!("{job}/cancel"), &json!({})).status, 202);
    server.wait_for(&job, "canceled");
    assert!(server.get(&format!("{job}/recording.mcap")).body.len() > 1000);
    server.wait_until(&job, "the end of the nodes' copies", |_| folders(&scratch).is_empty());
    assert_eq!(s3.check_published("slurm"), jobs.len() + 3);
}

#[test]
fn containers_need_no_shared_volume() {
    let (cluster, s3, dir) = (Kubernetes::start(), S3::start(), tempfile::tempdir().unwrap());
    let scratch = dir.path().join("scratch");
    fs::create_dir(&scratch).unwrap();
    let expected = undisturbed(&dir.path().join("undisturbed"));
    let mut command = cluster.command(env!("CARGO_BIN_EXE_gridfall"));
    command.envs(s3.environment()).env("GRIDFALL_CLUSTER_SCRATCH", &scratch);
    let change = |mut job: Value| {
        let pod = &mut job["spec"]["template"]["spec"];
        pod["volumes"] = json!([{ "name": "scratch", "emptyDir": {} }]);
        let container = &mut pod["containers"][0];
        container["volumeMounts"] = json!([{ "name": "scratch", "mountPath": scratch.display().to_string() }]);
        let variables = container["env"].as_array_mut().unwrap();
        variables.extend(s3.environment().map(|(name, value)| json!({ "name": name, "value": value })));
        job
    };
    let (database, url) = (postgres::shared().database(), s3.url("kubernetes"));
    let data_dir = dir.path().join("server");
    let server = on_kubernetes_by(command, &cluster, &data_dir, &database, &["--files", &url], change);
    let jobs: Vec<String> = scenes().into_iter().map(|scene| server.submit(scene)).collect();
    for (job, expected) in jobs.iter().zip(&expected) {
        server.wait_for(job, "succeeded");
        compare(&server, job, expected);
        let log = String::from_utf8(server.get(&format!("{job}/log")).body).unwrap();
        assert!(log.contains("was handed to Kubernetes") && log.contains("attempt 1 runs from the start"), "{log}");
    }
    assert_eq!(s3.check_published("kubernetes"), jobs.len());
}

fn endless() -> Value {
    let mut scene = life::long();
    scene["time"]["end"] = 400.0.into();
    scene
}
