//! HTTP as clients, caches, browsers and proxies expect it.

use std::collections::HashMap;
use std::io::{Read, Write};

use flate2::Compression;
use flate2::read::GzDecoder;
use flate2::write::GzEncoder;
use serde_json::json;

use super::support::{Server, endless, short};

const JSON: (&str, &str) = ("content-type", "application/json");

#[test]
fn files_have_a_date_and_preconditions() {
    let dir = tempfile::tempdir().unwrap();
    let server = Server::start(dir.path());
    let job = server.submit(short());
    server.wait_for(&job, "succeeded");
    let path = format!("{job}/recording.mcap");
    let whole = server.get(&path);
    let (tag, date) = (whole.header("etag").to_owned(), whole.header("last-modified").to_owned());
    assert!(date.ends_with(" GMT"), "{date}");
    let early = "Sun, 06 Nov 1994 08:49:37 GMT";
    for (name, value, status) in [
        ("if-modified-since", date.as_str(), 304),
        ("if-modified-since", early, 200),
        ("if-unmodified-since", date.as_str(), 200),
        ("if-unmodified-since", early, 412),
        ("if-match", tag.as_str(), 200),
        ("if-match", "\"another\"", 412),
    ] {
        let answer = server.call("GET", &path, &[(name, value)], "");
        assert_eq!(answer.status, status, "{name}: {value}");
        if status == 412 {
            assert_eq!(answer.json()["code"], "precondition_failed");
        } else {
            assert_eq!(answer.header("etag"), tag);
        }
    }
    let resumed = server.call("GET", &path, &[("range", "bytes=8-"), ("if-range", &date)], "");
    assert_eq!((resumed.status, resumed.body.len()), (206, whole.body.len() - 8));
    // What was decided on an older version of a job does not happen to a newer one.
    let stale = server.call("DELETE", &job, &[("if-match", "\"another\"")], "");
    assert_eq!((stale.status, &stale.json()["code"]), (412, &json!("precondition_failed")));
    let current = server.get(&job).header("etag").to_owned();
    assert_eq!(server.call("DELETE", &job, &[("if-match", &current)], "").status, 204);
}

#[test]
fn requests_may_be_compressed_and_long_text_is() {
    let dir = tempfile::tempdir().unwrap();
    let server = Server::start(dir.path());
    let mut encoder = GzEncoder::new(Vec::new(), Compression::default());
    encoder.write_all(json!({ "scene": short() }).to_string().as_bytes()).unwrap();
    let answer = server.call("POST", "/v1/jobs", &[JSON, ("content-encoding", "gzip")], encoder.finish().unwrap());
    assert_eq!(answer.status, 202, "{}", String::from_utf8_lossy(&answer.body));
    let job = answer.header("location").to_owned();
    let refused = server.call("POST", "/v1/jobs", &[JSON, ("content-encoding", "br")], "x");
    assert_eq!((refused.status, refused.header("accept-encoding")), (415, "gzip, zstd, identity"));

    let plain = server.get("/openapi.json");
    for encoding in ["gzip", "zstd"] {
        let answer = server.call("GET", "/openapi.json", &[("accept-encoding", encoding)], "");
        assert_eq!((answer.status, answer.header("content-encoding")), (200, encoding));
        assert!(answer.body.len() < plain.body.len() / 4 && answer.header("vary").contains("accept-encoding"));
        if encoding == "gzip" {
            let mut text = Vec::new();
            GzDecoder::new(answer.body.as_slice()).read_to_end(&mut text).unwrap();
            assert!(text == plain.body);
        }
    }
    assert_eq!(server.get("/openapi.json").header("content-encoding"), "");
    server.wait_for(&job, "succeeded");
    for output in ["recording.mcap", "thumbnail.png"] {
        let answer = server.call("GET", &format!("{job}/{output}"), &[("accept-encoding", "gzip, zstd")], "");
        assert_eq!((answer.status, answer.header("content-encoding")), (200, ""), "{output}");
    }
}

#[test]
fn pages_of_configured_origins_may_use_the_api_and_others_may_change_nothing() {
    let dir = tempfile::tempdir().unwrap();
    let app = ("origin", "https://app.example");
    let server = Server::start_with(dir.path(), &["--cors-origin", app.1, "--allow-host", "sim.example"]);
    let preflight =
        [app, ("access-control-request-method", "POST"), ("access-control-request-headers", "content-type")];
    let answer = server.call("OPTIONS", "/v1/jobs", &preflight, "");
    assert_eq!((answer.status, answer.header("access-control-allow-origin")), (200, app.1));
    assert!(answer.header("access-control-allow-methods").contains("POST"));
    assert!(answer.header("access-control-allow-headers").contains("content-type"));
    let body = json!({ "scene": endless() }).to_string();
    let answer = server.call("POST", "/v1/jobs", &[JSON, app], body);
    assert_eq!((answer.status, answer.header("access-control-allow-origin")), (202, app.1));
    assert!(answer.header("access-control-expose-headers").contains("location"));
    let job = answer.header("location").to_owned();

    let cancel = format!("{job}/cancel");
    for (headers, code) in [
        ([("origin", "https://evil.example"), ("x-a", "a")], "foreign_origin"),
        ([("origin", "null"), ("x-a", "a")], "foreign_origin"),
        ([("host", "rebound.example"), ("origin", "http://rebound.example")], "unknown_host"),
    ] {
        let answer = server.call("POST", &cancel, &headers, "");
        assert_eq!((answer.status, &answer.json()["code"]), (403, &json!(code)), "{headers:?}");
        assert!(answer.json()["detail"].as_str().unwrap().contains("--"), "a remedy");
    }
    server.wait_for(&job, "running");
    let own = [("host", "sim.example"), ("origin", "https://sim.example")];
    assert_eq!(server.call("POST", &cancel, &own, "").status, 202);
    server.wait_for(&job, "canceled");
}

#[test]
fn metrics_come_in_the_format_that_every_prometheus_reads() {
    let dir = tempfile::tempdir().unwrap();
    let server = Server::start(dir.path());
    let answer = server.get("/metrics");
    assert_eq!(answer.header("content-type"), "text/plain; version=0.0.4; charset=utf-8");
    let text = String::from_utf8(answer.body).unwrap();
    let types: HashMap<&str, &str> =
        text.lines().filter_map(|line| line.strip_prefix("# TYPE ")?.split_once(' ')).collect();
    for (name, kind) in &types {
        assert!(["counter", "gauge", "histogram"].contains(kind), "{name} is a {kind}");
        assert_eq!(*kind == "counter", name.ends_with("_total"), "{name}");
        assert!(text.contains(&format!("# HELP {name} ")), "{name}");
    }
    for line in text.lines().filter(|line| !line.starts_with('#')) {
        let name = line.split(['{', ' ']).next().unwrap();
        let family = ["_bucket", "_sum", "_count"].iter().find_map(|suffix| name.strip_suffix(suffix)).unwrap_or(name);
        assert!(types.contains_key(name) || types.get(family) == Some(&"histogram"), "{line}");
    }
    assert!(!text.contains("# EOF") && !text.contains("# UNIT"));
}

#[test]
fn every_answer_has_the_id_of_its_request_and_logs_can_be_read_by_programs() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("log");
    let log = std::fs::File::create(&path).unwrap();
    let options = ["--log-format", "json", "--log", "gridfall_service=debug"];
    let server = Server::start_logging(dir.path(), &options, log.into());
    let answer = server.call("GET", "/v1/jobs", &[("x-request-id", "mine-1")], "");
    assert_eq!(answer.header("x-request-id"), "mine-1");
    let [first, second] = [(); 2].map(|()| server.get("/nothing").header("x-request-id").to_owned());
    assert!(!first.is_empty() && first != second);
    let odd = server.call("GET", "/livez", &[("x-request-id", &"x".repeat(500))], "");
    assert!(!odd.header("x-request-id").is_empty() && odd.header("x-request-id").len() < 100);

    let job = server.submit(short());
    server.wait_for(&job, "succeeded");
    let text = std::fs::read_to_string(path).unwrap();
    let lines: Vec<serde_json::Value> = text.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert!(lines.iter().any(|line| line["span"]["request_id"] == "mine-1"), "{text}");
    let id = job.rsplit('/').next().unwrap();
    assert!(lines.iter().any(|line| line["span"]["job"] == id && line["span"]["attempt"] == 1), "{text}");
}

#[test]
fn logs_in_files_have_no_colours() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("log");
    let server = Server::start_logging(dir.path(), &[], std::fs::File::create(&path).unwrap().into());
    let job = server.submit(short());
    server.wait_for(&job, "succeeded");
    let text = std::fs::read_to_string(path).unwrap();
    assert!(text.contains("started") && !text.contains('\u{1b}'), "{text}");
}
