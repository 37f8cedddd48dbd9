//! Other ways to write the name of a field: that of physics-USD, and comments.

use serde_json::{Map, Value};

/// What a field is meant to be.
pub(crate) enum Spelling<'a> {
    /// Text for readers of the document.
    Comment,
    /// The field of this name.
    Name(&'a str),
    /// A field of physics-USD with another unit.
    Fault { code: &'static str, reason: String, remedy: String },
}

/// What a field called `name` is meant to be where the `known` fields may stand.
///
/// Physics-USD writes `youngsModulus`, `poissonsRatio`, `dynamicFriction`, with or without `physics:` before it; its
/// values are in the units of the stage, for which metres and kilograms are taken.
pub(crate) fn meant<'a>(name: &'a str, value: &Value, known: &'a Map<String, Value>) -> Spelling<'a> {
    if name == "$comment" && value.is_string() {
        return Spelling::Comment;
    }
    if known.contains_key(name) {
        return Spelling::Name(name);
    }
    let usd = name.strip_prefix("physics:").unwrap_or(name);
    let ours = match usd {
        "dynamicFriction" => "friction".to_owned(),
        _ => snake_case(usd),
    };
    match known.get_key_value(&ours) {
        Some((ours, _)) if ours == "angular_velocity" => Spelling::Fault {
            code: "other_unit",
            reason: "in physics-USD it is in degrees a second".into(),
            remedy: "write `angular_velocity`, in radians a second".into(),
        },
        Some((ours, _)) => Spelling::Name(ours),
        None => Spelling::Name(name),
    }
}

/// `youngsModulus` as `youngs_modulus`.
fn snake_case(camel: &str) -> String {
    let mut snake = String::with_capacity(camel.len() + 4);
    for letter in camel.chars() {
        if letter.is_ascii_uppercase() && !snake.is_empty() {
            snake.push('_');
        }
        snake.push(letter.to_ascii_lowercase());
    }
    snake
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn names_of_physics_usd_are_known_and_others_stay() {
        let known = json!({ "youngs_modulus": 0, "friction": 0, "angular_velocity": 0, "J": 0, "density": 0 });
        let known = known.as_object().unwrap();
        let name = |name| match meant(name, &json!(1), known) {
            Spelling::Name(name) => name.to_owned(),
            Spelling::Comment => "a comment".into(),
            Spelling::Fault { code, .. } => code.into(),
        };
        for (given, expected) in [
            ("youngsModulus", "youngs_modulus"),
            ("physics:youngsModulus", "youngs_modulus"),
            ("physics:density", "density"),
            ("dynamicFriction", "friction"),
            ("angularVelocity", "other_unit"),
            ("angular_velocity", "angular_velocity"),
            ("J", "J"),
            ("poissonsRatio", "poissonsRatio"),
            ("$comment", "$comment"),
        ] {
            assert_eq!(name(given), expected, "{given}");
        }
        assert!(matches!(meant("$comment", &json!("why"), known), Spelling::Comment));
    }
}
