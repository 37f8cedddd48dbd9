//! Frames as viewers draw them, scenes of jobs, and the library.

use serde_json::json;

use super::support::{Answer, Server, endless, short};

/// A frame's points, taken apart as the document says.
struct Points {
    frame: u32,
    recorded: u32,
    time_s: f64,
    range: [f32; 2],
    positions: Vec<[f64; 3]>,
    rest: Vec<u8>,
}

fn points(answer: &Answer) -> Points {
    let body = &answer.body;
    let u32_at = |at: usize| u32::from_le_bytes(body[at..at + 4].try_into().unwrap());
    let f32_at = |at: usize| f32::from_le_bytes(body[at..at + 4].try_into().unwrap());
    let f64_at = |at: usize| f64::from_le_bytes(body[at..at + 8].try_into().unwrap());
    assert_eq!((&body[..4], u32_at(4)), (&b"GFPT"[..], 1));
    let n = u32_at(12) as usize;
    assert_eq!(body.len(), 64 + 16 * n);
    let position = |k: usize| std::array::from_fn(|a| f64_at(32 + 8 * a) + f64::from(f32_at(64 + 12 * k + 4 * a)));
    Points {
        frame: u32_at(8),
        recorded: u32_at(16),
        time_s: f64_at(24),
        range: [f32_at(56), f32_at(60)],
        positions: (0..n).map(position).collect(),
        rest: body[64 + 12 * n..].to_vec(),
    }
}

#[test]
fn points_of_any_frame() {
    let dir = tempfile::tempdir().unwrap();
    let server = Server::start(dir.path());
    let job = server.submit(short());
    let done = server.wait_for(&job, "succeeded");
    let list = server.get(&format!("{job}/frames")).json();
    assert_eq!((&list["frames"], &list["points"]), (&done["progress"]["frames"], &done["particles"]));
    let fields: Vec<&str> =
        list["fields"].as_array().unwrap().iter().map(|field| field["name"].as_str().unwrap()).collect();
    assert!(fields.contains(&"speed") && fields.contains(&"vy"), "{fields:?}");

    let frame = |n: u64, query: &str| server.get(&format!("{job}/frames/{n}/points{query}"));
    let first = points(&frame(0, "?field=vy"));
    assert_eq!((first.frame, first.recorded, first.time_s, first.range), (0, 64, 0.0, [0.0; 2]));
    // The square of the scene: every point within it, at z = 0.
    assert!(first.positions.iter().all(|x| x[..2].iter().all(|c| (0.375..=0.625).contains(c)) && x[2] == 0.0));
    let last = points(&frame(5, "?field=vy"));
    assert!((last.time_s - 0.05).abs() < 1e-12);
    let speeds: Vec<f32> = last.rest.chunks(4).map(|bytes| f32::from_le_bytes(bytes.try_into().unwrap())).collect();
    // Free fall.
    assert!(speeds.iter().all(|v| (v + 9.81 * 0.05).abs() < 1e-3), "{speeds:?}");
    assert!(speeds.iter().all(|v| (last.range[0]..=last.range[1]).contains(v)));
    let colors = points(&frame(5, ""));
    assert!(colors.rest.chunks(4).all(|color| color[3] == 255) && colors.range[0].is_nan());
    let few = points(&frame(5, "?max_points=10"));
    assert_eq!((few.positions.len(), few.recorded), (10, 64));
    assert!(few.positions.iter().all(|x| colors.positions.contains(x)));

    let tag = frame(3, "?field=vy").header("etag").to_owned();
    let same = server.call("GET", &format!("{job}/frames/3/points?field=vy"), &[("if-none-match", &tag)], "");
    assert_eq!(same.status, 304);
    let other = server.call("GET", &format!("{job}/frames/3/points?field=vx"), &[("if-none-match", &tag)], "");
    assert_eq!(other.status, 200);

    for (path, status, code) in [
        ("/frames/6/points", 404, "output_not_found"),
        ("/frames/99999999999/points", 404, "output_not_found"),
        ("/frames/-1/points", 400, "invalid_path"),
        ("/frames/x/points", 400, "invalid_path"),
        ("/frames/0/points?field=taste", 400, "invalid_query"),
        ("/frames/0/points?max_points=0", 400, "invalid_query"),
        ("/frames/0/points?colour=red", 400, "invalid_query"),
    ] {
        let answer = server.get(&format!("{job}{path}"));
        assert_eq!((answer.status, answer.json()["code"].as_str()), (status, Some(code)), "{path}");
    }
    let nobody = "/v1/jobs/01890000-0000-7000-8000-000000000000";
    for path in ["/frames", "/frames/0/points", "/scene"] {
        assert_eq!(server.get(&format!("{nobody}{path}")).json()["code"], "job_not_found");
    }
}

#[test]
fn colliders_of_any_frame() {
    let dir = tempfile::tempdir().unwrap();
    let server = Server::start(dir.path());
    let mut scene = short();
    scene["colliders"] = json!([
        { "name": "still", "shape": { "box": { "min": [0.0, 0.0], "max": [0.25, 0.125] } }, "contact": "slip" },
        { "name": "turns", "shape": { "sphere": { "center": [0.75, 0.25], "radius": 0.1 } }, "contact": "slip",
          "motion": { "linear_velocity": [1.0, 0.0], "angular_velocity": 2.0 } },
        { "name": "comes", "shape": { "box": { "min": [0.5, 0.0], "max": [0.75, 0.125] } }, "contact": "slip",
          "from": 0.025 },
    ]);
    let job = server.submit(scene);
    server.wait_for(&job, "succeeded");
    let frame = |n: u64, query: &str| server.get(&format!("{job}/frames/{n}/colliders{query}"));
    let (first, last) = (frame(0, "?meshes=true").json(), frame(5, "").json());
    let names = |answer: &serde_json::Value| -> Vec<String> {
        answer["colliders"].as_array().unwrap().iter().map(|one| one["name"].as_str().unwrap().to_owned()).collect()
    };
    assert_eq!(
        (names(&first), names(&last)),
        (vec!["still".into(), "turns".into()], vec!["still".to_owned(), "turns".into(), "comes".into()])
    );
    assert!(first["edition"] != last["edition"] && frame(1, "").json()["edition"] == first["edition"]);
    assert_eq!(frame(4, "").json()["edition"], last["edition"]);
    assert_eq!((&first["moves"], &first["domain"]["min"][0]), (&json!(true), &json!(0.0)));
    // What is still is where its mesh is.
    let still = &first["colliders"][0];
    assert_eq!((&still["position"], &still["orientation"]), (&json!([0.0, 0.0, 0.0]), &json!([0.0, 0.0, 0.0, 1.0])));
    let mesh = |one: &serde_json::Value, name: &str| -> Vec<f64> {
        one["mesh"][name].as_array().unwrap().iter().map(|number| number.as_f64().unwrap()).collect()
    };
    let corners = mesh(still, "vertices");
    for (axis, [low, high]) in [[0.0, 0.25], [0.0, 0.125]].into_iter().enumerate() {
        let of_axis = || corners.iter().skip(axis).step_by(3);
        let ends = of_axis().fold([f64::MAX, f64::MIN], |[a, b], x| [a.min(*x), b.max(*x)]);
        assert!((ends[0] - low).abs() < 0.01 && (ends[1] - high).abs() < 0.01, "{axis}: {ends:?}");
    }
    let triangles = mesh(still, "triangles");
    assert!(triangles.len() >= 36 && triangles.iter().all(|corner| (*corner as usize) < corners.len() / 3));
    // What moves is where its motion has taken it: the center of the sphere, at (0.75, 0.25), goes on by v t.
    let turned = &last["colliders"][1];
    let number = |value: &serde_json::Value| value.as_f64().unwrap();
    let [x, y] = [0, 1].map(|axis| number(&turned["position"][axis]));
    let [z, w] = [2, 3].map(|part| number(&turned["orientation"][part]));
    let (sin, cos) = (2.0 * z * w, w * w - z * z);
    assert!((sin - 0.1f64.sin()).abs() < 1e-9 && (cos - 0.1f64.cos()).abs() < 1e-9, "{turned}");
    let center = [x + cos * 0.75 - sin * 0.25, y + sin * 0.75 + cos * 0.25];
    assert!((center[0] - 0.8).abs() < 1e-9 && (center[1] - 0.25).abs() < 1e-9, "{center:?}");
    assert!(turned.get("mesh").is_none());

    let tag = frame(3, "").header("etag").to_owned();
    let same = server.call("GET", &format!("{job}/frames/3/colliders"), &[("if-none-match", &tag)], "");
    assert_eq!(same.status, 304);
    for (path, status, code) in [
        ("/frames/6/colliders", 404, "output_not_found"),
        ("/frames/x/colliders", 400, "invalid_path"),
        ("/frames/0/colliders?meshes=maybe", 400, "invalid_query"),
    ] {
        let answer = server.get(&format!("{job}{path}"));
        assert_eq!((answer.status, &answer.json()["code"]), (status, &json!(code)), "{path}");
    }
}

#[test]
fn frames_are_there_while_the_job_runs() {
    let dir = tempfile::tempdir().unwrap();
    let server = Server::start(dir.path());
    let job = server.submit(endless());
    let waiting = server.submit(short());
    let problem = server.get(&format!("{waiting}/frames/0/points")).json();
    assert_eq!(problem["code"], "output_not_found");
    assert!(problem["detail"].as_str().unwrap().contains("queue"), "{problem}");
    let mut before = 0;
    for _ in 0..3 {
        let frames = server.wait_for_frames(&job, before + 3)["progress"]["frames_written"].as_u64().unwrap();
        let newest = points(&server.get(&format!("{job}/frames/{}/points?field=speed", frames - 1)));
        assert_eq!(u64::from(newest.frame), frames - 1);
        let list = server.get(&format!("{job}/frames")).json()["frames"].as_u64().unwrap();
        assert!(list >= frames, "{list} of {frames}");
        before = frames;
    }
    let far = server.get(&format!("{job}/frames/99000/points"));
    assert_eq!((far.status, far.header("retry-after")), (404, "1"));
    server.call("POST", &format!("{job}/cancel"), &[], "");
    server.wait_for(&job, "canceled");
    assert_eq!(points(&server.get(&format!("{job}/frames/{}/points", before - 1))).frame as u64, before - 1);
}

#[test]
fn the_library_can_be_run_and_jobs_say_what_they_run() {
    let dir = tempfile::tempdir().unwrap();
    let server = Server::start(dir.path());
    let library = server.get("/v1/library").json();
    let scenes = library["scenes"].as_array().unwrap();
    let named = |name: &str| scenes.iter().find(|scene| scene["name"] == name).unwrap();
    assert!(scenes.iter().all(|scene| scene["description"].as_str().is_some_and(|text| text.len() > 20)));
    assert_eq!((&named("quickstart")["dimension"], &named("elastic-gate-2d")["dimension"]), (&json!(3), &json!(2)));
    let answer = server.get("/v1/library/quickstart");
    assert_eq!(answer.body, include_bytes!("../../../scenes/quickstart.json"));
    let tag = answer.header("etag").to_owned();
    assert_eq!(server.call("GET", "/v1/library/quickstart", &[("if-none-match", &tag)], "").status, 304);
    for name in ["nothing", "%2e%2e%2fCargo.toml"] {
        assert_eq!(server.get(&format!("/v1/library/{name}")).json()["code"], "scene_not_found");
    }
    let request = json!({ "scene": answer.json(), "overrides": { "time.end": 0.5 } });
    let job = server.post_json("/v1/jobs", &request).header("location").to_owned();
    let scene = server.get(&format!("{job}/scene"));
    assert_eq!((&scene.json()["name"], &scene.json()["time"]["end"]), (&json!("quickstart"), &json!(0.5)));
    let tag = scene.header("etag").to_owned();
    assert_eq!(server.call("GET", &format!("{job}/scene"), &[("if-none-match", &tag)], "").status, 304);
}
