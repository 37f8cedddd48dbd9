//! Frames of jobs as files of other programs.

use std::fs::File;
use std::io::Seek;

use axum::body::Body;
use axum::extract::State;
use axum::http::{HeaderMap, HeaderValue, Method, header};
use axum::response::{IntoResponse, Response};
use serde::Deserialize;
use tokio_util::io::ReaderStream;
use utoipa::{IntoParams, ToSchema};

use super::conditional::Version;
use super::dto;
use super::extract::Query;
use super::file::READ_BYTES;
use super::filters::commas;
use super::frames::{JobFrame, Source};
use super::openapi::PROBLEM;
use super::problem::{Code, Problem, internal};
use super::state::Api;
use gridfall_recording::RecordingError;
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
    let bodies: Vec<String> = selection.bodies().iter().map(usize::to_string).collect();
    let (name, bodies) = (format.name(), bodies.join("."));
    let version = Version::of_tag(format!("\"e{EDITION}-{}-{frame}-{name}-{bodies}-{most:x}\"", source.attempt));
    if let Some(answer) = version.judge(&Method::GET, &headers)? {
        return Ok(answer);
    }

    // On the disk, so that slow clients cost no memory; without a name, so that nothing is left of it.
    let target = source.files.recording();
    let write = move || -> Result<File, ExportError> {
        let folder = target.parent().expect("recordings are in folders");
        let mut file = tempfile::tempfile_in(folder).map_err(RecordingError::io("create a file in", folder))?;
        export::write_frame((&index, &target), frame, (format, &selection), &file, folder)?;
        file.rewind().map_err(RecordingError::io("read a file in", folder))?;
        Ok(file)
    };
    let file = {
        let _reader = api.frames.readers.acquire().await.map_err(internal)?;
        tokio::task::spawn_blocking(write).await.map_err(internal)?.map_err(refused)?
    };
    let kind = if format == Format::Csv { "text/csv; charset=utf-8" } else { "application/octet-stream" };
    self::file(file, kind, &format!("gridfall-{id}.{frame:04}.{name}"), &version)
}

/// A file that was made for this answer, which browsers save under a name.
pub(super) fn file(file: File, kind: &'static str, name: &str, version: &Version) -> Result<Response, Problem> {
    let length = file.metadata()?.len();
    let body = Body::from_stream(ReaderStream::with_capacity(tokio::fs::File::from_std(file), READ_BYTES));
    let mut answer = ([(header::CONTENT_TYPE, kind)], body).into_response();
    let disposition = HeaderValue::try_from(format!("attachment; filename=\"{name}\""));
    let disposition = disposition.expect("digits, letters and quotes are fit for a header");
    answer.headers_mut().insert(header::CONTENT_DISPOSITION, disposition);
    answer.headers_mut().insert(header::CONTENT_LENGTH, length.into());
    version.write(answer.headers_mut());
    Ok(answer)
}

fn refused(error: ExportError) -> Problem {
    match error {
        ExportError::NoBody { .. } | ExportError::NoBodies => Problem::new(Code::InvalidQuery, error.to_string()),
        // The frame was there.
        error => internal(error),
    }
}
