//! Structure: types, missing and unknown fields, and unknown choices. One walk over the JSON Schema
//! finds all such faults.
//!
//! The schema is derived from the scene's types by `schemars`, so the types remain the only
//! definition. serde alone would stop at the first error. The walk also returns a repaired
//! document, in which faulty values are removed or replaced by stand-ins, so that the meaning of
//! the rest can still be judged; what depends on a faulty value is skipped.

use std::sync::LazyLock;

use serde_json::{Map, Value, json};

use crate::fault::{Fault, Faults, join};
use crate::schema::Scene;
use crate::spelling::{self, Spelling};
use crate::suggest::{closest, list, quote};

/// JSON Schema (2020-12) of a scene.
pub fn schema() -> &'static Value {
    static SCHEMA: LazyLock<Value> = LazyLock::new(|| schemars::schema_for!(Scene).to_value());
    &SCHEMA
}

/// Checks a document. Returns one with the structure of a scene: the same document if it has no
/// faults.
pub fn check(document: &Value, faults: &mut Faults) -> Value {
    check_value(schema(), document, "", faults).unwrap_or_else(|| stand_in(schema()))
}

/// Follows `$ref`.
fn resolve(mut node: &'static Value) -> &'static Value {
    while let Some(reference) = node["$ref"].as_str() {
        node = schema().pointer(reference.trim_start_matches('#')).expect("the schema has what it refers to");
    }
    node
}

/// The value, repaired; none if it is of no use.
fn check_value(node: &'static Value, value: &Value, at: &str, faults: &mut Faults) -> Option<Value> {
    let node = resolve(node);
    if let Some(choices) = choices(node) {
        return check_choice(&choices, value, at, faults);
    }
    if let Some(variants) = node["oneOf"].as_array() {
        return check_variant(variants, value, at, faults);
    }
    if let Some(options) = node["anyOf"].as_array() {
        let real: Vec<&Value> = options.iter().filter(|option| option["type"] != "null").collect();
        if let ([only], false) = (real.as_slice(), value.is_null()) {
            // An optional field.
            return check_value(only, value, at, faults);
        }
        let fitting = options.iter().find(|option| accepts(resolve(option), value));
        return match fitting {
            Some(option) => check_value(option, value, at, faults),
            None => wrong_type(&options.iter().map(describe).collect::<Vec<_>>().join(" or "), value, at, faults),
        };
    }
    if !accepts(node, value) {
        return wrong_type(&describe(node), value, at, faults);
    }
    match value {
        Value::Object(fields) => Some(Value::Object(check_fields(node, fields, at, faults))),
        Value::Array(items) => {
            let item = |(n, value)| {
                check_value(&node["items"], value, &join(at, n), faults).unwrap_or_else(|| stand_in(&node["items"]))
            };
            Some(items.iter().enumerate().map(item).collect())
        }
        // JSON has no other mark of whole numbers: 8.0 is one.
        Value::Number(number) if number.is_f64() && accepts_only_whole(node) => {
            check_value(node, &whole(value)?, at, faults)
        }
        Value::Number(number) if !in_range(node, number) => {
            let least = if node["minimum"] == 0 { "0" } else { "its least value" };
            faults.add(
                at,
                "out_of_range",
                format!("{number} does not fit"),
                format!("write a whole number from {least} up"),
            );
            None
        }
        _ => Some(value.clone()),
    }
}

fn check_fields(
    node: &'static Value,
    fields: &Map<String, Value>,
    at: &str,
    faults: &mut Faults,
) -> Map<String, Value> {
    let empty = Map::new();
    let known = node["properties"].as_object().unwrap_or(&empty);
    let others = &node["additionalProperties"];
    let mut repaired = Map::new();
    for (spelled, value) in fields {
        let pointer = join(at, spelled);
        let name = match spelling::meant(spelled, value, known) {
            Spelling::Comment => continue,
            Spelling::Name(name) => name,
            Spelling::Fault { code, reason, remedy } => {
                faults.note(Fault { pointer, code, reason, remedy });
                continue;
            }
        };
        if name != spelled && fields.contains_key(name) {
            let reason = format!("{} means `{name}`, which is given as well", quote(spelled));
            faults.note(Fault { pointer, code: "duplicate_key", reason, remedy: "keep one of the two".into() });
            continue;
        }
        if let Some(property) = node["properties"].get(name) {
            let value = check_value(property, value, &pointer, faults);
            repaired.extend(value.map(|value| (name.to_owned(), value)));
        } else if others.is_object() {
            let value = check_value(others, value, &pointer, faults).unwrap_or_else(|| stand_in(others));
            repaired.insert(name.to_owned(), value);
        } else {
            let unused: Vec<&str> = known.keys().map(String::as_str).filter(|k| !fields.contains_key(*k)).collect();
            // Presets have filled in what is beside a slip in a material.
            let every: Vec<&str> = known.keys().map(String::as_str).collect();
            let remedy = match closest(name, &unused).or_else(|| closest(name, &every)) {
                Some(near) => format!("did you mean `{near}`? Otherwise take it out"),
                None => format!("take it out; the fields here are {}", list(known.keys().map(String::as_str))),
            };
            let reason = format!("there is no field {} here", quote(name));
            faults.note(Fault { pointer, code: "unknown_field", reason, remedy });
        }
    }
    for name in node["required"].as_array().into_iter().flatten().filter_map(Value::as_str) {
        let property = &node["properties"][name];
        let is_given = fields.iter().any(|(spelled, value)| match spelling::meant(spelled, value, known) {
            Spelling::Name(meant) => meant == name,
            _ => false,
        });
        if !is_given {
            let meaning = property["description"].as_str().or(resolve(property)["description"].as_str());
            let remedy = match meaning {
                Some(meaning) => format!("add it: {}", meaning.lines().next().unwrap_or_default()),
                None => format!("add it: {}", describe(property)),
            };
            faults.add(&join(at, name), "missing_field", format!("the field `{name}` is missing"), remedy);
        }
        if !repaired.contains_key(name) {
            repaired.insert(name.to_owned(), stand_in(property));
        }
    }
    repaired
}

/// The strings that an enumeration allows; none if the node is not an enumeration.
fn choices(node: &'static Value) -> Option<Vec<&'static str>> {
    let of = |node: &'static Value| -> Option<Vec<&'static str>> {
        match (node["const"].as_str(), node["enum"].as_array()) {
            (Some(choice), _) => Some(vec![choice]),
            (_, Some(choices)) => choices.iter().map(Value::as_str).collect(),
            _ => None,
        }
    };
    match node["oneOf"].as_array() {
        Some(variants) => variants.iter().map(of).collect::<Option<Vec<_>>>().map(|choices| choices.concat()),
        None => of(node),
    }
}

fn check_choice(choices: &[&'static str], value: &Value, at: &str, faults: &mut Faults) -> Option<Value> {
    let Some(text) = value.as_str() else {
        return wrong_type(&format!("one of {}", list(choices.iter().copied())), value, at, faults);
    };
    if choices.contains(&text) {
        return Some(value.clone());
    }
    unknown_choice(text, choices, at, faults);
    None
}

fn unknown_choice(text: &str, choices: &[&str], at: &str, faults: &mut Faults) {
    let choose = format!("choose one of {}", list(choices.iter().copied()));
    let remedy = match closest(text, choices) {
        Some(near) => format!("did you mean `{near}`? Otherwise {choose}"),
        None => choose,
    };
    faults.add(at, "unknown_value", format!("{} is not known here", quote(text)), remedy);
}

/// Checks an object that is one of several variants, which differ in a field with a fixed value (a
/// tag) or in the name of their only field.
fn check_variant(variants: &'static [Value], value: &Value, at: &str, faults: &mut Faults) -> Option<Value> {
    let checked = find_variant(variants, value, at, faults);
    if checked.is_none() {
        faults.spoil(at);
    }
    checked
}

fn find_variant(variants: &'static [Value], value: &Value, at: &str, faults: &mut Faults) -> Option<Value> {
    let Some(fields) = value.as_object() else {
        return wrong_type("an object", value, at, faults);
    };
    let tag_of = |variant: &'static Value| {
        variant["properties"].as_object()?.iter().find_map(|(name, p)| Some((name.as_str(), p["const"].as_str()?)))
    };
    if let Some((tag, _)) = tag_of(&variants[0]) {
        let tags: Vec<&str> = variants.iter().filter_map(tag_of).map(|(_, value)| value).collect();
        let pointer = join(at, tag);
        let Some(given) = fields.get(tag) else {
            let remedy = format!("add it, one of {}", list(tags.iter().copied()));
            faults.add(&pointer, "missing_field", format!("the field `{tag}` is missing"), remedy);
            return None;
        };
        let given = check_choice(&tags, given, &pointer, faults)?;
        let variant = variants.iter().find(|v| tag_of(v).is_some_and(|(_, value)| given == value))?;
        return Some(Value::Object(check_fields(variant, fields, at, faults)));
    }
    let name_of = |variant: &'static Value| variant["required"][0].as_str();
    let names: Vec<&str> = variants.iter().filter_map(name_of).collect();
    let mut keys = fields.keys();
    let (Some(key), None) = (keys.next(), keys.next()) else {
        let reason = format!("has {} fields, where exactly one belongs", fields.len());
        faults.add(at, "not_one_variant", reason, format!("give exactly one of {}", list(names.iter().copied())));
        return None;
    };
    let Some(variant) = variants.iter().find(|v| name_of(v) == Some(key)) else {
        unknown_choice(key, &names, &join(at, key), faults);
        return None;
    };
    Some(Value::Object(check_fields(variant, fields, at, faults)))
}

fn wrong_type(expected: &str, value: &Value, at: &str, faults: &mut Faults) -> Option<Value> {
    let found = match value {
        Value::Null => "null".to_owned(),
        Value::Bool(v) => v.to_string(),
        Value::Number(n) => format!("the number {n}"),
        Value::String(_) => "a string".to_owned(),
        Value::Array(_) => "a list".to_owned(),
        Value::Object(_) => "an object".to_owned(),
    };
    faults.add(at, "wrong_type", format!("is {found}, where {expected} belongs"), format!("write {expected}"));
    None
}

fn type_names(node: &Value) -> Vec<&str> {
    match &node["type"] {
        Value::Array(names) => names.iter().filter_map(Value::as_str).collect(),
        name => name.as_str().into_iter().collect(),
    }
}

fn accepts(node: &Value, value: &Value) -> bool {
    type_names(node).iter().any(|name| match *name {
        "null" => value.is_null(),
        "boolean" => value.is_boolean(),
        "integer" => whole(value).is_some(),
        "number" => value.is_number(),
        "string" => value.is_string(),
        "array" => value.is_array(),
        _ => value.is_object(),
    })
}

fn accepts_only_whole(node: &Value) -> bool {
    type_names(node).contains(&"integer")
}

/// A whole number as such, however it is written.
fn whole(value: &Value) -> Option<Value> {
    /// Below 2⁵³, all whole numbers are told apart.
    const EXACT: f64 = 9007199254740992.0;
    match value.as_f64().filter(|_| value.is_f64()) {
        Some(x) => (x.fract() == 0.0 && x.abs() < EXACT).then(|| (x as i64).into()),
        None => value.is_number().then(|| value.clone()),
    }
}

fn in_range(node: &Value, number: &serde_json::Number) -> bool {
    match node["format"].as_str() {
        Some("uint32") => number.as_u64().is_some_and(|n| u32::try_from(n).is_ok()),
        Some("uint64") => number.is_u64(),
        _ => true,
    }
}

/// What a node accepts, in words.
fn describe(node: &'static Value) -> String {
    let node = resolve(node);
    if let Some(choices) = choices(node) {
        return list(choices.into_iter());
    }
    let name = type_names(node).into_iter().find(|name| *name != "null").unwrap_or("object");
    match name {
        "integer" => "a whole number".into(),
        "number" => "a number".into(),
        "string" => "a string".into(),
        "boolean" => "true or false".into(),
        "array" => match type_names(resolve(&node["items"])).first() {
            _ if type_names(node).contains(&"number") => "a number or a list of numbers".into(),
            Some(&"number") => "a list of numbers".into(),
            Some(&"array") => "a matrix, a list of rows".into(),
            _ => "a list".into(),
        },
        _ => "an object".into(),
    }
}

/// A value with the right structure but no meaning, to replace one that is at fault.
fn stand_in(node: &'static Value) -> Value {
    let node = resolve(node);
    if let Some(choices) = choices(node) {
        return choices[0].into();
    }
    if let Some(variants) = node["oneOf"].as_array().or(node["anyOf"].as_array()) {
        return stand_in(&variants[0]);
    }
    match type_names(node).first() {
        Some(&"object") => {
            let required = node["required"].as_array().into_iter().flatten().filter_map(Value::as_str);
            required.map(|name| (name.to_owned(), stand_in(&node["properties"][name]))).collect::<Map<_, _>>().into()
        }
        Some(&"array") => json!([]),
        Some(&"string") => json!(""),
        _ => json!(1),
    }
}
