//! Requests that are wrong before anybody asks what they are about.

use super::super::support::short;

/// Bodies of requests that are no requests.
pub fn bodies() -> Vec<Vec<u8>> {
    let scene = short().to_string();
    let deep = |open: &str, close: &str| format!("{}{}", open.repeat(100_000), close.repeat(100_000));
    let texts = [
        "null",
        "true",
        "0",
        "\"scene\"",
        "[]",
        "{",
        "}",
        "{\"scene\"",
        "{\"scene\":}",
        "{\"scene\":NaN}",
        "{\"scene\":1e999}",
        "{\"scene\":-}",
        "{\"scene\":{}}{}",
        "{'scene':{}}",
        "{\"scene\":{},}",
        "// \n{}",
        "\u{feff}{}",
        "{\"scene\":\"\\ud800\"}",
        "{\"scene\":\"\\u0000\"}",
        "{\"scene\":{},\"scene\":{}}",
        "{\"scene\":[[[[]]]]}",
        "{\"scene\":null}",
        "{\"Scene\":{}}",
        "{\"scene\":{\"\":{}}}",
        "undefined",
        " ",
        "\0",
        "{\"scene\":{\"gridfall\":1}}",
        "<?xml version=\"1.0\"?>",
    ];
    let mut bodies: Vec<Vec<u8>> = texts.iter().map(|text| text.as_bytes().to_vec()).collect();
    bodies.push(deep("[", "]").into_bytes());
    bodies.push(deep("{\"scene\":", "}").into_bytes());
    bodies.push(b"{\"scene\": \"\xff\xfe\"}".to_vec());
    for more in [
        "\"name\": 7",
        "\"name\": \"\"",
        "\"name\": \"a\\nb\"",
        "\"name\": [\"a\"]",
        "\"overrides\": []",
        "\"overrides\": null, \"webhok\": 1",
        "\"priority\": \"high\"",
        "\"tags\": 7",
        "\"scene_id\": 1",
    ] {
        bodies.push(format!("{{\"scene\": {scene}, {more}}}").into_bytes());
    }
    bodies.push(scene.as_bytes()[..scene.len() / 2].to_vec());
    bodies
}

/// Of a recording.
pub const RANGES: &[&str] = &[
    "",
    "bytes",
    "bytes=",
    "bytes=-",
    "bytes=--1",
    "bytes=a-b",
    "bytes=1-0",
    "bytes=0-0,0-0",
    "bytes=0-,0-,0-,0-",
    "bytes=-0",
    "bytes=99999999999999999999-",
    "bytes=0-99999999999999999999",
    "bytes=-99999999999999999999",
    "bytes=9007199254740993-",
    "bytes =0-1",
    "bytes= 0 - 1 ",
    "BYTES=0-1",
    "lines=0-1",
    "bytes=0x0-0x1",
    "bytes=+1-+2",
    "bytes=1.5-2",
    "bytes=\u{e9}-1",
];

pub const PATHS: &[(&str, &str)] = &[
    ("GET", "/v1/jobs?limit=-1"),
    ("GET", "/v1/jobs?limit=1e9"),
    ("GET", "/v1/jobs?limit=99999999999999999999"),
    ("GET", "/v1/jobs?limit=1&limit=2"),
    ("GET", "/v1/jobs?cursor=-"),
    ("GET", "/v1/jobs?cursor=%00"),
    ("GET", "/v1/jobs?cursor=99999999999999999999"),
    ("GET", "/v1/jobs?status=%27%20OR%201=1"),
    ("GET", "/v1/jobs?status=queued,lost"),
    ("GET", "/v1/jobs?status=queued&status=failed"),
    ("GET", "/v1/jobs?%FF=1"),
    ("GET", "/v1/jobs/%2e%2e%2f%2e%2e"),
    ("GET", "/v1/jobs/..%2f..%2fetc%2fpasswd/recording.mcap"),
    ("GET", "/v1/jobs/%00"),
    ("GET", "/v1/jobs/0"),
    ("GET", "/v1/jobs/00000000-0000-0000-0000-000000000000"),
    ("GET", "/v1/jobs/%F0%9F%92%A9"),
    ("GET", "/v1/assets/sha256:"),
    ("GET", "/v1/assets/..%2f..%2fjobs.db"),
    ("GET", "/v1/assets/md5:00"),
    ("DELETE", "/v1/jobs/1%27%3B%20DROP%20TABLE%20jobs"),
    ("GET", "//v1//jobs"),
    ("GET", "/v1/../v1/jobs/x"),
    ("GET", "/v2/jobs"),
    ("PATCH", "/v1/jobs"),
    ("TRACE", "/v1/jobs"),
    ("POST", "/v1/jobs/0/cancel"),
    ("PUT", "/v1/jobs/0"),
    ("GET", "/v1/scenes:validate"),
    ("GET", "/metrics/x"),
];
