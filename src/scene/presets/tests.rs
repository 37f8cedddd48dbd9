//! Tests of the table of presets, and of what documents become.

use serde_json::json;

use super::*;
use crate::fault::Faults;
use crate::{Limits, check, from_value, from_value_with, problem};

/// A scene of a block.
fn scene(materials: Value, material: Value) -> Value {
    json!({
        "gridfall": 1, "name": "block", "domain": { "min": [0, 0, 0], "max": [1, 1, 1], "dx": 0.125 },
        "materials": materials,
        "bodies": [ { "name": "block", "material": material,
                      "shape": { "box": { "min": [0, 0, 0], "max": [0.5, 0.5, 0.5] } } } ],
        "time": { "end": 0.5, "frame_rate": 24 },
    })
}

fn codes(document: &Value) -> Vec<(String, &'static str)> {
    let judged = from_value(document).and_then(|scene| check(&scene, &Limits::default()));
    judged.err().unwrap_or_default().into_iter().map(|fault| (fault.pointer, fault.code)).collect()
}

#[test]
fn every_preset_is_a_valid_material_with_sources() {
    assert!(all().count() >= 24);
    for preset in all() {
        assert_eq!(all().filter(|other| other.name == preset.name).count(), 1, "{}", preset.name);
        let scene = scene(json!({}), json!({ "preset": preset.name }));
        assert!(codes(&scene).is_empty(), "{}: {:?}", preset.name, codes(&scene));
        let material = serde_json::to_value(preset.material()).unwrap();
        for quantity in preset.values {
            let [least, most] = quantity.typical;
            let at = format!("{} {}", preset.name, quantity.field);
            assert!((least..=most).contains(&quantity.value), "{at} is not usual");
            assert!(!quantity.sources.is_empty(), "{at} is from nowhere");
            let own = quantity.sources.iter().all(|source| *source == sources::HERE);
            assert!(!own || !quantity.note.is_empty(), "{at} says neither a source nor a reason");
            assert_eq!(material[quantity.field], json!(quantity.value), "{at}");
            assert!(!page::description(&preset.material(), quantity.field).is_empty(), "{at} has no description");
        }
        // All parameters that have no default, and those of strength.
        for field in page::parameters(&preset.material()) {
            let known = preset.values.iter().any(|quantity| quantity.field == field);
            assert!(known || field == "damping", "{} lacks {field}", preset.name);
        }
    }
}

#[test]
fn a_preset_becomes_a_whole_material() {
    let mut document = scene(json!({ "sand": { "preset": "dry-sand", "friction_angle_degrees": 40 } }), json!("sand"));
    let overrides = ["materials.sand.density=1500", "bodies.0.material.cohesion=10"].map(str::to_owned);
    let read = from_value_with(&mut document, &overrides).unwrap();
    let whole = json!({
        "model": "mohr-coulomb", "origin": "dry-sand", "density": 1500.0, "youngs_modulus": 15e6,
        "poissons_ratio": 0.3, "friction_angle_degrees": 40.0, "cohesion": 10.0, "dilatancy_angle_degrees": 0.0,
    });
    assert_eq!(document["materials"]["sand"], whole, "what is stored has all numbers");
    assert_eq!(serde_json::to_value(&read).unwrap()["materials"]["sand"], whole);
    // Read again it is the same, without the table.
    assert_eq!(from_value(&document).unwrap(), read);
    let defaults = from_value(&scene(json!({ "m": { "preset": "steel" } }), json!("m"))).unwrap().to_json();
    assert!(defaults.contains("\"elasticity\": \"hencky\"") && defaults.contains("\"damping\": 0.0"), "{defaults}");
}

#[test]
fn a_material_may_stand_in_a_body() {
    let inline = scene(json!({ "block": { "preset": "ice" } }), json!({ "preset": "jelly", "density": 1200 }));
    let read = from_value(&inline).unwrap();
    assert_eq!(read.bodies[0].material, "block-2", "a name that is taken gets a number");
    assert_eq!(read.materials["block-2"].density(), 1200.0);
    let mut alone = scene(
        json!({}),
        json!({ "model": "neo-hookean", "density": 1, "youngs_modulus": 1e3,
        "poissons_ratio": 0.3 }),
    );
    alone.as_object_mut().unwrap().remove("materials");
    assert!(codes(&alone).is_empty(), "{:?}", codes(&alone));
    let mut swept = alone.clone();
    from_value_with(&mut swept, &["bodies.0.material.density=2".to_owned()]).unwrap();
    assert_eq!(swept["materials"]["block"]["density"], json!(2));
    // Of what was stored, too.
    from_value_with(&mut swept, &["bodies.0.material.density=3".to_owned()]).unwrap();
    assert_eq!(swept["materials"]["block"]["density"], json!(3));
}

#[test]
fn faults_have_the_places_that_were_written() {
    let cases = [
        (json!({ "preset": "dry_snad" }), vec![("/preset", "unknown_preset")]),
        (json!({ "preset": 7 }), vec![("/preset", "wrong_type")]),
        (json!({ "preset": "water", "model": "snow" }), vec![("/model", "model_differs")]),
        (json!({ "preset": "water", "model": "weakly-compressible-fluid" }), vec![]),
        (
            json!({ "preset": "water", "friction_angle_degrees": 30 }),
            vec![("/friction_angle_degrees", "unknown_field")],
        ),
        (json!({ "preset": "water", "density": -1 }), vec![("/density", "not_positive")]),
        (json!({ "preset": "water", "density": "heavy" }), vec![("/density", "wrong_type")]),
        (
            json!({ "preset": "dense-sand", "friction_angle_degrees": 5 }),
            vec![("/dilatancy_angle_degrees", "out_of_range")],
        ),
        (json!({}), vec![("/model", "missing_field")]),
    ];
    for (material, expected) in cases {
        for (document, at) in [
            (scene(json!({ "m": material.clone() }), json!("m")), "/materials/m"),
            (scene(json!({}), material.clone()), "/bodies/0/material"),
        ] {
            let expected: Vec<_> = expected.iter().map(|(field, code)| (format!("{at}{field}"), *code)).collect();
            assert_eq!(codes(&document), expected, "{material}");
        }
    }
    let mut faults = Faults::default();
    let mut document = scene(json!({ "m": { "preset": "watr" } }), json!("m"));
    expand(&mut document, &mut faults);
    assert!(faults.into_vec()[0].remedy.contains("did you mean `water`?"));
}

#[test]
fn softened_liquids_are_said() {
    let notices = |material: Value| {
        let problem = problem(&from_value(&scene(json!({}), material)).unwrap(), &Limits::default()).unwrap();
        problem.setup.notices.into_iter().map(|notice| (notice.pointer, notice.code)).collect::<Vec<_>>()
    };
    let said = vec![("/bodies/0/material/bulk_modulus".to_owned(), "softened_material".to_owned())];
    assert_eq!(notices(json!({ "preset": "water" })), said);
    assert_eq!(notices(json!({ "preset": "water", "bulk_modulus": 4e6 })), vec![]);
    assert_eq!(notices(json!({ "preset": "dry-sand" })), vec![]);
}
