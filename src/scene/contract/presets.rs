//! Presets in the published schema: a material may be one, with any of its model's parameters beside
//! it, and may stand in a body.

use serde_json::{Map, Value, json};

use super::reference;
use crate::presets::{self, Preset};

/// Adds them to the definitions, which have their bounds already.
pub fn add(definitions: &mut Map<String, Value>) {
    let names: Vec<&str> = presets::all().map(|preset| preset.name).collect();
    let about = |preset: &Preset| format!("- `{}`: {}", preset.name, preset.about);
    let lines: Vec<String> = presets::all().map(about).collect();
    let described = format!(
        "A material that people know; `gridfall material` says where its values are from.\n{}",
        lines.join("\n")
    );
    definitions.insert(
        "PresetName".into(),
        json!({ "title": "PresetName", "description": described, "type": "string", "enum": names }),
    );
    let material = definitions.get_mut("Material").and_then(Value::as_object_mut).expect("scenes have materials");
    let by_model = material.remove("allOf").expect("materials are told by their models");
    material.remove("required");
    material["properties"]["preset"] = reference("PresetName");
    let models = models();
    let rules: Vec<Value> = models.iter().map(|(model, names)| rule(model, names)).collect();
    material.insert("if".into(), json!({ "properties": { "preset": {} }, "required": ["preset"] }));
    material.insert("then".into(), json!({ "allOf": rules }));
    material.insert("else".into(), json!({ "properties": { "model": {} }, "required": ["model"], "allOf": by_model }));
    for (model, names) in models {
        let whole = format!("{}Material", pascal(model));
        let mut definition = definitions[&whole].clone();
        definition["title"] = json!(name_of(model));
        definition["required"] = json!(["preset"]);
        definition["description"] =
            json!(format!("A preset of the model `{model}`; what is beside it replaces its values."));
        definition["properties"]["preset"] = json!({ "type": "string", "enum": names });
        let fields = definition["properties"].as_object_mut().expect("materials have fields");
        for (_, field) in fields.iter_mut() {
            // Its value is the preset's.
            field.as_object_mut().expect("a field has a schema").remove("default");
        }
        definitions.insert(name_of(model), definition);
    }
    for user in ["Body", "Source"] {
        let place = &mut definitions[user]["properties"]["material"];
        let described = place["description"].take();
        *place = json!({
            "description": described,
            "if": { "type": "object" }, "then": reference("Material"), "else": { "type": "string" },
        });
    }
}

/// Models of presets, with the names of these.
fn models() -> Vec<(&'static str, Vec<&'static str>)> {
    let mut models: Vec<(&str, Vec<&str>)> = Vec::new();
    for preset in presets::all() {
        match models.iter_mut().find(|(model, _)| *model == preset.model) {
            Some((_, names)) => names.push(preset.name),
            None => models.push((preset.model, vec![preset.name])),
        }
    }
    models
}

fn rule(model: &str, names: &[&str]) -> Value {
    let tagged = json!({ "properties": { "preset": { "enum": names } }, "required": ["preset"] });
    json!({ "if": tagged, "then": reference(&name_of(model)) })
}

fn name_of(model: &str) -> String {
    format!("{}Preset", pascal(model))
}

fn pascal(kebab: &str) -> String {
    super::variants::pascal(kebab)
}
