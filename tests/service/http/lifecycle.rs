//! Every accepted job reaches a terminal state: succeeded, failed or canceled, also across crashes
//! and shutdowns.

use std::collections::BTreeSet;

use gridfall_service::store::MAX_DEATHS;
use serde_json::{Value, json};

use super::super::postgres;
use super::support::{Server, endless, scene, short};

/// Long enough to be interrupted in the middle.
fn medium() -> Value {
    scene(4.0)
}

#[test]
fn a_job_runs_from_submission_to_success() {
    let dir = tempfile::tempdir().unwrap();
    let server = Server::start(dir.path());
    assert_eq!(server.get("/livez").json()["status"], "live");

    let answer = server.post_json("/v1/jobs", &json!({ "scene": short(), "name": "first" }));
    assert_eq!(answer.status, 202);
    let submitted = answer.json();
    let path = answer.header("location").to_owned();
    assert_eq!(path, format!("/v1/jobs/{}", submitted["id"].as_str().unwrap()));
    assert_eq!((&submitted["name"], &submitted["attempt"]), (&json!("first"), &json!(0)));
    assert_eq!(submitted["particles"], 64);

    let job = server.wait_for(&path, "succeeded");
    let progress = &job["progress"];
    assert_eq!((&progress["frames_written"], &progress["frames"]), (&json!(6), &json!(6)));
    assert_eq!((&progress["fraction"], &progress["eta_s"]), (&json!(1.0), &Value::Null));
    assert!((progress["sim_time"].as_f64().unwrap() - 0.05).abs() < 1e-12, "{progress}");
    assert!(progress["step"].as_u64().unwrap() > 0);
    assert!(progress["particle_steps_per_s"].as_f64().unwrap() > 0.0);
    assert_eq!((&job["attempt"], &job["queue_position"], &job["failure"]), (&json!(1), &Value::Null, &Value::Null));
    assert_eq!(job["backend"]["kind"], "cpu");
    assert!(!job["backend"]["reason"].as_str().unwrap().is_empty());
    let time = |name: &str| job[name].as_str().unwrap().parse::<jiff::Timestamp>().unwrap();
    assert!(time("created_at") <= time("started_at") && time("started_at") <= time("finished_at"));
    assert_eq!(server.get("/readyz").status, 200);
}

#[test]
fn a_job_unchanged_is_not_sent_again() {
    let dir = tempfile::tempdir().unwrap();
    let server = Server::start(dir.path());
    let path = server.submit(short());
    server.wait_for(&path, "succeeded");
    let tag = server.get(&path).header("etag").to_owned();
    let again = server.call("GET", &path, &[("if-none-match", &tag)], "");
    assert_eq!((again.status, again.body.len()), (304, 0));
    assert_eq!(server.call("GET", &path, &[("if-none-match", "\"other\"")], "").status, 200);
}

#[test]
fn overrides_change_the_scene_and_a_repeated_request_makes_one_job() {
    let dir = tempfile::tempdir().unwrap();
    let server = Server::start(dir.path());
    let body = json!({ "scene": short(), "overrides": { "time.end": 0.02, "solver.kernel": "quadratic" } }).to_string();
    let headers = [("content-type", "application/json"), ("idempotency-key", "k-1")];
    let first = server.call("POST", "/v1/jobs", &headers, body.clone());
    let again = server.call("POST", "/v1/jobs", &headers, body);
    assert_eq!((first.status, again.status), (202, 202));
    assert_eq!(first.json()["id"], again.json()["id"]);
    assert_eq!(first.json()["progress"]["frames"], 3);
    let other = server.call("POST", "/v1/jobs", &headers, json!({ "scene": short() }).to_string());
    assert_eq!((other.status, &other.json()["code"]), (422, &json!("idempotency_key_reused")));
    server.wait_for(first.header("location"), "succeeded");

    let rerun = format!("/v1/jobs/{}/rerun", first.json()["id"].as_str().unwrap());
    let again = |overrides| server.call("POST", &rerun, &headers, json!({ "overrides": overrides }).to_string());
    assert_eq!(again(json!({ "seed": 2 })).json()["code"], "idempotency_key_reused", "of the submission");
    let headers = [("content-type", "application/json"), ("idempotency-key", "k-2")];
    let again = |overrides| server.call("POST", &rerun, &headers, json!({ "overrides": overrides }).to_string());
    let (one, two) = (again(json!({ "seed": 2 })), again(json!({ "seed": 2 })));
    assert_eq!((one.status, two.status, &one.json()["id"]), (202, 202, &two.json()["id"]));
    assert_eq!(again(json!({ "seed": 3 })).json()["code"], "idempotency_key_reused");
}

#[test]
fn the_example_request_runs() {
    let dir = tempfile::tempdir().unwrap();
    let server = Server::start(dir.path());
    let body = include_str!("../../../api/examples/submit-job.json");
    let answer = server.call("POST", "/v1/jobs", &[("content-type", "application/json")], body);
    assert_eq!((answer.status, &answer.json()["name"]), (202, &json!("my first job")));
    server.wait_for(answer.header("location"), "succeeded");
}

#[test]
fn a_running_job_is_canceled_and_keeps_its_recording() {
    let dir = tempfile::tempdir().unwrap();
    let server = Server::start(dir.path());
    let (running, waiting) = (server.submit(endless()), server.submit(short()));
    server.wait_for_frames(&running, 3);
    assert_eq!(server.job(&waiting)["queue_position"], 1);

    let canceled = server.call("POST", &format!("{waiting}/cancel"), &[], "");
    assert_eq!((canceled.status, &canceled.json()["status"]), (200, &json!("canceled")));
    let asked = server.call("POST", &format!("{running}/cancel"), &[], "");
    assert_eq!((asked.status, &asked.json()["cancel_requested"]), (202, &json!(true)));
    let job = server.wait_for(&running, "canceled");
    assert!(job["finished_at"].is_string());
    let again = server.call("POST", &format!("{running}/cancel"), &[], "");
    assert_eq!((again.status, again.json()), (200, job.clone()));

    let frames = frames_of(&server.get(&format!("{running}/recording.mcap")).body);
    assert_eq!(job["progress"]["frames_written"], frames);

    // The worker continues with the next job.
    server.wait_for(&server.submit(short()), "succeeded");
}

#[test]
fn only_jobs_that_have_ended_are_deleted_and_their_files_go_with_them() {
    let dir = tempfile::tempdir().unwrap();
    let server = Server::start(dir.path());
    let path = server.submit(short());
    server.wait_for(&path, "succeeded");
    let file = server.file(&path, "recording.mcap");
    assert!(file.exists());
    assert_eq!(server.call("DELETE", &path, &[], "").status, 204);
    assert_eq!(server.get(&path).status, 404);
    assert!(!file.parent().unwrap().exists());
}

#[test]
fn lists_are_filtered_and_paged() {
    let dir = tempfile::tempdir().unwrap();
    let server = Server::start(dir.path());
    let paths: Vec<String> = (0..5).map(|_| server.submit(short())).collect();
    paths.iter().for_each(|path| drop(server.wait_for(path, "succeeded")));
    let (mut seen, mut query) = (Vec::new(), "/v1/jobs?limit=2&status=succeeded".to_owned());
    loop {
        let page = server.get(&query).json();
        seen.extend(
            page["jobs"].as_array().unwrap().iter().map(|job| format!("/v1/jobs/{}", job["id"].as_str().unwrap())),
        );
        let Some(cursor) = page["next_cursor"].as_str() else { break };
        query = format!("/v1/jobs?limit=2&status=succeeded&cursor={cursor}");
    }
    seen.reverse();
    assert_eq!(seen, paths);
    assert_eq!(server.get("/v1/jobs?status=failed").json()["jobs"], json!([]));
}

#[test]
fn after_a_crash_the_running_job_runs_again_the_queued_ones_run_and_the_finished_ones_are_there() {
    let dir = tempfile::tempdir().unwrap();
    let server = Server::start(dir.path());
    let finished = server.submit(short());
    let finished_job = server.wait_for(&finished, "succeeded");
    let recording = server.get(&format!("{finished}/recording.mcap")).body;
    let (running, queued) = (server.submit(medium()), server.submit(short()));
    server.wait_for_frames(&running, 2);
    server.kill();

    let server = Server::start(dir.path());
    assert_eq!(server.job(&finished), finished_job);
    assert_eq!(server.get(&format!("{finished}/recording.mcap")).body, recording);
    let again = server.wait_for(&running, "succeeded");
    assert_eq!(again["attempt"], 2);
    assert_eq!(again["progress"]["frames_written"], 401);
    assert_eq!(frames_of(&server.get(&format!("{running}/recording.mcap")).body), 401);
    let after = server.wait_for(&queued, "succeeded");
    assert_eq!(after["attempt"], 1);
    // It kept its place: the queued job came after it.
    assert!(again["finished_at"].as_str() <= after["started_at"].as_str());
}

#[test]
fn servers_of_one_database_take_over_from_each_other() {
    let dir = tempfile::tempdir().unwrap();
    let database = postgres::shared().database();
    let start = |name: &str| Server::start_with(&dir.path().join(name), &["--database", &database]);
    let first = start("first");
    let job = first.submit(endless());
    first.wait_for_frames(&job, 2);
    // The one has this job, so the other takes the next.
    let second = start("second");
    second.wait_for(&second.submit(short()), "succeeded");
    assert_eq!(second.job(&job)["attempt"], 1, "its worker lives");
    first.kill();
    second.wait_until(&job, "the end of the lease", |job| job["attempt"] == 2 && job["status"] == "running");
    second.call("POST", &format!("{job}/cancel"), &[], "");
    second.wait_for(&job, "canceled");
}

#[test]
fn a_job_that_brings_down_every_server_fails_and_keeps_its_recording() {
    let dir = tempfile::tempdir().unwrap();
    // Later attempts save sooner. None of these comes that far.
    let start = || Server::start_with(dir.path(), &["--checkpoint-seconds", "1e6"]);
    let mut server = start();
    let job = server.submit(endless());
    for attempt in 1..=MAX_DEATHS {
        server.wait_until(&job, "the next attempt", |job| {
            job["attempt"] == attempt && job["progress"]["frames_written"].as_u64() >= Some(2)
        });
        server.kill();
        server = start();
    }
    let failed = server.job(&job);
    assert_eq!((&failed["status"], &failed["failure"]["code"]), (&json!("failed"), &json!("crashed")));
    let message = failed["failure"]["message"].as_str().unwrap();
    assert!(message.contains("5 times") && message.contains("attempt 5 runs from the start"), "{message}");
    assert!(frames_of(&server.get(&format!("{job}/recording.mcap")).body) >= 2);
    server.wait_for(&server.submit(short()), "succeeded");
}

#[cfg(unix)]
#[test]
fn sigterm_puts_the_running_job_back_and_is_not_held_against_it() {
    let dir = tempfile::tempdir().unwrap();
    let job = {
        let server = Server::start(dir.path());
        let job = server.submit(endless());
        server.wait_for_frames(&job, 2);
        assert!(server.terminate().success());
        job
    };
    // More often than crashes are forgiven.
    for attempt in 2..=MAX_DEATHS + 1 {
        let server = Server::start(dir.path());
        server.wait_until(&job, "the next attempt", |job| {
            job["attempt"] == attempt && job["progress"]["frames_written"].as_u64() >= Some(2)
        });
        assert!(server.terminate().success());
    }
    let server = Server::start(dir.path());
    server.wait_for_frames(&job, 1);
    server.call("POST", &format!("{job}/cancel"), &[], "");
    server.wait_for(&job, "canceled");
}

#[test]
fn metrics_count_jobs_without_naming_them() {
    let dir = tempfile::tempdir().unwrap();
    let server = Server::start(dir.path());
    let job = server.submit(short());
    server.wait_for(&job, "succeeded");
    server.get("/nothing/at/all");
    // The worker counts a job just after its end can be seen.
    let ended = "gridfall_jobs_ended_total{status=\"succeeded\"} 1";
    let read = || {
        let answer = server.call("GET", "/metrics", &[("accept", "application/openmetrics-text;version=1.0.0")], "");
        assert!(answer.header("content-type").starts_with("application/openmetrics-text"));
        String::from_utf8(answer.body).unwrap()
    };
    let mut text = read();
    for _ in 0..100 {
        if text.contains(ended) {
            break;
        }
        std::thread::sleep(std::time::Duration::from_millis(50));
        text = read();
    }
    let lines: BTreeSet<&str> = text.lines().collect();
    for line in [
        "gridfall_jobs{status=\"succeeded\"} 1",
        "gridfall_jobs{status=\"queued\"} 0",
        ended,
        "gridfall_frames_total 6",
        "gridfall_http_requests_total{method=\"POST\",route=\"/v1/jobs\",status=\"202\"} 1",
        "gridfall_http_requests_total{method=\"GET\",route=\"unmatched\",status=\"404\"} 1",
        "# EOF",
    ] {
        assert!(lines.contains(line), "{line:?} is not in\n{text}");
    }
    for series in [
        "gridfall_queue_wait_seconds_count 1",
        "gridfall_attempt_duration_seconds_count{status=\"succeeded\"} 1",
        "gridfall_leases_lost_total 0",
        "gridfall_last_checkpoint_timestamp_seconds ",
        "gridfall_stage_seconds_total{stage=\"validate\"}",
        "gridfall_stage_seconds_total{stage=\"load\"}",
        "gridfall_stage_seconds_total{stage=\"simulate\"}",
    ] {
        assert!(text.contains(series), "{series:?} is not in\n{text}");
    }
    assert!(!text.contains(job.rsplit('/').next().unwrap()), "a label has a job's id");
}

/// Number of frames in a recording, by its index; the summary must be complete.
pub fn frames_of(recording: &[u8]) -> u64 {
    let summary = mcap::Summary::read(recording).unwrap().expect("a recording has a summary");
    let statistics = summary.stats.expect("a recording has statistics");
    let diagnostics = summary.channels.values().find(|channel| channel.topic == "/diagnostics").unwrap();
    statistics.channel_message_counts.get(&diagnostics.id).copied().unwrap_or(0)
}

#[test]
fn small_jobs_run_beside_others_on_one_device() {
    let dir = tempfile::tempdir().unwrap();
    let alone = Server::start(&dir.path().join("alone"));
    let job = alone.submit(medium());
    alone.wait_for(&job, "succeeded");
    let expected = alone.get(&format!("{job}/recording.mcap")).body;
    let more = ["--adapter", "cpu", "--small-jobs", "2", "--small-particles", "64"];
    let server = Server::start_with(&dir.path().join("beside"), &more);
    let mut large = endless();
    large["domain"]["dx"] = 0.03.into();
    let first = server.submit(large.clone());
    server.wait_for(&first, "running");
    let second = server.submit(large);
    let small: Vec<String> = (0..4).map(|_| server.submit(medium())).collect();
    for job in &small {
        server.wait_for(job, "succeeded");
        assert!(server.get(&format!("{job}/recording.mcap")).body == expected, "what runs beside changes nothing");
    }
    assert_eq!((&server.job(&first)["status"], &server.job(&second)["status"]), (&json!("running"), &json!("queued")));
    assert!(server.terminate().success());
}
