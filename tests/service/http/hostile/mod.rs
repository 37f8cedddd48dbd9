//! Inputs that mean no good: each is refused with a problem that says where and what to do, or is harmless. None gives
//! a server error, and the server goes on.

mod requests;
mod scenes;
mod uploads;

use serde_json::{Value, json};

use super::support::{Answer, Server, short};
use requests::{PATHS, RANGES, bodies};
use scenes::{OVERRIDES, values};
use uploads::uploads;

const JSON: (&str, &str) = ("content-type", "application/json");

/// Checks an answer; `true` if it is a refusal.
fn judged(what: &str, answer: &Answer) -> bool {
    let shown = String::from_utf8_lossy(&answer.body);
    let shown: String = shown.chars().take(500).collect();
    assert!(answer.status < 500, "{what}: {} {shown}", answer.status);
    if answer.status < 400 {
        return false;
    }
    assert_eq!(answer.header("content-type"), "application/problem+json", "{what}");
    let problem = answer.json();
    for member in ["code", "title", "detail"] {
        assert!(problem[member].as_str().is_some_and(|text| !text.is_empty()), "{what}: no {member}: {shown}");
    }
    assert!(answer.body.len() < 300_000, "{what}: {} bytes of problem", answer.body.len());
    if problem["code"] == "invalid_scene" {
        for fault in problem["faults"].as_array().unwrap_or_else(|| panic!("{what}: no faults")) {
            let text = |member: &str| fault[member].as_str().unwrap_or_default().to_owned();
            assert!(text("pointer").starts_with("/scene"), "{what}: {fault}");
            assert!(!text("reason").is_empty() && !text("remedy").is_empty(), "{what}: {fault}");
        }
    }
    true
}

#[test]
fn hostile_inputs_are_refused_and_harm_nothing() {
    let dir = tempfile::tempdir().unwrap();
    let server = Server::start(dir.path());
    let mut inputs = 0;
    for (at, value) in values() {
        let mut scene = short();
        let (parent, last) = at.rsplit_once('/').unwrap();
        match scene.pointer_mut(parent).unwrap() {
            Value::Object(fields) => drop(fields.insert(last.to_owned(), value)),
            Value::Array(items) => items[last.parse::<usize>().unwrap()] = value,
            _ => panic!("{at}"),
        }
        let answer = server.post_json("/v1/scenes:validate", &json!({ "scene": scene }));
        let shown: String = scene.pointer(at).unwrap().to_string().chars().take(80).collect();
        assert!(judged(&format!("{at} = {shown}"), &answer), "{at} = {shown} was accepted");
        inputs += 1;
    }
    for body in bodies() {
        let shown: String = String::from_utf8_lossy(&body).chars().take(80).collect();
        let answer = server.call("POST", "/v1/jobs", &[JSON], body);
        assert!(judged(&shown, &answer), "{shown} was accepted");
        inputs += 1;
    }
    for (path, value) in OVERRIDES {
        let value: Value = serde_json::from_str(value).unwrap();
        let overrides = json!({ "scene": short(), "overrides": { *path: value } });
        let answer = server.post_json("/v1/scenes:validate", &overrides);
        assert!(judged(&format!("{path}={value}"), &answer), "{path}={value} was accepted");
        inputs += 1;
    }
    for file in uploads() {
        let shown: String = String::from_utf8_lossy(&file).chars().take(80).collect();
        let answer = server.call("PUT", "/v1/assets", &[], file);
        assert!(judged(&format!("upload {shown:?}"), &answer), "the upload {shown:?} was accepted");
        inputs += 1;
    }
    for (method, path) in PATHS {
        assert!(
            judged(&format!("{method} {path}"), &server.call(method, path, &[], "")),
            "{method} {path} was accepted"
        );
        inputs += 1;
    }
    let job = server.submit(short());
    server.wait_for(&job, "succeeded");
    let recording = format!("{job}/recording.mcap");
    let whole = server.get(&recording).body;
    for range in RANGES {
        let answer = server.call("GET", &recording, &[("range", range)], "");
        if !judged(range, &answer) {
            assert!(answer.status == 206 || answer.body == whole, "{range}: {} bytes", answer.body.len());
        }
        inputs += 1;
    }
    let long = "k".repeat(256);
    let valid = json!({ "scene": short() }).to_string();
    for (name, value) in [
        ("idempotency-key", ""),
        ("idempotency-key", long.as_str()),
        ("idempotency-key", "\u{e9}"),
        ("content-type", "application/jsonp"),
        ("content-type", "text/plain"),
        ("content-type", "application/json; charset"),
        ("content-type", ""),
        ("content-encoding", "bogus"),
        ("if-match", "x"),
        ("accept", "\u{7f}"),
        ("prefer", "wait=-1"),
    ] {
        let given: Vec<(&str, &str)> = match name {
            "content-type" => vec![(name, value)],
            _ => vec![JSON, (name, value)],
        };
        if ureq::http::HeaderValue::try_from(value).is_ok() {
            judged(&format!("{name}: {value}"), &server.call("POST", "/v1/scenes:validate", &given, valid.as_str()));
            inputs += 1;
        }
    }
    println!("{inputs} hostile inputs");
    assert!(inputs >= 200);
    assert_eq!(server.get("/livez").status, 200);
    let after = server.submit(short());
    server.wait_for(&after, "succeeded");
}
