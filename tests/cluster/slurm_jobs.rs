//! The life of a job in Slurm: each of Slurm's states means one thing for the job.

use std::thread::sleep;
use std::time::Duration;

use super::life::{half_way, log, long, signal, sweep_of_seven, with_checkpoint};
use super::support::{self, Server};
use super::work::{compare, scenes};
use super::{cluster_job, guide, postgres, serve, serve_alone, slurm, undisturbed};

/// Waits until Slurm has the job.
fn in_slurm(server: &Server, job: &str) -> String {
    cluster_job(&server.wait_until(job, "a place in Slurm", |job| job["cluster_job"].is_string()))
}

#[test]
fn slurm_runs_a_job_and_can_tell_whose_it_is() {
    let (slurm, dir) = (slurm::shared(), tempfile::tempdir().unwrap());
    let expected = undisturbed(&dir.path().join("undisturbed"));
    let server = serve(slurm, &dir.path().join("slurm"), &postgres::shared().database(), &[]);
    let jobs: Vec<String> = scenes().into_iter().map(|scene| server.submit(scene)).collect();
    for (job, expected) in jobs.iter().zip(&expected) {
        let ended = server.wait_for(job, "succeeded");
        assert_eq!(ended["attempt"], 1);
        assert_eq!(ended["backend"]["kind"], "cpu");
        compare(&server, job, expected);
        let number = cluster_job(&ended);
        slurm.wait_for(&number, "COMPLETED");
        let record = slurm.ask("scontrol", &["show", "job", &number]);
        let name = format!("JobName=gridfall {}", ended["name"].as_str().unwrap());
        let comment = format!("Comment={}", ended["id"].as_str().unwrap());
        for said in [&name, &comment, "gpu:1", "TimeLimit=00:10:00", "Requeue=1"] {
            assert!(record.contains(said), "{said} is not in {record}");
        }
        assert!(log(&server, job).contains(&format!("attempt 1 was handed to Slurm as job {number}")));
    }
    let ready = server.get("/readyz");
    assert_eq!(ready.status, 200, "{}", String::from_utf8_lossy(&ready.body));
}

#[test]
fn a_sweep_is_an_array() {
    let (slurm, dir) = (slurm::shared(), tempfile::tempdir().unwrap());
    let server = serve(slurm, dir.path(), &postgres::shared().database(), &[]);
    let path = sweep_of_seven(&server);
    let id = path.rsplit('/').next().unwrap();
    let jobs = server.get(&format!("/v1/jobs?sweep={id}&limit=10")).json();
    let mut arrays: Vec<String> = jobs["jobs"].as_array().unwrap().iter().map(cluster_job).collect();
    arrays.sort();
    let of: Vec<(&str, &str)> = arrays.iter().map(|job| job.split_once('_').expect("it is a task")).collect();
    // Slurm was set up to take five at most.
    let arrays: std::collections::BTreeSet<&str> = of.iter().map(|(array, _)| *array).collect();
    assert_eq!(arrays.len(), 2, "{of:?}");
    for array in arrays {
        let record = slurm.ask("scontrol", &["show", "job", array]);
        assert!(record.contains(&format!("Comment={id}")), "{record}");
        assert!(record.contains("JobName=gridfall seven"), "{record}");
    }
}

#[test]
fn a_job_that_is_canceled_here_leaves_slurm() {
    let (slurm, dir) = (slurm::shared(), tempfile::tempdir().unwrap());
    let server = serve(slurm, dir.path(), &postgres::shared().database(), &["--sbatch=--gres=gpu:2"]);
    let (runs, waits) = (server.submit(support::endless()), server.submit(support::endless()));
    let running = cluster_job(&server.wait_for_frames(&runs, 1));
    let waiting = in_slurm(&server, &waits);
    for job in [&waits, &runs] {
        assert!([200, 202].contains(&server.call("POST", &format!("{job}/cancel"), &[], "").status));
        server.wait_for(job, "canceled");
    }
    slurm.wait_for(&waiting, "CANCELLED");
    for _ in 0..200 {
        if ["CANCELLED", "COMPLETED"].contains(&slurm.state(&running).as_str()) {
            return;
        }
        sleep(Duration::from_millis(100));
    }
    panic!("job {running} is {}", slurm.state(&running));
}

#[test]
fn a_job_that_is_canceled_in_slurm_is_canceled() {
    let (slurm, dir) = (slurm::shared(), tempfile::tempdir().unwrap());
    let server = serve(slurm, dir.path(), &postgres::shared().database(), &["--sbatch=--gres=gpu:2"]);
    let (runs, waits) = (server.submit(support::endless()), server.submit(support::endless()));
    let running = cluster_job(&server.wait_for_frames(&runs, 1));
    let waiting = in_slurm(&server, &waits);
    for number in [&waiting, &running] {
        slurm.ask("scancel", &[number]);
    }
    for job in [&waits, &runs] {
        server.wait_for(job, "canceled");
        assert!(log(&server, job).contains("somebody canceled it there"), "{}", log(&server, job));
    }
}

#[test]
fn a_job_that_loses_its_place_goes_on_from_where_it_was() {
    // Its own: what takes the place of a job might take that of another test's.
    let (slurm, dir) = (slurm::Slurm::start(), tempfile::tempdir().unwrap());
    let server = serve(&slurm, dir.path(), &postgres::shared().database(), &[]);
    let (job, expected) = half_way(&server);
    let first = cluster_job(&server.job(&job));
    let other = ["--parsable", "--partition=high", "--gres=gpu:2", "--output=/dev/null", "--wrap=sleep 1"];
    slurm.ask("sbatch", &other);
    let ended = server.wait_for(&job, "succeeded");
    // Slurm would start the same attempt once more.
    slurm.wait_for(&first, "CANCELLED");
    assert_eq!(ended["attempt"], 2, "{}", log(&server, &job));
    assert_ne!(cluster_job(&ended), first);
    let told = log(&server, &job);
    assert!(told.contains("runs after frame"), "{told}");
    compare(&server, &job, expected);
}

#[test]
fn a_process_that_has_lost_its_job_changes_nothing() {
    let (slurm, dir) = (slurm::shared(), tempfile::tempdir().unwrap());
    let database = postgres::shared().database();
    let server = serve(slurm, dir.path(), &database, &[]);
    let (job, expected) = half_way(&server);
    // To everybody else it is as if its node had died; and a server that runs jobs itself cannot end it.
    assert!(signal(&job, "-STOP"));
    server.terminate();
    let server = serve_alone(dir.path(), &["--database", &database]);
    server.wait_until(&job, "a second attempt", |job| job["attempt"] == 2);
    assert!(signal(&job, "-CONT"));
    server.wait_for(&job, "succeeded");
    compare(&server, &job, expected);
    for _ in 0..100 {
        if log(&server, &job).contains("attempt 1: ended after the job was taken from it") {
            compare(&server, &job, expected);
            return;
        }
        sleep(Duration::from_millis(100));
    }
    panic!("the process goes on: {}", log(&server, &job));
}

#[test]
fn a_process_that_hangs_is_ended_and_another_goes_on() {
    let (slurm, dir) = (slurm::shared(), tempfile::tempdir().unwrap());
    let server = serve(slurm, dir.path(), &postgres::shared().database(), &[]);
    let job = server.submit(long());
    with_checkpoint(&server, &job);
    let first = cluster_job(&server.job(&job));
    assert!(signal(&job, "-STOP"));
    assert_eq!(server.wait_for(&job, "succeeded")["attempt"], 2);
    assert!(log(&server, &job).contains("nothing was heard of it for too long"), "{}", log(&server, &job));
    slurm.wait_for(&first, "CANCELLED");
}

#[test]
fn a_node_that_goes_down_costs_no_job() {
    let (slurm, dir) = (slurm::Slurm::start(), tempfile::tempdir().unwrap());
    let server = serve(&slurm, dir.path(), &postgres::shared().database(), &[]);
    let (job, expected) = half_way(&server);
    let first = cluster_job(&server.job(&job));
    slurm.ask("scontrol", &["update", "nodename=ALL", "state=down", "reason=test"]);
    slurm.wait_for_node();
    let ended = server.wait_for(&job, "succeeded");
    assert_eq!(ended["attempt"], 2, "{}", log(&server, &job));
    slurm.wait_for(&first, "CANCELLED");
    compare(&server, &job, expected);
}

#[test]
fn a_database_that_is_away_for_a_while_costs_no_job() {
    let (slurm, dir) = (slurm::shared(), tempfile::tempdir().unwrap());
    let mut database = postgres::Postgres::start();
    let server = serve(slurm, dir.path(), &database.database(), &[]);
    let (job, expected) = half_way(&server);
    database.stop();
    sleep(Duration::from_secs(2));
    database.restart();
    server.wait_for(&job, "succeeded");
    compare(&server, &job, expected);
}

#[test]
fn a_program_that_does_not_start_fails_the_job_with_what_it_said() {
    let (slurm, dir) = (slurm::shared(), tempfile::tempdir().unwrap());
    let server = serve(slurm, dir.path(), &postgres::shared().database(), &["--cluster-program", "/nowhere/gridfall"]);
    let job = server.submit(support::short());
    let ended = server.wait_for(&job, "failed");
    assert_eq!(ended["failure"]["code"], "crashed");
    let message = ended["failure"]["message"].as_str().unwrap();
    assert!(message.contains("ended as FAILED") && message.contains("/nowhere/gridfall"), "{message}");
}

#[test]
fn what_slurm_refuses_waits_and_is_told() {
    let (slurm, dir) = (slurm::shared(), tempfile::tempdir().unwrap());
    let database = postgres::shared().database();
    let server = serve(slurm, dir.path(), &database, &["--sbatch=--partition=none"]);
    let job = server.submit(support::short());
    let ready = || String::from_utf8(server.get("/readyz").body).unwrap();
    for _ in 0..200 {
        if ready().contains("jobs wait") {
            break;
        }
        sleep(Duration::from_millis(50));
    }
    assert!(ready().contains("jobs wait: sbatch") && ready().contains("partition"), "{}", ready());
    assert_eq!(server.job(&job)["status"], "queued");
    server.terminate();
    // Set right, it runs.
    let server = serve(slurm, dir.path(), &database, &[]);
    server.wait_for(&job, "succeeded");
}

#[test]
fn a_server_says_what_it_lacks_for_slurm() {
    let (slurm, dir) = (slurm::shared(), tempfile::tempdir().unwrap());
    let said = |arguments: &[&str]| {
        let mut server = slurm.command(env!("CARGO_BIN_EXE_gridfall"));
        server.args(["serve", "--listen", "127.0.0.1:0", "--data-dir"]).arg(dir.path()).args(arguments);
        let answer = server.output().unwrap();
        assert_eq!(answer.status.code(), Some(2), "{answer:?}");
        String::from_utf8(answer.stderr).unwrap()
    };
    let slurm_on = |more: &'static str| said(&["--executor", "slurm", "--database", "postgres://db/jobs", more]);
    assert!(said(&["--executor", "slurm"]).contains("give --database postgres://"));
    assert!(said(&["--sbatch=--gres=gpu:1"]).contains("add --executor slurm"));
    assert!(slurm_on("--adapter=a,b").contains("give --adapter once at most"));
    assert!(slurm_on("--sbatch=--array=1").contains("leave it out"));
}

#[test]
fn the_commands_of_the_guide_run() {
    let package = tempfile::tempdir().unwrap();
    guide::install_package(package.path());
    let (_, blocks) = guide::pages().into_iter().find(|(name, _)| name == "cluster").expect("there is such a page");
    let (slurm, database) = (slurm::shared(), postgres::shared().database());
    let environment = [("SLURM_CONF", slurm.configuration()), ("GRIDFALL_DATABASE", database)];
    let environment = environment.each_ref().map(|(name, value)| (*name, value.as_str()));
    assert!(guide::run("cluster", &blocks, package.path(), &environment));
}
