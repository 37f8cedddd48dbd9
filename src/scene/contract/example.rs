//! JSON as people write it: short values on a line.

use serde_json::Value;

/// Most columns of a line.
const WIDTH: usize = 100;

/// A value as text. What does not fit into a line has a line a member.
pub fn text(value: &Value) -> String {
    written(value, 0, 0)
}

/// The same in a line of an indent, of which so many columns are taken.
fn written(value: &Value, indent: usize, taken: usize) -> String {
    let line = on_a_line(value);
    // A comma may follow.
    if taken + line.chars().count() < WIDTH {
        return line;
    }
    let inner = indent + 2;
    let broken = |members: Vec<String>, [open, close]: [char; 2]| {
        let margin = format!("\n{}", " ".repeat(inner));
        format!("{open}{margin}{}\n{}{close}", members.join(&format!(",{margin}")), " ".repeat(indent))
    };
    match value {
        Value::Array(items) => broken(items.iter().map(|item| written(item, inner, inner)).collect(), ['[', ']']),
        Value::Object(members) => {
            let member = |(name, value): (&String, &Value)| {
                let name = format!("\"{name}\": ");
                let taken = inner + name.chars().count();
                name + &written(value, inner, taken)
            };
            broken(members.iter().map(member).collect(), ['{', '}'])
        }
        _ => line,
    }
}

fn on_a_line(value: &Value) -> String {
    match value {
        Value::Array(items) => format!("[{}]", items.iter().map(on_a_line).collect::<Vec<_>>().join(", ")),
        Value::Object(members) if members.is_empty() => "{}".into(),
        Value::Object(members) => {
            let member = |(name, value): (&String, &Value)| format!("\"{name}\": {}", on_a_line(value));
            format!("{{ {} }}", members.iter().map(member).collect::<Vec<_>>().join(", "))
        }
        // Whole numbers without a point.
        Value::Number(number) if number.is_f64() => number.as_f64().map(|x| x.to_string()).unwrap_or_default(),
        value => value.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn what_fits_is_on_a_line_and_the_rest_is_broken() {
        assert_eq!(text(&json!({ "a": [1, 2.5], "b": {} })), "{ \"a\": [1, 2.5], \"b\": {} }");
        let long = json!({ "list": ["x".repeat(60), "y".repeat(60)], "modulus": 210e9 });
        let shown = text(&long);
        assert_eq!(shown.lines().count(), 7, "{shown}");
        assert!(
            shown.lines().all(|line| line.len() <= WIDTH) && shown.contains("\"modulus\": 210000000000"),
            "{shown}"
        );
        assert_eq!(serde_json::from_str::<Value>(&shown).unwrap()["list"], long["list"]);
    }
}
