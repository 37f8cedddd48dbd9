//! Jobs: submit, run again, list, read, cancel, delete.

use axum::Json;
use axum::extract::State;
use axum::http::{HeaderMap, HeaderValue, Method, StatusCode, header};
use axum::response::{IntoResponse, Response};
use tokio::time::{Duration, Instant, timeout_at};
use uuid::Uuid;

use super::caller::Caller;
use super::conditional::Version;
use super::dto::{self, JobList, RerunJob, SubmitJob};
use super::extract::{JobId, JsonBody, Query};
use super::filters::ListJobs;
use super::health::require_space;
use super::openapi::PROBLEM;
use super::pages::Page;
use super::problem::{Code, Problem, internal};
use super::state::Api;
use super::submission::{accept, answer, finished, idempotency_key, prepare, sha256_hex};
use super::usage::require_rest;
use crate::store::{Deletion, Status};

/// Submits a scene. It is judged before it is accepted: all its faults come back at once.
#[utoipa::path(post, path = "/v1/jobs", tag = "jobs", operation_id = "submit_job",
    params(("Idempotency-Key" = Option<String>, Header,
        description = "1 to 255 printable characters of your choice. \
            A request repeated under the same key is accepted once.")),
    request_body = SubmitJob,
    responses(
        (status = 200, body = dto::Job, description = "A finished job that has the result already (`reuse`)",
            headers(("Location" = String, description = "Path of the job"))),
        (status = 202, body = dto::Job, description = "Accepted, or accepted before under the same idempotency key",
            headers(("Location" = String, description = "Path of the job"))),
        (status = 400, body = dto::Problem, content_type = PROBLEM,
            description = "`invalid_json`, `invalid_body`, `invalid_header`"),
        (status = 422, body = dto::Problem, content_type = PROBLEM,
            description = "`invalid_scene` with all its `faults`, `invalid_request`, `cost_exceeded`, \
                `idempotency_key_reused`"),
        (status = 507, body = dto::Problem, content_type = PROBLEM, description = "`disk_low`"),
        (status = 429, body = dto::Problem, content_type = PROBLEM, description = "`queue_full`",
            headers(("Retry-After" = u32, description = "Seconds"))),
    ))]
pub async fn submit(
    State(api): State<Api>,
    caller: Caller,
    headers: HeaderMap,
    JsonBody(request, room): JsonBody<SubmitJob>,
) -> Result<Response, Problem> {
    require_space(&api)?;
    require_rest(&api, &caller, 0).await?;
    let idempotency_key = idempotency_key(&headers)?;
    let reuse = request.reuse;
    let new = prepare(&api, &caller, request, room, idempotency_key).await?;
    if reuse && let Some(job) = finished(&api, &new).await? {
        return Ok(answer(StatusCode::OK, job));
    }
    accept(&api, &new).await
}

/// Runs the scene of a job again, as a new job.
#[utoipa::path(post, path = "/v1/jobs/{id}/rerun", tag = "jobs", operation_id = "rerun_job",
    params(("id" = Uuid, Path), ("Idempotency-Key" = Option<String>, Header,
        description = "1 to 255 printable characters of your choice. \
            A request repeated under the same key is accepted once.")),
    request_body = RerunJob,
    responses(
        (status = 202, body = dto::Job, headers(("Location" = String, description = "Path of the new job"))),
        (status = 422, body = dto::Problem, content_type = PROBLEM,
            description = "`invalid_scene` with all its `faults`, `invalid_request`, `cost_exceeded`, \
                `idempotency_key_reused`"),
        (status = 507, body = dto::Problem, content_type = PROBLEM, description = "`disk_low`"),
        (status = 429, body = dto::Problem, content_type = PROBLEM, description = "`queue_full`",
            headers(("Retry-After" = u32, description = "Seconds"))),
    ))]
pub async fn rerun(
    State(api): State<Api>,
    caller: Caller,
    JobId(id): JobId,
    headers: HeaderMap,
    JsonBody(request, room): JsonBody<RerunJob>,
) -> Result<Response, Problem> {
    require_space(&api)?;
    require_rest(&api, &caller, 0).await?;
    let idempotency_key = idempotency_key(&headers)?;
    let (job, scene) = (api.store.get(id).await?, api.store.scene(id).await?);
    let (Some(job), Some(scene)) = (job, scene) else { return Err(Problem::job_not_found(id)) };
    let RerunJob { start_from, name, overrides, tags, priority, deadline, max_cost } = request;
    let scene = serde_json::from_str(&scene).map_err(internal)?;
    let request = SubmitJob {
        scene: Some(scene),
        scene_id: None,
        start_from,
        name: name.or(Some(job.name)),
        overrides,
        tags: tags.unwrap_or(job.tags),
        priority: priority.or(Some(job.priority)),
        deadline,
        max_cost,
        reuse: false,
    };
    accept(&api, &prepare(&api, &caller, request, room, idempotency_key).await?).await
}

/// The scene that a job runs, with its overrides.
#[utoipa::path(get, path = "/v1/jobs/{id}/scene", tag = "jobs", operation_id = "get_job_scene",
    params(
        ("id" = Uuid, Path),
        ("If-None-Match" = Option<String>, Header, description = "`ETag` of an earlier answer"),
    ),
    responses(
        (status = 200, body = Object, headers(("ETag" = String))),
        (status = 304, description = "The client has it"),
    ))]
pub async fn scene(State(api): State<Api>, JobId(id): JobId, headers: HeaderMap) -> Result<Response, Problem> {
    let document = api.store.scene(id).await?.ok_or_else(|| Problem::job_not_found(id))?;
    let version = version(document.as_bytes());
    if let Some(answer) = version.judge(&Method::GET, &headers)? {
        return Ok(answer);
    }
    let mut answer = ([(header::CONTENT_TYPE, "application/json")], document).into_response();
    version.write(answer.headers_mut());
    Ok(answer)
}

/// Lists jobs, newest first.
#[utoipa::path(get, path = "/v1/jobs", tag = "jobs", operation_id = "list_jobs",
    params(ListJobs), responses((status = 200, body = JobList)))]
pub async fn list(
    State(api): State<Api>,
    caller: Caller,
    Query(query): Query<ListJobs>,
) -> Result<Json<JobList>, Problem> {
    let page = Page::of(query.limit, query.cursor.as_ref())?;
    let jobs = api.store.list(&query.filter(&caller), page.after, page.wanted()).await?;
    let (jobs, next_cursor) = page.cut(jobs, |job| job.seq);
    Ok(Json(JobList { jobs: jobs.into_iter().map(Into::into).collect(), next_cursor }))
}

/// A job as it stands. `ETag` and `If-None-Match` make looking again cheap.
#[utoipa::path(get, path = "/v1/jobs/{id}", tag = "jobs", operation_id = "get_job",
    params(
        ("id" = Uuid, Path),
        ("If-None-Match" = Option<String>, Header, description = "`ETag` of an earlier answer"),
        ("Prefer" = Option<String>, Header, description = "`wait=SECONDS`: answer when the job is no longer as in \
            `If-None-Match` or, without that, when it has ended; at the latest after so long, and after a minute"),
    ),
    responses(
        (status = 200, body = dto::Job, headers(("ETag" = String), ("Preference-Applied" = String))),
        (status = 304, description = "The job is as it was"),
    ))]
pub async fn get(State(api): State<Api>, JobId(id): JobId, headers: HeaderMap) -> Result<Response, Problem> {
    let wait = preferred_wait(&headers).map(|seconds| seconds.min(api.config.max_wait.as_secs()));
    let Some(seconds) = wait else { return now(&api, id, &headers).await.map(|(answer, _)| answer) };
    let until = Instant::now() + Duration::from_secs(seconds);
    let mut seen = api.watch(id).await?;
    loop {
        let (mut answer, ended) = now(&api, id, &headers).await?;
        // With a tag the client waits for any change, without one for the end.
        let changed = headers.contains_key(header::IF_NONE_MATCH) && answer.status() != StatusCode::NOT_MODIFIED;
        if ended || changed || timeout_at(until, seen.changed()).await.is_err() {
            let applied = HeaderValue::try_from(format!("wait={seconds}")).expect("digits are fit for a header");
            answer.headers_mut().insert("preference-applied", applied);
            return Ok(answer);
        }
    }
}

/// A job as it stands, and whether it has ended.
async fn now(api: &Api, id: Uuid, headers: &HeaderMap) -> Result<(Response, bool), Problem> {
    let job = api.store.get(id).await?.ok_or_else(|| Problem::job_not_found(id))?;
    let ended = job.status.is_terminal();
    let body = serde_json::to_vec(&dto::Job::from(job)).map_err(internal)?;
    let version = version(&body);
    if let Some(answer) = version.judge(&Method::GET, headers)? {
        return Ok((answer, ended));
    }
    let mut answer = ([(header::CONTENT_TYPE, "application/json")], body).into_response();
    version.write(answer.headers_mut());
    Ok((answer, ended))
}

/// The seconds of `Prefer: wait=N` (RFC 7240).
fn preferred_wait(headers: &HeaderMap) -> Option<u64> {
    let preferences = headers.get_all("prefer").iter().filter_map(|value| value.to_str().ok());
    preferences.flat_map(|list| list.split([',', ';'])).find_map(|one| one.trim().strip_prefix("wait=")?.parse().ok())
}

/// The version of a job that an answer shows.
pub(super) fn version(body: &[u8]) -> Version {
    Version::of_tag(format!("\"{}\"", &sha256_hex(body)[..32]))
}

/// Fails if the client has decided on another version of the job than it has now.
async fn require(api: &Api, id: Uuid, headers: &HeaderMap) -> Result<(), Problem> {
    if headers.contains_key(header::IF_MATCH) {
        let job = api.store.get(id).await?.ok_or_else(|| Problem::job_not_found(id))?;
        version(&serde_json::to_vec(&dto::Job::from(job)).map_err(internal)?).require(headers)?;
    }
    Ok(())
}

/// Cancels a job. A queued one ends at once; a running one stops within about a second and keeps its recording so far;
/// nothing happens to one that has ended.
#[utoipa::path(post, path = "/v1/jobs/{id}/cancel", tag = "jobs", operation_id = "cancel_job",
    params(
        ("id" = Uuid, Path),
        ("If-Match" = Option<String>, Header, description = "`ETag` of the version to cancel; 412 for another one"),
    ),
    responses(
    (status = 412, body = dto::Problem, content_type = PROBLEM, description = "`precondition_failed`"),
    (status = 200, body = dto::Job, description = "The job has ended"),
    (status = 202, body = dto::Job, description = "The job is running and will stop"),
))]
pub async fn cancel(
    State(api): State<Api>,
    JobId(id): JobId,
    headers: HeaderMap,
) -> Result<(StatusCode, Json<dto::Job>), Problem> {
    require(&api, id, &headers).await?;
    let job = api.store.cancel(id).await?.ok_or_else(|| Problem::job_not_found(id))?;
    let status = if job.status.is_terminal() { StatusCode::OK } else { StatusCode::ACCEPTED };
    Ok((status, Json(job.into())))
}

/// Deletes a job that has ended, and its files. Cancel a queued or running one first.
#[utoipa::path(delete, path = "/v1/jobs/{id}", tag = "jobs", operation_id = "delete_job",
    params(
        ("id" = Uuid, Path),
        ("If-Match" = Option<String>, Header, description = "`ETag` of the version to delete; 412 for another one"),
    ),
    responses(
    (status = 412, body = dto::Problem, content_type = PROBLEM, description = "`precondition_failed`"),
    (status = 204, description = "The job and its files are gone"),
    (status = 409, body = dto::Problem, content_type = PROBLEM, description = "`job_not_finished`"),
))]
pub async fn delete(State(api): State<Api>, JobId(id): JobId, headers: HeaderMap) -> Result<StatusCode, Problem> {
    require(&api, id, &headers).await?;
    match api.store.delete(id).await? {
        Deletion::Deleted => {
            api.data.remove(id).await?;
            Ok(StatusCode::NO_CONTENT)
        }
        Deletion::NotFound => Err(Problem::job_not_found(id)),
        Deletion::NotFinished(status) => {
            let state = if status == Status::Queued { "waits" } else { "runs" };
            let detail = format!("the job {state}; cancel it first (POST /v1/jobs/{id}/cancel)");
            Err(Problem::new(Code::JobNotFinished, detail))
        }
    }
}
