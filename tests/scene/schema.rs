//! The published JSON Schema says what the program says, in the words of two independent validators.

use std::path::{Path, PathBuf};
use std::process::Command;

use gridfall_scene::{self as scene, Limits};
use serde_json::{Value, json};

use crate::cases::{changed, flat, good, pouring};

/// Where tests/run installs the validators.
fn tools() -> PathBuf {
    Path::new(env!("CARGO_TARGET_TMPDIR")).parent().expect("it is in the target directory").join("clients")
}

/// Runs a validator beside the clients' tests on the schema and documents.
fn judge(program: &Path, script: &str, more: &[PathBuf], documents: &[Value]) -> Vec<Value> {
    let folder = tempfile::tempdir().unwrap();
    let (schema, list) = (folder.path().join("schema.json"), folder.path().join("documents.json"));
    std::fs::write(&schema, scene::contract::json_schema()).unwrap();
    std::fs::write(&list, serde_json::to_vec(documents).unwrap()).unwrap();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/clients").join(script);
    let ran = Command::new(program).arg(script).args(more).arg(&schema).arg(&list).output();
    let ran = ran.unwrap_or_else(|error| panic!("{program:?}: {error}; tests/run installs it"));
    assert!(ran.status.success(), "{}; tests/run installs what it needs", String::from_utf8_lossy(&ran.stderr));
    serde_json::from_slice(&ran.stdout).unwrap()
}

/// The errors that ajv finds in each document.
fn ajv(documents: &[Value]) -> Vec<Vec<Value>> {
    let judged = judge(Path::new("node"), "schema.mjs", &[tools().join("npm")], documents);
    judged.into_iter().map(|errors| errors.as_array().unwrap().clone()).collect()
}

fn refused(document: &Value) -> bool {
    match scene::from_value(document) {
        Ok(scene) => scene::check(&scene, &Limits { max_particles: 1 << 20, ..Limits::default() }).is_err(),
        Err(_) => true,
    }
}

#[test]
fn valid_scenes_pass() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let read = |path: PathBuf| -> Value { serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap() };
    let folder = std::fs::read_dir(root.join("scenes")).unwrap();
    let mut documents: Vec<Value> = folder.map(|entry| read(entry.unwrap().path())).collect();
    assert!(documents.len() > 60);
    documents.push(read(root.join("api/examples/submit-job.json"))["scene"].clone());
    documents.extend([good(), flat(), pouring()]);
    documents.push(changed(good(), &[("/$schema", json!("https://example.org/scene.schema.json"))]));
    // What is optional may be null.
    let mut nothing = good();
    for at in ["description", "gravity"] {
        nothing[at] = Value::Null;
    }
    nothing["bodies"][0]["points"] = Value::Null;
    nothing["bodies"][0]["contact"] = Value::Null;
    nothing["colliders"][0]["motion"] = Value::Null;
    nothing["solver"]["max_dt"] = Value::Null;
    assert!(!refused(&nothing));
    documents.push(nothing);
    // Presets, in the list and in a body, also where there is no list.
    let mut presets = good();
    presets["materials"]["water"] = json!({ "preset": "water", "viscosity": 0.01 });
    presets["bodies"][1]["material"] = json!({ "preset": "dense-sand", "model": "mohr-coulomb" });
    assert!(!refused(&presets));
    documents.push(serde_json::from_str(&scene::from_value(&presets).unwrap().to_json()).unwrap());
    presets["bodies"][0]["material"] = json!({ "preset": "steel", "damping": 1e-6 });
    presets.as_object_mut().unwrap().remove("materials");
    assert!(!refused(&presets));
    documents.push(presets);
    // Written out as the program writes it.
    documents.push(serde_json::from_str(&scene::from_value(&good()).unwrap().to_json()).unwrap());
    for (errors, document) in ajv(&documents).iter().zip(&documents) {
        assert!(errors.is_empty(), "{errors:#?} in {}", document["name"]);
    }
    let python = tools().join("python/bin/python");
    for (judged, document) in judge(&python, "schema.py", &[], &documents).iter().zip(&documents) {
        assert_eq!(judged[0], 0, "{judged} in {}", document["name"]);
    }
}

#[test]
fn one_slip_is_one_error_at_its_place() {
    let material = "/materials/jelly";
    let cases: &[(&str, Value)] = &[
        ("/gridfall", json!(2)),
        ("/seed", serde_json::from_str("1180591620717411303424").unwrap()),
        ("/seed", json!(-1)),
        ("/dimension", json!(4)),
        ("/name", json!("")),
        ("/name", json!(3)),
        ("/gravity/2", json!(1e30)),
        ("/domain/dx", json!(-1)),
        ("/domain/dx", json!(0)),
        ("/domain/boundary/x", json!("periodical")),
        ("/domain/boundary/z-/friction", json!(-0.3)),
        ("/domain/boundary/z-/contact", json!("seperate")),
        (material, json!({ "model": "neo-hooke", "density": 1000 })),
        (material, json!({ "preset": "watr" })),
        (material, json!({ "preset": "water", "density": -1 })),
        (material, json!({ "preset": "water", "model": "snow" })),
        (material, json!({ "preset": "water", "friction_angle_degrees": 30 })),
        ("/bodies/1/material", json!({ "preset": "snow", "hardening": -1 })),
        ("/bodies/1/material", json!({ "density": 1000 })),
        ("/bodies/1/material", json!(7)),
        ("/materials/jelly/density", json!(-1)),
        ("/materials/jelly/density", json!("heavy")),
        ("/materials/jelly/poissons_ratio", json!(0.5)),
        ("/materials/water/gamma", json!(1)),
        ("/bodies/0/shape/box/max", json!([0.5])),
        ("/bodies/1/shape/sphere/radius", json!(0)),
        ("/bodies/1/particles_per_cell", json!(0)),
        ("/bodies/1/sampling", json!("random")),
        ("/bodies/1/J", json!(-1)),
        ("/bodies/1/contact", json!("slippery")),
        ("/colliders/0/shape/cylinder/axis", json!([0, 0, 0])),
        ("/colliders/0/friction", json!(-1)),
        ("/time/end", json!(0)),
        ("/time/frame_rate", json!(-24)),
        ("/solver/cfl", json!(1.5)),
        ("/solver/kernel", json!("compac")),
        ("/solver/implicit", json!({ "levels": 0 })),
        ("/output/fields/0", json!("speed")),
    ];
    let typos: &[(&str, &str)] = &[
        ("", "nmae"),
        ("/domain", "dxx"),
        (material, "youngs_moduls"),
        ("/bodies/0", "shpae"),
        ("/bodies/0/shape/box", "mni"),
        ("/colliders/0/motion", "linear_velocit"),
        ("/solver", "krenel"),
    ];
    let mut documents = Vec::new();
    let mut places = Vec::new();
    for (at, value) in cases {
        documents.push(changed(good(), &[(at, value.clone())]));
        places.push((*at).to_owned());
    }
    for (at, name) in typos {
        documents.push(changed(good(), &[(&format!("{at}/{name}"), json!(1))]));
        places.push((*at).to_owned());
    }
    // A typo deep inside of shapes.
    let shapes = json!({ "union": [{ "sphere": { "center": [0.7, 0.7, 0.7], "radius": 0.2 } }, { "sphre": {} }] });
    documents.push(changed(good(), &[("/bodies/1/shape", shapes)]));
    places.push("/bodies/1/shape/union/1".into());
    let errors = ajv(&documents);
    let python = judge(&tools().join("python/bin/python"), "schema.py", &[], &documents);
    for n in 0..documents.len() {
        let place = &places[n];
        assert!(refused(&documents[n]), "the program takes {place}: {}", documents[n].pointer(place).unwrap());
        assert_eq!(errors[n].len(), 1, "{place}: {:#?}", errors[n]);
        assert!(errors[n][0]["at"].as_str().unwrap().starts_with(place.as_str()), "{place}: {:#?}", errors[n]);
        assert_eq!(python[n][0], 1, "{place}: {}", python[n]);
        assert!(python[n][1].as_str().unwrap().starts_with(place.as_str()), "{place}: {}", python[n]);
    }
}

/// Pointers of all values of a document.
fn pointers(value: &Value, at: String, found: &mut Vec<String>) {
    match value {
        Value::Object(fields) => fields.iter().for_each(|(name, v)| pointers(v, format!("{at}/{name}"), found)),
        Value::Array(items) => items.iter().enumerate().for_each(|(n, v)| pointers(v, format!("{at}/{n}"), found)),
        _ => {}
    }
    found.push(at);
}

#[test]
fn what_the_schema_refuses_the_program_refuses() {
    let values = [
        json!(-1),
        json!(0),
        json!(1),
        json!(2.5),
        json!(90),
        json!(1e-20),
        json!(1e20),
        json!(8.0),
        json!(""),
        json!("slip"),
        json!("x"),
        json!(null),
        json!([]),
        json!([0, 0]),
        json!({}),
        json!(true),
    ];
    let mut documents = Vec::new();
    for base in [good(), flat(), pouring()] {
        let mut all = Vec::new();
        pointers(&base, String::new(), &mut all);
        for at in all.iter().filter(|at| !at.is_empty()) {
            for value in &values {
                let mut document = base.clone();
                *document.pointer_mut(at).unwrap() = value.clone();
                documents.push(document);
            }
            if let Some(fields) = base.pointer(at).and_then(Value::as_object) {
                for name in fields.keys() {
                    documents.push(changed(base.clone(), &[(&format!("{at}/{name}"), Value::Null)]));
                }
            }
        }
    }
    let mut lax = 0;
    for (errors, document) in ajv(&documents).iter().zip(&documents) {
        let wrong = refused(document);
        assert!(errors.is_empty() || wrong, "only the schema refuses {document}: {errors:#?}");
        lax += usize::from(errors.is_empty() && wrong);
    }
    println!("{} documents; of {lax} only the program knows that they are wrong", documents.len());
    assert!(documents.len() > 1000);
}
