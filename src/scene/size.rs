//! How large a document may be. It is looked at before anything is made of it, because a small
//! document can ask for much.

use serde_json::Value;

use crate::fault::{Faults, join};

/// Most entries of the lists at the top of a document.
const LISTS: [(&str, usize); 4] = [("bodies", 10_000), ("colliders", 1_000), ("sources", 1_000), ("materials", 1_000)];
/// Most shapes in a union, an intersection or a difference, and grips of a body.
const MAX_OBJECTS_IN_LIST: usize = 4096;
/// Most objects in a document.
const MAX_OBJECTS: usize = 120_000;

/// Refuses documents that are too large, and names the lists that are.
pub fn check(document: &Value, faults: &mut Faults) {
    for (name, most) in LISTS {
        let n = match &document[name] {
            Value::Array(entries) => entries.len(),
            Value::Object(entries) => entries.len(),
            _ => 0,
        };
        if n > most {
            let reason = format!("{n} {name}; {most} is the most");
            let remedy = "unite shapes of one material in one body, or split the scene";
            faults.add(&format!("/{name}"), "too_many", reason, remedy);
        }
    }
    if !faults.is_empty() {
        return;
    }
    let mut objects = 0;
    lists(document, "", 0, &mut objects, faults);
    if objects > MAX_OBJECTS && faults.is_empty() {
        let reason = format!("the document has {objects} objects; {MAX_OBJECTS} is the most");
        faults.add("", "too_many", reason, "describe it with fewer bodies, colliders or shapes");
    }
}

/// Counts objects, and looks for lists of too many. Lists of numbers, such as heights, may be long.
fn lists(value: &Value, at: &str, depth: usize, objects: &mut usize, faults: &mut Faults) {
    match value {
        Value::Array(items) if items.first().is_some_and(|first| first.is_object() || first.is_array()) => {
            if depth > 1 && items.len() > MAX_OBJECTS_IN_LIST && items[0].is_object() {
                let reason = format!("a list of {} parts; {MAX_OBJECTS_IN_LIST} is the most", items.len());
                faults.add(at, "too_complex", reason, "split it among several bodies or colliders");
                return;
            }
            for (n, item) in items.iter().enumerate().filter(|(_, item)| item.is_object() || item.is_array()) {
                lists(item, &join(at, n), depth + 1, objects, faults);
            }
        }
        Value::Object(fields) => {
            *objects += 1;
            for (name, field) in fields.iter().filter(|(_, field)| field.is_object() || field.is_array()) {
                lists(field, &join(at, name), depth + 1, objects, faults);
            }
        }
        _ => {}
    }
}
