//! An API server that is away, refuses, or is asked twice; and templates that cannot be used.

use std::path::Path;
use std::process::{Command, Output};
use std::thread::sleep;
use std::time::Duration;

use serde_json::{Value, json};

use super::kubernetes::{Kubernetes, TOKEN};
use super::life::{half_way, log};
use super::support::{self, Server};
use super::work::compare;
use super::{cluster_job, job_manifest, on_kubernetes, on_kubernetes_by, postgres};

fn start(cluster: &Kubernetes, dir: &tempfile::TempDir) -> Server {
    on_kubernetes(cluster, &dir.path().join("data"), &postgres::shared().database(), &[], |job| job)
}

fn ready(server: &Server) -> String {
    String::from_utf8(server.get("/readyz").body).unwrap()
}

fn ready_when(server: &Server, wanted: impl Fn(&str) -> bool) -> String {
    for _ in 0..600 {
        let said = ready(server);
        if wanted(&said) {
            return said;
        }
        sleep(Duration::from_millis(50));
    }
    panic!("{}", ready(server));
}

/// An answer of the API server's.
fn says(code: u16, reason: &str, message: &str) -> Option<(u16, Value)> {
    Some((
        code,
        json!({ "kind": "Status", "apiVersion": "v1", "metadata": {}, "status": "Failure", "code": code,
        "reason": reason, "message": message, "details": { "retryAfterSeconds": 1 } }),
    ))
}

#[test]
fn an_api_server_that_is_away_costs_no_job_and_is_told() {
    let (cluster, dir) = (Kubernetes::start(), tempfile::tempdir().unwrap());
    let server = start(&cluster, &dir);
    let (job, expected) = half_way(&server);
    cluster.kill_api();
    // A question that was on its way says something else, once.
    let refused = "Kubernetes: jobs wait: the API server cannot be asked: Connection refused";
    ready_when(&server, |said| said.contains(refused));
    let waits = server.submit(support::short());
    sleep(Duration::from_secs(1));
    assert_eq!(server.job(&waits)["status"], "queued");
    cluster.start_api();
    server.wait_for(&waits, "succeeded");
    assert_eq!(server.wait_for(&job, "succeeded")["attempt"], 1);
    compare(&server, &job, expected);
    ready_when(&server, |said| !said.contains("jobs wait"));
}

#[test]
fn a_server_starts_without_an_api_server_and_finds_it_later() {
    let (cluster, dir) = (Kubernetes::start(), tempfile::tempdir().unwrap());
    cluster.kill_api();
    let server = start(&cluster, &dir);
    let job = server.submit(support::short());
    ready_when(&server, |said| said.contains("jobs wait"));
    cluster.start_api();
    server.wait_for(&job, "succeeded");
}

#[test]
fn controllers_that_are_away_cost_no_job() {
    let (cluster, dir) = (Kubernetes::start(), tempfile::tempdir().unwrap());
    let server = start(&cluster, &dir);
    let (job, expected) = half_way(&server);
    cluster.kill_controllers();
    let waits = server.submit(support::short());
    assert_eq!(server.wait_for(&job, "succeeded")["attempt"], 1);
    cluster.start_controllers();
    server.wait_for(&waits, "succeeded");
    compare(&server, &job, expected);
}

#[test]
fn a_job_that_was_made_although_the_answer_was_lost_is_not_made_twice() {
    let (cluster, dir) = (Kubernetes::start(), tempfile::tempdir().unwrap());
    let server = start(&cluster, &dir);
    cluster.state().answers.push_back(None);
    let job = server.submit(support::short());
    let ended = server.wait_for(&job, "succeeded");
    assert_eq!(ended["attempt"], 1);
    let state = cluster.state();
    let name = cluster_job(&ended);
    assert_eq!(state.submitted.iter().filter(|job| job["metadata"]["name"] == name.as_str()).count(), 1);
}

#[test]
fn a_server_that_died_before_it_noted_its_offer_finds_the_job_there() {
    let (cluster, dir) = (Kubernetes::start(), tempfile::tempdir().unwrap());
    let server = start(&cluster, &dir);
    // What the server would have made, had it died before the note.
    cluster.kill_controllers();
    let job = server.submit(support::short());
    let name = cluster_job(&server.wait_until(&job, "a Job", |job| job["cluster_job"].is_string()));
    let id = job.rsplit('/').next().unwrap();
    server.kill();
    let database = cluster_database(&cluster);
    postgres::shared()
        .sql(&database, &format!("UPDATE jobs SET cluster_job = NULL, offered_attempt = NULL WHERE id = '{id}'"));
    let url = database_url(&cluster);
    let server = on_kubernetes(&cluster, &dir.path().join("data"), &url, &[], |job| job);
    cluster.start_controllers();
    let ended = server.wait_for(&job, "succeeded");
    assert_eq!((cluster_job(&ended), ended["attempt"].as_u64()), (name, Some(1)));
    assert_eq!(cluster.state().submitted.len(), 1);
}

fn database_url(cluster: &Kubernetes) -> String {
    cluster.state().secret_values().next().unwrap().clone()
}

fn cluster_database(cluster: &Kubernetes) -> String {
    database_url(cluster).split('/').nth(3).unwrap().split('?').next().unwrap().to_owned()
}

#[test]
fn an_api_server_that_has_no_time_is_asked_again() {
    let (cluster, dir) = (Kubernetes::start(), tempfile::tempdir().unwrap());
    let server = start(&cluster, &dir);
    for _ in 0..2 {
        cluster.state().answers.push_back(says(429, "TooManyRequests", "too many requests"));
    }
    let job = server.submit(support::short());
    server.wait_for(&job, "succeeded");
    assert!(!log(&server, &job).contains("does not take it"), "{}", log(&server, &job));
}

#[test]
fn what_kubernetes_refuses_waits_and_is_told() {
    let (cluster, dir) = (Kubernetes::start(), tempfile::tempdir().unwrap());
    let server = start(&cluster, &dir);
    cluster.state().answers.push_back(says(403, "Forbidden", "exceeded quota: jobs"));
    let job = server.submit(support::short());
    let said = ready_when(&server, |said| said.contains("jobs wait"));
    assert!(said.contains("jobs wait: the API server says 403 (Forbidden): exceeded quota: jobs"), "{said}");
    let told = log(&server, &job);
    assert!(told.contains("Kubernetes does not take it: the API server says 403"), "{told}");
    // Others are taken, and it itself after a while.
    let other = server.submit(support::short());
    server.wait_for(&other, "succeeded");
    server.wait_for(&job, "succeeded");
}

#[test]
fn a_server_in_a_pod_finds_its_cluster() {
    let (cluster, dir) = (Kubernetes::start(), tempfile::tempdir().unwrap());
    let (command, data_dir) = (cluster.command_in_pod(env!("CARGO_BIN_EXE_gridfall")), dir.path().join("data"));
    let database = postgres::shared().database();
    let server = on_kubernetes_by(command, &cluster, &data_dir, &database, &[], |job| job);
    let job = server.submit(support::short());
    let ended = server.wait_for(&job, "succeeded");
    let made = cluster.job(&cluster_job(&ended)).unwrap();
    assert_eq!(made["metadata"]["namespace"], super::kubernetes::NAMESPACE);
}

#[test]
fn a_server_without_rights_says_so() {
    let (cluster, dir) = (Kubernetes::start(), tempfile::tempdir().unwrap());
    let configuration = std::fs::read_to_string(cluster.kubeconfig()).unwrap();
    std::fs::write(cluster.kubeconfig(), configuration.replace(TOKEN, "another")).unwrap();
    let server = start(&cluster, &dir);
    let job = server.submit(support::short());
    let said = ready_when(&server, |said| said.contains("jobs wait"));
    assert!(said.contains("the API server says 401 (Unauthorized)"), "{said}");
    assert_eq!(server.job(&job)["status"], "queued");
}

/// A server that does not start with this manifest.
fn refused(cluster: &Kubernetes, dir: &Path, job: &Value, more: &[&str]) -> String {
    let manifest = dir.join("refused.yaml");
    std::fs::write(&manifest, job.to_string()).unwrap();
    let mut command: Command = cluster.command(env!("CARGO_BIN_EXE_gridfall"));
    let Output { status, stderr, .. } = command
        .args(["serve", "--listen", "127.0.0.1:0", "--executor", "kubernetes", "--data-dir"])
        .arg(dir.join("data"))
        .arg("--kubernetes-job")
        .arg(&manifest)
        .args(more)
        .env("GRIDFALL_DATABASE", "postgres://nowhere.invalid/jobs")
        .output()
        .unwrap();
    let said = String::from_utf8(stderr).unwrap();
    assert_eq!(status.code(), Some(2), "{said}");
    said
}

#[test]
fn a_template_that_cannot_be_used_is_refused_when_the_server_starts() {
    let (cluster, dir) = (Kubernetes::start(), tempfile::tempdir().unwrap());
    let whole = job_manifest(&dir.path().join("data"));
    let said = |path: &str, value: Value| {
        let mut job = whole.clone();
        *job.pointer_mut(path).unwrap_or_else(|| panic!("{path}")) = value;
        refused(&cluster, dir.path(), &job, &[])
    };
    // What only the API server knows.
    let unknown = said("/spec/template/spec/tolerations", json!([{ "keys": "nvidia.com/gpu" }]));
    assert!(
        unknown.contains("strict decoding error: unknown field \"spec.template.spec.tolerations[0].keys\""),
        "{unknown}"
    );
    let volume = said("/spec/template/spec/volumes/0/name", json!("other"));
    assert!(volume.contains("the API server does not take a Job of this template"), "{volume}");
    let namespace = refused(&cluster, dir.path(), &whole, &["--kubernetes-namespace", "nowhere"]);
    assert!(namespace.contains("namespace \"nowhere\"") && namespace.contains("--kubernetes-namespace"), "{namespace}");
    let kind = said("/kind", json!("Deployment"));
    assert!(kind.contains("kind is \"Deployment\" of \"batch/v1\"; write `apiVersion: batch/v1`"), "{kind}");
    assert!(cluster.state().jobs.is_empty(), "a trial makes nothing");
}
