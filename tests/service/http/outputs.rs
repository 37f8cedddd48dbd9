//! Recordings, pictures and diagnostics over HTTP: by ranges, from other origins, and while the job
//! runs.

use serde_json::json;

use super::lifecycle::frames_of;
use super::support::{Server, endless, short};

#[test]
fn a_finished_recording_is_served_by_ranges() {
    let dir = tempfile::tempdir().unwrap();
    let server = Server::start(dir.path());
    let job = server.submit(short());
    server.wait_for(&job, "succeeded");
    let path = format!("{job}/recording.mcap");
    let whole = server.get(&path);
    assert_eq!((whole.status, whole.header("accept-ranges")), (200, "bytes"));
    assert_eq!(whole.header("content-length"), whole.body.len().to_string());
    assert_eq!(whole.body, std::fs::read(server.file(&job, "recording.mcap")).unwrap());
    assert_eq!(frames_of(&whole.body), 6);
    let (n, tag) = (whole.body.len(), whole.header("etag").to_owned());

    let ranged =
        |range: &str, extra: &[(&str, &str)]| server.call("GET", &path, &[&[("range", range)], extra].concat(), "");
    for (range, start, end) in
        [("bytes=0-7", 0, 8), ("bytes=8-99", 8, 100), ("bytes=-8", n - 8, n), ("bytes=100-", 100, n)]
    {
        let part = ranged(range, &[]);
        assert_eq!((part.status, part.header("etag")), (206, tag.as_str()), "{range}");
        assert_eq!(part.header("content-range"), format!("bytes {start}-{}/{n}", end - 1));
        assert_eq!(part.header("content-length"), (end - start).to_string());
        assert!(part.body == whole.body[start..end], "{range}");
    }
    let outside = ranged(&format!("bytes={n}-"), &[]);
    assert_eq!((outside.status, outside.header("content-range")), (416, format!("bytes */{n}").as_str()));
    assert_eq!(outside.header("content-type"), "application/problem+json");
    assert_eq!(outside.json()["code"], "range_not_satisfiable");
    assert_eq!(ranged("bytes=0-7", &[("if-range", &tag)]).status, 206);
    let changed = ranged("bytes=0-7", &[("if-range", "\"another\"")]);
    assert_eq!((changed.status, changed.body.len()), (200, n));
    assert_eq!(server.call("GET", &path, &[("if-none-match", &tag)], "").status, 304);

    let head = server.call("HEAD", &path, &[("range", "bytes=0-7")], "");
    assert_eq!((head.status, head.body.len(), head.header("content-length")), (200, 0, n.to_string().as_str()));
    assert_eq!((head.header("etag"), head.header("accept-ranges")), (tag.as_str(), "bytes"));
}

#[test]
fn viewers_in_browsers_may_read_recordings_and_nothing_else() {
    let dir = tempfile::tempdir().unwrap();
    let server = Server::start(dir.path());
    let job = server.submit(short());
    server.wait_for(&job, "succeeded");
    let origin = ("origin", "https://viewer.example");
    for output in ["recording.mcap", "thumbnail.png"] {
        let path = format!("{job}/{output}");
        let preflight = [
            origin,
            ("access-control-request-method", "GET"),
            ("access-control-request-headers", "range"),
            ("access-control-request-private-network", "true"),
        ];
        let answer = server.call("OPTIONS", &path, &preflight, "");
        assert_eq!((answer.status, answer.header("access-control-allow-origin")), (200, "*"));
        assert!(answer.header("access-control-allow-methods").contains("GET"));
        assert!(answer.header("access-control-allow-headers").contains("range"));
        assert_eq!(answer.header("access-control-allow-private-network"), "true");
        let answer = server.call("GET", &path, &[origin, ("range", "bytes=0-3")], "");
        assert_eq!((answer.status, answer.header("access-control-allow-origin")), (206, "*"));
        let exposed = answer.header("access-control-expose-headers");
        for name in ["accept-ranges", "content-length", "content-range", "etag"] {
            assert!(exposed.contains(name), "{name} is not exposed: {exposed}");
        }
        let answer = server.call("PUT", &path, &[], "x");
        assert_eq!((answer.status, &answer.json()["code"]), (405, &json!("method_not_allowed")));
        assert!(answer.header("allow").contains("GET"), "{}", answer.header("allow"));
    }
    // A page elsewhere must not run jobs here: the browser asks first, and is refused.
    let preflight =
        [origin, ("access-control-request-method", "POST"), ("access-control-request-headers", "content-type")];
    let answer = server.call("OPTIONS", "/v1/jobs", &preflight, "");
    assert_eq!(answer.header("access-control-allow-origin"), "");
    assert_eq!(server.call("GET", &job, &[origin], "").header("access-control-allow-origin"), "");
}

#[test]
fn a_running_job_gives_a_valid_recording_and_diagnostics_so_far() {
    let dir = tempfile::tempdir().unwrap();
    let server = Server::start(dir.path());
    let job = server.submit(endless());
    let mut last = 0;
    for _ in 0..5 {
        server.wait_for_frames(&job, last + 1);
        let snapshot = server.get(&format!("{job}/recording-so-far.mcap"));
        assert_eq!((snapshot.status, snapshot.header("accept-ranges")), (200, "none"));
        let frames = frames_of(&snapshot.body);
        assert!(frames > last, "{frames} frames, and {last} were there before");
        // Every message can be read, in order of time.
        let times: Vec<u64> =
            mcap::MessageStream::new(&snapshot.body).unwrap().map(|message| message.unwrap().log_time).collect();
        assert!(times.len() as u64 >= frames && times.is_sorted());
        last = frames;
    }
    // Neither is ever continued by another file.
    let part = |name| server.call("GET", &format!("{job}/{name}"), &[("range", "bytes=9-")], "");
    assert_eq!(part("recording-so-far.mcap").json()["code"], "range_not_satisfiable");
    let early = part("recording.mcap");
    assert_eq!((early.status, &early.json()["code"]), (409, &json!("job_not_finished")));
    assert!(early.json()["detail"].as_str().unwrap().contains("/recording-so-far.mcap"));
    let rows = server.get(&format!("{job}/diagnostics")).json()["rows"].as_array().unwrap().clone();
    assert!(rows.len() as u64 >= last);
    assert!(rows.iter().enumerate().all(|(n, row)| row["frame"] == n));
}

#[test]
fn diagnostics_are_rows_of_numbers_in_json_and_csv() {
    let dir = tempfile::tempdir().unwrap();
    let server = Server::start(dir.path());
    let job = server.submit(short());
    server.wait_for(&job, "succeeded");
    let json = server.get(&format!("{job}/diagnostics"));
    assert_eq!(json.header("content-type"), "application/json");
    let rows = json.json()["rows"].as_array().unwrap().clone();
    assert_eq!(rows.len(), 6);
    assert_eq!((&rows[0]["frame"], &rows[0]["time_s"]), (&json!(0), &json!(0.0)));
    // 0.25 m × 0.25 m of 1000 kg/m³.
    assert!(rows.iter().all(|row| (row["mass_kg"].as_f64().unwrap() - 62.5).abs() < 1e-4));

    let csv = server.get(&format!("{job}/diagnostics.csv"));
    assert!(csv.header("content-type").starts_with("text/csv"));
    assert_eq!(server.get(&format!("{job}/diagnostics?format=csv")).body, csv.body);
    let text = String::from_utf8(csv.body).unwrap();
    let columns: Vec<&str> = text.lines().next().unwrap().split(',').collect();
    assert_eq!(text.lines().count(), 7);
    assert!(columns.iter().all(|column| rows[0].get(column).is_some()), "{columns:?}");
    // An explicit run has no implicit steps.
    assert!(columns.contains(&"residual"));
    let steps = server.get(&format!("{job}/solver")).json();
    assert_eq!(steps["rows"], json!([]));
    let steps = server.get(&format!("{job}/solver.csv"));
    assert_eq!(String::from_utf8(steps.body).unwrap().lines().count(), 1);
}

#[test]
fn the_thumbnail_is_a_png() {
    let dir = tempfile::tempdir().unwrap();
    let server = Server::start(dir.path());
    let job = server.submit(short());
    server.wait_for(&job, "succeeded");
    let answer = server.get(&format!("{job}/thumbnail.png"));
    assert_eq!((answer.status, answer.header("content-type")), (200, "image/png"));
    let reader = png::Decoder::new(std::io::Cursor::new(answer.body)).read_info().unwrap();
    assert!(reader.info().width >= 64 && reader.info().height >= 64);
}

#[test]
fn scenes_are_costed_before_they_run_and_their_schema_is_served() {
    let dir = tempfile::tempdir().unwrap();
    let server = Server::start(dir.path());
    let answer = server.post_json("/v1/scenes:validate", &json!({ "scene": short() }));
    assert_eq!((answer.status, &answer.json()["valid"]), (200, &json!(true)));
    assert_eq!(answer.json()["estimate"]["particles"], 64);
    let schema = server.get("/v1/schema/scene");
    assert_eq!(schema.header("content-type"), "application/schema+json");
    assert!(schema.json()["properties"]["materials"].is_object());
}
