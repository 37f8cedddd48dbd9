//! The schemas of rows of diagnostics, from the columns that the simulation writes.

use serde_json::{Map, Value, json};

use gridfall_core::sim::diagnostics::{self, Row, SolverRow};

/// The component of a frame's row.
pub fn frame() -> Value {
    let mut row = object(Row::COLUMNS, &Row::default().values());
    // Forces and torques have the names of colliders and walls before them.
    row["additionalProperties"] = json!({ "type": ["number", "null"] });
    row["description"] = json!(
        "A frame's diagnostics; the columns of the CSV. Of each collider and wall that is met, members such as \
         `post.force_x` come on top. What is not finite is null."
    );
    row
}

/// The component of an implicit step's row.
pub fn step() -> Value {
    let mut row = object(SolverRow::COLUMNS, &SolverRow::default().values());
    row["description"] = json!("How the implicit integrator fared in a step; the columns of the CSV.");
    row
}

fn object(columns: &[&str], values: &[diagnostics::Value]) -> Value {
    let schema = |value: &diagnostics::Value| match value {
        diagnostics::Value::Count(_) => json!({ "type": "integer", "format": "int64", "minimum": 0 }),
        diagnostics::Value::Real(_) => json!({ "type": ["number", "null"], "format": "double" }),
        diagnostics::Value::Flag(_) => json!({ "type": "boolean" }),
    };
    let properties: Map<String, Value> =
        columns.iter().zip(values).map(|(name, value)| ((*name).to_owned(), schema(value))).collect();
    json!({ "type": "object", "required": columns, "properties": properties })
}
