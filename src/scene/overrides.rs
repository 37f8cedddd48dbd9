//! `path=value` changes to a scene document before it is read.

use serde_json::{Map, Value};

use crate::fault::Fault;

/// Applies `solver.kernel=quadratic`, `bodies.0.velocity=[0,0,1]` or, where a name has dots, `/materials/wet.sand/density=1800`.
///
/// The value is JSON, or a string if it does not parse as JSON. Missing objects on the way are made. Fails when the text has no `=`, or the path
/// leads through something that is neither an object nor an existing item of a list; whether the result is a scene shows later.
pub fn apply(document: &mut Value, text: &str) -> Result<(), Fault> {
    let Some((path, value)) = text.split_once('=') else {
        return Err(bad(text, "has no `=`"));
    };
    let steps: Vec<String> = match path.trim().strip_prefix('/') {
        Some(pointer) => pointer.split('/').map(|step| step.replace("~1", "/").replace("~0", "~")).collect(),
        None => path.trim().split('.').map(str::to_owned).collect(),
    };
    if steps.iter().any(String::is_empty) {
        return Err(bad(text, "has an empty step in its path"));
    }
    let value = value.trim();
    let value = serde_json::from_str(value).unwrap_or_else(|_| Value::String(value.to_owned()));
    let mut place = document;
    for step in &steps {
        if place.is_null() {
            *place = Value::Object(Map::new());
        }
        place = match place {
            Value::Object(fields) => fields.entry(step.as_str()).or_insert(Value::Null),
            Value::Array(items) => {
                let count = items.len();
                let item = step.parse().ok().and_then(|n: usize| items.get_mut(n));
                item.ok_or_else(|| bad(text, &format!("asks for item {step} of a list of {count}")))?
            }
            _ => return Err(bad(text, &format!("leads to `{step}` inside a value that has no fields"))),
        };
    }
    *place = value;
    Ok(())
}

fn bad(text: &str, what: &str) -> Fault {
    Fault {
        pointer: String::new(),
        code: "bad_override",
        reason: format!("the override `{text}` {what}"),
        remedy: "write path=value, such as solver.kernel=quadratic or bodies.0.velocity=[0,0,1]".into(),
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn sets_makes_and_refuses() {
        let mut scene = json!({ "bodies": [{ "name": "a" }], "materials": { "wet.sand": { "density": 1 } } });
        for text in [
            "solver.kernel=quadratic",
            "bodies.0.velocity=[0, 0, 1]",
            "/materials/wet.sand/density=1800",
            "name=42 = x",
            "solver.max_dt=1e-4",
        ] {
            apply(&mut scene, text).unwrap();
        }
        let expected = json!({
            "bodies": [{ "name": "a", "velocity": [0, 0, 1] }], "materials": { "wet.sand": { "density": 1800 } },
            "solver": { "kernel": "quadratic", "max_dt": 1e-4 }, "name": "42 = x",
        });
        assert_eq!(scene, expected);
        for text in ["solver.kernel", "bodies.1.name=b", "name.x=1", "a..b=1", "=1"] {
            assert_eq!(apply(&mut scene, text).unwrap_err().code, "bad_override", "{text}");
        }
        assert_eq!(scene, expected, "a refused override must change nothing");
    }
}
