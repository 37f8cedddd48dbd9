//! Presets over HTTP: lists, and what becomes of them in jobs and sweeps.

use std::process::Command;

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

/// The curve of the command line.
fn on_the_command_line(material: &str, test: &str, options: &[&str]) -> Value {
    let mut command = Command::new(env!("CARGO_BIN_EXE_gridfall"));
    let ran = command.args(["material", material, "--test", test, "--json"]).args(options).output().unwrap();
    assert!(ran.status.success(), "{}", String::from_utf8_lossy(&ran.stderr));
    serde_json::from_slice(&ran.stdout).unwrap()
}

#[test]
fn element_tests_are_those_of_the_command_line() {
    let dir = tempfile::tempdir().unwrap();
    let server = Server::start(dir.path());
    let angle = ["--set", "friction_angle_degrees=40", "--confining-pressure", "5e4", "--steps", "50"];
    let rate = ["--rate", "10", "--strain", "0.3"];
    let cases: &[(&str, &str, &[&str], Value)] = &[
        ("steel", "uniaxial", &[], json!({ "material": { "preset": "steel" } })),
        (
            "dry-sand",
            "triaxial",
            &angle,
            json!({ "material": { "preset": "dry-sand", "friction_angle_degrees": 40 }, "confining_pressure": 5e4,
                    "steps": 50 }),
        ),
        ("glycerine", "shear", &rate, json!({ "material": { "preset": "glycerine" }, "rate": 10, "strain": 0.3 })),
        ("snow", "oedometer", &[], json!({ "material": { "preset": "snow" } })),
        ("soft-clay", "shear", &[], json!({ "material": { "preset": "soft-clay" } })),
    ];
    for (material, test, options, request) in cases {
        let mut request = request.clone();
        request["test"] = json!(test);
        let answer = server.post_json("/v1/materials/test", &request);
        assert_eq!(answer.status, 200, "{}", answer.json());
        let (curve, expected) = (answer.json(), on_the_command_line(material, test, options));
        assert_eq!(curve, expected, "{material} {test}");
        assert_eq!(curve["rows"].as_array().unwrap().len() as u64, curve["steps"].as_u64().unwrap() + 1);
    }
    // A model with its parameters is a material too.
    let rubber = json!({ "model": "neo-hookean", "density": 1000, "youngs_modulus": 1e6, "poissons_ratio": 0.3 });
    let curve = server.post_json("/v1/materials/test", &json!({ "material": rubber, "test": "uniaxial" })).json();
    let (columns, first) = (curve["columns"].as_array().unwrap(), &curve["rows"][1]);
    let at = |name: &str| first[columns.iter().position(|column| column == name).unwrap()].as_f64().unwrap();
    assert!((at("axial_stress") / at("strain") / 1e6 - 1.0).abs() < 0.01, "{first}");
}

#[test]
fn faults_of_element_tests_name_field_reason_and_remedy() {
    let dir = tempfile::tempdir().unwrap();
    let server = Server::start(dir.path());
    let steel = json!({ "preset": "steel" });
    for (request, pointer, code, remedy) in [
        (json!({ "material": { "preset": "steal" } }), "/material/preset", "unknown_preset", "did you mean `steel`"),
        (json!({ "material": { "preset": "steel", "density": -1 } }), "/material/density", "not_positive", "above 0"),
        (json!({ "material": { "preset": "steel", "color": 1 } }), "/material/color", "unknown_field", ""),
        (json!({ "material": 7 }), "/material", "wrong_type", ""),
        (json!({ "material": steel, "confining_pressure": 1e5 }), "/confining_pressure", "out_of_range", "take it out"),
        (json!({ "material": steel, "strain": -1 }), "/strain", "out_of_range", "not 0"),
        (json!({ "material": steel, "rate": 0 }), "/rate", "out_of_range", "above 0"),
        (json!({ "material": steel, "steps": 0 }), "/steps", "out_of_range", "above 0"),
        (json!({ "material": steel, "steps": 2001 }), "/steps", "too_many", "2000 or less"),
    ] {
        let mut request = request;
        request["test"] = json!("uniaxial");
        let answer = server.post_json("/v1/materials/test", &request);
        let problem = answer.json();
        assert_eq!((answer.status, &problem["code"]), (422, &json!("invalid_material")), "{request}: {problem}");
        let fault = &problem["faults"][0];
        assert_eq!((&fault["pointer"], &fault["code"]), (&json!(pointer), &json!(code)), "{request}: {problem}");
        assert!(fault["remedy"].as_str().is_some_and(|said| !said.is_empty() && said.contains(remedy)), "{problem}");
    }
    for request in
        [json!({ "material": steel, "test": "bend" }), json!({ "material": steel }), json!({ "test": "shear" })]
    {
        let answer = server.post_json("/v1/materials/test", &request);
        assert_eq!((answer.status, &answer.json()["code"]), (422, &json!("invalid_request")), "{}", answer.json());
    }
}
