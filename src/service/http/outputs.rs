//! Outputs of a job: its recording, a picture and its diagnostics.

use std::collections::BTreeMap;
use std::io;

use axum::Json;
use axum::body::Body;
use axum::extract::State;
use axum::http::{HeaderMap, Method, header};
use axum::response::{IntoResponse, Response};
use tokio::fs::File;
use tokio::io::AsyncReadExt;
use tokio_util::io::ReaderStream;
use uuid::Uuid;

use super::dto::{self, RecordingQuery};
use super::extract::{JobId, Query};
use super::file::{FileAnswer, READ_BYTES, found};
use super::follow::follow;
use super::openapi::PROBLEM;
use super::problem::{Code, Problem, internal};
use super::state::Api;
use super::tables::{Diagnostics, DiagnosticsFormat, DiagnosticsPer, DiagnosticsQuery, Rows, SolverSteps, Summary};
use crate::jobs;
use crate::store::{AttemptFiles, Job, Remote, Status};
use gridfall_recording::{self as recording, RecordingError};

/// Outputs as the object storage names them, too.
pub(super) const RECORDING: &str = "recording.mcap";
pub(super) const STATE: &str = "state.npz";
const TABLES: [&str; 2] = ["diagnostics.csv", "solver.csv"];

/// The recording (MCAP) of a job that has ended, by ranges if asked. Once there, it never changes,
/// so a download may be resumed at any time. With `follow=true` it can be read while the job runs.
#[utoipa::path(get, path = "/v1/jobs/{id}/recording.mcap", tag = "outputs", operation_id = "get_recording",
    params(
        ("id" = Uuid, Path),
        RecordingQuery,
        ("Range" = Option<String>, Header, description = "One byte range"),
        ("If-Range" = Option<String>, Header, description = "`ETag` or `Last-Modified` that the range is of"),
        ("If-Match" = Option<String>, Header, description = "`ETag` of an earlier answer; 412 for another version"),
        ("If-Unmodified-Since" = Option<String>, Header, description = "412 for a later version"),
        ("If-None-Match" = Option<String>, Header, description = "`ETag` of an earlier answer; 304 for the same"),
        ("If-Modified-Since" = Option<String>, Header, description = "304 if there is no later version"),
    ),
    responses(
        (status = 200, content_type = "application/octet-stream", body = dto::Bytes,
            headers(("ETag" = String), ("Last-Modified" = String), ("Accept-Ranges" = String))),
        (status = 206, content_type = "application/octet-stream", body = dto::Bytes,
            headers(("ETag" = String), ("Content-Range" = String))),
        (status = 304, description = "The recording is as it was"),
        (status = 404, body = dto::Problem, content_type = PROBLEM,
            description = "`job_not_found`, `output_not_found`"),
        (status = 409, body = dto::Problem, content_type = PROBLEM,
            description = "`job_not_finished`: `recording-so-far.mcap` has the frames so far"),
        (status = 412, body = dto::Problem, content_type = PROBLEM, description = "`precondition_failed`"),
        (status = 416, body = dto::Problem, content_type = PROBLEM, description = "`range_not_satisfiable`"),
    ))]
pub async fn recording(
    State(api): State<Api>,
    JobId(id): JobId,
    Query(query): Query<RecordingQuery>,
    method: Method,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let name = format!("gridfall-{id}.mcap");
    if query.follow {
        let job = api.store.get(id).await?.ok_or_else(|| Problem::job_not_found(id))?;
        if !job.status.is_terminal() && method == Method::GET {
            return follow(&api, id, &name).await;
        }
    }
    // Not brought here as a whole only to be sent on.
    let (files, Job { status, attempt, .. }) = find(&api, id, &[]).await?;
    let file = FileAnswer { path: &files.recording(), content_type: "application/octet-stream", download: Some(&name) };
    if let Some(response) = file.send(&method, &headers).await? {
        return Ok(response);
    }
    if let Some(remote) = remote(&api, id, attempt, RECORDING).await? {
        return file.send_from(remote, &method, &headers);
    }
    if status.is_terminal() {
        return Err(missing("recording", status));
    }
    let detail = format!(
        "the job runs, and its recording is not complete; GET /v1/jobs/{id}/recording-so-far.mcap for the frames so \
         far, or this with ?follow=true to receive it as it grows"
    );
    Err(Problem::new(Code::JobNotFinished, detail))
}

/// The frames so far of a running job, as a complete recording (MCAP); the recording itself once
/// the job has ended. Each answer is a file of its own, so none can be resumed.
#[utoipa::path(get, path = "/v1/jobs/{id}/recording-so-far.mcap", tag = "outputs",
    operation_id = "get_recording_so_far",
    params(("id" = Uuid, Path)),
    responses(
        (status = 200, content_type = "application/octet-stream", body = dto::Bytes),
        (status = 404, body = dto::Problem, content_type = PROBLEM,
            description = "`job_not_found`, `output_not_found`"),
        (status = 416, body = dto::Problem, content_type = PROBLEM,
            description = "`range_not_satisfiable`: a part of one answer does not fit another"),
    ))]
pub async fn recording_so_far(
    State(api): State<Api>,
    JobId(id): JobId,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let (files, Job { status, .. }) = find(&api, id, &[RECORDING]).await?;
    // Clients that resume take even a whole answer for a continuation.
    if headers.get(header::RANGE).is_some_and(|range| range != "bytes=0-") {
        let detail = "the recording so far is another file with every frame; download it anew, as a whole";
        return Err(Problem::new(Code::RangeNotSatisfiable, detail));
    }
    let name = format!("gridfall-{id}-so-far.mcap");
    if let Some(response) = snapshot(&files, &name).await? {
        return Ok(response);
    }
    let Some(file) = found(File::open(files.recording()).await)? else { return Err(missing("recording", status)) };
    let length = file.metadata().await?.len();
    Ok(unresumable(Body::from_stream(ReaderStream::with_capacity(file, READ_BYTES)), length, &name))
}

/// An output that is in the object storage.
async fn remote(api: &Api, id: Uuid, attempt: i64, name: &str) -> Result<Option<Remote>, Problem> {
    let Some(objects) = api.data.objects() else { return Ok(None) };
    Ok(objects.outputs(id, attempt).await?.into_iter().find(|output| output.name == name))
}

/// The frames so far as a complete recording; `None` before the first one is written.
async fn snapshot(files: &AttemptFiles, name: &str) -> Result<Option<Response>, Problem> {
    let path = files.partial_recording();
    let Some(file) = found(File::open(&path).await)? else { return Ok(None) };
    let snapshot = match tokio::task::spawn_blocking(move || recording::snapshot(&path)).await.map_err(internal)? {
        Ok(snapshot) => snapshot,
        Err(RecordingError::Damaged { .. }) => return Ok(None),
        Err(RecordingError::Io { source, .. }) if source.kind() == io::ErrorKind::NotFound => return Ok(None),
        Err(error) => return Err(internal(error)),
    };
    let length = snapshot.length();
    let body =
        ReaderStream::with_capacity(file.take(snapshot.prefix).chain(io::Cursor::new(snapshot.tail)), READ_BYTES);
    Ok(Some(unresumable(Body::from_stream(body), length, name)))
}

/// An answer that the next request would get differently.
fn unresumable(body: Body, length: u64, name: &str) -> Response {
    let headers = [
        (header::CONTENT_TYPE, "application/octet-stream".to_owned()),
        (header::CONTENT_LENGTH, length.to_string()),
        (header::CONTENT_DISPOSITION, format!("attachment; filename=\"{name}\"")),
        (header::ACCEPT_RANGES, "none".to_owned()),
        (header::CACHE_CONTROL, "no-store".to_owned()),
    ];
    (headers, body).into_response()
}

/// A picture of the last frame (PNG), once the job has ended.
#[utoipa::path(get, path = "/v1/jobs/{id}/thumbnail.png", tag = "outputs", operation_id = "get_thumbnail",
    params(
        ("id" = Uuid, Path),
        ("If-None-Match" = Option<String>, Header, description = "`ETag` of an earlier answer"),
    ),
    responses(
        (status = 200, content_type = "image/png", body = dto::Bytes, headers(("ETag" = String))),
        (status = 206, content_type = "image/png", body = dto::Bytes),
        (status = 304, description = "The picture is as it was"),
        (status = 404, body = dto::Problem, content_type = PROBLEM,
            description = "`job_not_found`, `output_not_found`"),
        (status = 416, body = dto::Problem, content_type = PROBLEM, description = "`range_not_satisfiable`"),
    ))]
pub async fn thumbnail(
    State(api): State<Api>,
    JobId(id): JobId,
    method: Method,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let (files, Job { status, .. }) = find(&api, id, &["thumbnail.png"]).await?;
    let file = FileAnswer { path: &files.thumbnail(), content_type: "image/png", download: None };
    file.send(&method, &headers).await?.ok_or_else(|| missing("thumbnail", status))
}

/// The last state of a job whose scene has `output.state`: an npz with `x`, `v` (n × d), `B`, `F` (n × d × d),
/// `plastic` and `body` (n) of all particles, in f64. Another job can begin with it (`start_from`, or `start` of a
/// scene once it is an asset).
#[utoipa::path(get, path = "/v1/jobs/{id}/state.npz", tag = "outputs", operation_id = "get_state",
    params(
        ("id" = Uuid, Path),
        ("Range" = Option<String>, Header, description = "One byte range"),
        ("If-Range" = Option<String>, Header, description = "`ETag` or `Last-Modified` that the range is of"),
        ("If-None-Match" = Option<String>, Header, description = "`ETag` of an earlier answer"),
    ),
    responses(
        (status = 200, content_type = "application/octet-stream", body = dto::Bytes, headers(("ETag" = String))),
        (status = 206, content_type = "application/octet-stream", body = dto::Bytes,
            headers(("ETag" = String), ("Content-Range" = String))),
        (status = 304, description = "The state is as it was"),
        (status = 404, body = dto::Problem, content_type = PROBLEM,
            description = "`job_not_found`, `output_not_found`"),
        (status = 416, body = dto::Problem, content_type = PROBLEM, description = "`range_not_satisfiable`"),
    ))]
pub async fn state(
    State(api): State<Api>,
    JobId(id): JobId,
    method: Method,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let (files, job) = find(&api, id, &[STATE]).await?;
    let name = format!("gridfall-{id}.state.npz");
    let file = FileAnswer { path: &files.state(), content_type: "application/octet-stream", download: Some(&name) };
    file.send(&method, &headers).await?.ok_or_else(|| missing("state", job.status))
}

/// Energies, momenta, mass and time steps, one row per frame. Of a running job: those so far.
#[utoipa::path(get, path = "/v1/jobs/{id}/diagnostics", tag = "outputs", operation_id = "get_diagnostics",
    params(("id" = Uuid, Path)),
    responses(
        (status = 200, body = Diagnostics),
        (status = 400, body = dto::Problem, content_type = PROBLEM, description = "`invalid_path`, `invalid_query`"),
        (status = 404, body = dto::Problem, content_type = PROBLEM,
            description = "`job_not_found`, `output_not_found`"),
    ))]
pub async fn diagnostics(
    State(api): State<Api>,
    JobId(id): JobId,
    Query(query): Query<DiagnosticsQuery>,
) -> Result<Response, Problem> {
    let per = query.per;
    match query.format {
        DiagnosticsFormat::Json => Ok(Json(Rows { rows: rows(&table(&api, id, per).await?) }).into_response()),
        DiagnosticsFormat::Csv => Ok(csv(table(&api, id, per).await?)),
    }
}

/// The same as CSV, with a line of names first.
#[utoipa::path(get, path = "/v1/jobs/{id}/diagnostics.csv", tag = "outputs", operation_id = "get_diagnostics_csv",
    params(("id" = Uuid, Path)),
    responses(
        (status = 200, body = String, content_type = "text/csv"),
        (status = 404, body = dto::Problem, content_type = PROBLEM,
            description = "`job_not_found`, `output_not_found`"),
    ))]
pub async fn diagnostics_csv(State(api): State<Api>, JobId(id): JobId) -> Result<Response, Problem> {
    Ok(csv(table(&api, id, DiagnosticsPer::Frame).await?))
}

/// How the implicit integrator fared, one row per step; none for an explicit run. Of a running job: those so far.
#[utoipa::path(get, path = "/v1/jobs/{id}/solver", tag = "outputs", operation_id = "get_solver",
    params(("id" = Uuid, Path)),
    responses(
        (status = 200, body = SolverSteps),
        (status = 404, body = dto::Problem, content_type = PROBLEM,
            description = "`job_not_found`, `output_not_found`"),
    ))]
pub async fn solver(State(api): State<Api>, JobId(id): JobId) -> Result<Response, Problem> {
    Ok(Json(Rows { rows: rows(&table(&api, id, DiagnosticsPer::Step).await?) }).into_response())
}

/// The same as CSV, with a line of names first.
#[utoipa::path(get, path = "/v1/jobs/{id}/solver.csv", tag = "outputs", operation_id = "get_solver_csv",
    params(("id" = Uuid, Path)),
    responses(
        (status = 200, body = String, content_type = "text/csv"),
        (status = 404, body = dto::Problem, content_type = PROBLEM,
            description = "`job_not_found`, `output_not_found`"),
    ))]
pub async fn solver_csv(State(api): State<Api>, JobId(id): JobId) -> Result<Response, Problem> {
    Ok(csv(table(&api, id, DiagnosticsPer::Step).await?))
}

/// What the diagnostics of a job come to so far, by column; empty where there are none yet.
pub(super) async fn summaries(api: &Api, job: &Job) -> Result<BTreeMap<String, Summary>, Problem> {
    api.data.fetch(job, &TABLES).await?;
    let path = api.data.job(job.id).attempt(job.attempt).diagnostics();
    let csv = found(tokio::fs::read_to_string(path).await)?.unwrap_or_default();
    Ok(Summary::of_columns(&csv[..csv.rfind('\n').map_or(0, |end| end + 1)]))
}

/// The lines that a job has written so far.
async fn table(api: &Api, id: Uuid, per: DiagnosticsPer) -> Result<String, Problem> {
    let (files, Job { status, .. }) = find(api, id, &TABLES).await?;
    let path = match per {
        DiagnosticsPer::Frame => files.diagnostics(),
        DiagnosticsPer::Step => files.solver(),
    };
    let csv = found(tokio::fs::read_to_string(path).await)?;
    let mut csv = csv.ok_or_else(|| missing("diagnostics", status))?;
    // A line that is still being written is not a row yet.
    csv.truncate(csv.rfind('\n').map_or(0, |end| end + 1));
    Ok(csv)
}

fn csv(lines: String) -> Response {
    ([(header::CONTENT_TYPE, "text/csv; charset=utf-8")], lines).into_response()
}

/// Converts a CSV of numbers and flags to JSON. Anything that is neither a flag nor a finite number
/// becomes null.
fn rows(csv: &str) -> Vec<serde_json::Value> {
    let mut lines = csv.lines();
    let columns: Vec<&str> = lines.next().unwrap_or_default().split(',').collect();
    lines
        .map(|line| {
            let cells = line.split(',').map(|cell| serde_json::from_str(cell).unwrap_or(serde_json::Value::Null));
            columns.iter().map(|column| column.to_string()).zip(cells).collect::<serde_json::Map<_, _>>().into()
        })
        .collect()
}

/// The files of a job that has started, those of these names among them if there are any.
pub(super) async fn find(api: &Api, id: Uuid, names: &[&str]) -> Result<(AttemptFiles, Job), Problem> {
    let job = api.store.get(id).await?.ok_or_else(|| Problem::job_not_found(id))?;
    if job.status == Status::Queued {
        return Err(missing("output", job.status));
    }
    api.data.fetch(&job, names).await?;
    let files = api.data.job(id).attempt(job.attempt);
    // What its last attempt has left on another machine without an end.
    if job.status.is_terminal() && api.data.objects().is_some() && files.partial_recording().exists() {
        jobs::complete(&api.data, &job).await?;
    }
    Ok((files, job))
}

pub(super) fn missing(what: &str, status: Status) -> Problem {
    let why = match status {
        Status::Queued => "the job waits in the queue",
        Status::Running => "the job has not come that far",
        Status::Succeeded | Status::Failed | Status::Canceled => "the job ended before there was one",
    };
    Problem::new(Code::OutputNotFound, format!("there is no {what}: {why}"))
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn rows_keep_whole_numbers_and_turn_what_is_no_number_into_null() {
        let csv = "frame,time_s,min_J\n0,0.0,inf\n18446744073709551615,0.5,-1e-9\n";
        assert_eq!(
            rows(csv),
            [
                json!({"frame": 0, "time_s": 0.0, "min_J": null}),
                json!({"frame": u64::MAX, "time_s": 0.5, "min_J": -1e-9}),
            ]
        );
        assert!(rows("").is_empty());
    }
}
