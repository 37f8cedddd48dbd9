//! Presets: materials that people know, with what their values are from.
//!
//! `{ "preset": "dry-sand", "friction_angle_degrees": 40 }` in a document becomes the whole material
//! when the document is read (`expand`): the preset's model and values, then what is written beside
//! it. `origin` names the preset after that. So what is stored and run has numbers, and changes of
//! this table change nothing that was accepted before.

mod brittle;
mod elastic;
mod expand;
mod inline;
mod liquids;
mod metals;
pub mod page;
mod snow;
mod soils;
pub mod sources;

use gridfall_core::material::parameters::Material;
use gridfall_core::sim::notice::Notice;
use serde_json::{Map, Value, json};

use crate::fault::join;
use crate::schema::Scene;
use crate::suggest::{closest, list, quote};
pub(crate) use expand::expand;

use sources::Source;

/// A material that people know.
#[derive(Debug)]
pub struct Preset {
    pub name: &'static str,
    pub title: &'static str,
    /// As the `model` of a scene's material.
    pub model: &'static str,
    pub about: &'static str,
    /// What it does not have of the real thing.
    pub limits: &'static str,
    pub values: &'static [Quantity],
}

/// A parameter of a preset, in SI units.
#[derive(Debug)]
pub struct Quantity {
    pub field: &'static str,
    pub value: f64,
    /// Least and most that is usual.
    pub typical: [f64; 2],
    pub sources: &'static [Source],
    /// How the value follows from the sources, where it is not simply there.
    pub note: &'static str,
    /// What the real material has, where the value is softer to make runs affordable.
    pub real: Option<f64>,
}

/// A parameter with its value, what is usual, and where it is from.
const fn q(field: &'static str, value: f64, typical: [f64; 2], sources: &'static [Source]) -> Quantity {
    Quantity { field, value, typical, sources, note: "", real: None }
}

impl Quantity {
    const fn note(self, note: &'static str) -> Self {
        Self { note, ..self }
    }

    const fn real(self, real: f64) -> Self {
        Self { real: Some(real), ..self }
    }
}

const GROUPS: [(&str, &[Preset]); 6] = [
    ("Liquids", liquids::PRESETS),
    ("Rubbers, gels and foams", elastic::PRESETS),
    ("Metals", metals::PRESETS),
    ("Soils", soils::PRESETS),
    ("Snow", snow::PRESETS),
    ("Brittle solids", brittle::PRESETS),
];

/// All presets, with the name of their group.
pub fn grouped() -> impl Iterator<Item = (&'static str, &'static Preset)> {
    GROUPS.iter().flat_map(|(group, presets)| presets.iter().map(|preset| (*group, preset)))
}

/// All presets.
pub fn all() -> impl Iterator<Item = &'static Preset> {
    grouped().map(|(_, preset)| preset)
}

/// The preset of a name.
pub fn find(name: &str) -> Option<&'static Preset> {
    all().find(|preset| preset.name == name)
}

/// What to write instead of an unknown name.
pub fn suggestion(name: &str) -> String {
    let names: Vec<&str> = all().map(|preset| preset.name).collect();
    let known = format!("the presets are {}", list(names.iter().copied()));
    match closest(name, &names) {
        Some(near) => format!("did you mean `{near}`? Otherwise {known}"),
        None => known,
    }
}

/// All presets with their materials, values and sources.
pub fn json() -> Value {
    let value = |quantity: &Quantity| {
        let sources: Vec<&str> = quantity.sources.iter().map(|source| source.key).collect();
        json!({ "field": quantity.field, "value": quantity.value, "usual": quantity.typical, "sources": sources,
            "note": quantity.note, "real": quantity.real })
    };
    let preset = |(group, preset): (&str, &Preset)| {
        let values: Vec<Value> = preset.values.iter().map(value).collect();
        let sources: Map<String, Value> =
            preset.sources().iter().map(|source| (source.key.to_owned(), json!(source.text))).collect();
        json!({ "name": preset.name, "title": preset.title, "group": group, "about": preset.about,
            "limits": preset.limits, "material": preset.document(), "values": values, "sources": sources })
    };
    grouped().map(preset).collect()
}

impl Preset {
    /// The members of its material, `model` first.
    fn members(&self) -> Map<String, Value> {
        let mut members = Map::from_iter([("model".to_owned(), json!(self.model))]);
        members.extend(self.values.iter().map(|quantity| (quantity.field.to_owned(), json!(quantity.value))));
        members
    }

    /// Its material as JSON, with what its model has by default.
    pub fn document(&self) -> Value {
        serde_json::to_value(self.material()).expect("a material is plain data")
    }

    /// Its material.
    pub fn material(&self) -> Material {
        serde_json::from_value(Value::Object(self.members())).expect("a preset is a material")
    }

    /// Its sources, each once.
    pub fn sources(&self) -> Vec<Source> {
        let mut found: Vec<Source> = Vec::new();
        for source in self.values.iter().flat_map(|quantity| quantity.sources) {
            if !found.contains(source) {
                found.push(*source);
            }
        }
        found
    }
}

/// Says of each material that is softer than the real one, as its preset has it, by how much.
pub(crate) fn notices(scene: &Scene) -> Vec<Notice> {
    let mut notices = Vec::new();
    for (name, material) in &scene.materials {
        let Some(preset) = material.origin.as_deref().and_then(find) else { continue };
        let members = serde_json::to_value(&material.law).expect("a material is plain data");
        for quantity in preset.values {
            let (Some(real), true) = (quantity.real, members[quantity.field] == json!(quantity.value)) else {
                continue;
            };
            let sound = (quantity.value / material.density()).sqrt();
            notices.push(Notice {
                pointer: join(&join("/materials", name), quantity.field),
                code: "softened_material".into(),
                reason: format!(
                    "{} has {:e} Pa where the real one has {real:e} Pa, so that steps are affordable: sound goes at \
                     {sound:.0} m/s in it, and density is right within 1 % up to flows of {:.1} m/s",
                    quote(preset.name),
                    quantity.value,
                    sound / 10.0
                ),
                remedy: format!(
                    "for faster flows, or columns above {:.1} m, write `{}`: 100 times the density times the square \
                     of the largest speed",
                    sound * sound / 100.0 / (2.0 * 9.81),
                    quantity.field
                ),
            });
        }
    }
    notices
}

#[cfg(test)]
mod tests;
