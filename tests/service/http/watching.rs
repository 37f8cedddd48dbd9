//! Seeing what becomes of a job: by waiting, by events, and by its recording as it grows.

use serde_json::{Value, json};

use super::support::{Server, endless, scene, short};

#[test]
fn a_client_may_wait_for_a_change_and_for_the_end() {
    let dir = tempfile::tempdir().unwrap();
    let server = Server::start(dir.path());
    let job = server.submit(endless());
    let tag = server.get(&job).header("etag").to_owned();
    let changed = server.call("GET", &job, &[("prefer", "wait=60"), ("if-none-match", &tag)], "");
    assert_eq!((changed.status, changed.header("preference-applied")), (200, "wait=60"));
    assert_ne!(changed.header("etag"), tag);
    let soon = server.call("GET", &job, &[("prefer", "respond-async, wait=0")], "");
    assert_eq!((soon.status, &soon.json()["status"]), (200, &json!("running")));
    let ended = std::thread::scope(|scope| {
        let waiting = scope.spawn(|| server.call("GET", &job, &[("prefer", "wait=9999")], ""));
        server.call("POST", &format!("{job}/cancel"), &[], "");
        waiting.join().unwrap()
    });
    assert_eq!((ended.header("preference-applied"), &ended.json()["status"]), ("wait=60", &json!("canceled")));
    let tag = ended.header("etag").to_owned();
    assert_eq!(server.call("GET", &job, &[("prefer", "wait=60"), ("if-none-match", &tag)], "").status, 304);
}

/// Kind, id and data of events.
fn events(answer: &super::support::Answer) -> Vec<[String; 3]> {
    assert_eq!((answer.status, answer.header("content-type")), (200, "text/event-stream"));
    let text = String::from_utf8(answer.body.clone()).unwrap();
    let blocks = text.split("\n\n").filter(|block| block.contains("event: "));
    let field = |block: &str, name: &str| {
        let line = block.lines().find_map(|line| line.strip_prefix(name));
        line.unwrap_or_default().to_owned()
    };
    blocks.map(|block| ["event: ", "id: ", "data: "].map(|name| field(block, name))).collect()
}

#[test]
fn events_tell_of_a_job_to_its_end_and_go_on_where_a_client_stopped() {
    let dir = tempfile::tempdir().unwrap();
    let server = Server::start(dir.path());
    let job = server.submit(scene(0.5));
    let path = format!("{job}/events");
    let all = events(&server.get(&path));
    let [kind, _, data] = all.last().unwrap();
    let last: Value = serde_json::from_str(data).unwrap();
    assert_eq!((kind.as_str(), &last["status"]), ("status", &json!("succeeded")));
    assert_eq!(last, server.job(&job));
    let log: Vec<&str> = all.iter().filter(|[kind, ..]| kind == "log").map(|[.., data]| data.as_str()).collect();
    for said in
        ["attempt 1 runs from the start on ", "integrated explicitly: ", "frame 50 of 50", "attempt 1: succeeded"]
    {
        assert!(log.iter().any(|line| line.contains(said)), "{said:?} is not in {log:#?}");
    }
    // The same as a text.
    let text = server.get(&format!("{job}/log"));
    assert_eq!(text.header("content-type"), "text/plain; charset=utf-8");
    assert_eq!(String::from_utf8(text.body).unwrap().lines().collect::<Vec<_>>(), log);

    let (n, [_, id, _]) = all.iter().enumerate().find(|(_, [kind, ..])| kind == "log").unwrap();
    let rest = events(&server.call("GET", &path, &[("last-event-id", id)], ""));
    let logs = |events: &[[String; 3]]| events.iter().filter(|[kind, ..]| kind == "log").count();
    assert_eq!(logs(&rest), logs(&all) - logs(&all[..=n]));
    let [_, id, _] = all.last().unwrap();
    assert!(events(&server.call("GET", &path, &[("last-event-id", id)], "")).is_empty());
    assert_eq!(server.call("DELETE", &job, &[], "").status, 204);
    assert_eq!(server.get(&path).status, 404);
}

#[test]
fn a_recording_that_is_followed_ends_as_the_finished_one() {
    let dir = tempfile::tempdir().unwrap();
    let server = Server::start(dir.path());
    let (first, second) = (server.submit(scene(1.5)), server.submit(endless()));
    let follow = |job: &str| server.get(&format!("{job}/recording.mcap?follow=true"));
    // From the beginning, and a canceled one from a place in the middle.
    let followed = follow(&first);
    assert_eq!((followed.status, followed.header("accept-ranges")), (200, "none"));
    server.wait_for(&first, "succeeded");
    assert!(followed.body == server.get(&format!("{first}/recording.mcap")).body);
    server.wait_for_frames(&second, 3);
    let followed = std::thread::scope(|scope| {
        let following = scope.spawn(|| follow(&second));
        let frames = server.job(&second)["progress"]["frames_written"].as_u64().unwrap();
        server.wait_for_frames(&second, frames + 20);
        server.call("POST", &format!("{second}/cancel"), &[], "");
        following.join().unwrap()
    });
    server.wait_for(&second, "canceled");
    assert!(followed.body == server.get(&format!("{second}/recording.mcap")).body);
    // Now it is a file like any other.
    let path = format!("{first}/recording.mcap?follow=true");
    assert_eq!(server.call("GET", &path, &[("range", "bytes=0-7")], "").status, 206);
}

#[test]
fn devices_are_listed() {
    let dir = tempfile::tempdir().unwrap();
    let server = Server::start(dir.path());
    server.wait_for(&server.submit(short()), "succeeded");
    let devices = server.get("/v1/devices").json();
    assert_eq!((&devices["state"], &devices["devices"][0]["kind"]), (&json!("ready"), &json!("cpu")));
}
