//! Jobs that a cluster's scheduler runs end as those that the server runs itself, whatever dies. The cluster is a real
//! Slurm on this machine.
//!
//! `GRIDFALL_KILLS` sets how often each part is killed (3 by default).

#[path = "../common/daemon.rs"]
mod daemon;
#[path = "../common/guide.rs"]
mod guide;
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
mod slurm_jobs;
mod storage;

use std::path::Path;
use std::process::{Command, Stdio};

use serde_json::Value;

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

/// Slurm's name of a job's last attempt.
fn cluster_job(job: &Value) -> String {
    job["cluster_job"].as_str().unwrap_or_else(|| panic!("{job:#} is not in Slurm")).to_owned()
}
