//! Vectors and matrices as a document writes them.

/// A vector of the scene's dimension (2 or 3 components).
pub type Vector = Vec<f64>;
/// A square matrix of the scene's dimension, rows first.
pub type Matrix = Vec<Vec<f64>>;

/// Angular velocities: three components, in 2D one, which may stand without a list.
pub(super) mod spin {
    use schemars::{Schema, SchemaGenerator, json_schema};
    use serde::{Deserialize, Deserializer};

    use super::Vector;

    pub fn schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": ["array", "number", "null"], "items": { "type": "number", "format": "double" } })
    }

    pub fn read<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<Vector>, D::Error> {
        #[derive(Deserialize)]
        #[serde(untagged)]
        enum Spin {
            Number(f64),
            List(Vector),
        }
        let spin: Option<Spin> = Option::deserialize(deserializer)?;
        Ok(spin.map(|spin| match spin {
            Spin::Number(w) => vec![w],
            Spin::List(w) => w,
        }))
    }
}
