//! Changes of the form `path=value` to a scene document before it is read.

use serde_json::{Map, Value};

use crate::fault::Fault;

/// Applies overrides in order. Each one that cannot be applied is a fault.
///
/// An override is `solver.kernel=quadratic`, `bodies.0.velocity=[0,0,1]` or, where a name has dots,
/// `/materials/wet.sand/density=1800`. Its value is JSON, or a string if it does not parse as JSON.
/// A step into the material that a body names, `bodies.0.material.density`, goes to that entry of `materials`.
/// Missing objects on the way are made. An override cannot be applied when the text has no `=`, or
/// when the path leads through something that is neither an object nor an existing item of a list.
/// Whether the result is a scene shows later.
pub(crate) fn apply(document: &mut Value, overrides: &[String]) -> Result<(), Vec<Fault>> {
    let refused: Vec<Fault> = overrides.iter().filter_map(|text| apply_one(document, text).err()).collect();
    if refused.is_empty() { Ok(()) } else { Err(refused) }
}

fn apply_one(document: &mut Value, text: &str) -> Result<(), Fault> {
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
    let steps = through_names(document, steps);
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

/// Steps into the material of a body or source that has the name of one lead to that entry of
/// `materials`.
fn through_names(document: &Value, steps: Vec<String>) -> Vec<String> {
    let [list, n, member, rest @ ..] = steps.as_slice() else { return steps };
    if !matches!(list.as_str(), "bodies" | "sources") || member != "material" || rest.is_empty() {
        return steps;
    }
    let index = n.parse::<usize>().ok();
    match index.and_then(|n| document[list].get(n)).and_then(|user| user["material"].as_str()) {
        Some(name) => ["materials", name].into_iter().map(str::to_owned).chain(rest.iter().cloned()).collect(),
        None => steps,
    }
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
        let good = [
            "solver.kernel=quadratic",
            "bodies.0.velocity=[0, 0, 1]",
            "/materials/wet.sand/density=1800",
            "name=42 = x",
            "solver.max_dt=1e-4",
        ];
        apply(&mut scene, &good.map(str::to_owned)).unwrap();
        let expected = json!({
            "bodies": [{ "name": "a", "velocity": [0, 0, 1] }], "materials": { "wet.sand": { "density": 1800 } },
            "solver": { "kernel": "quadratic", "max_dt": 1e-4 }, "name": "42 = x",
        });
        assert_eq!(scene, expected);
        let bad = ["solver.kernel", "bodies.1.name=b", "name.x=1", "a..b=1", "=1"];
        let faults = apply(&mut scene, &bad.map(str::to_owned)).unwrap_err();
        assert_eq!(faults.len(), bad.len());
        for (fault, text) in faults.iter().zip(bad) {
            assert!(fault.code == "bad_override" && fault.reason.contains(text), "{text}: {fault}");
        }
        assert_eq!(scene, expected, "a refused override must change nothing");
    }
}
