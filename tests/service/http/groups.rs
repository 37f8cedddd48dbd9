//! Sweeps, reruns, reuse, filters, limits of cost, and changes of many jobs, over HTTP.

use std::path::Path;

use serde_json::{Value, json};

use super::support::{Server, endless, short};

fn accepted(server: &Server, body: Value) -> String {
    let answer = server.post_json("/v1/jobs", &body);
    assert_eq!(answer.status, 202, "{}", String::from_utf8_lossy(&answer.body));
    answer.header("location").to_owned()
}

fn refused(server: &Server, path: &str, body: Value, code: &str) -> String {
    let answer = server.post_json(path, &body);
    let problem = answer.json();
    assert_eq!((answer.status, &problem["code"]), (422, &json!(code)), "{problem}");
    problem["detail"].as_str().unwrap().to_owned()
}

#[test]
fn a_sweep_is_judged_before_it_is_submitted() {
    let dir = tempfile::tempdir().unwrap();
    let server = Server::start(dir.path());
    let validate = "/v1/sweeps:validate";
    let body = json!({ "scene": short(), "name": "steps", "grid": { "domain.dx": [0.125, 0.0625], "seed": [1, 2] } });
    let valid = server.post_json(validate, &body).json();
    let jobs = valid["jobs"].as_array().unwrap_or_else(|| panic!("{valid}"));
    assert_eq!((jobs.len(), &jobs[0]["values"]), (4, &json!({ "domain.dx": 0.125, "seed": 1 })));
    assert_eq!((&jobs[0]["particles"], &jobs[2]["particles"]), (&json!(16), &json!(64)));
    let sum: f64 = jobs.iter().map(|job| job["estimate_s"].as_f64().unwrap()).sum();
    assert!(sum > 0.0 && (valid["estimate_s"].as_f64().unwrap() - sum).abs() < 1e-9 * sum, "{valid}");
    let detail = refused(&server, validate, json!({ "scene": short(), "grid": { "seed": [1, -1] } }), "invalid_scene");
    assert!(detail.starts_with("job 2 of 2 (seed=-1)"), "{detail}");
    let dear = json!({ "scene": short(), "grid": { "seed": [1, 2] }, "max_cost": 1e-9 });
    refused(&server, validate, dear, "cost_exceeded");
    assert_eq!(server.get("/v1/sweeps").json(), json!({ "sweeps": [], "next_cursor": null }));
}

#[test]
fn sweeps_are_listed_with_their_results() {
    let dir = tempfile::tempdir().unwrap();
    let server = Server::start(dir.path());
    let submit = |name: &str, seeds: &[u64]| {
        let answer =
            server.post_json("/v1/sweeps", &json!({ "scene": short(), "name": name, "grid": { "seed": seeds } }));
        assert_eq!(answer.status, 202, "{}", answer.json());
        answer.header("location").to_owned()
    };
    let (first, second) = (submit("first", &[1, 2]), submit("second", &[3]));
    for path in [&first, &second] {
        server.wait_until(path, "the end of the sweep", |sweep| sweep["ended"] == true);
    }
    let page = server.get("/v1/sweeps?limit=1").json();
    assert_eq!((&page["sweeps"][0]["name"], &page["sweeps"][0]["total"]), (&json!("second"), &json!(1)));
    let next = server.get(&format!("/v1/sweeps?limit=1&cursor={}", page["next_cursor"].as_str().unwrap())).json();
    assert_eq!((&next["sweeps"][0]["name"], &next["next_cursor"]), (&json!("first"), &json!(null)));
    for query in ["limit=0", "cursor=x", "colour=red"] {
        let wrong = server.get(&format!("/v1/sweeps?{query}"));
        assert_eq!((wrong.status, &wrong.json()["code"]), (400, &json!("invalid_query")), "{query}");
    }

    let results = server.get(&format!("{first}/results")).json();
    let jobs = results["jobs"].as_array().unwrap();
    assert_eq!(jobs.iter().map(|job| &job["values"]["seed"]).collect::<Vec<_>>(), [1, 2]);
    for job in jobs {
        let rows = server.get(&format!("/v1/jobs/{}/diagnostics", job["id"].as_str().unwrap())).json();
        let speeds: Vec<f64> =
            rows["rows"].as_array().unwrap().iter().map(|row| row["max_speed"].as_f64().unwrap()).collect();
        let (least, most) = speeds.iter().fold((f64::MAX, f64::MIN), |(a, b), v| (a.min(*v), b.max(*v)));
        let expected = json!({ "last": speeds.last(), "least": least, "most": most });
        assert_eq!(job["diagnostics"]["max_speed"], expected, "{job}");
        assert_eq!((&job["status"], &job["progress"]["frames_written"]), (&json!("succeeded"), &json!(6)));
    }
    let none = server.get("/v1/sweeps/01890000-0000-7000-8000-000000000000/results");
    assert_eq!((none.status, &none.json()["code"]), (404, &json!("sweep_not_found")));

    // A sweep is listed as long as it has jobs.
    let id = second.rsplit('/').next().unwrap();
    assert_eq!(server.post_json("/v1/jobs:delete", &json!({ "sweep": id })).json(), json!({ "jobs": 1 }));
    let left = server.get("/v1/sweeps").json();
    assert_eq!((left["sweeps"].as_array().unwrap().len(), &left["sweeps"][0]["name"]), (1, &json!("first")));
}

#[test]
fn a_sweep_runs_every_combination_and_ends() {
    let dir = tempfile::tempdir().unwrap();
    let server = Server::start(dir.path());
    let body = json!({ "scene": short(), "name": "steps", "tags": ["s"],
        "grid": { "solver.cfl": [0.3, 0.5], "solver.kernel": ["compact", "quadratic"] } });
    let answer = server.post_json("/v1/sweeps", &body);
    assert_eq!((answer.status, &answer.json()["total"]), (202, &json!(4)));
    let path = answer.header("location").to_owned();
    let sweep = server.wait_until(&path, "the end of the sweep", |sweep| sweep["ended"] == true);
    assert_eq!((&sweep["jobs"], &sweep["fraction"]), (&json!({ "succeeded": 4 }), &json!(1.0)));
    let jobs = server.get(&format!("/v1/jobs?sweep={}", sweep["id"].as_str().unwrap())).json();
    let names: Vec<&str> = jobs["jobs"].as_array().unwrap().iter().map(|job| job["name"].as_str().unwrap()).collect();
    assert_eq!(names.len(), 4);
    assert_eq!(names[3], "steps solver.cfl=0.3 solver.kernel=\"compact\"");

    let values = json!({ "solver.cfl": 0.3, "solver.kernel": "compact" });
    assert_eq!((&jobs["jobs"][3]["sweep_values"], &jobs["jobs"][3]["sweep"]), (&values, &sweep["id"]));

    let wrong = json!({ "scene": short(), "list": [{ "solver.cfl": 0.4 }, { "solver.cfl": -1 }] });
    let detail = refused(&server, "/v1/sweeps", wrong, "invalid_scene");
    assert!(detail.starts_with("job 2 of 2 (solver.cfl=-1)"), "{detail}");
    refused(&server, "/v1/sweeps", json!({ "scene": short() }), "invalid_request");
    let many: Vec<usize> = (1..=257).collect();
    refused(&server, "/v1/sweeps", json!({ "scene": short(), "grid": { "seed": many } }), "invalid_request");
    assert_eq!(server.get("/v1/jobs").json()["jobs"].as_array().unwrap().len(), 4, "none of the refused ones");

    let headers = [("content-type", "application/json"), ("idempotency-key", "k")];
    let body = json!({ "scene": endless(), "grid": { "seed": [1, 2, 3] } }).to_string();
    let answer = server.call("POST", "/v1/sweeps", &headers, body.clone());
    let again = server.call("POST", "/v1/sweeps", &headers, body);
    assert_eq!((answer.status, again.status, again.header("location")), (202, 202, answer.header("location")));
    let other = json!({ "scene": endless(), "grid": { "seed": [1, 2] } }).to_string();
    let other = server.call("POST", "/v1/sweeps", &headers, other);
    assert_eq!((other.status, &other.json()["code"]), (422, &json!("idempotency_key_reused")));
    let path = answer.header("location").to_owned();
    assert!([200, 202].contains(&server.call("POST", &format!("{path}/cancel"), &[], "").status));
    let sweep = server.wait_until(&path, "the end of the sweep", |sweep| sweep["ended"] == true);
    assert_eq!(sweep["jobs"], json!({ "canceled": 3 }));
    let none = server.get("/v1/sweeps/01890000-0000-7000-8000-000000000000");
    assert_eq!((none.status, &none.json()["code"]), (404, &json!("sweep_not_found")));
}

#[test]
fn a_job_is_run_again_and_the_same_scene_is_answered_by_a_finished_job() {
    let dir = tempfile::tempdir().unwrap();
    let server = Server::start(dir.path());
    let first = accepted(&server, json!({ "scene": short(), "name": "first", "tags": ["b", "a", "b"], "priority": 3 }));
    let job = server.wait_for(&first, "succeeded");
    assert_eq!((&job["tags"], &job["priority"]), (&json!(["a", "b"]), &json!(3)));
    assert!(job["estimate_s"].as_f64() > Some(0.0) && job["run_s"].as_f64() > Some(0.0), "{job:#}");

    let again = server.post_json(&format!("{first}/rerun"), &json!({ "overrides": { "time.end": 0.02 } }));
    assert_eq!(again.status, 202);
    let again = server.wait_for(again.header("location"), "succeeded");
    assert_eq!((&again["name"], &again["tags"], &again["priority"]), (&job["name"], &job["tags"], &job["priority"]));
    assert_eq!(again["progress"]["frames"], 3);

    let reused = server.post_json("/v1/jobs", &json!({ "scene": short(), "reuse": true }));
    assert_eq!((reused.status, reused.header("location")), (200, first.as_str()));
    let other = server.post_json("/v1/jobs", &json!({ "scene": short(), "reuse": true, "overrides": { "seed": 7 } }));
    assert_eq!(other.status, 202, "another seed is another scene");
}

#[test]
fn a_job_begins_with_the_last_state_of_another() {
    let dir = tempfile::tempdir().unwrap();
    let server = Server::start(dir.path());
    let without = accepted(&server, json!({ "scene": short() }));
    let without = server.wait_for(&without, "succeeded")["id"].clone();
    let first = accepted(&server, json!({ "scene": short(), "overrides": { "output.state": true } }));
    let id = server.wait_for(&first, "succeeded")["id"].clone();
    let state = server.get(&format!("{first}/state.npz"));
    assert!(state.status == 200 && state.body.starts_with(b"PK"), "{}", state.status);

    let second = accepted(&server, json!({ "scene": short(), "start_from": id }));
    server.wait_for(&second, "succeeded");
    let rows = |path: &str| server.get(&format!("{path}/diagnostics")).json()["rows"].clone();
    let (last, begun) = (rows(&first), rows(&second));
    let last = last.as_array().unwrap().last().unwrap();
    for column in ["mass_kg", "kinetic_j", "affine_j", "strain_j", "gravity_j", "min_J"] {
        assert!(last[column].is_f64() && begun[0][column] == last[column], "{column}: {begun} {last}");
    }
    // What it began with is in its scene, so that it can be run again when the first job is gone.
    assert_eq!(server.post_json("/v1/jobs:delete", &json!({ "name": "no such" })).status, 200);
    server.call("DELETE", &first, &[], "");
    let again = server.post_json(&format!("{second}/rerun"), &json!({}));
    server.wait_for(again.header("location"), "succeeded");
    assert_eq!(rows(again.header("location"))[0]["kinetic_j"], begun[0]["kinetic_j"]);

    refused(&server, "/v1/jobs", json!({ "scene": short(), "start_from": without }), "invalid_request");
    refused(&server, "/v1/jobs", json!({ "scene": short(), "start_from": id }), "invalid_request");
}

#[test]
fn the_scene_of_a_recording_is_kept_and_run_again() {
    let dir = tempfile::tempdir().unwrap();
    let server = Server::start(dir.path());
    let first = accepted(&server, json!({ "scene": short() }));
    server.wait_for(&first, "succeeded");
    let recording = server.get(&format!("{first}/recording.mcap")).body;
    let head = [("content-type", "application/octet-stream")];
    let kept = server.call("PUT", "/v1/scenes", &head, &recording[..recording.len().min(1 << 20)]);
    assert_eq!(kept.status, 201, "{}", kept.json());
    let again = accepted(&server, json!({ "scene_id": kept.json()["id"] }));
    server.wait_for(&again, "succeeded");
    assert_eq!(server.get(&format!("{again}/diagnostics")).json(), server.get(&format!("{first}/diagnostics")).json());
    let refused = server.call("PUT", "/v1/scenes", &head, "no recording");
    assert_eq!((refused.status, &refused.json()["code"]), (422, &json!("invalid_recording")));
}

#[test]
fn jobs_are_found_canceled_and_deleted_by_filters() {
    let dir = tempfile::tempdir().unwrap();
    let server = Server::start(dir.path());
    let running = accepted(&server, json!({ "scene": endless(), "tags": ["long"] }));
    server.wait_for_frames(&running, 1);
    for name in ["one", "two"] {
        accepted(&server, json!({ "scene": short(), "name": name, "tags": ["quick"] }));
    }
    let found = |query: &str| {
        let page = server.get(&format!("/v1/jobs?{query}")).json();
        page["jobs"].as_array().unwrap_or_else(|| panic!("{page:#}")).len()
    };
    assert_eq!(found("status=queued,running"), 3);
    assert_eq!((found("status=queued&tag=quick"), found("tag=long,quick"), found("name=t*")), (2, 0, 1));
    assert_eq!((found("created_after=2000-01-01T00:00:00Z"), found("created_before=2000-01-01T00:00:00Z")), (3, 0));
    assert_eq!(server.get("/v1/jobs?status=waiting").json()["code"], "invalid_query");

    refused(&server, "/v1/jobs:cancel", json!({}), "invalid_request");
    let canceled = server.post_json("/v1/jobs:cancel", &json!({ "tag": ["quick"] }));
    assert_eq!((canceled.status, canceled.json()), (200, json!({ "jobs": 2 })));
    let deleted = server.post_json("/v1/jobs:delete", &json!({ "status": ["canceled", "running"] }));
    assert_eq!((deleted.status, deleted.json()), (200, json!({ "jobs": 2 })));
    assert_eq!(found(""), 1);
    server.call("POST", &format!("{running}/cancel"), &[], "");
    server.wait_for(&running, "canceled");
    let folder = server.file(&running, "");
    assert!(folder.exists());
    assert_eq!(server.post_json("/v1/jobs:delete", &json!({ "tag": ["long"] })).json(), json!({ "jobs": 1 }));
    assert!(!folder.exists());
}

#[test]
fn what_costs_too_much_or_is_out_of_form_is_refused() {
    let dir = tempfile::tempdir().unwrap();
    let server = Server::start(dir.path());
    let detail = refused(&server, "/v1/jobs", json!({ "scene": endless(), "max_cost": 1e-3 }), "cost_exceeded");
    assert!(detail.contains("/max_cost"), "{detail}");
    for (field, value) in
        [("tags", json!(["a,b"])), ("tags", json!([""])), ("priority", json!(5000)), ("max_cost", json!(0))]
    {
        let mut body = json!({ "scene": short() });
        body[field] = value;
        let detail = refused(&server, "/v1/jobs", body, "invalid_request");
        assert!(detail.starts_with(&format!("/{field}")), "{detail}");
    }
    let late = accepted(&server, json!({ "scene": short(), "deadline": "2020-01-01T00:00:00Z" }));
    assert_eq!(server.wait_for(&late, "failed")["failure"]["code"], "deadline");
}

/// Size of the files of a folder and of its folders.
fn bytes(folder: &Path) -> u64 {
    let entries = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    entries.map(|path| if path.is_dir() { bytes(&path) } else { path.metadata().unwrap().len() }).sum()
}

#[test]
fn what_takes_too_much_room_is_removed_oldest_first() {
    let dir = tempfile::tempdir().unwrap();
    let jobs: Vec<String> = {
        let server = Server::start(dir.path());
        let jobs: Vec<String> = (0..3).map(|_| server.submit(short())).collect();
        jobs.iter().for_each(|job| drop(server.wait_for(job, "succeeded")));
        jobs
    };
    let folder = |job: &str| dir.path().join("jobs").join(job.rsplit('/').next().unwrap());
    let two = bytes(&folder(&jobs[1])) + bytes(&folder(&jobs[2]));
    let server = Server::start_with(dir.path(), &["--keep-bytes", &two.to_string()]);
    server.wait_until("/v1/jobs", "the removal", |page| page["jobs"].as_array().unwrap().len() == 2);
    assert_eq!(server.get(&jobs[0]).status, 404);
    assert!(folder(&jobs[1]).exists() && folder(&jobs[2]).exists());
}
