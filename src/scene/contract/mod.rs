//! The scene's JSON Schema as it is published: what a scene may look like, said so that validators
//! find one error for one slip, and code generators make one class for each thing.
//!
//! It is made of the schema that is derived from the scene's types. Bounds are added that hold for
//! single values (`bounds`), and variants get names (`variants`). What values mean together is for
//! `validate` alone.

mod bounds;
mod example;
mod examples;
mod presets;
mod reference;
mod variants;

use std::collections::BTreeSet;

use serde_json::{Map, Value, json};

/// Who reads the schema.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Reader {
    /// Validators and editors: alternatives by `if` and `then`, optional values may be null.
    Validator,
    /// Generators of code: alternatives by `oneOf` and `discriminator`, optional values are left
    /// out.
    Generator,
}

pub use reference::page as reference_page;

/// Identifies the schema of this version of the format.
const ID: &str = "urn:gridfall:schema:scene:1";

/// Definitions whose names say too little outside of this schema, and better ones.
const NAMES: &[(&str, &str)] = &[
    ("Cone", "FrictionCone"),
    ("Field", "OutputField"),
    ("Method", "ImplicitMethod"),
    ("Norm", "ImplicitNorm"),
    ("Output", "SceneOutput"),
    ("Time", "SceneTime"),
];

/// The JSON Schema of scenes, pretty-printed: what `api/scene.schema.json` holds.
pub fn json_schema() -> String {
    let mut definitions = definitions(Reader::Validator);
    let mut schema = definitions.remove("Scene").expect("the root is a definition");
    schema["$schema"] = json!("https://json-schema.org/draft/2020-12/schema");
    schema["$id"] = json!(ID);
    schema["$defs"] = Value::Object(definitions);
    let text = serde_json::to_string_pretty(&schema).expect("a schema is plain data") + "\n";
    text.replace(AT, "#/$defs/")
}

/// The same as components of an OpenAPI document, by name, for generators of code.
pub fn components() -> Map<String, Value> {
    let text = Value::Object(definitions(Reader::Generator)).to_string().replace(AT, "#/components/schemas/");
    serde_json::from_str(&text).expect("it was JSON before")
}

/// Stands for the place of the definitions until it is known.
const AT: &str = "at:";

fn reference(name: &str) -> Value {
    json!({ "$ref": format!("{AT}{name}") })
}

fn definitions(reader: Reader) -> Map<String, Value> {
    let mut root = crate::structure::schema().clone();
    let mut definitions = match root["$defs"].take() {
        Value::Object(definitions) => definitions,
        _ => unreachable!("the scene's types refer to each other"),
    };
    for member in ["$defs", "$schema"] {
        root.as_object_mut().expect("a schema is an object").remove(member);
    }
    definitions.insert("Scene".into(), root);
    variants::split(&mut definitions, reader);
    let publisher = Publisher::new(reader, &definitions);
    let mut published = Map::new();
    for (name, mut definition) in definitions {
        publisher.publish(&mut definition);
        if publisher.nullable.contains(&name) {
            allow_null(&mut definition);
        }
        let name = new_name(&name);
        definition["title"] = json!(name);
        published.insert(name.to_owned(), definition);
    }
    if reader == Reader::Validator {
        bounds::add(&mut published);
        presets::add(&mut published);
        examples::add(&mut published);
        // A scene whose materials all stand in its bodies has no list of them.
        let required = published["Scene"]["required"].as_array_mut().expect("scenes have required fields");
        required.retain(|field| field != "materials");
    } else {
        presets::add_class(&mut published);
    }
    published
}

fn new_name(name: &str) -> &str {
    NAMES.iter().find(|(old, _)| *old == name).map_or(name, |(_, new)| new)
}

/// Two types in the form that strict validators take, with one error for one slip.
fn number_or_list(node: &mut Value) {
    let members = node.as_object_mut().expect("it has members");
    members.remove("type");
    let list = json!({ "type": ["array", "null"], "items": members.remove("items") });
    members.insert("if".into(), json!({ "type": "number" }));
    members.insert("then".into(), json!({ "type": "number" }));
    members.insert("else".into(), list);
}

/// Lets a definition take null; who refers to it says where that may not be.
fn allow_null(definition: &mut Value) {
    definition["type"] = json!([definition["type"], "null"]);
    if let Some(choices) = definition.get_mut("enum").and_then(Value::as_array_mut) {
        choices.push(Value::Null);
    }
}

/// The value, if this is one that may also be null.
fn or_null(node: &Value) -> Option<&Value> {
    match node["anyOf"].as_array().map(Vec::as_slice) {
        Some([value, null]) if null["type"] == "null" => Some(value),
        _ => None,
    }
}

/// The name of the definition that a node refers to, as it was derived.
fn referred(node: &Value) -> Option<&str> {
    node["$ref"].as_str().map(|path| path.rsplit(['/', ':']).next().unwrap_or_default())
}

struct Publisher {
    reader: Reader,
    /// Definitions of lists of choices, by their derived names.
    choices: BTreeSet<String>,
    /// Definitions in whose place some fields may have null; for validators only.
    nullable: BTreeSet<String>,
}

impl Publisher {
    fn new(reader: Reader, definitions: &Map<String, Value>) -> Self {
        let is_choice = |definition: &Value| {
            let mut definition = definition.clone();
            variants::merge_choices(&mut definition);
            definition["enum"].is_array()
        };
        let choices = definitions.iter().filter(|(_, definition)| is_choice(definition));
        let choices = choices.map(|(name, _)| name.clone()).collect();
        let mut publisher = Self { reader, choices, nullable: BTreeSet::new() };
        if reader == Reader::Validator {
            definitions.values().for_each(|definition| publisher.find_nullable(definition));
        }
        publisher
    }

    fn find_nullable(&mut self, node: &Value) {
        if let Some(name) = or_null(node).and_then(referred) {
            self.nullable.insert(name.to_owned());
        }
        match node {
            Value::Object(members) => members.values().for_each(|member| self.find_nullable(member)),
            Value::Array(items) => items.iter().for_each(|item| self.find_nullable(item)),
            _ => {}
        }
    }

    fn publish(&self, node: &mut Value) {
        match node {
            Value::Object(_) => self.publish_schema(node),
            Value::Array(items) => return items.iter_mut().for_each(|item| self.publish(item)),
            _ => return,
        }
        // A default or a choice is data, not a schema.
        let members = node.as_object_mut().expect("it is an object").iter_mut();
        let schemas = members.filter(|(name, _)| !matches!(name.as_str(), "default" | "const" | "enum"));
        schemas.for_each(|(_, member)| self.publish(member));
    }

    fn publish_schema(&self, node: &mut Value) {
        if let Some(text) = node["description"].as_str() {
            // Line breaks are those of the source.
            node["description"] = text.split_whitespace().collect::<Vec<_>>().join(" ").into();
        }
        self.publish_reference(node);
        variants::merge_choices(node);
        self.publish_type(node);
        self.publish_comment(node);
        let members = node.as_object_mut().expect("it is an object");
        members.retain(|name, value| !value.is_null() || name == "const");
    }

    /// Says of each reference whether null may stand there.
    fn publish_reference(&self, node: &mut Value) {
        let optional = or_null(node).cloned();
        let may_be_null = optional.is_some();
        let members = node.as_object_mut().expect("it is an object");
        if let Some(inner) = optional {
            members.remove("anyOf");
            members.extend(inner.as_object().cloned().unwrap_or_default());
        }
        let Some(name) = referred(node).map(str::to_owned) else { return };
        node["$ref"] = reference(new_name(&name))["$ref"].take();
        if !may_be_null && self.nullable.contains(&name) {
            node["type"] = if self.choices.contains(&name) { "string" } else { "object" }.into();
        }
    }

    /// Any object may have a comment.
    fn publish_comment(&self, node: &mut Value) {
        let is_object = node["additionalProperties"] == false && node["maxProperties"].is_null();
        if self.reader == Reader::Validator
            && is_object
            && let Some(properties) = node["properties"].as_object_mut()
        {
            properties.insert("$comment".into(), json!({ "type": "string", "description": "For readers; ignored." }));
        }
    }

    /// Formats that only some validators know become bounds. Generators need them: without, some
    /// make 32-bit numbers.
    fn publish_type(&self, node: &mut Value) {
        let most = match node["format"].as_str() {
            Some("uint32") => Some(u64::from(u32::MAX)),
            Some("uint64") => Some(u64::MAX),
            _ => None,
        };
        if self.reader == Reader::Validator {
            node["format"] = Value::Null;
            node["maximum"] = json!(most);
            if node["type"] == json!(["array", "number", "null"]) {
                number_or_list(node);
            }
            return;
        }
        // Of several types the first, which servers write.
        if let Some(kind) = node["type"].as_array().and_then(|kinds| kinds.first()) {
            node["type"] = kind.clone();
        }
        // Clients that send defaults would hold on to those of their day.
        node["default"] = Value::Null;
        if most.is_some() {
            node["format"] = "int64".into();
        }
    }
}
