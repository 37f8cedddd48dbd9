//! Tables of a job as requests ask for them and answers have them.

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
