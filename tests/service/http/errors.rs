//! Every error of the API is a problem with a stable code, whichever layer found it.

use super::support::{self, Server};
use serde_json::{Value, json};

const JSON: (&str, &str) = ("content-type", "application/json");

/// The path template of the document that matches a request's path.
fn template(path: &str) -> String {
    let path = path.split('?').next().unwrap();
    let mut parts: Vec<&str> = path.split('/').collect();
    if parts.len() > 3 && parts[1] == "v1" && parts[2] == "jobs" {
        parts[3] = "{id}";
    }
    if parts.len() > 3 && ["assets", "scenes"].contains(&parts[2]) {
        parts[3] = "{id}";
    }
    parts.join("/")
}

/// Checks that a response is a problem with this status and code, and that the document lists it.
fn assert_problem(document: &Value, request: (&str, &str), answer: &support::Answer, status: u16, code: &str) -> Value {
    let (method, path) = request;
    let what = format!("{method} {path}");
    assert_eq!(answer.status, status, "{what}: {}", String::from_utf8_lossy(&answer.body));
    assert_eq!(answer.header("content-type"), "application/problem+json", "{what}");
    let body = answer.json();
    assert_eq!(body["code"], code, "{what}: {body:#}");
    assert_eq!(body["status"], status, "{what}");
    assert_eq!(body["type"], format!("/docs/errors#{code}"), "{what}");
    for member in ["title", "detail"] {
        assert!(body[member].as_str().is_some_and(|text| !text.is_empty()), "{what}: no {member}");
    }
    let codes = document["components"]["schemas"]["Code"]["description"].as_str().unwrap();
    assert!(codes.contains(&format!("`{code}`")), "{what}: {code} is not documented");
    if !matches!(code, "route_not_found" | "method_not_allowed") {
        let operation = &document["paths"][template(path)][method.to_lowercase()];
        let response = &operation["responses"][status.to_string()];
        let description = response["description"].as_str().unwrap_or_default();
        assert!(description.contains(code), "{what}: the document promises no {status} {code}: {description:?}");
        assert!(response["content"]["application/problem+json"].is_object(), "{what}: {response:#}");
    }
    body
}

#[test]
fn every_error_is_a_documented_problem() {
    let dir = tempfile::tempdir().unwrap();
    let server = Server::start(dir.path());
    let document = server.get("/openapi.json").json();
    let nobody = "/v1/jobs/01890000-0000-7000-8000-000000000000";
    let valid = json!({ "scene": support::short() }).to_string();
    let no_asset = format!("/v1/assets/sha256:{}", "0".repeat(64));
    let huge = "x".repeat((64 << 20) + 1);
    let large = format!("\"{}\"", "x".repeat(9 << 20));
    let long_name = json!({ "scene": support::short(), "name": "x".repeat(201) }).to_string();
    type Headers<'a> = &'a [(&'a str, &'a str)];
    let cases: &[(&str, &str, Headers, &str, u16, &str)] = &[
        ("GET", "/nothing", &[], "", 404, "route_not_found"),
        ("GET", "/v1/jobs/", &[], "", 404, "route_not_found"),
        ("GET", "/v1/scenes:validate/x", &[], "", 404, "route_not_found"),
        ("PUT", "/v1/jobs", &[JSON], "{}", 405, "method_not_allowed"),
        ("POST", "/livez", &[JSON], "{}", 405, "method_not_allowed"),
        ("GET", "/v1/scenes:validate", &[], "", 405, "method_not_allowed"),
        ("POST", "/v1/jobs", &[], &valid, 415, "unsupported_media_type"),
        ("POST", "/v1/jobs", &[("content-type", "text/plain")], &valid, 415, "unsupported_media_type"),
        ("POST", "/v1/scenes:validate", &[], "{}", 415, "unsupported_media_type"),
        ("POST", "/v1/jobs", &[JSON, ("content-encoding", "br")], &valid, 415, "unsupported_encoding"),
        ("POST", "/v1/jobs", &[JSON, ("content-encoding", "gzip")], &valid, 400, "invalid_body"),
        ("POST", "/v1/jobs", &[JSON, ("origin", "https://evil.example")], &valid, 403, "foreign_origin"),
        ("PUT", "/v1/assets", &[("origin", "null")], "x", 403, "foreign_origin"),
        ("POST", &format!("{nobody}/cancel"), &[("host", "rebound.example")], "", 403, "unknown_host"),
        ("POST", &format!("{nobody}/cancel"), &[("if-match", "*")], "", 404, "job_not_found"),
        ("GET", &format!("{nobody}/recording-so-far.mcap"), &[], "", 404, "job_not_found"),
        ("POST", "/v1/jobs", &[JSON], "{", 400, "invalid_json"),
        ("POST", "/v1/jobs", &[JSON], "", 400, "invalid_json"),
        ("POST", "/v1/scenes:validate", &[JSON], "{\"scene\": {},}", 400, "invalid_json"),
        ("POST", "/v1/jobs", &[JSON], "[]", 422, "invalid_request"),
        ("POST", "/v1/jobs", &[JSON], "{}", 422, "invalid_request"),
        ("POST", "/v1/jobs", &[JSON], "{\"scene\": {}, \"nmae\": 1}", 422, "invalid_request"),
        ("POST", "/v1/jobs", &[JSON], &long_name, 422, "invalid_request"),
        ("POST", "/v1/jobs", &[JSON], "{\"scene\": {}, \"name\": \" \"}", 422, "invalid_request"),
        ("POST", "/v1/jobs", &[JSON], "{\"scene\": {}, \"name\": \"a\\u202eb\"}", 422, "invalid_request"),
        ("POST", "/v1/jobs", &[JSON, ("idempotency-key", "")], &valid, 400, "invalid_header"),
        ("POST", "/v1/jobs", &[JSON], &large, 413, "body_too_large"),
        ("POST", "/v1/scenes:validate", &[JSON], &large, 413, "body_too_large"),
        ("POST", "/v1/jobs", &[JSON], "{\"scene\": {}}", 422, "invalid_scene"),
        ("POST", "/v1/scenes:validate", &[JSON], "{}", 422, "invalid_request"),
        ("POST", "/v1/scenes:validate", &[JSON], "{\"scene\": {}}", 422, "invalid_scene"),
        ("GET", "/v1/jobs?limit=0", &[], "", 400, "invalid_query"),
        ("GET", "/v1/jobs?limit=201", &[], "", 400, "invalid_query"),
        ("GET", "/v1/jobs?limit=many", &[], "", 400, "invalid_query"),
        ("GET", "/v1/jobs?status=lost", &[], "", 400, "invalid_query"),
        ("GET", "/v1/jobs?cursor=here", &[], "", 400, "invalid_query"),
        ("GET", "/v1/jobs?page=2", &[], "", 400, "invalid_query"),
        ("GET", "/v1/jobs/7", &[], "", 400, "invalid_path"),
        ("PUT", "/v1/assets", &[], "no mesh", 422, "invalid_asset"),
        ("PUT", "/v1/assets", &[JSON], "{}", 422, "invalid_asset"),
        ("PUT", "/v1/assets", &[], &huge, 413, "body_too_large"),
        ("DELETE", "/v1/assets", &[], "", 405, "method_not_allowed"),
        ("GET", "/v1/assets/7", &[], "", 400, "invalid_path"),
        ("GET", "/v1/scenes/7", &[], "", 400, "invalid_path"),
        ("GET", &no_asset.replace("assets", "scenes"), &[], "", 404, "scene_not_found"),
        ("POST", "/v1/scenes", &[JSON], "{\"scene\": {}}", 422, "invalid_scene"),
        ("POST", "/v1/jobs", &[JSON], "{\"scene_id\": \"7\"}", 422, "invalid_request"),
        ("POST", "/v1/jobs", &[JSON], "{\"scene\": {}, \"scene_id\": \"7\"}", 422, "invalid_request"),
        ("GET", &no_asset, &[], "", 404, "asset_not_found"),
        ("GET", "/v1/jobs/%FF", &[], "", 400, "invalid_path"),
        ("DELETE", "/v1/jobs/7", &[], "", 400, "invalid_path"),
        ("POST", "/v1/jobs/7/cancel", &[], "", 400, "invalid_path"),
        ("GET", "/v1/jobs/7/recording.mcap", &[], "", 400, "invalid_path"),
        ("GET", nobody, &[], "", 404, "job_not_found"),
        ("DELETE", nobody, &[], "", 404, "job_not_found"),
        ("POST", &format!("{nobody}/cancel"), &[], "", 404, "job_not_found"),
        ("GET", &format!("{nobody}/recording.mcap"), &[], "", 404, "job_not_found"),
        ("GET", &format!("{nobody}/thumbnail.png"), &[], "", 404, "job_not_found"),
        ("GET", &format!("{nobody}/diagnostics"), &[], "", 404, "job_not_found"),
        ("GET", &format!("{nobody}/diagnostics?format=xml"), &[], "", 400, "invalid_query"),
        ("GET", &format!("{nobody}/diagnostics.csv"), &[], "", 404, "job_not_found"),
        ("GET", &format!("{nobody}/solver"), &[], "", 404, "job_not_found"),
        ("GET", &format!("{nobody}/solver.csv"), &[], "", 404, "job_not_found"),
    ];
    for (method, path, headers, body, status, code) in cases {
        let answer = server.call(method, path, headers, *body);
        assert_problem(&document, (method, path), &answer, *status, code);
        if *code == "method_not_allowed" {
            assert!(!answer.header("allow").is_empty(), "{method} {path}: no Allow header");
        }
    }

    // For a running job, and for one that waits behind it.
    let (running, waiting) = (server.submit(support::endless()), server.submit(support::short()));
    server.wait_for(&running, "running");
    for job in [&running, &waiting] {
        let stale = server.call("DELETE", job, &[("if-match", "\"another\"")], "");
        assert_problem(&document, ("DELETE", job), &stale, 412, "precondition_failed");
        assert_problem(&document, ("DELETE", job), &server.call("DELETE", job, &[], ""), 409, "job_not_finished");
    }
    let path = format!("{running}/thumbnail.png");
    assert_problem(&document, ("GET", &path), &server.get(&path), 404, "output_not_found");
    for output in ["recording.mcap", "recording-so-far.mcap", "thumbnail.png", "diagnostics"] {
        let path = format!("{waiting}/{output}");
        assert_problem(&document, ("GET", &path), &server.get(&path), 404, "output_not_found");
    }
}

#[test]
fn all_faults_of_a_scene_come_back_at_once_with_pointers_into_the_request() {
    let dir = tempfile::tempdir().unwrap();
    let server = Server::start(dir.path());
    let mut scene = support::short();
    scene["materials"]["jelly"]["density"] = json!(-1.0);
    scene["materials"]["jelly"]["poissons_ratio"] = json!(0.5);
    scene["bodies"][0]["material"] = json!("custard");
    let pointers = |answer: support::Answer| {
        assert_eq!(answer.status, 422);
        let faults = answer.json()["faults"].as_array().unwrap().clone();
        for fault in &faults {
            for member in ["code", "reason", "remedy"] {
                assert!(fault[member].as_str().is_some_and(|text| !text.is_empty()), "{fault:#}");
            }
        }
        let mut pointers: Vec<String> =
            faults.iter().map(|fault| fault["pointer"].as_str().unwrap().to_owned()).collect();
        pointers.sort();
        pointers
    };
    let expected =
        ["/scene/bodies/0/material", "/scene/materials/jelly/density", "/scene/materials/jelly/poissons_ratio"];
    let request = json!({ "scene": scene });
    assert_eq!(pointers(server.post_json("/v1/scenes:validate", &request)), expected);
    assert_eq!(pointers(server.post_json("/v1/jobs", &request)), expected);
    let overrides = json!({ "scene": support::short(), "overrides": { "solver.cfl": -1 } });
    assert_eq!(pointers(server.post_json("/v1/jobs", &overrides)), ["/scene/solver/cfl"]);
}

#[test]
fn a_server_open_to_others_must_be_asked_for_in_so_many_words() {
    let dir = tempfile::tempdir().unwrap();
    let output = std::process::Command::new(env!("CARGO_BIN_EXE_gridfall"))
        .args(["serve", "--listen", "0.0.0.0:0", "--data-dir"])
        .arg(dir.path())
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(2));
    let message = String::from_utf8(output.stderr).unwrap();
    for part in ["--listen 0.0.0.0:0", "--insecure-no-auth", "gridfall keys create"] {
        assert!(message.contains(part), "{message}");
    }
}

#[test]
fn a_data_directory_in_use_is_refused() {
    let dir = tempfile::tempdir().unwrap();
    let _server = Server::start(dir.path());
    let output = std::process::Command::new(env!("CARGO_BIN_EXE_gridfall"))
        .args(["serve", "--listen", "127.0.0.1:0", "--data-dir"])
        .arg(dir.path())
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(2));
    assert!(String::from_utf8(output.stderr).unwrap().contains("--data-dir"));
}
