//! The reference of scenes as a page of Markdown, made of the published schema.

use std::fmt::Write;

use serde_json::{Map, Value};

use super::{AT, Reader, definitions, example};
use crate::presets;
use crate::prose::paragraph;

/// The parts in the order of reading, and their headings.
const PARTS: &[(&str, &str)] = &[
    ("Scene", "The document"),
    ("Domain", "Domain"),
    ("WallContact", "Walls"),
    ("SceneTime", "Time"),
    ("Body", "Bodies"),
    ("Points", "Points from files"),
    ("Source", "Sources"),
    ("Collider", "Colliders"),
    ("Grip", "Grips"),
    ("Motion", "Motion"),
    ("Keyframe", "Keyframes"),
    ("Solver", "Solver"),
    ("Implicit", "Implicit steps"),
    ("SceneOutput", "Output"),
    ("StartState", "Start from another run"),
];

const HEAD: &str = "# Scene

Made by `gridfall schema reference`. Every field, with its type, default and meaning, in SI units.
Fields without a default may be left out, unless they must be given. A *vector* has as many numbers
as the scene has dimensions.

Any object may have a `$comment`, a text for readers. Names may be written as physics-USD does, such
as `youngsModulus` or `physics:density`.
";

const PICTURES: &str = "The pictures show a block of 20 cm that has hit a ball, at the speed given below. Those of \
                        models with presets show one of these.";

/// The page.
pub fn page() -> String {
    let definitions = definitions(Reader::Validator);
    let page = Page { definitions: &definitions };
    let mut text = HEAD.to_owned();
    for (name, heading) in PARTS {
        text += &page.part(name, heading, 2);
    }
    text += "\n## Materials\n";
    text += &paragraph(
        "`materials` has a name for each. `model` says which law it follows. With `preset` in its place a material \
         begins with the values of one that people know ([presets](../PRESETS.md)), and what stands beside replaces \
         them. [Materials](../MATERIALS.md) says which one to take.",
    );
    text += &paragraph(PICTURES);
    for (model, name) in page.materials() {
        text += &page.part(&name, &model, 3);
        text += &page.shown(&name, "material", None);
        let preset = presets::all().find(|preset| preset.model == model);
        let speed = if model == "nacc" { 5 } else { 1 };
        let own = || format!("![{model} at {speed} m/s](pictures/materials/{model}.png)\n*{model}, {speed} m/s*");
        let _ = writeln!(text, "\n{}", preset.map_or_else(own, |preset| presets::page::picture(preset, "")));
    }
    text += "\n## Shapes\n";
    let example = "`{\"sphere\": {\"center\": [0, 0, 1], \"radius\": 0.2}}`";
    let about = page.described("Shape");
    text +=
        &paragraph(&format!("{about} A shape is an object with one member, whose name says what it is: {example}."));
    let shapes = definitions["Shape"]["properties"].as_object().expect("shapes have names");
    for (shape, schema) in shapes {
        match referred(schema) {
            Some(name) => text += &page.part(name, shape, 3),
            None => {
                let about = [schema["description"].as_str().unwrap_or_default(), "A list of shapes."];
                let _ = write!(text, "\n### {shape}\n{}", paragraph(about.join(" ").trim()));
            }
        }
        let name = referred(schema).unwrap_or(shape);
        text += &page.shown(name, "shape", Some((shape, schema)));
        let _ = writeln!(text, "\n![{shape}](pictures/shapes/{shape}.png)");
    }
    text
}

struct Page<'a> {
    definitions: &'a Map<String, Value>,
}

impl Page<'_> {
    fn described(&self, name: &str) -> &str {
        self.definitions[name]["description"].as_str().unwrap_or_default()
    }

    fn materials(&self) -> Vec<(String, String)> {
        let rules = self.definitions["Material"]["else"]["allOf"].as_array().expect("materials have models");
        let of = |rule: &Value| {
            let model = rule["if"]["properties"]["model"]["const"].as_str()?.to_owned();
            Some((model, referred(&rule["then"])?.to_owned()))
        };
        rules.iter().filter_map(of).collect()
    }

    /// A heading, what is described, and a table of the fields: those that must be given first.
    fn part(&self, name: &str, heading: &str, level: usize) -> String {
        let definition = &self.definitions[name];
        let mut text = format!("\n{} {heading}\n", "#".repeat(level));
        if let Some(about) = definition["description"].as_str() {
            text += &paragraph(about);
        }
        let fields = definition["properties"].as_object().expect("parts have fields");
        let required =
            |field: &str| definition["required"].as_array().is_some_and(|all| all.iter().any(|f| f == field));
        let mut fields: Vec<_> = fields
            .iter()
            .filter(|(field, _)| !matches!(field.as_str(), "$comment" | "$schema" | "model" | "origin"))
            .collect();
        fields.sort_by_key(|(field, _)| !required(field));
        if fields.is_empty() {
            return text;
        }
        text += "\n| field | type | default | meaning |\n|---|---|---|---|\n";
        for (field, schema) in fields {
            let default = match (&schema["default"], required(field)) {
                (_, true) => "must be given".into(),
                (Value::Null | Value::Object(_), _) => String::new(),
                (value, _) => format!("`{}`", value.to_string().trim_matches('"')),
            };
            let meaning = self.meaning(schema).replace('|', "\\|");
            let _ = writeln!(text, "| `{field}` | {} | {default} | {meaning} |", self.kind(schema));
        }
        text
    }

    /// The example of a definition, or of a member of shapes.
    fn shown(&self, name: &str, mark: &str, shape: Option<(&str, &Value)>) -> String {
        let definition = self.definitions.get(name).or(shape.map(|(_, schema)| schema));
        let first = definition.map(|definition| &definition["examples"][0]).filter(|example| !example.is_null());
        let first = first.unwrap_or_else(|| panic!("{name} has no example")).clone();
        let whole = match shape {
            Some((shape, _)) => Value::Object(Map::from_iter([(shape.to_owned(), first)])),
            None => first,
        };
        format!("\n```json {mark}\n{}\n```\n", example::text(&whole))
    }

    /// The type of a value, with its bounds.
    fn kind(&self, schema: &Value) -> String {
        if let Some(name) = referred(schema) {
            return self.named(name);
        }
        if schema["if"].is_object() {
            return format!("{} or {}", self.kind(&schema["then"]), self.kind(&schema["else"]));
        }
        if schema["const"].is_number() {
            return format!("`{}`", schema["const"]);
        }
        let kind = schema["type"].as_str().or_else(|| schema["type"][0].as_str()).unwrap_or("object");
        match kind {
            "number" => format!("number{}", bounds(schema)),
            "integer" => format!("whole number{}", bounds(schema)),
            "boolean" => "true or false".into(),
            "string" => "text".into(),
            "array" => match (referred(&schema["items"]), schema["items"]["type"].as_str()) {
                (_, Some("array")) => "matrix".into(),
                (Some("Number" | "Place" | "Speed" | "Acceleration"), _) => "vector".into(),
                (Some(name), _) => format!("list of {}", self.named(name)),
                _ => "list".into(),
            },
            _ => match referred(&schema["additionalProperties"]) {
                Some(name) => format!("by name: {}", self.named(name)),
                None => "object".into(),
            },
        }
    }

    fn named(&self, name: &str) -> String {
        match name {
            "Shape" => return "[shape](#shapes)".into(),
            "Material" => return "[material](#materials)".into(),
            "Boundary" => return "`periodic` or [contact](#walls)".into(),
            "Number" => return "number".into(),
            _ => {}
        }
        if let Some((_, heading)) = PARTS.iter().find(|(part, _)| *part == name) {
            let anchor = heading.to_lowercase().replace(' ', "-");
            return format!("[{}](#{anchor})", heading.to_lowercase());
        }
        let choices = self.definitions[name]["enum"].as_array();
        let choices: Vec<String> = choices.into_iter().flatten().filter_map(Value::as_str).map(code).collect();
        if choices.is_empty() { name.to_owned() } else { choices.join(", ") }
    }

    /// What a field says of itself, and what its choices mean.
    fn meaning(&self, schema: &Value) -> String {
        let own = schema["description"].as_str().unwrap_or_default();
        let name = referred(schema).or_else(|| referred(&schema["items"]));
        let choices = name.filter(|name| self.definitions[*name]["enum"].is_array());
        match choices.map(|name| self.described(name)).filter(|about| !about.is_empty()) {
            Some(about) => {
                // The first line may say the same as the field.
                let lines = about.split('\n').map(|line| line.trim_start_matches("- ").trim());
                let lines = lines.filter(|line| !own.contains(line.trim_end_matches('.')));
                [own].into_iter().chain(lines).filter(|line| !line.is_empty()).collect::<Vec<_>>().join("<br>")
            }
            None => own.to_owned(),
        }
    }
}

fn code(word: &str) -> String {
    format!("`{word}`")
}

fn referred(schema: &Value) -> Option<&str> {
    schema["$ref"].as_str()?.strip_prefix(AT)
}

/// Bounds that tell something: not those that only keep numbers plausible.
fn bounds(schema: &Value) -> String {
    let plain = |key: &str| schema[key].as_f64().filter(|bound| *bound == 0.0 || (1e-6..1e6).contains(&bound.abs()));
    let lower = plain("minimum").map(|least| format!(" ≥ {least}"));
    let lower = lower.or(plain("exclusiveMinimum").map(|least| format!(" > {least}")));
    let positive = (schema["minimum"].as_f64().is_some_and(|least| least > 0.0)).then(|| " > 0".to_owned());
    let upper = plain("maximum").map(|most| format!(" ≤ {most}"));
    let upper = upper.or(plain("exclusiveMaximum").map(|most| format!(" < {most}")));
    [lower.or(positive), upper].into_iter().flatten().collect::<Vec<_>>().join(",")
}
