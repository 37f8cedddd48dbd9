//! Assets: uploads by content, and scenes that name them.

use super::support::{self, Server};
use serde_json::{Value, json};

/// A closed box as an OBJ.
pub fn mesh(size: f64) -> String {
    let corner = |k: usize| (0..3).map(|a| (size * (k >> a & 1) as f64).to_string()).collect::<Vec<_>>().join(" ");
    let vertices: String = (0..8).map(|k| format!("v {}\n", corner(k))).collect();
    vertices + "f 1 3 4 2\nf 1 2 6 5\nf 2 4 8 6\nf 4 3 7 8\nf 3 1 5 7\nf 5 6 8 7\n"
}

/// A small solid scene with one body of the given shape.
fn scene(shape: Value) -> Value {
    let mut scene = support::short();
    scene["dimension"] = json!(3);
    scene["domain"] = json!({ "min": [0, 0, 0], "max": [1, 1, 1], "dx": 0.0625 });
    scene["gravity"] = json!([0, 0, -9.81]);
    scene["bodies"][0]["shape"] = json!({ "translate": { "offset": [0.25, 0.25, 0.25], "shape": shape } });
    scene
}

#[test]
fn an_upload_is_kept_by_its_content_and_runs_in_a_job() {
    let dir = tempfile::tempdir().unwrap();
    let server = Server::start(dir.path());
    let bytes = mesh(0.25);
    let first = server.call("PUT", "/v1/assets", &[], bytes.clone());
    assert_eq!(first.status, 201, "{}", String::from_utf8_lossy(&first.body));
    let asset = first.json();
    let id = asset["id"].as_str().unwrap();
    assert!(id.starts_with("sha256:") && id.len() == 71, "{id}");
    assert_eq!((asset["bytes"].as_u64(), asset["kind"].as_str()), (Some(bytes.len() as u64), Some("obj")));
    assert_eq!(first.header("location"), format!("/v1/assets/{id}"));
    let again = server.call("PUT", "/v1/assets", &[("content-type", "model/obj")], bytes.clone());
    assert_eq!((again.status, again.json()), (200, asset.clone()));

    let answer = server.get(first.header("location"));
    assert_eq!((answer.status, answer.body.as_slice()), (200, bytes.as_bytes()));
    let tag = answer.header("etag").to_owned();
    assert_eq!(server.call("GET", first.header("location"), &[("if-none-match", &tag)], "").status, 304);
    assert_eq!(server.get("/v1/assets").json(), json!({ "assets": [asset] }));

    let job = server.submit(scene(json!({ "mesh": { "asset": id } })));
    assert_eq!(server.wait_for(&job, "succeeded")["particles"], 512);
    // Uploads survive a restart of the server.
    server.kill();
    let server = Server::start(dir.path());
    assert_eq!(server.get("/v1/assets").json(), json!({ "assets": [asset] }));
}

#[test]
fn what_was_mended_is_said_wherever_a_scene_is_judged() {
    let dir = tempfile::tempdir().unwrap();
    let server = Server::start(dir.path());
    // The last face is turned.
    let bytes = mesh(0.25).replace("f 5 6 8 7", "f 7 8 6 5");
    let id = server.call("PUT", "/v1/assets", &[], bytes).json()["id"].clone();
    let request = json!({ "scene": scene(json!({ "mesh": { "asset": id } })) });
    let judged = server.post_json("/v1/scenes:validate", &request).json();
    let notice = &judged["notices"][0];
    assert_eq!(notice["code"], "mended_mesh", "{judged:#}");
    assert_eq!(notice["pointer"], "/bodies/0/shape/translate/shape/mesh");
    assert!(notice["reason"].as_str().unwrap().contains("2 of 12 faces were turned"), "{notice:#}");
    let job = server.submit(request["scene"].clone());
    let done = server.wait_for(&job, "succeeded");
    assert_eq!((&done["notices"], done["particles"].as_u64()), (&judged["notices"], Some(512)));
    let plain = server.submit(support::short());
    assert_eq!(server.wait_for(&plain, "succeeded")["notices"], json!([]));
}

#[test]
fn scenes_may_name_what_was_uploaded_and_nothing_else() {
    let dir = tempfile::tempdir().unwrap();
    let server = Server::start(dir.path());
    let nowhere = format!("sha256:{}", "0".repeat(64));
    std::fs::write(dir.path().join("secret.obj"), mesh(0.25)).unwrap();
    for (mesh, at, code) in [
        (json!({ "asset": nowhere }), "asset", "unknown_asset"),
        (json!({ "asset": "../../secret" }), "asset", "unknown_asset"),
        (json!({ "file": dir.path().join("secret.obj") }), "file", "file_refused"),
    ] {
        for path in ["/v1/jobs", "/v1/scenes:validate"] {
            let answer = server.post_json(path, &json!({ "scene": scene(json!({ "mesh": mesh })) }));
            assert_eq!(answer.status, 422);
            let fault = &answer.json()["faults"][0];
            assert_eq!(fault["code"], code, "{fault:#}");
            assert_eq!(fault["pointer"], format!("/scene/bodies/0/shape/translate/shape/mesh/{at}"));
        }
    }
}

#[test]
fn a_scene_is_kept_by_its_content_and_runs_by_its_id() {
    let dir = tempfile::tempdir().unwrap();
    let server = Server::start(dir.path());
    let first = server.post_json("/v1/scenes", &json!({ "scene": support::short() }));
    assert_eq!((first.status, &first.json()["particles"]), (201, &json!(64)));
    let (path, id) = (first.header("location").to_owned(), first.json()["id"].clone());
    assert_eq!(path, format!("/v1/scenes/{}", id.as_str().unwrap()));
    let again = server.post_json("/v1/scenes", &json!({ "scene": support::short() }));
    assert_eq!((again.status, again.json()), (200, first.json()));
    assert_eq!(server.get("/v1/scenes").json(), json!({ "ids": [id] }));
    let kept = server.get(&path);
    assert_eq!(kept.json(), support::short());
    assert_eq!(server.call("GET", &path, &[("if-none-match", kept.header("etag"))], "").status, 304);
    let body = json!({ "scene_id": id, "overrides": { "time.end": 0.02 } });
    let submitted = server.post_json("/v1/jobs", &body);
    assert_eq!((submitted.status, &submitted.json()["progress"]["frames"]), (202, &json!(3)));
    server.wait_for(submitted.header("location"), "succeeded");
    assert_eq!(server.post_json("/v1/scenes:validate", &body).status, 200);
}
