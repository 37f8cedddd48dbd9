//! Materials that are written in a body or a source instead of a name.

use serde_json::{Map, Value};

use crate::fault::join;
use crate::schema::Homes;

/// Moves materials from bodies and sources into `materials`, under the name of the body.
pub(super) fn move_out(document: &mut Value) -> Homes {
    let mut homes = Homes::default();
    let Some(scene) = document.as_object_mut() else { return homes };
    let had = scene.contains_key("materials");
    let mut materials = match scene.remove("materials") {
        None => Map::new(),
        Some(Value::Object(materials)) => materials,
        Some(other) => {
            scene.insert("materials".into(), other);
            return homes;
        }
    };
    let mut moved = false;
    for list in ["bodies", "sources"] {
        let users = scene.get_mut(list).and_then(Value::as_array_mut);
        for (n, user) in users.into_iter().flatten().enumerate() {
            let own = user["name"].as_str().filter(|name| !name.trim().is_empty());
            let base = own.map_or_else(|| format!("{list}-{n}"), str::to_owned);
            let Some(place) = user.get_mut("material").filter(|place| place.is_object()) else { continue };
            let name = free(&base, &materials);
            homes.add(join("/materials", &name), format!("/{list}/{n}/material"));
            moved = true;
            materials.insert(name.clone(), place.take());
            *place = Value::String(name);
        }
    }
    // A scene that lacks materials is at fault, and stays so.
    if had || moved {
        scene.insert("materials".into(), Value::Object(materials));
    }
    homes
}

/// A name that no material has yet.
fn free(base: &str, taken: &Map<String, Value>) -> String {
    let numbered = (2..).map(|n| format!("{base}-{n}"));
    std::iter::once(base.to_owned()).chain(numbered).find(|name| !taken.contains_key(name)).expect("numbers do not end")
}
