//! Jobs of some seconds, and what can be done to them.

use std::process::Command;
use std::sync::OnceLock;
use std::thread::sleep;
use std::time::Duration;

use serde_json::{Value, json};

use super::serve_alone;
use super::support::{self, Server};
use super::work::{outputs, scenes};

/// Outputs of a job, by name.
type Outputs = Vec<(&'static str, Vec<u8>)>;

/// Waits until an attempt has written a checkpoint.
pub fn with_checkpoint(server: &Server, job: &str) {
    server.wait_for_frames(job, 2);
    let checkpoints = server.file(job, "checkpoints");
    let found = || std::fs::read_dir(&checkpoints).is_ok_and(|mut files| files.next().is_some());
    for _ in 0..500 {
        if found() {
            return;
        }
        sleep(Duration::from_millis(20));
    }
    panic!("no checkpoint in {}", checkpoints.display());
}

/// What a long run leaves that nothing disturbs.
pub fn undisturbed_long() -> &'static Outputs {
    static OUTPUTS: OnceLock<Outputs> = OnceLock::new();
    OUTPUTS.get_or_init(|| {
        let dir = tempfile::tempdir().unwrap();
        let server = serve_alone(dir.path(), &[]);
        let calm = server.submit(long());
        server.wait_for(&calm, "succeeded");
        outputs(&server, &calm)
    })
}

/// A job that has written a checkpoint, and what it leaves if nothing disturbs it.
pub fn half_way(server: &Server) -> (String, &'static Outputs) {
    // First, so that nothing is over before it is disturbed.
    let expected = undisturbed_long();
    let job = server.submit(long());
    with_checkpoint(server, &job);
    (job, expected)
}

/// Sends a signal to the process of a job's first attempt. Returns false if there is none.
pub fn signal(job: &str, signal: &str) -> bool {
    let id = job.rsplit('/').next().unwrap();
    let sent = Command::new("pkill").args([signal, "-f", &format!("worker.*--attempt 1 --job {id}")]).status();
    sent.unwrap().success()
}

pub fn log(server: &Server, job: &str) -> String {
    String::from_utf8(server.get(&format!("{job}/log")).body).unwrap()
}

/// A run of many frames, of some seconds, that ends with the same bytes wherever it is interrupted.
pub fn long() -> Value {
    let mut scene = scenes().remove(0);
    scene["time"] = json!({ "end": 6.0, "frame_rate": 200 });
    scene
}

/// The path of a sweep of seven jobs, which have ended.
pub fn sweep_of_seven(server: &Server) -> String {
    let request = json!({ "name": "seven", "scene": support::short(), "grid": { "seed": [1, 2, 3, 4, 5, 6, 7] } });
    let answer = server.post_json("/v1/sweeps", &request);
    assert_eq!(answer.status, 202, "{}", String::from_utf8_lossy(&answer.body));
    let path = answer.header("location").to_owned();
    server.wait_until(&path, "the end of the sweep", |sweep| sweep["jobs"]["succeeded"] == 7);
    path
}
