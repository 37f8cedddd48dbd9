//! Tables of a job as requests ask for them and answers have them.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// How to write diagnostics. Not in the document, which has a path for each: clients that are
/// generated get one type from one path.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DiagnosticsQuery {
    #[serde(default)]
    pub format: DiagnosticsFormat,
    #[serde(default)]
    pub per: DiagnosticsPer,
}

/// What a row of diagnostics is of.
#[derive(Clone, Copy, Debug, Default, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum DiagnosticsPer {
    /// A frame: energies, momenta and extremes.
    #[default]
    Frame,
    /// A step of the implicit integrator: iterations and residual.
    Step,
}

#[derive(Clone, Copy, Debug, Default, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum DiagnosticsFormat {
    #[default]
    Json,
    Csv,
}

/// Rows of a table, one object each.
#[derive(Debug, Serialize)]
pub struct Rows {
    pub rows: Vec<serde_json::Value>,
}

/// The finite values of a column; null where there is none.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, ToSchema)]
pub struct Summary {
    #[schema(required)]
    pub last: Option<f64>,
    #[schema(required)]
    pub least: Option<f64>,
    #[schema(required)]
    pub most: Option<f64>,
}

impl Summary {
    /// Of each column of a CSV of numbers, with a line of names first.
    pub fn of_columns(csv: &str) -> BTreeMap<String, Self> {
        let mut lines = csv.lines();
        let names: Vec<&str> = lines.next().unwrap_or_default().split(',').collect();
        let mut columns = vec![Self::default(); names.len()];
        for line in lines {
            for (column, cell) in columns.iter_mut().zip(line.split(',')) {
                let value = cell.parse().ok().filter(|value: &f64| value.is_finite());
                let Some(x) = value else {
                    column.last = None;
                    continue;
                };
                *column = Self {
                    last: value,
                    least: Some(column.least.map_or(x, |least| least.min(x))),
                    most: Some(column.most.map_or(x, |most| most.max(x))),
                };
            }
        }
        let rows = csv.lines().nth(1).is_some();
        names.into_iter().map(str::to_owned).zip(columns).filter(|_| rows).collect()
    }
}

/// The diagnostics of the frames so far, frame 0 included.
#[derive(ToSchema)]
#[expect(dead_code, reason = "describes `Rows` to clients")]
pub struct Diagnostics {
    pub rows: Vec<FrameRow>,
}

/// The steps of the implicit integrator so far.
#[derive(ToSchema)]
#[expect(dead_code, reason = "describes `Rows` to clients")]
pub struct SolverSteps {
    pub rows: Vec<StepRow>,
}

/// Described in `openapi::rows`, by its columns.
#[derive(ToSchema)]
pub struct FrameRow {}

/// Described in `openapi::rows`, by its columns.
#[derive(ToSchema)]
pub struct StepRow {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_are_summed_up_by_their_finite_values() {
        let columns = Summary::of_columns("frame,speed,min_J\n0,0.0,inf\n1,3.5,0.5\n2,-1e-9,NaN\n");
        let summary = |last, least, most| Summary { last, least, most };
        assert_eq!(columns["frame"], summary(Some(2.0), Some(0.0), Some(2.0)));
        assert_eq!(columns["speed"], summary(Some(-1e-9), Some(-1e-9), Some(3.5)));
        assert_eq!(columns["min_J"], summary(None, Some(0.5), Some(0.5)));
        assert!(Summary::of_columns("").is_empty() && Summary::of_columns("frame,speed\n").is_empty());
    }
}
