//! The database goes away, or the disk takes no more.

use std::process::{Command, Stdio};
use std::thread::sleep;
use std::time::Duration;

use serde_json::json;

use super::postgres::Postgres;
use super::support::{Server, endless, short};
use super::work::{compare, scenes, undisturbed};

#[test]
fn a_job_outlives_an_outage_of_the_database() {
    let dir = tempfile::tempdir().unwrap();
    let expected = undisturbed(&dir.path().join("undisturbed"));
    let mut postgres = Postgres::start();
    let url = postgres.database();
    let server = Server::start_with(&dir.path().join("data"), &["--database", &url]);
    let jobs: Vec<String> = scenes().into_iter().map(|scene| server.submit(scene)).collect();
    server.wait_for_frames(&jobs[0], 2);
    postgres.stop();
    // Meanwhile the server lives, says that it is not ready, and promises nothing.
    assert_eq!(server.get("/livez").status, 200);
    assert_eq!(server.get("/readyz").status, 503);
    let refused = server.post_json("/v1/jobs", &json!({ "scene": scenes()[0] }));
    assert_eq!((refused.status, &refused.json()["code"]), (503, &json!("database_away")));
    assert_eq!(refused.header("retry-after"), "5");
    assert_eq!(server.get(&jobs[0]).status, 503);
    sleep(Duration::from_secs(3));
    postgres.restart();
    for (job, expected) in jobs.iter().zip(&expected) {
        server.wait_for(job, "succeeded");
        compare(&server, job, expected);
    }
    assert_eq!(server.get("/readyz").status, 200);
}

#[test]
fn a_job_whose_files_cannot_be_written_fails_with_the_reason_and_the_server_lives() {
    let dir = tempfile::tempdir().unwrap();
    // No file may grow past 6 MiB: what a full disk does to a recording, and not to the database.
    let mut limited = Command::new("bash");
    limited.args(["-c", "trap '' XFSZ; ulimit -f 6144; exec \"$0\" \"$@\"", env!("CARGO_BIN_EXE_gridfall")]);
    let server = Server::launch(limited, dir.path(), &[], Stdio::inherit());
    let mut scene = endless();
    scene["domain"]["dx"] = 0.004.into();
    let job = server.submit(scene);
    let ended = server.wait_for(&job, "failed");
    assert_eq!(ended["failure"]["code"], "output");
    let message = ended["failure"]["message"].as_str().unwrap();
    assert!(message.contains("recording.mcap") && message.contains("File too large"), "{message}");
    server.wait_for(&server.submit(short()), "succeeded");
}
