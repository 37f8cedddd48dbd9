//! Bounds of single values, those that `validate` has. What depends on other values is not here.

use serde_json::{Map, Value, json};

use super::reference;
use crate::validate::plausible::{
    DAMPING, DENSITY, END, EXPONENT, GRAVITY, LARGEST, PLACE, Range, SMALLEST, SPACING, SPEED, VOLUME_RATIO,
};
use crate::validate::{MAX_ERROR, MAX_LEVELS, MAX_NAME, MAX_PREVIEW_POINTS};

/// Adds all bounds to the published definitions.
pub fn add(definitions: &mut Map<String, Value>) {
    for (places, bounds) in table() {
        for place in places {
            let (name, field) = place.split_once('.').expect("a place is a definition and a field");
            let fields = definitions.get_mut(name).map(|definition| &mut definition["properties"]);
            let field = fields.and_then(|fields| fields.get_mut(field));
            let node = field.unwrap_or_else(|| panic!("the schema has no {place}"));
            merge(node, &bounds);
        }
    }
    definitions.values_mut().for_each(bound_numbers);
    for (name, most, about) in [
        ("Number", LARGEST, "A number of a vector or a matrix."),
        ("Place", PLACE.most, "A coordinate (m)."),
        ("Speed", SPEED.most, "A component of a velocity (m/s)."),
        ("Acceleration", GRAVITY.most, "A component of an acceleration (m/s²)."),
    ] {
        let number =
            json!({ "title": name, "description": about, "type": "number", "minimum": -most, "maximum": most });
        definitions.insert(name.into(), number);
    }
}

/// Adds members of `bounds` to a node, and those of its `items` to the items.
fn merge(node: &mut Value, bounds: &Value) {
    // Of a number or a list, the list.
    let node = if node["else"].is_object() { &mut node["else"] } else { node };
    for (key, value) in bounds.as_object().expect("bounds are an object") {
        if key == "items" && value["$ref"].is_null() {
            merge(&mut node["items"], value);
        } else {
            node[key] = value.clone();
        }
    }
}

/// No number is larger than any quantity can be.
fn bound_numbers(node: &mut Value) {
    if node["items"]["type"] == "number" {
        node["items"] = reference("Number");
    }
    let is_number = node["type"] == "number" || node["type"] == json!(["number", "null"]);
    if let (true, Some(members)) = (is_number, node.as_object_mut()) {
        if !members.contains_key("exclusiveMinimum") {
            members.entry("minimum").or_insert(json!(-LARGEST));
        }
        if !members.contains_key("exclusiveMaximum") {
            members.entry("maximum").or_insert(json!(LARGEST));
        }
    }
    match node {
        Value::Object(members) => members.values_mut().for_each(bound_numbers),
        Value::Array(items) => items.iter_mut().for_each(bound_numbers),
        _ => {}
    }
}

fn table() -> Vec<(Vec<String>, Value)> {
    let positive = json!({ "minimum": SMALLEST });
    let not_negative = json!({ "minimum": 0 });
    let within = |range: &Range| json!({ "minimum": range.least, "maximum": range.most });
    let of_each = |number: &str| json!({ "items": reference(number), "minItems": 2, "maxItems": 3 });
    let spin = json!({ "minItems": 1, "maxItems": 3 });
    let matrix = json!({ "items": { "minItems": 2, "maxItems": 3 }, "minItems": 2, "maxItems": 3 });
    let vector = json!({ "minItems": 2, "maxItems": 3 });
    let direction = json!({ "minItems": 2, "maxItems": 3, "not": { "type": "array", "items": { "const": 0 } } });
    let name = json!({ "minLength": 1, "maxLength": MAX_NAME });
    let asset = json!({ "pattern": "^sha256:[0-9A-Fa-f]{64}$" });
    let angle = json!({ "minimum": 0, "exclusiveMaximum": 90 });
    vec![
        (of(&["Scene.gridfall"]), json!({ "const": 1 })),
        (of(&["Scene.dimension"]), json!({ "minimum": 2, "maximum": 3 })),
        (of(&["Scene.gravity"]), of_each("Acceleration")),
        (of(&["Scene.materials"]), json!({ "propertyNames": name })),
        (of(&["Scene.name", "Body.name", "Source.name", "Collider.name", "Grip.name"]), name),
        (of(&["Domain.min", "Domain.max", "Motion.center"]), of_each("Place")),
        (of(&["Domain.dx"]), within(&SPACING)),
        (of(&["Domain.boundary"]), json!({ "propertyNames": { "pattern": "^[xyz][+-]?$" } })),
        (of(&["SceneTime.end"]), json!({ "minimum": SMALLEST, "maximum": END.most })),
        (of(&["SceneTime.frame_rate", "Solver.max_dt"]), positive.clone()),
        (of(&["Solver.cfl"]), json!({ "exclusiveMinimum": 0, "maximum": 1 })),
        (of(&["Implicit.levels"]), json!({ "minimum": 1, "maximum": MAX_LEVELS })),
        (of(&["Implicit.max_iterations"]), json!({ "minimum": 1 })),
        (of(&["Implicit.tolerance"]), json!({ "exclusiveMinimum": 0, "maximum": MAX_ERROR })),
        (of(&["SceneOutput.preview_points"]), json!({ "minimum": 1, "maximum": MAX_PREVIEW_POINTS })),
        (of(&["SceneOutput.fields"]), json!({ "uniqueItems": true })),
        (of(&["Body.J"]), within(&VOLUME_RATIO)),
        (of(&["Body.particles_per_cell", "Source.particles_per_cell"]), json!({ "minimum": 1 })),
        (of(&["Source.sampling"]), json!({ "const": "regular" })),
        (of(&["Body.velocity", "Source.velocity", "Motion.linear_velocity"]), of_each("Speed")),
        (of(&["Body.angular_velocity", "Motion.angular_velocity"]), spin),
        (of(&["Body.velocity_gradient", "Body.deformation_gradient"]), matrix),
        (of(&["Body.friction", "Collider.friction", "WallContact.friction"]), not_negative.clone()),
        (of(&["Collider.from", "Grip.from", "Source.from", "Keyframe.time"]), not_negative.clone()),
        (of(&["Collider.until", "Grip.until", "Source.until"]), json!({ "exclusiveMinimum": 0 })),
        (of(&["Motion.axis", "HalfSpaceShape.normal"]), direction.clone()),
        (of(&["CylinderShape.axis", "CapsuleShape.axis", "ConeShape.axis", "TorusShape.axis"]), direction),
        (of(&["Keyframe.offset", "BoxShape.min", "BoxShape.max", "SphereShape.center"]), vector.clone()),
        (of(&["CylinderShape.center", "CapsuleShape.center", "ConeShape.base", "TorusShape.center"]), vector.clone()),
        (of(&["HalfSpaceShape.point", "TranslateShape.offset", "RotateShape.center", "ScaleShape.center"]), vector),
        (of(&["HeightfieldShape.min", "HeightfieldShape.max"]), json!({ "minItems": 1, "maxItems": 2 })),
        (of(&["HeightfieldShape.heights"]), json!({ "items": { "minItems": 2 }, "minItems": 1 })),
        (of(&["SphereShape.radius", "CylinderShape.radius", "CylinderShape.height"]), positive.clone()),
        (of(&["CapsuleShape.radius", "CapsuleShape.height", "ConeShape.radius", "ConeShape.height"]), positive.clone()),
        (of(&["TorusShape.major_radius", "TorusShape.minor_radius"]), positive.clone()),
        (of(&["ScaleShape.factor", "ShellShape.thickness"]), positive.clone()),
        (of(&["ConeShape.top_radius"]), not_negative.clone()),
        (of(&["Shape.union", "Shape.intersection"]), json!({ "minItems": 1 })),
        (of(&["Shape.difference"]), json!({ "minItems": 2 })),
        (of(&["MeshShape.asset", "Points.asset", "StartState.asset"]), asset),
        (of_solids("density"), within(&DENSITY)),
        (of(&["WeaklyCompressibleFluidMaterial.density"]), within(&DENSITY)),
        (of_solids("youngs_modulus"), positive.clone()),
        (of_solids("poissons_ratio"), json!({ "exclusiveMinimum": -1, "exclusiveMaximum": 0.5 })),
        (
            of(&[
                "FixedCorotatedMaterial.damping",
                "NeoHookeanMaterial.damping",
                "StvkHenckyMaterial.damping",
                "VonMisesMaterial.damping",
            ]),
            within(&DAMPING),
        ),
        (
            of(&["WeaklyCompressibleFluidMaterial.bulk_modulus", "NaccMaterial.M", "VonMisesMaterial.yield_stress"]),
            positive,
        ),
        (of(&["WeaklyCompressibleFluidMaterial.gamma"]), json!({ "exclusiveMinimum": 1, "maximum": EXPONENT.most })),
        (
            of(&[
                "WeaklyCompressibleFluidMaterial.viscosity",
                "DruckerPragerMaterial.cohesion",
                "MohrCoulombMaterial.cohesion",
                "NaccMaterial.beta",
                "NaccMaterial.xi",
                "SnowMaterial.critical_stretch",
                "SnowMaterial.hardening",
            ]),
            not_negative,
        ),
        (of(&["SnowMaterial.critical_compression"]), json!({ "minimum": 0, "exclusiveMaximum": 1 })),
        (
            of(&[
                "DruckerPragerMaterial.friction_angle_degrees",
                "DruckerPragerMaterial.dilatancy_angle_degrees",
                "MohrCoulombMaterial.friction_angle_degrees",
                "MohrCoulombMaterial.dilatancy_angle_degrees",
            ]),
            angle,
        ),
    ]
}

fn of(places: &[&str]) -> Vec<String> {
    places.iter().map(|place| (*place).to_owned()).collect()
}

/// A field that all solid materials have.
fn of_solids(field: &str) -> Vec<String> {
    let models =
        ["FixedCorotated", "NeoHookean", "StvkHencky", "DruckerPrager", "MohrCoulomb", "Nacc", "VonMises", "Snow"];
    models.iter().map(|model| format!("{model}Material.{field}")).collect()
}
