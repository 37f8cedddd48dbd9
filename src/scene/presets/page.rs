//! The presets as a page: what `docs/PRESETS.md` is, and what the program prints
//! of one.

use gridfall_core::material::parameters::Material;
use serde_json::Value;

use super::{Preset, Quantity, grouped};
use crate::prose::filled;
use crate::structure::schema;

/// Some lines are those of lists, which are indented.
const COLUMNS: usize = 96;

const HEAD: &str = "\
# Presets

`gridfall schema materials` writes this page, from the table that the program has.
[MATERIALS](MATERIALS.md) says how to use presets and what the parameters mean. Values are in SI
units. *Usual* is the range in which such materials are found. *Really* is what the real material
has, where the value is softer so that steps are affordable.

In the pictures a block of 20 cm hits a ball that does not move. It is shown when it would have gone
30 cm. Each is thrown as fast as it takes to show what it does. The cells are of 2 cm. Jelly is torn
there, though its law knows no tearing: a body comes apart where it is stretched by so much that its
particles lose each other ([limits](guide/limits.md)).

";

const CHECKED: &str = "\
Brackets say what was seen of a work when its values were taken. Many are books that were not at
hand. Check a value at its source before something depends on it.

";

/// How fast the block of the picture is (m/s): so that ρ v² is of the order of its strength, or as in a fall.
fn thrown_m_s(preset: &Preset) -> f64 {
    match (preset.name, preset.model) {
        ("gelatine", _) => 1.0,
        ("jelly", _) => 1.5,
        ("soft-clay" | "stiff-clay", _) => 10.0,
        ("foam", _) => 15.0,
        ("cork" | "lead", _) => 50.0,
        ("concrete" | "ice", _) => 100.0,
        (_, "neo-hookean" | "stvk-hencky") => 20.0,
        (_, "von-mises") => 200.0,
        (_, "weakly-compressible-fluid") => 2.0,
        _ => 1.0,
    }
}

/// The picture of a preset, for pages of the folder that `docs/guide/pictures` is at `from`. The script that draws it
/// reads the speed there.
pub fn picture(preset: &Preset, from: &str) -> String {
    let Preset { name, .. } = preset;
    let speed = thrown_m_s(preset);
    format!("![{name} at {speed} m/s]({from}pictures/materials/{name}.png)\n*{name}, {speed} m/s*")
}

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
        text += &format!("{}\n\n", picture(preset, "guide/"));
        text += &filled(&format!("{} Model: `{}`. Left out: {}", preset.about, preset.model, preset.limits), COLUMNS);
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
    text += CHECKED;
    for source in sources {
        text += filled(&cited(&source, "**"), COLUMNS).replace('\n', "\n  ").trim_end();
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
        text += &format!("  {}\n", cited(&source, ""));
    }
    text
}

/// A work, with what was seen of it.
fn cited(source: &super::Source, strong: &str) -> String {
    let seen = if source.checked.is_empty() { String::new() } else { format!(" [{}]", source.checked) };
    format!("- {strong}{}{strong}: {}{seen}", source.key, source.text)
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
