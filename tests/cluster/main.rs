//! Jobs that a cluster's scheduler runs end as those that the server runs itself, whatever dies. The clusters are a
//! real Slurm on this machine, and a stand-in for Kubernetes.
//!
//! `GRIDFALL_KILLS` sets how often each part is killed (3 by default).

#[path = "../common/daemon.rs"]
mod daemon;
#[path = "../common/guide.rs"]
mod guide;
#[path = "../common/kubernetes/mod.rs"]
mod kubernetes;
#[path = "../common/postgres.rs"]
mod postgres;
#[expect(dead_code, reason = "here the storage lives on")]
#[path = "../common/s3.rs"]
mod s3;
#[path = "../common/slurm.rs"]
mod slurm;
#[path = "../service/http/support.rs"]
mod support;
#[expect(dead_code, reason = "these tests start their servers with an environment of their own")]
#[path = "../faults/work.rs"]
mod work;

mod kills;
mod kubernetes_faults;
mod kubernetes_jobs;
mod kubernetes_manifests;
mod life;
mod slurm_jobs;
mod storage;

use std::path::Path;
use std::process::{Command, Stdio};

use serde_json::Value;

use kubernetes::Kubernetes;
use slurm::Slurm;
use support::Server;

/// A server whose jobs run in Slurm, on a database of its own.
fn serve(slurm: &Slurm, data_dir: &Path, database: &str, more: &[&str]) -> Server {
    let mut arguments = vec!["--executor", "slurm", "--database", database, "--cluster-seconds", "0.3"];
    arguments.extend(["--checkpoint-seconds", "0.2", "--sbatch=--gres=gpu:1"]);
    arguments.extend(more);
    let mut command: Command = slurm.command(env!("CARGO_BIN_EXE_gridfall"));
    command.env("GRIDFALL_LOG", "warn");
    Server::launch(command, data_dir, &arguments, Stdio::inherit())
}

/// The manifest that is given to users, for a data directory, with its image changed to what the cluster has.
fn job_manifest(data_dir: &Path) -> Value {
    let text = std::fs::read_to_string(Path::new(guide::ROOT).join("deploy/kubernetes/job.yaml")).unwrap();
    let mut job: Value = serde_saphyr::from_str(&text).unwrap();
    let container = &mut job["spec"]["template"]["spec"]["containers"][0];
    container["image"] = kubernetes::IMAGE.into();
    container["volumeMounts"][0]["mountPath"] = data_dir.display().to_string().into();
    // Recordings tell on how many processors they were made.
    container["resources"]["limits"]["cpu"] = "1".into();
    container["resources"]["requests"]["cpu"] = "1".into();
    job
}

/// A server whose jobs run in the stand-in for Kubernetes, by a manifest that the caller may change.
fn on_kubernetes(
    cluster: &Kubernetes,
    data_dir: &Path,
    database: &str,
    more: &[&str],
    change: impl Fn(Value) -> Value,
) -> Server {
    let command = cluster.command(env!("CARGO_BIN_EXE_gridfall"));
    on_kubernetes_by(command, cluster, data_dir, database, more, change)
}

/// The same by a command of the caller's.
fn on_kubernetes_by(
    mut command: Command,
    cluster: &Kubernetes,
    data_dir: &Path,
    database: &str,
    more: &[&str],
    change: impl Fn(Value) -> Value,
) -> Server {
    std::fs::create_dir_all(data_dir).unwrap();
    let manifest = data_dir.with_extension("job.yaml");
    let secret = format!("gridfall-{}", rand::random::<u32>());
    let mut job = job_manifest(data_dir);
    job["spec"]["template"]["spec"]["containers"][0]["env"][0]["valueFrom"]["secretKeyRef"]["name"] =
        secret.as_str().into();
    std::fs::write(&manifest, change(job).to_string()).unwrap();
    cluster.keep_secret(&secret, "database", database);
    let manifest = manifest.display().to_string();
    let mut arguments = vec!["--executor", "kubernetes", "--kubernetes-job", &manifest, "--cluster-seconds", "0.3"];
    arguments.extend(["--checkpoint-seconds", "0.2"]);
    arguments.extend(more);
    command.env("GRIDFALL_LOG", "warn").env("GRIDFALL_DATABASE", database);
    Server::launch(command, data_dir, &arguments, Stdio::inherit())
}

/// A server that runs jobs itself, and has one processor, as Slurm gives one to each job: recordings tell on what they
/// were made.
fn serve_alone(data_dir: &Path, more: &[&str]) -> Server {
    let mut command = Command::new(env!("CARGO_BIN_EXE_gridfall"));
    command.env("RAYON_NUM_THREADS", "1").env("GRIDFALL_LOG", "warn");
    Server::launch(command, data_dir, more, Stdio::inherit())
}

/// What the scenes leave when nothing disturbs them.
fn undisturbed(dir: &Path) -> Vec<Vec<(&'static str, Vec<u8>)>> {
    work::on(&serve_alone(dir, &[]))
}

/// The scheduler's name of a job's last attempt.
fn cluster_job(job: &Value) -> String {
    job["cluster_job"].as_str().unwrap_or_else(|| panic!("{job:#} is in no cluster")).to_owned()
}
