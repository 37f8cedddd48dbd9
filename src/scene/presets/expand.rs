//! Presets, and materials that stand in bodies, become entries of `materials` with a model and all
//! its parameters. It works on the document as it was read, before anything else looks at it.

use serde_json::{Map, Value, json};

use super::inline::move_out;
use super::{find, suggestion};
use crate::fault::{Fault, Faults, join};
use crate::schema::{Homes, SceneMaterial};
use crate::spelling::{self, Spelling};
use crate::suggest::quote;

/// Makes the materials of a document whole. Returns where those were written that have moved.
pub(crate) fn expand(document: &mut Value, faults: &mut Faults) -> Homes {
    let homes = move_out(document);
    let materials = document.get_mut("materials").and_then(Value::as_object_mut);
    for (name, material) in materials.into_iter().flatten() {
        let at = join("/materials", name);
        if let Err(fault) = expand_one(material, &homes.of(&at)) {
            // It has no meaning now, and what it lacks need not be said.
            faults.spoil(&at);
            faults.note(fault);
        }
    }
    homes
}

/// The material that a preset and what is written beside it make; others are as they are.
fn expand_one(material: &mut Value, at: &str) -> Result<(), Fault> {
    let Some(fields) = material.as_object_mut() else { return Ok(()) };
    let Some(given) = fields.remove("preset") else { return Ok(()) };
    let fault =
        |field: &str, code, reason: String, remedy: String| Fault { pointer: join(at, field), code, reason, remedy };
    let Some(name) = given.as_str() else {
        let remedy = "write the name of a preset; `gridfall material` lists them";
        return Err(fault("preset", "wrong_type", "is not the name of a preset".into(), remedy.into()));
    };
    let unknown = || fault("preset", "unknown_preset", format!("there is no preset {}", quote(name)), suggestion(name));
    let preset = find(name).ok_or_else(unknown)?;
    if let Some(model) = fields.get("model").filter(|model| *model != preset.model) {
        let reason = format!("the preset `{name}` is of the model `{}`, and this says {model}", preset.model);
        let remedy = match fields.contains_key("origin") {
            true => format!("write `{{ \"preset\": \"{name}\" }}` alone: the other fields are of another preset"),
            false => "take `model` out; or take the preset out, and give all parameters of the model".to_owned(),
        };
        return Err(fault("model", "model_differs", reason, remedy));
    }
    let values = preset.members();
    let mut whole = values.clone();
    for (spelled, value) in std::mem::take(fields) {
        match spelling::meant(&spelled, &value, &values) {
            Spelling::Name(name) if !whole.contains_key(&spelled) => whole.insert(name.to_owned(), value),
            _ => whole.insert(spelled, value),
        };
    }
    whole.insert("origin".into(), json!(name));
    // Without faults it gets what the model has by default. Otherwise they are found later, in this.
    let read = serde_json::from_value::<SceneMaterial>(Value::Object(whole.clone()));
    *fields = read.map_or(whole, |material| members(&material));
    Ok(())
}

/// All fields of a material.
fn members(material: &SceneMaterial) -> Map<String, Value> {
    match serde_json::to_value(material) {
        Ok(Value::Object(members)) => members,
        _ => unreachable!("a material is an object of plain data"),
    }
}
