//! Presets over HTTP: lists, and what becomes of them in jobs and sweeps.

use serde_json::{Value, json};

use super::support::{Server, short};

#[test]
fn presets_are_listed_with_their_sources() {
    let dir = tempfile::tempdir().unwrap();
    let server = Server::start(dir.path());
    let list = server.get("/v1/materials").json();
    let materials = list["materials"].as_array().unwrap();
    assert!(materials.len() >= 24);
    for material in materials {
        let name = material["name"].as_str().unwrap();
        assert_eq!(&server.get(&format!("/v1/materials/{name}")).json(), material);
        let keys: Vec<&Value> = material["sources"].as_array().unwrap().iter().map(|source| &source["key"]).collect();
        for value in material["values"].as_array().unwrap() {
            assert!(value["sources"].as_array().unwrap().iter().all(|key| keys.contains(&key)), "{name}");
            let field = value["field"].as_str().unwrap();
            assert_eq!(value["value"], material["material"][field], "{name} {field}");
            assert!(value["least"].as_f64() <= value["value"].as_f64(), "{name} {field}");
        }
    }
    let missing = server.get("/v1/materials/watr");
    assert_eq!((missing.status, &missing.json()["code"]), (404, &json!("material_not_found")));
    assert!(missing.json()["detail"].as_str().unwrap().contains("did you mean `water`?"));
}

#[test]
fn jobs_and_sweeps_keep_whole_materials() {
    let dir = tempfile::tempdir().unwrap();
    let server = Server::start(dir.path());
    let mut scene = short();
    scene["bodies"][0]["material"] = json!({ "preset": "jelly", "damping": 0.001 });
    let job = server.submit(scene.clone());
    let kept = server.get(&format!("{job}/scene")).json();
    let name = kept["bodies"][0]["material"].as_str().unwrap();
    let material = &kept["materials"][name];
    assert_eq!((&material["origin"], &material["model"]), (&json!("jelly"), &json!("neo-hookean")));
    assert_eq!((&material["youngs_modulus"], &material["damping"]), (&json!(4.3e3), &json!(0.001)));
    server.wait_for(&job, "succeeded");
    let grid = json!({ "bodies.0.material.preset": ["jelly", "gelatine"], "bodies.0.material.density": [900, 1000] });
    let sweep = server.post_json("/v1/sweeps", &json!({ "scene": scene, "grid": grid }));
    assert_eq!((sweep.status, &sweep.json()["total"]), (202, &json!(4)), "{}", sweep.json());
    let jobs = server.get(&format!("/v1/jobs?sweep={}", sweep.json()["id"].as_str().unwrap())).json();
    let mut found: Vec<String> = Vec::new();
    for job in jobs["jobs"].as_array().unwrap() {
        let scene = server.get(&format!("/v1/jobs/{}/scene", job["id"].as_str().unwrap())).json();
        let material = &scene["materials"][scene["bodies"][0]["material"].as_str().unwrap()];
        found.push(format!("{} {}", material["origin"].as_str().unwrap(), material["density"]));
    }
    found.sort();
    assert_eq!(found, ["gelatine 1000.0", "gelatine 900.0", "jelly 1000.0", "jelly 900.0"]);
    // A run again has the values of its day, and takes changes of them.
    let again =
        server.post_json(&format!("{job}/rerun"), &json!({ "overrides": { "bodies.0.material.density": 1100 } }));
    assert_eq!(again.status, 202, "{}", again.json());
    let scene = server.get(&format!("{}/scene", again.header("location"))).json();
    assert_eq!(scene["materials"][scene["bodies"][0]["material"].as_str().unwrap()]["density"], json!(1100));
    scene_of_a_wrong_preset(&server);
}

fn scene_of_a_wrong_preset(server: &Server) {
    let mut scene = short();
    scene["bodies"][0]["material"] = json!({ "preset": "jely" });
    let problem = server.post_json("/v1/jobs", &json!({ "scene": scene })).json();
    let fault = &problem["faults"][0];
    assert_eq!(
        (&fault["pointer"], &fault["code"]),
        (&json!("/scene/bodies/0/material/preset"), &json!("unknown_preset"))
    );
}
