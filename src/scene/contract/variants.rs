//! Alternatives: each gets a name, and is told from the others by one field.

use serde_json::{Map, Value, json};

use super::{Reader, reference};

/// Gives every shape and every material a definition of its own.
pub fn split(definitions: &mut Map<String, Value>, reader: Reader) {
    let shapes = definitions.remove("Shape").expect("scenes have shapes");
    let shape = split_shapes(shapes, definitions, reader);
    definitions.insert("Shape".into(), shape);
    let materials = definitions.remove("Material").expect("scenes have materials");
    let material = split_materials(materials, definitions, reader);
    definitions.insert("Material".into(), material);
    let periodic = definitions.remove("Periodic").expect("walls may be periodic");
    let boundary = definitions["Boundary"].as_object_mut().expect("it is an alternative");
    boundary.remove("anyOf");
    let wall = reference("WallContact");
    boundary.extend(match reader {
        Reader::Validator => members(json!({ "if": { "type": "string" }, "then": periodic, "else": wall })),
        Reader::Generator => members(json!({ "oneOf": [periodic, wall] })),
    });
}

fn members(value: Value) -> Map<String, Value> {
    match value {
        Value::Object(members) => members,
        _ => unreachable!("only called with objects"),
    }
}

/// A shape is an object with one member, whose name tells what it is.
fn split_shapes(shapes: Value, definitions: &mut Map<String, Value>, reader: Reader) -> Value {
    let mut properties = Map::new();
    for variant in shapes["oneOf"].as_array().expect("shapes are alternatives") {
        let (key, inner) = variant["properties"].as_object().and_then(|p| p.iter().next()).expect("it has its name");
        let description = &variant["description"];
        if inner["type"] == "object" {
            let name = pascal(key) + "Shape";
            let mut inner = inner.clone();
            inner["description"] = description.clone();
            let mut place = reference(&name);
            if reader == Reader::Validator {
                place["description"] = description.clone();
            }
            properties.insert(key.clone(), place);
            definitions.insert(name, inner);
        } else {
            let mut inner = inner.clone();
            inner["description"] = description.clone();
            properties.insert(key.clone(), inner);
        }
    }
    json!({
        "description": shapes["description"], "type": "object",
        "properties": properties, "additionalProperties": false, "minProperties": 1, "maxProperties": 1,
    })
}

const MODEL: &str = "The law that it follows; with a preset, that of the preset by default.";

/// A material is an object whose `model` tells what else it has.
fn split_materials(materials: Value, definitions: &mut Map<String, Value>, reader: Reader) -> Value {
    let mut names = Vec::new();
    for variant in materials["oneOf"].as_array().expect("materials are alternatives") {
        let mut variant = variant.clone();
        let model = variant["properties"]["model"]["const"].as_str().expect("it has its name").to_owned();
        variant["properties"]["model"] = match reader {
            Reader::Validator => {
                json!({ "description": "The law that it follows.", "type": "string", "const": model })
            }
            // Some generators read a mark only if it has a type of its own.
            Reader::Generator => {
                let name = pascal(&model) + "Model";
                // Go has one space for the values of all types.
                let constant = format!("MODEL_{}", model.to_uppercase().replace('-', "_"));
                definitions
                    .insert(name.clone(), json!({ "type": "string", "enum": [model], "x-enum-varnames": [constant] }));
                reference(&name)
            }
        };
        let name = pascal(&model) + "Material";
        definitions.insert(name.clone(), variant);
        names.push((model, name));
    }
    let description = &materials["description"];
    if reader == Reader::Generator {
        // Presets join them, which have no model to tell them by.
        return json!({
            "description": description,
            "oneOf": names.iter().map(|(_, name)| reference(name)).collect::<Vec<_>>(),
        });
    }
    let rule = |(model, name): &(String, String)| {
        let tagged = json!({ "properties": { "model": { "const": model } }, "required": ["model"] });
        json!({ "if": tagged, "then": reference(name) })
    };
    let models: Vec<&String> = names.iter().map(|(model, _)| model).collect();
    json!({
        "description": description, "type": "object", "required": ["model"],
        "properties": { "model": { "description": MODEL, "type": "string", "enum": models } },
        "allOf": names.iter().map(rule).collect::<Vec<_>>(),
    })
}

/// A list of choices with a description each becomes one enumeration, which has one error.
pub fn merge_choices(node: &mut Value) {
    let Some(variants) = node["oneOf"].as_array() else { return };
    let choices: Option<Vec<(Vec<Value>, String)>> = variants.iter().map(choice).collect();
    let Some(choices) = choices else { return };
    let mut text: Vec<String> = node["description"].as_str().map(str::to_owned).into_iter().collect();
    text.extend(choices.iter().filter(|(_, about)| !about.is_empty()).map(|(values, about)| {
        let values: Vec<String> = values.iter().filter_map(Value::as_str).map(|value| format!("`{value}`")).collect();
        format!("- {}: {about}", values.join(", "))
    }));
    let values: Vec<Value> = choices.into_iter().flat_map(|(values, _)| values).collect();
    let merged = node.as_object_mut().expect("it has members");
    merged.remove("oneOf");
    merged.insert("type".into(), "string".into());
    merged.insert("enum".into(), values.into());
    if !text.is_empty() {
        merged.insert("description".into(), text.join("\n").into());
    }
}

/// The values of one choice and what they mean.
fn choice(variant: &Value) -> Option<(Vec<Value>, String)> {
    let values = match (variant["const"].as_str(), variant["enum"].as_array()) {
        (Some(value), _) => vec![value.into()],
        (_, Some(values)) => values.clone(),
        _ => return None,
    };
    let about = variant["description"].as_str().unwrap_or_default();
    Some((values, about.split_whitespace().collect::<Vec<_>>().join(" ")))
}

pub fn pascal(kebab: &str) -> String {
    let capital = |word: &str| word[..1].to_uppercase() + &word[1..];
    kebab.split('-').map(capital).collect()
}
