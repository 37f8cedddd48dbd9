//! Files in an object storage: what one machine leaves, all machines have, and nobody sees half of anything. The
//! storage is a real server of S3 on this machine.
//!
//! `GRIDFALL_KILLS` sets how often each part is killed (6 by default).

#[path = "../common/daemon.rs"]
mod daemon;
#[expect(dead_code, reason = "here the database lives on")]
#[path = "../common/postgres.rs"]
mod postgres;
#[path = "../common/s3.rs"]
mod s3;
#[expect(dead_code, reason = "here all jobs end")]
#[path = "../service/http/support.rs"]
mod support;
#[path = "../faults/work.rs"]
mod work;

mod kills;
mod outputs;
mod refusals;

use std::path::Path;
use std::process::{Command, Stdio};

use s3::S3;
use support::Server;

/// A server whose files are in an object storage.
fn serve(s3: &S3, prefix: &str, data_dir: &Path, more: &[&str]) -> Server {
    let mut command = Command::new(env!("CARGO_BIN_EXE_gridfall"));
    command.envs(s3.environment()).env("GRIDFALL_LOG", "warn");
    let url = s3.url(prefix);
    let mut arguments = vec!["--files", &url, "--checkpoint-seconds", "0.2"];
    arguments.extend(more);
    Server::launch(command, data_dir, &arguments, Stdio::inherit())
}
