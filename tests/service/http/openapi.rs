//! The OpenAPI document matches what the server does.

use super::support::Server;
use serde_json::Value;

#[test]
fn the_document_in_the_repository_is_current() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/api/openapi.json");
    let kept = std::fs::read_to_string(path).unwrap();
    let current = gridfall_service::http::document_json();
    assert!(kept == current, "api/openapi.json is out of date: run `gridfall schema openapi > api/openapi.json`");
}

#[test]
fn the_server_has_every_documented_operation_and_serves_the_document() {
    let dir = tempfile::tempdir().unwrap();
    let server = Server::start(dir.path());
    let document = server.get("/openapi.json").json();
    assert_eq!(document, serde_json::from_str::<Value>(&gridfall_service::http::document_json()).unwrap());
    assert!(document["openapi"].as_str().unwrap().starts_with("3.1."));
    let mut operations = 0;
    for (path, item) in document["paths"].as_object().unwrap() {
        for method in
            item.as_object().unwrap().keys().filter(|key| ["get", "post", "put", "delete"].contains(&key.as_str()))
        {
            let path = path.replace("{id}", "01890000-0000-7000-8000-000000000000");
            let answer = server.call(&method.to_uppercase(), &path, &[], "");
            if answer.header("content-type") == "application/problem+json" {
                let code = answer.json()["code"].clone();
                assert!(code != "route_not_found" && code != "method_not_allowed", "{method} {path}: {code}");
            }
            operations += 1;
        }
    }
    // The contract of the issue that introduced the API; new operations only add to it.
    assert!(operations >= 15, "{operations}");
}

#[test]
fn every_operation_has_an_id_a_summary_and_described_answers() {
    let document: Value = serde_json::from_str(&gridfall_service::http::document_json()).unwrap();
    let mut ids = std::collections::BTreeSet::new();
    for (path, item) in document["paths"].as_object().unwrap() {
        for (method, operation) in item.as_object().unwrap() {
            let id = operation["operationId"].as_str().unwrap_or_default();
            assert!(ids.insert(id), "{method} {path}: the id {id} is taken");
            for member in ["operationId", "summary"] {
                assert!(operation[member].as_str().is_some_and(|text| !text.is_empty()), "{method} {path}: {member}");
            }
            for (status, response) in operation["responses"].as_object().unwrap() {
                assert!(
                    response["description"].as_str().is_some_and(|text| !text.is_empty()),
                    "{method} {path} {status}"
                );
            }
        }
    }
}
