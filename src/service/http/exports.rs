//! Frames of jobs as files of other programs.

use axum::extract::State;
use axum::http::{HeaderMap, Method};
use axum::response::Response;
use serde::Deserialize;
use utoipa::{IntoParams, ToSchema};

use super::conditional::Version;
use super::dto;
use super::extract::Query;
use super::file::{made, unnamed};
use super::filters::commas;
use super::frames::{JobFrame, Source};
use super::openapi::PROBLEM;
use super::problem::{Code, Problem, internal};
use super::state::Api;
use gridfall_recording::export::{self, ExportError, Format, Selection};

/// Changes with what is written of the same frame.
const EDITION: u32 = 1;
/// What to export of a frame.
#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub struct ExportQuery {
    /// Form of the file.
    #[param(inline)]
    pub format: ExportFormat,
    /// Only points of bodies and sources of these names. The scene's `output.fields` must have `body`.
    #[param(style = Form, explode = false)]
    #[serde(default, deserialize_with = "commas")]
    pub body: Vec<String>,
    /// Most points to export, the same share of all parts; all by default.
    #[param(minimum = 1)]
    pub max_points: Option<u32>,
}

/// Form of an exported frame.
#[derive(Clone, Copy, Debug, Deserialize, ToSchema)]
#[serde(rename_all = "lowercase")]
pub enum ExportFormat {
    Ply,
    Vtp,
    Npz,
    Csv,
}

impl From<ExportFormat> for Format {
    fn from(format: ExportFormat) -> Self {
        match format {
            ExportFormat::Ply => Self::Ply,
            ExportFormat::Vtp => Self::Vtp,
            ExportFormat::Npz => Self::Npz,
            ExportFormat::Csv => Self::Csv,
        }
    }
}

/// A frame as a file of another program, as soon as it is complete: PLY, VTP (ParaView), npz (NumPy) or CSV.
///
/// Positions are those of the scene (m, f64). All else is as it was recorded.
#[utoipa::path(get, path = "/v1/jobs/{id}/frames/{frame}/export", tag = "outputs", operation_id = "export_frame",
    params(
        ("id" = Uuid, Path),
        ("frame" = u64, Path, description = "Number of the frame, from 0"),
        ExportQuery,
        ("If-None-Match" = Option<String>, Header, description = "`ETag` of an earlier answer"),
    ),
    responses(
        (status = 200, headers(("ETag" = String), ("Content-Disposition" = String)),
            content((dto::Bytes = "application/octet-stream"), (String = "text/csv"))),
        (status = 304, description = "The client has it"),
        (status = 400, body = dto::Problem, content_type = PROBLEM,
            description = "`invalid_path`; `invalid_query`: also for a body that is not there"),
        (status = 404, body = dto::Problem, content_type = PROBLEM,
            description = "`job_not_found`, `output_not_found`"),
    ))]
pub async fn export(
    State(api): State<Api>,
    JobFrame(id, frame): JobFrame,
    Query(query): Query<ExportQuery>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    if query.max_points == Some(0) {
        return Err(Problem::new(Code::InvalidQuery, "max_points is 0; ask for at least 1, or leave it out for all"));
    }
    let format = Format::from(query.format);
    let most = query.max_points.unwrap_or(u32::MAX);
    let (source, status) = Source::of(&api, id).await?;
    let index = source.with_frame(&api, frame, status).await?;
    let names = source.read(&api, |index, target| index.bodies(target).map(Some)).await?.unwrap_or_default();
    let selection = Selection::new(names, &query.body, most as usize).map_err(refused)?;
    let version = Version::of_frame(EDITION, source.attempt, frame, &(format, selection.bodies(), most));
    if let Some(answer) = version.judge(&Method::GET, &headers)? {
        return Ok(answer);
    }

    let target = source.files.recording();
    let write = move || {
        unnamed(&target, |file, folder| {
            export::write_frame((&index, &target), frame, (format, &selection), file, folder).map(drop)
        })
    };
    let file = {
        let _reader = api.frames.readers.acquire().await.map_err(internal)?;
        tokio::task::spawn_blocking(write).await.map_err(internal)?.map_err(refused)?
    };
    let kind = if format == Format::Csv { "text/csv; charset=utf-8" } else { "application/octet-stream" };
    made(file, kind, &format!("gridfall-{id}.{frame:04}.{}", format.name()), &version)
}

fn refused(error: ExportError) -> Problem {
    match error {
        ExportError::NoBody { .. } | ExportError::NoBodies => Problem::new(Code::InvalidQuery, error.to_string()),
        // The frame was there.
        error => internal(error),
    }
}
