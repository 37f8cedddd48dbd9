//! The dashboard: what browsers get, and that people can use it. `tests/dashboard` uses it in a browser.

use std::collections::HashMap;
use std::io::Cursor;
use std::path::Path;
use std::process::Command;

use serde_json::json;

use super::support::{Server, short};

const HTML: (&str, &str) = ("accept", "text/html,application/xhtml+xml,*/*;q=0.8");

#[test]
fn browsers_get_the_dashboard_and_programs_an_index() {
    let dir = tempfile::tempdir().unwrap();
    let server = Server::start(dir.path());
    let index = server.get("/");
    assert_eq!((index.header("content-type"), index.header("vary")), ("application/json", "accept"));
    for link in index.json()["links"].as_object().unwrap().values() {
        let answer = server.get(link.as_str().unwrap());
        assert_eq!(answer.status, 200, "{link}");
    }
    let page = server.call("GET", "/", &[HTML], "");
    assert_eq!(page.header("content-type"), "text/html; charset=utf-8");
    assert!(page.header("vary").contains("accept"));
    let text = String::from_utf8(page.body.clone()).unwrap();
    let loaded: Vec<&str> = text.split("=\"/dashboard/").skip(1).map(|rest| &rest[..rest.find('"').unwrap()]).collect();
    assert!(loaded.contains(&"main.js") && loaded.contains(&"style.css"), "{loaded:?}");
    for path in loaded.iter().map(|name| format!("/dashboard/{name}")).chain(["/".to_owned()]) {
        let answer = server.call("GET", &path, &[HTML], "");
        assert_eq!(answer.status, 200, "{path}");
        assert!(answer.header("content-security-policy").starts_with("default-src 'none'; script-src 'self'"));
        assert!(!answer.header("content-security-policy").contains("unsafe"));
        assert_eq!((answer.header("x-content-type-options"), answer.header("cache-control")), ("nosniff", "no-cache"));
        let tag = answer.header("etag").to_owned();
        let same = server.call("GET", &path, &[HTML, ("if-none-match", &tag)], "");
        assert_eq!((same.status, same.body.len()), (304, 0), "{path}");
    }
    assert_eq!(server.get("/dashboard/main.js").header("content-type"), "text/javascript; charset=utf-8");
    for path in ["/dashboard/none.js", "/dashboard/index.html", "/dashboard/%2e%2e%2fmod.rs"] {
        assert_eq!(server.get(path).json()["code"], "route_not_found", "{path}");
    }
}

#[test]
fn people_can_use_the_dashboard() {
    let dir = tempfile::tempdir().unwrap();
    use_in_a_browser(&Server::start(dir.path()), "pictures", "", &[]);
}

/// Old releases recorded no shapes of colliders.
#[test]
fn recordings_without_colliders_are_seen() {
    let dir = tempfile::tempdir().unwrap();
    let server = Server::start(dir.path());
    let mut scene = short();
    scene["colliders"] = json!([{ "name": "post", "contact": "slip",
        "shape": { "sphere": { "center": [0.2, 0.2], "radius": 0.1 } } }]);
    scene["time"] = json!({ "end": 0.04, "frame_rate": 100 });
    let job = server.submit(scene);
    server.wait_for(&job, "succeeded");
    let path = server.file(&job, "recording.mcap");
    let old = without(&std::fs::read(&path).unwrap(), "/colliders");
    std::fs::write(&path, old).unwrap();
    assert_eq!(server.get(&format!("{job}/frames/0/colliders")).json()["code"], "output_not_found");
    assert_eq!(server.get(&format!("{job}/frames/0/points")).status, 200);
    use_in_a_browser(&server, "pictures-old", "", &["recordingsWithoutShapes"]);
}

/// A recording without a topic, and without its attachments and metadata. A frame's points are in a chunk of their own,
/// and so are its diagnostics, with which it ends.
fn without(recording: &[u8], topic: &str) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut writer = mcap::Writer::new(Cursor::new(&mut bytes)).unwrap();
    // As in recordings, all channels are known from the start.
    let mut ids = HashMap::new();
    let summary = mcap::Summary::read(recording).unwrap().unwrap();
    for channel in summary.channels.values().filter(|channel| channel.topic != topic) {
        let schema = channel.schema.as_ref().unwrap();
        let schema = writer.add_schema(&schema.name, &schema.encoding, &schema.data).unwrap();
        let id = writer.add_channel(schema, &channel.topic, &channel.message_encoding, &channel.metadata).unwrap();
        ids.insert(channel.topic.clone(), id);
    }
    for message in mcap::MessageStream::new(recording).unwrap().map(Result::unwrap) {
        let Some(&channel_id) = ids.get(&message.channel.topic) else { continue };
        let mcap::Message { sequence, log_time, publish_time, .. } = message;
        let header = mcap::records::MessageHeader { channel_id, sequence, log_time, publish_time };
        let alone = ["/particles", "/diagnostics"].contains(&message.channel.topic.as_str());
        if alone {
            writer.flush().unwrap();
        }
        writer.write_to_known_channel(&header, &message.data).unwrap();
        if alone {
            writer.flush().unwrap();
        }
    }
    writer.finish().unwrap();
    drop(writer);
    bytes
}

#[test]
fn people_sign_in_to_the_dashboard_of_a_server_with_keys() {
    let dir = tempfile::tempdir().unwrap();
    let key = super::keys::keys(dir.path(), &["create", "people"]);
    let server = Server::start(dir.path());
    let steps = ["peopleSignIn", "whatIsSignedInCanDoItAll", "theReferenceIsShownUnderItsPolicy", "peopleSignOut"];
    use_in_a_browser(&server, "pictures-of-keys", &key, &steps);
}

/// Does steps of `tests/dashboard`, all of them without any, signed in with a key if there is one.
fn use_in_a_browser(server: &Server, pictures: &str, key: &str, steps: &[&str]) {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/dashboard/run");
    let tools = Path::new(env!("CARGO_TARGET_TMPDIR")).parent().unwrap().join("dashboard");
    let mut command = Command::new(script);
    command.arg(&tools).arg(&server.url).arg(tools.join(pictures)).args(steps).env("GRIDFALL_API_KEY", key);
    let ran = command.output().unwrap();
    let said = format!("{}{}", String::from_utf8_lossy(&ran.stdout), String::from_utf8_lossy(&ran.stderr));
    println!("{said}");
    assert!(ran.status.success(), "{said}");
}
