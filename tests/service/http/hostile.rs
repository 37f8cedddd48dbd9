//! Inputs that mean no good: each is refused with a problem that says where and what to do, or is harmless. None gives
//! a server error, and the server goes on.

use serde_json::{Value, json};

use super::support::{Answer, Server, short};

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

/// Changes of a value of the short scene; each makes it bad.
fn values() -> Vec<(&'static str, Value)> {
    let nested = |n: usize| {
        (0..n).fold(
            json!({ "box": { "min": [0.4, 0.4], "max": [0.6, 0.6] } }),
            |shape, _| json!({ "translate": { "offset": [0, 0], "shape": shape } }),
        )
    };
    let big = |number: &str| -> Value { serde_json::from_str(number).unwrap() };
    let shape = "/bodies/0/shape";
    vec![
        ("/gridfall", json!(0)),
        ("/gridfall", json!(-1)),
        ("/gridfall", json!("1")),
        ("/gridfall", json!(1.5)),
        ("/gridfall", big("99999999999999999999")),
        ("/gridfall", json!(null)),
        ("/gridfall", json!([1])),
        ("/name", json!("")),
        ("/name", json!(" ")),
        ("/name", json!("a\u{0}b")),
        ("/name", json!("\u{202e}gpj")),
        ("/name", json!("x".repeat(1 << 20))),
        ("/name", json!(["a"])),
        ("/name", json!("\u{1b}[2J")),
        ("/description", json!(7)),
        ("/description", json!("\u{7}")),
        ("/$schema", json!(3)),
        ("/__proto__", json!({ "polluted": true })),
        ("/constructor", json!({})),
        ("/dimension", json!(0)),
        ("/dimension", json!(1)),
        ("/dimension", json!(4)),
        ("/dimension", json!(4294967296_u64)),
        ("/dimension", json!(-2)),
        ("/dimension", json!("2")),
        ("/domain", json!(null)),
        ("/domain", json!([])),
        ("/domain/dx", json!(0)),
        ("/domain/dx", json!(-0.0)),
        ("/domain/dx", json!(1e-300)),
        ("/domain/dx", json!(1e300)),
        ("/domain/dx", json!(5e-324)),
        ("/domain/dx", json!(1e-9)),
        ("/domain/fit", json!("shrink")),
        ("/domain/dx", json!(true)),
        ("/domain/min", json!([])),
        ("/domain/min", json!([0])),
        ("/domain/min", json!([0, 0, 0])),
        ("/domain/min", json!(vec![0; 100_000])),
        ("/domain/min", json!([2, 2])),
        ("/domain/min/0", json!(-1e308)),
        ("/domain/max", json!([0, 0])),
        ("/domain/max/0", json!(1e15)),
        ("/domain/max/0", json!(1e308)),
        ("/domain/max/1", json!("1")),
        ("/domain/boundary", json!({ "w": "periodic" })),
        ("/domain/boundary", json!({ "x-": "periodic" })),
        ("/domain/boundary", json!({ "x": "Periodic" })),
        ("/domain/boundary", json!({ "": "periodic" })),
        ("/domain/boundary", json!({ "x": null })),
        ("/domain/boundary", json!({ "x-": { "contact": "separate", "friction": -1e300 } })),
        ("/gravity", json!([0])),
        ("/gravity", json!([0, 1e300])),
        ("/gravity", json!("down")),
        ("/gravity/0", json!({})),
        ("/materials", json!({})),
        ("/materials", json!([])),
        ("/materials", json!(null)),
        ("/materials/jelly", json!({ "model": "vacuum" })),
        ("/materials/jelly", json!({ "model": ["snow"] })),
        ("/materials/jelly", json!({})),
        ("/materials/jelly/density", json!(0)),
        ("/materials/jelly/density", json!(1e300)),
        ("/materials/jelly/youngs_modulus", json!(-1e5)),
        ("/materials/jelly/youngs_modulus", json!(1e300)),
        ("/materials/jelly/poissons_ratio", json!(0.5)),
        ("/materials/jelly/poissons_ratio", json!(-1)),
        ("/materials/jelly/damping", json!(-1)),
        ("/materials/jelly/damping", json!(1e9)),
        ("/bodies", json!([])),
        ("/bodies", json!({})),
        ("/bodies", json!([null])),
        ("/bodies", json!([[[]]])),
        ("/bodies/0/material", json!("jelly\u{0}")),
        ("/bodies/0/material", json!("../jelly")),
        ("/bodies/0/particles_per_cell", json!(0)),
        ("/bodies/0/particles_per_cell", json!(4294967295_u32)),
        ("/bodies/0/particles_per_cell", json!(4294967296_u64)),
        ("/bodies/0/particles_per_cell", json!(3)),
        ("/bodies/0/sampling", json!("REGULAR")),
        ("/bodies/0/velocity", json!([1e300, 0])),
        ("/bodies/0/velocity", json!([1])),
        ("/bodies/0/J", json!(0)),
        ("/bodies/0/J", json!(-1)),
        ("/bodies/0/deformation_gradient", json!([[1, 0], [0, -1]])),
        ("/bodies/0/deformation_gradient", json!([[1]])),
        ("/bodies/0/deformation_gradient", json!([[1e200, 0], [0, 1e200]])),
        ("/bodies/0/points", json!({})),
        ("/bodies/0/points", json!({ "file": "/etc/passwd" })),
        (shape, json!({})),
        (shape, json!("box")),
        (shape, json!({ "box": {}, "sphere": {} })),
        (shape, nested(90)),
        (shape, json!({ "union": [] })),
        (shape, json!({ "difference": [] })),
        (shape, json!({ "sphere": { "center": [0.5, 0.5], "radius": -1 } })),
        (shape, json!({ "sphere": { "center": [0.5, 0.5], "radius": 1e-300 } })),
        (shape, json!({ "sphere": { "center": [1e14, 1e14], "radius": 1 } })),
        (shape, json!({ "sphere": { "center": [0.5, 0.5], "radius": 1e14 } })),
        (shape, json!({ "half-space": { "point": [0, 0], "normal": [0, 0] } })),
        (shape, json!({ "box": { "min": [0.6, 0.6], "max": [0.4, 0.4] } })),
        (shape, json!({ "scale": { "factor": 0, "shape": { "box": { "min": [0, 0], "max": [1, 1] } } } })),
        (shape, json!({ "scale": { "factor": 1e-14, "shape": { "box": { "min": [0, 0], "max": [1, 1] } } } })),
        (shape, json!({ "rotate": { "angle_degrees": 1e300, "shape": { "box": { "min": [0, 0], "max": [1, 1] } } } })),
        (
            shape,
            json!({ "shell": { "thickness": 1e-12, "shape": { "sphere": { "center": [0.5, 0.5], "radius": 0.2 } } } }),
        ),
        (shape, json!({ "heightfield": { "min": [0], "max": [1], "base": 0, "heights": [[0]] } })),
        (shape, json!({ "heightfield": { "min": [0], "max": [1], "base": 0, "heights": [] } })),
        (
            shape,
            json!({ "heightfield": { "min": [0], "max": [1], "base": 0, "heights": [(0..3000).collect::<Vec<_>>()] } }),
        ),
        (shape, json!({ "mesh": { "file": "/etc/passwd" } })),
        (shape, json!({ "mesh": { "asset": "sha256:../.." } })),
        (shape, json!({ "cylinder": { "center": [0.5, 0.5], "radius": 0.1, "height": 1 } })),
        ("/colliders", json!([{ "name": "z-", "shape": {}, "contact": "slip" }])),
        ("/colliders", json!({})),
        (
            "/sources",
            json!([{ "name": "tap", "material": "jelly", "shape": { "box": { "min": [0, 0], "max": [1, 1] } },
            "velocity": [0, 0] }]),
        ),
        (
            "/sources",
            json!([{ "name": "tap", "material": "jelly", "velocity": [0, -1e-12],
            "shape": { "half-space": { "point": [0, 1], "normal": [0, 1] } } }]),
        ),
        ("/time", json!(1)),
        ("/time/end", json!(0)),
        ("/time/end", json!(-1)),
        ("/time/end", json!(1e300)),
        ("/time/end", json!(1e-300)),
        ("/time/end", json!(1e9)),
        ("/time/frame_rate", json!(0)),
        ("/time/frame_rate", json!(1e300)),
        ("/time/frame_rate", json!(-100)),
        ("/solver", json!([])),
        ("/solver", json!({ "cfl": 0 })),
        ("/solver", json!({ "cfl": 1e300 })),
        ("/solver", json!({ "max_dt": 0 })),
        ("/solver", json!({ "max_dt": 1e-15 })),
        ("/solver", json!({ "kernel": "none" })),
        ("/solver", json!({ "implicit": { "levels": 4294967295_u32 } })),
        ("/solver", json!({ "precision": "f16" })),
        ("/solver", json!({ "implicit": { "max_iterations": 0 } })),
        ("/solver", json!({ "implicit": { "tolerance": 0 } })),
        ("/output", json!({ "preview_points": 0 })),
        ("/output", json!({ "preview_points": 4294967295_u32 })),
        ("/output", json!({ "fields": ["J", "J"] })),
        ("/output", json!({ "fields": vec!["velocity"; 10_000] })),
        ("/seed", json!(-1)),
        ("/seed", json!(1.5)),
        ("/seed", big("1180591620717411303424")),
        ("/seed", json!("1")),
    ]
}

/// Bodies of requests that are no requests.
fn bodies() -> Vec<Vec<u8>> {
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

const OVERRIDES: &[(&str, &str)] = &[
    ("", "1"),
    (".", "1"),
    ("/", "1"),
    ("a..b", "1"),
    ("bodies.9.J", "1"),
    ("bodies.-1.J", "1"),
    ("bodies.x", "1"),
    ("bodies.0", "null"),
    ("bodies", "null"),
    ("name.first", "1"),
    ("solver.kernel", "7"),
    ("solver.kernl", "\"compact\""),
    ("solver", "\"fast\""),
    ("domain.dx", "1e-300"),
    ("domain.dx", "\"a=b\""),
    ("=", "1"),
    ("a=b", "1"),
    ("gridfall", "2"),
    ("seed", "1e300"),
    ("time.end", "-1"),
    ("~1~0", "1"),
    ("/~", "1"),
    ("__proto__.x", "1"),
    ("bodies.99999999999999999999", "1"),
    ("materials.jelly.model", "\"snow\\u0000\""),
];

/// Files that are no meshes and no particles.
fn uploads() -> Vec<Vec<u8>> {
    let mut files: Vec<Vec<u8>> = [
        "",
        " ",
        "\0",
        "solid",
        "solid x\nfacet normal nan nan nan\nouter loop\nvertex 0 0\nendloop",
        "v 0 0 0\n",
        "v 0 0 0\nf 1 2 3\n",
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 999999999\n",
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 0 0 0\n",
        "v nan inf 1e999\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nf -4 -5 -6\n",
        "v 1\nf 1\n",
        "ply\n",
        "ply\nformat ascii 1.0\nend_header\n",
        "ply\nformat ascii 1.0\nelement vertex 4294967295\nend_header\n",
        "ply\nformat ascii 1.0\nelement vertex -1\nproperty float x\nend_header\n",
        "ply\nformat binary_little_endian 1.0\nelement vertex 1000000000000\nproperty double x\nend_header\n\0\0",
        "ply\nformat ascii 1.0\nelement vertex 1\nproperty list uchar int x\nend_header\n255 1\n",
        "ply\nformat ascii 9.9\nelement vertex 1\nproperty float x\nend_header\nnan\n",
        "glTF",
        "{\"asset\":{\"version\":\"2.0\"}}",
        "{\"asset\":{\"version\":\"2.0\"},\"buffers\":[{\"byteLength\":99,\"uri\":\"http://localhost/x\"}]}",
        "{\"asset\":{\"version\":\"2.0\"},\"buffers\":[{\"byteLength\":99,\"uri\":\"file:///etc/passwd\"}]}",
        "<svg/>",
        "%PDF-1.7",
        "PK\u{3}\u{4}",
        "{}",
        "[]",
    ]
    .iter()
    .map(|text| text.as_bytes().to_vec())
    .collect();
    // A binary STL that promises four thousand million triangles.
    files.push([vec![0; 80], vec![0xff; 4], vec![0; 50]].concat());
    // A GLB that is longer than itself, and one whose first chunk is.
    files.push([b"glTF".as_slice(), &[2, 0, 0, 0], &[0xff; 4]].concat());
    files.push([b"glTF".as_slice(), &[2, 0, 0, 0, 20, 0, 0, 0], &[0xff; 4], b"JSON"].concat());
    // An archive with an end and no beginning.
    files.push([b"PK\x05\x06".as_slice(), &[0xff; 18]].concat());
    files.push(vec![0xff; 1000]);
    files
}

const RANGES: &[&str] = &[
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

const PATHS: &[(&str, &str)] = &[
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
