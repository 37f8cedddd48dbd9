//! The presets as a page: what `docs/PRESETS.md` is, and what the program prints
//! of one.

use gridfall_core::material::parameters::Material;
use serde_json::Value;

use super::{Preset, Quantity, grouped};
use crate::structure::schema;

const HEAD: &str = "\
# Presets

`gridfall schema materials` writes this page, from the table that the program has.
[MATERIALS](MATERIALS.md) says how to use presets and what the parameters mean. Values are in SI
units. *Usual* is the range in which such materials are found. *Really* is what the real material
has, where the value is softer so that steps are affordable.

";

/// Tables of all presets in Markdown, and the list of sources.
pub fn markdown() -> String {
    let mut text = HEAD.to_owned();
    let mut sources: Vec<super::Source> = Vec::new();
    let mut group = "";
    for (of, preset) in grouped() {
        if of != group {
            group = of;
            text += &format!("## {group}\n\n");
        }
        text += &format!("### `{}`: {}\n\n", preset.name, preset.title);
        text += &wrapped(&format!("{} Model: `{}`. Left out: {}", preset.about, preset.model, preset.limits));
        text += "\n| parameter | value | usual | from |\n|---|---|---|---|\n";
        for quantity in preset.values {
            let [least, most] = quantity.typical.map(number);
            let usual = if least == most { least } else { format!("{least} to {most}") };
            let unit = unit(&preset.material(), quantity.field);
            let value = format!("{}{unit}", number(quantity.value));
            text += &format!("| `{}` | {value} | {usual} | {} |\n", quantity.field, origin(quantity));
        }
        text += "\n";
        sources.extend(preset.sources());
    }
    sources.sort_by_key(|source| source.key.to_lowercase());
    sources.dedup();
    text += "## Sources\n\n";
    for source in sources {
        text += wrapped(&format!("- **{}**: {}", source.key, source.text)).replace('\n', "\n  ").trim_end();
        text += "\n";
    }
    text
}

/// One preset as text for a terminal.
pub fn text(preset: &Preset) -> String {
    let mut text = format!("{}: {} ({})\n", preset.name, preset.title, preset.model);
    text += &format!("  {}\n  Left out: {}\n\n", preset.about, preset.limits);
    for quantity in preset.values {
        let [least, most] = quantity.typical.map(number);
        let unit = unit(&preset.material(), quantity.field);
        let value = format!("{}{unit}", number(quantity.value));
        text += &format!("  {:<24} {value:<16} usual {least} to {most}; {}\n", quantity.field, origin(quantity));
    }
    text += "\n  Sources\n";
    for source in preset.sources() {
        text += &format!("  - {}: {}\n", source.key, source.text);
    }
    text
}

/// Where a value is from.
fn origin(quantity: &Quantity) -> String {
    let keys: Vec<&str> = quantity.sources.iter().map(|source| source.key).collect();
    let mut parts = vec![keys.join(", ")];
    parts.extend((!quantity.note.is_empty()).then(|| quantity.note.to_owned()));
    parts.extend(quantity.real.map(|real| format!("**really {}**", number(real))));
    parts.join("; ")
}

/// A number as people write it.
fn number(value: f64) -> String {
    if value != 0.0 && !(1e-3..1e6).contains(&value.abs()) { format!("{value:e}") } else { value.to_string() }
}

/// The unit of a material's field, from its description, with a blank before it.
fn unit(material: &Material, field: &str) -> String {
    let description = description(material, field);
    let unit = description.split_once('(').and_then(|(_, rest)| rest.split_once(')')).map(|(unit, _)| unit);
    match unit.unwrap_or_default() {
        "degrees" => "°".into(),
        unit @ ("kg/m³" | "Pa" | "Pa·s" | "s") => format!(" {unit}"),
        _ => String::new(),
    }
}

/// What the schema says of a field of a material.
pub fn description(material: &Material, field: &str) -> &'static str {
    let model = serde_json::to_value(material).expect("a material is plain data")["model"].take();
    let variants = schema()["$defs"]["Material"]["oneOf"].as_array().expect("materials are alternatives");
    let variant = variants.iter().find(|variant| variant["properties"]["model"]["const"] == model);
    let text = variant.and_then(|variant| variant["properties"][field]["description"].as_str());
    text.map(str::trim).unwrap_or_default()
}

/// Names of the number fields of a material.
pub fn parameters(material: &Material) -> Vec<String> {
    match serde_json::to_value(material) {
        Ok(Value::Object(members)) => {
            members.into_iter().filter(|(_, value)| value.is_number()).map(|(name, _)| name).collect()
        }
        _ => Vec::new(),
    }
}

/// Lines of at most 96 columns.
fn wrapped(text: &str) -> String {
    let mut lines = vec![String::new()];
    for word in text.split_whitespace() {
        let line = lines.last_mut().expect("there is a line");
        if !line.is_empty() && line.chars().count() + 1 + word.chars().count() > 96 {
            lines.push(word.to_owned());
        } else {
            *line += &format!("{}{word}", if line.is_empty() { "" } else { " " });
        }
    }
    lines.join("\n") + "\n"
}
