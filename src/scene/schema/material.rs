//! A material of a scene: a law with its parameters, and where they are from.

use std::borrow::Cow;
use std::ops::Deref;

use gridfall_core::material::parameters::Material;
use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize};
use serde_json::{Map, Value, json};

/// A material as it is run. Presets are resolved before (`presets`).
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SceneMaterial {
    #[serde(flatten)]
    pub law: Material,
    /// Name of the preset that the values began with.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub origin: Option<String>,
}

const ORIGIN: &str = "Name of the preset that the values began with, as the program writes it; nothing depends on it.";

impl Deref for SceneMaterial {
    type Target = Material;

    fn deref(&self) -> &Material {
        &self.law
    }
}

/// serde cannot refuse unknown fields of a flattened enumeration, so this takes `origin` away first.
impl<'de> Deserialize<'de> for SceneMaterial {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let mut members = Map::deserialize(deserializer)?;
        let origin = match members.remove("origin") {
            None | Some(Value::Null) => None,
            Some(Value::String(origin)) => Some(origin),
            Some(_) => return Err(D::Error::custom("`origin` is not a string")),
        };
        let law = Material::deserialize(Value::Object(members)).map_err(D::Error::custom)?;
        Ok(Self { law, origin })
    }
}

/// That of the law, with `origin` in every variant.
impl JsonSchema for SceneMaterial {
    fn schema_name() -> Cow<'static, str> {
        "Material".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let mut schema = Material::json_schema(generator);
        let variants = schema.get_mut("oneOf").and_then(Value::as_array_mut);
        for variant in variants.expect("materials are alternatives") {
            variant["properties"]["origin"] = json!({ "description": ORIGIN, "type": ["string", "null"] });
        }
        schema
    }
}

/// Where materials were written that the program made entries of `materials`: pairs of the new and
/// the old JSON pointer.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Homes(Vec<(String, String)>);

impl Homes {
    pub fn add(&mut self, new: String, old: String) {
        self.0.push((new, old));
    }

    /// The pointer in the document as it was written.
    pub fn of(&self, pointer: &str) -> String {
        let written = self.0.iter().find_map(|(new, old)| {
            let rest = pointer.strip_prefix(new.as_str())?;
            (rest.is_empty() || rest.starts_with('/')).then(|| format!("{old}{rest}"))
        });
        written.unwrap_or_else(|| pointer.to_owned())
    }
}
