//! `kill -9` of processes, the server, and the cluster's daemons, again and again.

use std::path::Path;
use std::process::Command;
use std::thread::sleep;
use std::time::Duration;

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::kubernetes::Kubernetes;
use super::slurm::Slurm;
use super::support::Server;
use super::work::{all_succeed, scenes};
use super::{on_kubernetes, postgres, serve, undisturbed};

/// Jobs that wait or run at any time.
const LOAD: usize = 4;

fn kills() -> usize {
    std::env::var("GRIDFALL_KILLS").map_or(3, |kills| kills.parse().expect("GRIDFALL_KILLS is a number"))
}

/// Kills one of the processes that run attempts. Returns false if there is none.
fn kill_a_process(rng: &mut ChaCha8Rng, data_dir: &str) -> bool {
    let found = Command::new("pgrep").args(["-f", &format!("worker.*{data_dir}")]).output().unwrap().stdout;
    let found = String::from_utf8(found).unwrap();
    let processes: Vec<&str> = found.lines().collect();
    if processes.is_empty() {
        return false;
    }
    let process = processes[rng.random_range(0..processes.len())];
    // It may have ended by itself.
    Command::new("kill").args(["-KILL", process]).stderr(std::process::Stdio::null()).status().unwrap().success()
}

/// A part of a cluster: what kills it, and what starts it again.
type Part<'a> = (&'a dyn Fn(), &'a dyn Fn());

/// Kills processes, the server and two parts of its cluster, each in turn, so that what one leaves meets the death of
/// the next.
fn survive(start: &dyn Fn(&Path, &str) -> Server, parts: [Part; 2], heal: &dyn Fn()) {
    let (mut rng, kills) = (ChaCha8Rng::seed_from_u64(17), kills());
    println!("seed 17, {kills} kills of each part");
    let dir = tempfile::tempdir().unwrap();
    let expected = undisturbed(&dir.path().join("undisturbed"));
    let (data_dir, database) = (dir.path().join("killed"), postgres::shared().database());
    let mut server = start(&data_dir, &database);
    let mut jobs: Vec<(String, usize)> = Vec::new();
    let mut killed = [0; 4];
    while let Some(part) = killed.iter().position(|&n| n < kills) {
        let part = (0..4).min_by_key(|&part| killed[part]).unwrap_or(part);
        let open = jobs.iter().filter(|(job, _)| is_open(&server, job)).count();
        for _ in open..LOAD {
            let kind = jobs.len() % scenes().len();
            jobs.push((server.submit(scenes()[kind].clone()), kind));
        }
        sleep(Duration::from_millis(rng.random_range(300..1500)));
        heal();
        let away = Duration::from_millis(rng.random_range(0..1500));
        let done = match part {
            0 => kill_a_process(&mut rng, &data_dir.display().to_string()),
            1 => {
                server.kill();
                sleep(away);
                server = start(&data_dir, &database);
                true
            }
            _ => {
                let (kill, start) = parts[part - 2];
                kill();
                sleep(away);
                start();
                true
            }
        };
        killed[part] += usize::from(done);
    }
    while jobs.iter().any(|(job, _)| is_open(&server, job)) {
        heal();
        sleep(Duration::from_secs(1));
    }
    all_succeed(&server, &jobs, &expected);
}

#[test]
fn jobs_in_slurm_survive_kills_of_everything() {
    let slurm = Slurm::start();
    let start = |data_dir: &Path, database: &str| serve(&slurm, data_dir, database, &[]);
    let node: Part = (&|| slurm.kill_node(), &|| slurm.start_node());
    let controller: Part = (&|| slurm.kill_controller(), &|| slurm.start_controller());
    // A controller that comes back finds jobs on the node of which it does not know, and takes it out of service.
    survive(&start, [node, controller], &|| slurm.heal());
}

#[test]
fn jobs_in_kubernetes_survive_kills_of_everything() {
    let kubernetes = Kubernetes::start();
    let start = |data_dir: &Path, database: &str| on_kubernetes(&kubernetes, data_dir, database, &[], |job| job);
    let node: Part = (&|| kubernetes.kill_node(), &|| kubernetes.start_node());
    let api: Part = (&|| kubernetes.kill_api(), &|| kubernetes.start_api());
    survive(&start, [node, api], &|| {});
}

fn is_open(server: &Server, job: &str) -> bool {
    ["queued", "running"].contains(&server.job(job)["status"].as_str().unwrap())
}
