//! Servers that share a queue, and clocks that jump.

use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::thread::sleep;
use std::time::Duration;

use super::postgres::Postgres;
use super::support::{Server, short};
use super::work::{compare, scenes, undisturbed};

/// Jobs that two servers take from one queue.
const JOBS: usize = 24;

#[test]
fn two_servers_of_one_queue_run_each_job_once() {
    let dir = tempfile::tempdir().unwrap();
    let postgres = Postgres::start();
    let url = postgres.database();
    let start = |name: &str| {
        Server::start_with(&dir.path().join(name), &["--database", &url, "--adapter", "cpu", "--adapter", "cpu"])
    };
    let servers = [start("one"), start("two")];
    let jobs: Vec<String> = (0..JOBS).map(|n| servers[n % 2].submit(short())).collect();
    for job in &jobs {
        let ended = servers[0].wait_for(job, "succeeded");
        assert_eq!(ended["attempt"], 1, "{ended:#}");
    }
    // Each by one of them, and both at work.
    let files =
        |server: &Server| jobs.iter().filter(|job| server.job_dir(job).join("1/recording.mcap").exists()).count();
    let [one, two] = [0, 1].map(|n| files(&servers[n]));
    println!("{one} and {two} of {JOBS} jobs");
    assert_eq!(one + two, JOBS);
    assert!(one > 0 && two > 0);
}

#[test]
fn clocks_may_jump() {
    let dir = tempfile::tempdir().unwrap();
    let expected = undisturbed(&dir.path().join("undisturbed"));
    let clock = dir.path().join("clock");
    std::fs::write(&clock, "+0").unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_gridfall"));
    command
        .env("LD_PRELOAD", faketime())
        .env("FAKETIME_TIMESTAMP_FILE", &clock)
        .env("FAKETIME_NO_CACHE", "1")
        .env("FAKETIME_DONT_FAKE_MONOTONIC", "1");
    let server = Server::launch(command, &dir.path().join("data"), &["--checkpoint-seconds", "0.2"], Stdio::inherit());
    let jobs: Vec<String> = scenes().into_iter().map(|scene| server.submit(scene)).collect();
    // An hour on, two back, and to the day after tomorrow, while jobs run and wait.
    for (frames, jump) in [(2, "+3600"), (10, "-3600"), (20, "+172800")] {
        server.wait_for_frames(&jobs[0], frames);
        std::fs::write(&clock, jump).unwrap();
        sleep(Duration::from_millis(300));
    }
    for (job, expected) in jobs.iter().zip(&expected) {
        let ended = server.wait_for(job, "succeeded");
        println!("{} in {} attempts", ended["name"], ended["attempt"]);
        compare(&server, job, expected);
    }
    let day = |time: &serde_json::Value| time.as_str().unwrap()[..10].to_owned();
    let last = server.job(jobs.last().unwrap());
    assert_ne!(day(&last["created_at"]), day(&last["finished_at"]), "the clock did jump");
}

/// The library that answers for the clock.
fn faketime() -> PathBuf {
    let found = std::fs::read_dir("/usr/lib").unwrap().filter_map(Result::ok);
    found
        .map(|entry| entry.path().join("faketime/libfaketimeMT.so.1"))
        .find(|path| path.exists())
        .expect("faketime is there; tests/run installs it")
}
