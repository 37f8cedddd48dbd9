//! `kill -9` of the server, again and again, on both databases.

use std::path::Path;
use std::thread::sleep;
use std::time::Duration;

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::postgres;
use super::support::Server;
use super::work::{all_succeed, scenes, undisturbed};

/// Jobs that wait or run at any time.
const LOAD: usize = 4;

fn kills() -> usize {
    std::env::var("GRIDFALL_KILLS").map_or(12, |kills| kills.parse().expect("GRIDFALL_KILLS is a number"))
}

fn kill_again_and_again(dir: &Path, database: Option<&str>, seed: u64) {
    let (mut rng, kills) = (ChaCha8Rng::seed_from_u64(seed), kills());
    println!("seed {seed}, {kills} kills");
    let expected = undisturbed(&dir.join("undisturbed"));
    let data_dir = dir.join("killed");
    let mut arguments = vec!["--checkpoint-seconds", "0.2"];
    arguments.extend(database.iter().flat_map(|url| ["--database", url]));
    let start = || Server::start_with(&data_dir, &arguments);
    let mut jobs: Vec<(String, usize)> = Vec::new();
    for _ in 0..kills {
        let server = start();
        let open = jobs.iter().filter(|(job, _)| matches!(status(&server, job).as_str(), "queued" | "running")).count();
        for _ in open..LOAD {
            let kind = jobs.len() % scenes().len();
            jobs.push((server.submit(scenes()[kind].clone()), kind));
        }
        sleep(Duration::from_millis(rng.random_range(200..1200)));
        server.kill();
    }
    let server = start();
    all_succeed(&server, &jobs, &expected);
}

fn status(server: &Server, job: &str) -> String {
    server.job(job)["status"].as_str().unwrap().to_owned()
}

#[test]
fn jobs_survive_kills_of_a_server_with_sqlite() {
    let dir = tempfile::tempdir().unwrap();
    kill_again_and_again(dir.path(), None, 15);
}

#[test]
fn jobs_survive_kills_of_a_server_with_postgresql() {
    let dir = tempfile::tempdir().unwrap();
    let url = postgres::shared().database();
    kill_again_and_again(dir.path(), Some(&url), 16);
}
