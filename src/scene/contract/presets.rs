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
    material["properties"]["preset"]["description"] =
        json!("A material that people know, in the place of `model`; none by default.");
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
        definition["properties"]["preset"] = json!({
            "description": "Its name; `gridfall material` lists all, with their values.",
            "type": "string", "enum": names,
        });
        definition["properties"]["model"]["description"] = json!("That of the preset, which it is by default.");
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

/// Adds a class of presets to what materials may be, for generators of code: with its name, and what models have.
pub fn add_class(definitions: &mut Map<String, Value>) {
    let names: Vec<&str> = presets::all().map(|preset| preset.name).collect();
    // Go has one space for the values of all types.
    let constants = names.iter().map(|name| format!("PRESET_{}", name.to_uppercase().replace('-', "_")));
    let constants: Vec<String> = constants.collect();
    let name = json!({
        "title": "PresetName", "description": "A material that people know.", "type": "string", "enum": names,
        "x-enum-varnames": constants,
    });
    let mut fields = Map::from_iter([("preset".to_owned(), reference("PresetName"))]);
    for (model, _) in models() {
        let own = definitions[&format!("{}Material", pascal(model))]["properties"].as_object();
        fields.extend(own.into_iter().flatten().map(|(field, schema)| (field.clone(), schema.clone())));
    }
    fields.retain(|field, _| !matches!(field.as_str(), "model" | "origin"));
    let preset = json!({
        "title": "PresetMaterial", "type": "object", "required": ["preset"], "properties": fields,
        "description": "A material that people know. What is beside its name replaces the values of its model.",
        "additionalProperties": false,
    });
    definitions.insert("PresetName".into(), name);
    definitions.insert("PresetMaterial".into(), preset);
    let variants = definitions["Material"]["oneOf"].as_array_mut().expect("materials are alternatives");
    variants.push(reference("PresetMaterial"));
    for user in ["Body", "Source"] {
        let place = &mut definitions[user]["properties"]["material"];
        let described = place["description"].take();
        *place = reference("MaterialHere");
        place["description"] = described;
    }
    // All in one list: some generators take no alternatives within alternatives.
    let mut kinds = vec![json!({ "type": "string" })];
    kinds.extend(definitions["Material"]["oneOf"].as_array().into_iter().flatten().cloned());
    let here = json!({
        "title": "MaterialHere", "description": "Name of an entry of `materials`, or a material as it would be there.",
        "oneOf": kinds,
    });
    definitions.insert("MaterialHere".into(), here);
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

/// What the definition of a model's presets is called.
pub fn name_of(model: &str) -> String {
    format!("{}Preset", pascal(model))
}

fn pascal(kebab: &str) -> String {
    super::variants::pascal(kebab)
}
