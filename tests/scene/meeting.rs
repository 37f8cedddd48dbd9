//! Contact of bodies in scenes: faults, what it makes of `auto`, what it costs, and the notice where there is none.

use gridfall_core::sim::setup::{Integrator, Problem};
use gridfall_scene::estimate::estimate;
use gridfall_scene::{self as scene, Limits};
use serde_json::{Value, json};

use crate::cases::{changed, flat, good};
use crate::faults::expect;

fn problem(document: &Value) -> Problem {
    scene::problem(&scene::from_value(document).unwrap(), &Limits::default()).unwrap()
}

/// Boxes of jelly side by side in a row along x, `gap` cells apart.
fn row(count: usize, gap: f64) -> Value {
    let body = |k: usize| {
        let low = 0.0625 + k as f64 * (1.0 + gap) * 0.0625;
        json!({ "name": format!("box {k}"), "material": "jelly",
                "shape": { "box": { "min": [low, 0.25], "max": [low + 0.0625, 0.5] } } })
    };
    changed(flat(), &[("/bodies", (0..count).map(body).collect())])
}

#[test]
fn contact_has_the_form_of_a_colliders() {
    let limits = Limits::default();
    let with = |changes: &[(&str, Value)]| changed(good(), changes);
    let separate = ("/bodies/1/contact", json!("separate"));
    expect(&with(&[separate.clone(), ("/bodies/1/friction", json!(0.4))]), &limits, &[]);
    expect(&with(&[("/bodies/1/contact", json!("sticky"))]), &limits, &[]);
    expect(&with(&[("/bodies/1/contact", json!("glue"))]), &limits, &[("/bodies/1/contact", "unknown_value")]);
    let negative = [separate, ("/bodies/1/friction", json!(-0.4))];
    expect(&with(&negative), &limits, &[("/bodies/1/friction", "negative")]);
    let unused = [("/bodies/1/friction", json!(0.4))];
    expect(&with(&unused), &limits, &[("/bodies/1/friction", "friction_unused")]);
}

#[test]
fn so_many_bodies_may_have_it() {
    let mut document = row(9, 0.0);
    for k in 0..9 {
        document["bodies"][k]["contact"] = json!("separate");
    }
    expect(&document, &Limits::default(), &[("/bodies/8/contact", "too_many_contacts")]);
    document["bodies"][3]["contact"] = json!("sticky");
    expect(&document, &Limits::default(), &[]);
}

#[test]
fn it_is_explicit() {
    let mut document = row(2, 0.0);
    document["bodies"][1]["contact"] = json!("slip");
    document["solver"] = json!({ "integrator": "implicit" });
    expect(&document, &Limits::default(), &[("/solver/integrator", "unsupported")]);
    document["solver"] = json!({ "integrator": "auto" });
    let setup = problem(&document).setup;
    assert_eq!(setup.integrator, Integrator::Explicit);
    assert!(setup.integrator_reason.contains("'box 1' has contact"), "{}", setup.integrator_reason);
}

#[test]
fn blocks_of_each_field_count() {
    let mut document = row(2, 0.0);
    let together = estimate(&problem(&document));
    document["bodies"][1]["contact"] = json!("separate");
    let apart = estimate(&problem(&document));
    assert!(apart.blocks > together.blocks);
}

#[test]
fn bodies_that_will_stick_are_said() {
    let said = |document: &Value| -> Vec<(String, String)> {
        problem(document).setup.notices.into_iter().map(|n| (n.pointer, n.code)).collect()
    };
    let sticks = |n: usize| (format!("/bodies/{n}"), "bodies_stick".to_string());
    assert_eq!(said(&row(3, 0.0)), [sticks(1), sticks(2)]);
    assert_eq!(said(&row(2, 0.9)), [sticks(1)]);
    assert_eq!(said(&row(2, 1.5)), []);
    let mut document = row(2, 0.0);
    document["bodies"][1]["contact"] = json!("separate");
    assert_eq!(said(&document), []);
    // A fluid beside a solid is no joint.
    assert_eq!(said(&good()), []);
}
