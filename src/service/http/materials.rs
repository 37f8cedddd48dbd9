//! Presets of materials.

use axum::Json;
use axum::extract::Path;
use axum::extract::rejection::PathRejection;
use serde::Serialize;
use serde_json::Value;
use utoipa::ToSchema;

use super::problem::{Code, Problem};
use gridfall_scene::presets::{self, Preset};

/// The presets of materials.
#[derive(Debug, Serialize, ToSchema)]
pub struct MaterialList {
    pub materials: Vec<MaterialPreset>,
}

/// A material that people know: `{"preset": NAME}` in a scene, with values to replace beside it.
#[derive(Debug, Serialize, ToSchema)]
pub struct MaterialPreset {
    pub name: &'static str,
    pub title: &'static str,
    /// `Liquids`, `Metals`, …
    pub group: &'static str,
    pub about: &'static str,
    /// What it does not have of the real thing.
    pub limits: &'static str,
    /// As it is in a scene.
    #[schema(value_type = Object)]
    pub material: Value,
    pub values: Vec<PresetValue>,
    pub sources: Vec<PresetSource>,
}

/// A parameter of a preset, in SI units.
#[derive(Debug, Serialize, ToSchema)]
pub struct PresetValue {
    pub field: &'static str,
    /// What it means.
    pub description: &'static str,
    pub value: f64,
    /// Least that is usual.
    pub least: f64,
    /// Most that is usual.
    pub most: f64,
    /// Keys of its sources.
    pub sources: Vec<&'static str>,
    /// How it follows from the sources, where it is not simply there.
    pub note: Option<&'static str>,
    /// What the real material has, where the value is softer to make runs affordable.
    pub real: Option<f64>,
}

/// A work that values are taken from.
#[derive(Debug, Serialize, ToSchema)]
pub struct PresetSource {
    pub key: &'static str,
    /// Authors, year, title, where.
    pub text: &'static str,
    /// What of it was seen when its values were taken; empty for what was chosen for this program.
    pub checked: &'static str,
}

impl From<(&'static str, &'static Preset)> for MaterialPreset {
    fn from((group, preset): (&'static str, &'static Preset)) -> Self {
        let material = preset.material();
        let value = |quantity: &presets::Quantity| PresetValue {
            field: quantity.field,
            description: presets::page::description(&material, quantity.field),
            value: quantity.value,
            least: quantity.typical[0],
            most: quantity.typical[1],
            sources: quantity.sources.iter().map(|source| source.key).collect(),
            note: (!quantity.note.is_empty()).then_some(quantity.note),
            real: quantity.real,
        };
        let source = |source: presets::sources::Source| PresetSource {
            key: source.key,
            text: source.text,
            checked: source.checked,
        };
        Self {
            name: preset.name,
            title: preset.title,
            group,
            about: preset.about,
            limits: preset.limits,
            values: preset.values.iter().map(value).collect(),
            sources: preset.sources().into_iter().map(source).collect(),
            material: preset.document(),
        }
    }
}

/// Lists the presets of materials, with where their values are from.
#[utoipa::path(get, path = "/v1/materials", tag = "scenes", operation_id = "list_materials",
    responses((status = 200, body = MaterialList)))]
pub async fn list() -> Json<MaterialList> {
    Json(MaterialList { materials: presets::grouped().map(MaterialPreset::from).collect() })
}

/// One preset of materials.
#[utoipa::path(get, path = "/v1/materials/{name}", tag = "scenes", operation_id = "get_material",
    params(("name" = String, Path, description = "Name of the preset")),
    responses((status = 200, body = MaterialPreset)))]
pub async fn get(name: Result<Path<String>, PathRejection>) -> Result<Json<MaterialPreset>, Problem> {
    let Path(name) = name.map_err(|rejection| Problem::new(Code::InvalidPath, rejection.body_text()))?;
    let found = presets::grouped().find(|(_, preset)| preset.name == name);
    let missing = || {
        let detail = format!("there is no preset {name}; {}", presets::suggestion(&name));
        Problem::new(Code::MaterialNotFound, detail)
    };
    Ok(Json(found.ok_or_else(missing)?.into()))
}
