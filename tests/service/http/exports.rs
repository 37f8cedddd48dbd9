//! Frames as files of other programs.

use serde_json::json;

use super::support::{Server, endless, short};

#[test]
fn frames_are_exported() {
    let dir = tempfile::tempdir().unwrap();
    let server = Server::start(dir.path());
    let mut scene = short();
    scene["output"]["fields"] = json!(["velocity", "stress", "body", "id"]);
    let name = scene["bodies"][0]["name"].as_str().unwrap().to_owned();
    let job = server.submit(scene);
    server.wait_for(&job, "succeeded");
    let export = |frame: u64, query: &str| server.get(&format!("{job}/frames/{frame}/export?{query}"));
    for (format, start) in [("ply", &b"ply\n"[..]), ("vtp", b"<?xml"), ("npz", b"PK"), ("csv", b"time_s,x,y,z,vx,")] {
        let answer = export(5, &format!("format={format}"));
        assert_eq!(answer.status, 200, "{format}");
        assert!(answer.body.starts_with(start), "{format}");
        let disposition = answer.header("content-disposition");
        assert!(disposition.ends_with(&format!(".0005.{format}\"")), "{disposition}");
        let tag = answer.header("etag").to_owned();
        let path = format!("{job}/frames/5/export?format={format}");
        assert_eq!(server.call("GET", &path, &[("if-none-match", &tag)], "").status, 304);
        let other = server.call("GET", &format!("{path}&max_points=9"), &[("if-none-match", &tag)], "");
        assert_eq!(other.status, 200);
    }
    let answer = export(5, &format!("format=csv&body={name}&max_points=10"));
    assert_eq!(answer.header("content-type"), "text/csv; charset=utf-8");
    let text = String::from_utf8(answer.body).unwrap();
    let rows: Vec<Vec<f64>> =
        text.lines().skip(1).map(|line| line.split(',').map(|cell| cell.parse().unwrap()).collect()).collect();
    assert_eq!(rows.len(), 10);
    // The square of the scene after 0.05 s of free fall.
    for row in rows {
        assert!((row[0] - 0.05).abs() < 1e-12 && (0.37..0.63).contains(&row[1]) && row[3] == 0.0, "{row:?}");
        assert!((row[5] + 9.81 * 0.05).abs() < 1e-3, "{row:?}");
    }
    for (path, status, code) in [
        ("6/export?format=ply", 404, "output_not_found"),
        ("x/export?format=ply", 400, "invalid_path"),
        ("0/export", 400, "invalid_query"),
        ("0/export?format=xls", 400, "invalid_query"),
        ("0/export?format=ply&body=nobody", 400, "invalid_query"),
        ("0/export?format=ply&max_points=0", 400, "invalid_query"),
    ] {
        let answer = server.get(&format!("{job}/frames/{path}"));
        assert_eq!((answer.status, answer.json()["code"].as_str()), (status, Some(code)), "{path}");
    }
    let detail = server.get(&format!("{job}/frames/0/export?format=ply&body=nobody")).json();
    assert!(detail["detail"].as_str().unwrap().contains(&name), "{detail}");
    // Nothing is left beside the job's outputs.
    let names = std::fs::read_dir(dir.path().join("jobs")).unwrap().flat_map(|job| {
        let attempt = job.unwrap().path().join("1");
        std::fs::read_dir(attempt).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap())
    });
    let names: Vec<String> = names.collect();
    assert!(names.iter().all(|name| !name.starts_with(".tmp")), "{names:?}");
}

#[test]
fn frames_of_a_running_job_are_exported() {
    let dir = tempfile::tempdir().unwrap();
    let server = Server::start(dir.path());
    let job = server.submit(endless());
    server.wait_for_frames(&job, 2);
    assert_eq!(server.get(&format!("{job}/frames/1/export?format=vtp")).status, 200);
    let far = server.get(&format!("{job}/frames/99000/export?format=vtp"));
    assert_eq!((far.status, far.header("retry-after")), (404, "1"));
    let body = server.get(&format!("{job}/frames/1/export?format=vtp&body=b"));
    assert_eq!((body.status, body.json()["code"].as_str()), (400, Some("invalid_query")));
    server.call("POST", &format!("{job}/cancel"), &[], "");
    server.wait_for(&job, "canceled");
}
