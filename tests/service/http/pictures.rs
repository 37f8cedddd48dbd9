//! Pictures and surfaces of frames over HTTP.

use serde_json::json;

use super::support::{Server, endless, short};

#[test]
fn frames_are_drawn() {
    let dir = tempfile::tempdir().unwrap();
    let server = Server::start(dir.path());
    let job = server.submit(short());
    server.wait_for(&job, "succeeded");
    let picture = |query: &str| server.get(&format!("{job}/frames/5/picture.png{query}"));
    let size = |body: &[u8]| {
        let info = png::Decoder::new(std::io::Cursor::new(body)).read_info().unwrap();
        (info.info().width, info.info().height)
    };
    let plain = picture("");
    assert_eq!((plain.status, plain.header("content-type"), size(&plain.body)), (200, "image/png", (960, 540)));
    let colored = picture("?size=640x360&color_by=speed&range=0,1&camera=zoom=2,look_at=0.5,0.5");
    assert_eq!((colored.status, size(&colored.body)), (200, (640, 360)));
    let tag = plain.header("etag").to_owned();
    let again = |query: &str| {
        let path = format!("{job}/frames/5/picture.png{query}");
        server.call("GET", &path, &[("if-none-match", &tag)], "").status
    };
    assert_eq!((again(""), again("?size=640x360")), (304, 200));
    for (path, status, code, said) in [
        ("6/picture.png", 404, "output_not_found", "frame 6"),
        ("x/picture.png", 400, "invalid_path", "frames have numbers"),
        ("5/picture.png?size=9", 400, "invalid_query", "size:"),
        ("5/picture.png?size=1920x1080", 400, "invalid_query", "at most 1280x720"),
        ("5/picture.png?camera=azimuth=3", 400, "invalid_query", "camera: 2D scenes"),
        ("5/picture.png?color_by=heat", 400, "invalid_query", "color_by: the points have no field \"heat\""),
        ("5/picture.png?range=0,1", 400, "invalid_query", "range:"),
        ("5/picture.png?color_by=speed&range=1", 400, "invalid_query", "range:"),
        ("5/picture.png?body=nobody", 400, "invalid_query", "body: there is no body"),
        ("5/picture.png?colour=red", 400, "invalid_query", "colour"),
        ("5/surface?format=ply", 404, "output_not_found", "2D scenes have no surface"),
        ("5/surface", 400, "invalid_query", "format"),
    ] {
        let answer = server.get(&format!("{job}/frames/{path}"));
        let problem = answer.json();
        assert_eq!((answer.status, problem["code"].as_str()), (status, Some(code)), "{path}: {problem}");
        assert!(problem["detail"].as_str().unwrap().contains(said), "{path}: {problem}");
    }
}

#[test]
fn surfaces_are_made() {
    let dir = tempfile::tempdir().unwrap();
    let server = Server::start(dir.path());
    let scene = json!({
        "gridfall": 1, "name": "ball",
        "domain": { "min": [0, 0, 0], "max": [1, 1, 1], "dx": 0.1 },
        "materials": { "jelly": { "model": "neo-hookean", "density": 1000, "youngs_modulus": 1e4,
                                  "poissons_ratio": 0.3 } },
        "bodies": [ { "name": "ball", "material": "jelly",
                      "shape": { "sphere": { "center": [0.5, 0.5, 0.5], "radius": 0.25 } } } ],
        "time": { "end": 0.05, "frame_rate": 20 }
    });
    let job = server.submit(scene);
    server.wait_for(&job, "succeeded");
    let kinds = [("ply", "application/octet-stream"), ("glb", "model/gltf-binary"), ("obj", "model/obj")];
    for ((format, kind), start) in kinds.into_iter().zip([&b"ply\n"[..], b"glTF", b"# time_s 0"]) {
        let path = format!("{job}/frames/0/surface?format={format}");
        let answer = server.get(&path);
        assert_eq!((answer.status, answer.header("content-type")), (200, kind));
        assert!(
            answer.body.starts_with(start) && answer.header("content-disposition").ends_with(&format!(".{format}\""))
        );
        let tag = answer.header("etag").to_owned();
        assert_eq!(server.call("GET", &path, &[("if-none-match", &tag)], "").status, 304);
        assert!(server.get(&format!("{path}&body=ball&max_points=100")).body.len() < answer.body.len());
    }
    for query in ["format=ply&body=nobody", "format=ply&max_points=0", "format=ply&max_points=1000001"] {
        let answer = server.get(&format!("{job}/frames/0/surface?{query}"));
        assert_eq!((answer.status, answer.json()["code"].as_str()), (400, Some("invalid_query")), "{query}");
    }
}

#[test]
fn frames_of_a_running_job_are_drawn() {
    let dir = tempfile::tempdir().unwrap();
    let server = Server::start(dir.path());
    let job = server.submit(endless());
    server.wait_for_frames(&job, 2);
    assert_eq!(server.get(&format!("{job}/frames/1/picture.png")).status, 200);
    let far = server.get(&format!("{job}/frames/99000/picture.png"));
    assert_eq!((far.status, far.header("retry-after")), (404, "1"));
    server.call("POST", &format!("{job}/cancel"), &[], "");
    server.wait_for(&job, "canceled");
}
