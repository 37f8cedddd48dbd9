//! Mutations of JSON documents by their structure.

use rand::Rng;
use rand::seq::IndexedRandom;
use rand_chacha::ChaCha8Rng;
use serde_json::{Map, Value, json};

use super::mutate::NUMBERS;

/// Changes a value somewhere in a document; `other` is another document to take parts from.
pub fn mutate(document: &mut Value, other: &Value, rng: &mut ChaCha8Rng) {
    let part = if rng.random() { document.clone() } else { other.clone() };
    let part = node(&mut part.clone(), rng).clone();
    let place = node(document, rng);
    match rng.random_range(0..9) {
        // A number stays one, mostly: what is of the wrong type is refused at once.
        0..=2 => change_number(document, rng),
        3 => *place = part,
        4 => *place = any(rng),
        5 => drop(remove(place, rng)),
        6 => repeat(place, rng),
        7 => rename(place, rng),
        _ => wrap(place, rng),
    }
}

/// A random value of the document: deeper ones more often, because there are more of them.
fn node<'a>(document: &'a mut Value, rng: &mut ChaCha8Rng) -> &'a mut Value {
    let mut place = document;
    while rng.random_bool(0.85) {
        let inner = match &*place {
            Value::Array(items) => items.len(),
            Value::Object(fields) => fields.len(),
            _ => 0,
        };
        if inner == 0 {
            break;
        }
        let n = rng.random_range(0..inner);
        place = match place {
            Value::Array(items) => &mut items[n],
            Value::Object(fields) => fields.values_mut().nth(n).expect("it has so many"),
            _ => unreachable!("it has parts"),
        };
    }
    place
}

fn change_number(document: &mut Value, rng: &mut ChaCha8Rng) {
    for _ in 0..20 {
        let place = node(document, rng);
        let Some(old) = place.as_f64() else { continue };
        *place = match rng.random_range(0..4) {
            0 => json!(old * [-1.0, 0.0, 0.5, 2.0, 10.0, 1e3, 1e-3, 1e-6].choose(rng).unwrap()),
            1 => json!(old + [-1.0, 1.0, 1e-9].choose(rng).unwrap()),
            _ => parsed(NUMBERS.choose(rng).unwrap()),
        };
        return;
    }
}

/// A number, or the text if it is none that JSON has.
fn parsed(number: &str) -> Value {
    serde_json::from_str(number).unwrap_or_else(|_| Value::String(number.into()))
}

fn any(rng: &mut ChaCha8Rng) -> Value {
    match rng.random_range(0..9) {
        0 => Value::Null,
        1 => json!(rng.random::<bool>()),
        2 => json!(""),
        3 => json!("\u{0}/~\u{10ffff}e\u{301}".repeat(rng.random_range(1..4))),
        4 => json!("long ".repeat(*[10, 1000, 10_000].choose(rng).unwrap())),
        5 => json!([]),
        6 => json!({}),
        7 => json!([parsed(NUMBERS.choose(rng).unwrap()), 0, 1]),
        _ => parsed(NUMBERS.choose(rng).unwrap()),
    }
}

/// Takes an item or a field out.
fn remove(place: &mut Value, rng: &mut ChaCha8Rng) -> Option<(String, Value)> {
    match place {
        Value::Array(items) if !items.is_empty() => {
            Some((String::new(), items.remove(rng.random_range(0..items.len()))))
        }
        Value::Object(fields) if !fields.is_empty() => {
            let key = fields.keys().nth(rng.random_range(0..fields.len()))?.clone();
            let value = fields.remove(&key)?;
            Some((key, value))
        }
        _ => None,
    }
}

fn repeat(place: &mut Value, rng: &mut ChaCha8Rng) {
    let times = *[1, 1, 2, 10, 100].choose(rng).unwrap();
    match place {
        Value::Array(items) if !items.is_empty() => {
            let item = items[rng.random_range(0..items.len())].clone();
            items.extend(std::iter::repeat_n(item, times));
        }
        Value::Object(fields) if !fields.is_empty() => {
            let value = fields.values().nth(rng.random_range(0..fields.len())).expect("it has so many").clone();
            fields.extend((0..times).map(|n| (format!("again {n}"), value.clone())));
        }
        _ => {}
    }
}

fn rename(place: &mut Value, rng: &mut ChaCha8Rng) {
    let Some((key, value)) = remove(place, rng) else { return };
    match place {
        Value::Object(fields) => {
            let names = ["", "x", "mesh", "box", "union", "a/b~c", "\u{202e}", "material", "count", "byteStride"];
            let name = if rng.random() { names.choose(rng).unwrap().to_string() } else { format!("{key}_") };
            fields.insert(name, value);
        }
        Value::Array(items) => items.insert(rng.random_range(0..=items.len()), value),
        _ => {}
    }
}

/// Nests a value: as deep as it goes, or in what shapes can be nested in.
fn wrap(place: &mut Value, rng: &mut ChaCha8Rng) {
    let depth = *[1, 1, 1, 2, 10, 60, 130].choose(rng).unwrap();
    let kind = rng.random_range(0..5);
    for _ in 0..depth {
        let inner = place.take();
        *place = match kind {
            0 => json!([inner]),
            1 => Value::Object(Map::from_iter([("shape".to_owned(), inner)])),
            2 => json!({ "union": [inner.clone(), inner] }),
            3 => json!({ "shell": { "thickness": 0.1, "shape": inner } }),
            _ => json!({ "scale": { "factor": 0.9, "shape": inner } }),
        };
        // Unions double.
        if kind == 2 && depth > 10 {
            break;
        }
    }
}
