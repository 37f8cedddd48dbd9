//! `kill -9` of the storage, and of servers that lose their folders with it.

use std::fs;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{scope, sleep};
use std::time::Duration;

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::s3::S3;
use super::work::{all_succeed, scenes, undisturbed};
use super::{postgres, serve};

/// Jobs that wait or run at any time.
const LOAD: usize = 4;

fn kills() -> usize {
    std::env::var("GRIDFALL_KILLS").map_or(6, |kills| kills.parse().expect("GRIDFALL_KILLS is a number"))
}

/// While jobs run, publish and are downloaded.
#[test]
fn nothing_half_is_seen_when_the_storage_dies() {
    let (mut rng, kills) = (ChaCha8Rng::seed_from_u64(17), kills());
    println!("seed 17, {kills} kills");
    let (s3, dir) = (S3::start(), tempfile::tempdir().unwrap());
    let expected = undisturbed(&dir.path().join("undisturbed"));
    // Without copies, all downloads come from the storage.
    let database = postgres::shared().database();
    let at = |name: &str| serve(&s3, "dies", &dir.path().join(name), &["--database", &database, "--cache-bytes", "0"]);
    let server = at("runs");
    let mut jobs: Vec<(String, usize)> = Vec::new();
    let (mut whole, mut away, mut broken) = (0, 0, 0);
    for kill in 0..kills {
        let ended = |job: &str| server.job(job)["finished_at"].is_string();
        let open = jobs.iter().filter(|(job, _)| !ended(job)).count();
        for _ in open..LOAD {
            let kind = jobs.len() % scenes().len();
            jobs.push((server.submit(scenes()[kind].clone()), kind));
        }
        server.wait_until(&jobs[jobs.len() - LOAD].0, "the end of one of them", |job| job["finished_at"].is_string());
        let ended = AtomicBool::new(false);
        let tried = scope(|scope| {
            let downloads = scope.spawn(|| {
                let agent: ureq::Agent =
                    ureq::Agent::config_builder().http_status_as_error(false).proxy(None).build().into();
                let mut seen = (0, 0, 0);
                while !ended.load(Ordering::Relaxed) {
                    for (job, kind) in &jobs {
                        // Until it is published, it is the only one.
                        if server.job(job)["finished_at"].is_string() {
                            let _ = fs::remove_file(server.file(job, "recording.mcap"));
                        }
                        let mut answer = agent.get(format!("{}{job}/recording.mcap", server.url)).call().unwrap();
                        match (answer.status().as_u16(), answer.body_mut().read_to_vec()) {
                            (200, Ok(bytes)) => {
                                assert!(bytes == expected[*kind][0].1, "{job} has other bytes");
                                seen.0 += 1;
                            }
                            (404 | 409, _) => {}
                            (503, _) => seen.1 += 1,
                            (_, Err(_)) => seen.2 += 1,
                            (status, Ok(body)) => panic!("{job}: {status} {}", String::from_utf8_lossy(&body)),
                        }
                    }
                }
                seen
            });
            sleep(Duration::from_millis(rng.random_range(300..1500)));
            s3.kill();
            s3.check_published("dies");
            // Most are over before a request gives up.
            let outage = if kill == 0 { 15_000 } else { rng.random_range(100..1000) };
            sleep(Duration::from_millis(outage));
            s3.restart();
            ended.store(true, Ordering::Relaxed);
            downloads.join().unwrap()
        });
        (whole, away, broken) = (whole + tried.0, away + tried.1, broken + tried.2);
    }
    println!("downloads: {whole} whole, {away} refused, {broken} broken off");
    assert!(whole > 0 && away > 0);
    all_succeed_at_once(&server, &jobs, &expected);
    assert_eq!(s3.check_published("dies"), jobs.len());
}

fn all_succeed_at_once(server: &super::Server, jobs: &[(String, usize)], expected: &[Vec<(&'static str, Vec<u8>)>]) {
    for (job, kind) in jobs {
        let ended = server.wait_for(job, "succeeded");
        assert_eq!(ended["attempt"], 1, "an outage of the storage costs no attempt");
        super::work::compare(server, job, &expected[*kind]);
    }
    println!("{} jobs", jobs.len());
}

/// Each server begins with an empty folder.
#[test]
fn jobs_survive_servers_that_lose_their_folders() {
    let (mut rng, kills) = (ChaCha8Rng::seed_from_u64(18), kills());
    println!("seed 18, {kills} kills");
    let (s3, dir) = (S3::start(), tempfile::tempdir().unwrap());
    let expected = undisturbed(&dir.path().join("undisturbed"));
    let database = postgres::shared().database();
    let start = |n: usize| serve(&s3, "lost", &dir.path().join(n.to_string()), &["--database", &database]);
    let mut jobs: Vec<(String, usize)> = Vec::new();
    for n in 0..kills {
        let server = start(n);
        let ended = |job: &str| server.job(job)["finished_at"].is_string();
        let open = jobs.iter().filter(|(job, _)| !ended(job)).count();
        for _ in open..LOAD {
            let kind = jobs.len() % scenes().len();
            jobs.push((server.submit(scenes()[kind].clone()), kind));
        }
        sleep(Duration::from_millis(rng.random_range(500..2000)));
        server.kill();
        fs::remove_dir_all(dir.path().join(n.to_string())).unwrap();
        s3.check_published("lost");
    }
    let server = start(kills);
    all_succeed(&server, &jobs, &expected);
    assert_eq!(s3.check_published("lost"), jobs.len());
}
