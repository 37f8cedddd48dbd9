//! What editors show beside descriptions: a title and an example of every field, and defaults that
//! the program's types do not tell.

use serde_json::{Map, Value, json};

use crate::presets;

/// Examples of what stands in the place of a definition. A field has the value of the first one that has it; those
/// under `NAME+` are for fields alone.
const EXAMPLES: &str = include_str!("examples.json");

/// Values of fields that are left out. Where these depend on other fields, the description says it.
const DEFAULTS: &[(&str, &str)] = &[
    ("Body.friction", "0"),
    ("Body.grips", "[]"),
    ("Collider.from", "0"),
    ("Domain.fit", "\"grow\""),
    ("Grip.from", "0"),
    ("Motion.axis", "[0, 0, 1]"),
    ("Scene.sources", "[]"),
    ("SceneOutput.state", "false"),
    ("Source.from", "0"),
];

/// Titles that are not simply the field's name.
const TITLES: &[(&str, &str)] = &[
    ("$schema", "JSON Schema"),
    ("J", "Volume ratio J"),
    ("M", "Slope M of the critical state line"),
    ("alpha0", "State α₀ at the start"),
    ("beta", "Cohesion β"),
    ("cfl", "CFL number"),
    ("dx", "Size of a cell"),
    ("gamma", "Exponent γ"),
    ("gridfall", "Version of the format"),
    ("max_dt", "Longest step"),
    ("poissons_ratio", "Poisson's ratio"),
    ("xi", "Hardening ξ"),
    ("youngs_modulus", "Young's modulus"),
];

/// Adds them to the published definitions.
pub fn add(definitions: &mut Map<String, Value>) {
    for (at, value) in DEFAULTS {
        let (name, field) = at.split_once('.').expect("a place is a definition and a field");
        let node = definitions[name]["properties"].get_mut(field).unwrap_or_else(|| panic!("the schema has no {at}"));
        node["default"] = serde_json::from_str(value).expect("defaults are JSON");
    }
    let examples = all();
    for (name, definition) in definitions.iter_mut() {
        let listed = |name: &str| examples.get(name).and_then(Value::as_array).cloned().unwrap_or_default();
        let (whole, parts) = (listed(name), listed(&format!("{name}+")));
        let fields = definition.get_mut("properties").and_then(Value::as_object_mut);
        for (field, node) in fields.into_iter().flatten() {
            node["title"] = json!(title(field));
            let shown = whole.iter().chain(&parts).find_map(|example| example.get(field)).cloned();
            if let Some(example) = shown.or((field == "origin").then(|| json!("dry-sand"))) {
                node["examples"] = json!([example]);
            }
        }
        if !whole.is_empty() {
            definition["examples"] = Value::Array(whole);
        }
    }
}

/// By definition; those of presets follow from the presets.
fn all() -> Map<String, Value> {
    let mut examples: Map<String, Value> = serde_json::from_str(EXAMPLES).expect("examples are JSON");
    for preset in presets::all() {
        let mut whole = preset.document();
        whole["preset"] = json!(preset.name);
        let alone = json!({ "preset": preset.name });
        examples.entry(super::presets::name_of(preset.model)).or_insert(json!([alone, whole]));
    }
    examples
}

fn title(field: &str) -> String {
    if let Some((_, title)) = TITLES.iter().find(|(name, _)| *name == field) {
        return (*title).to_owned();
    }
    let words = field.trim_start_matches('$').replace(['_', '-'], " ");
    words[..1].to_uppercase() + &words[1..]
}
