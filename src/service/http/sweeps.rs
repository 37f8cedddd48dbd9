//! Sweeps: one scene with many values, submitted as one.

use std::collections::BTreeMap;

use axum::Json;
use axum::extract::State;
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use jiff::Timestamp;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use utoipa::{IntoParams, ToSchema};
use uuid::Uuid;

use super::caller::Caller;
use super::dto::{self, SubmitJob};
use super::extract::{JobId, JsonBody, Query, Room};
use super::health::require_space;
use super::openapi::PROBLEM;
use super::outputs::summaries;
use super::pages::Page;
use super::problem::{Code, Problem, internal};
use super::state::Api;
use super::submission::{accepted, affordable, idempotency_key, prepare, sha256_hex, valid_max_cost, valid_name};
use super::tables::Summary;
use super::usage::require_rest;
use crate::store::{self, Filter, NewJob, NewSweep, Status};

/// Most jobs of a sweep.
const MAX_JOBS: usize = 256;

/// A request to run a scene with many values: each of `list` with each combination of `grid`.
#[derive(Debug, Deserialize, Serialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct SubmitSweep {
    /// The scene document; its JSON Schema is at `/v1/schema/scene`.
    #[schema(value_type = Option<dto::Scene>)]
    pub scene: Option<Value>,
    /// Instead of `scene`: the id of one that was kept (`POST /v1/scenes`).
    pub scene_id: Option<String>,
    /// Name of the sweep, and the beginning of its jobs' names; the scene's by default.
    #[schema(max_length = 200)]
    pub name: Option<String>,
    /// Values that replace those of the scene in all jobs, by path.
    #[serde(default)]
    pub overrides: BTreeMap<String, Value>,
    /// Values to combine, by path.
    #[serde(default)]
    #[schema(example = json!({"solver.cfl": [0.3, 0.5], "solver.kernel": ["compact", "quadratic"]}))]
    pub grid: BTreeMap<String, Vec<Value>>,
    /// Overrides to run one after the other.
    #[serde(default)]
    pub list: Vec<BTreeMap<String, Value>>,
    /// Words to find the jobs by: at most 16, of 1 to 64 characters, without commas.
    #[serde(default)]
    #[schema(max_items = 16)]
    pub tags: Vec<String>,
    /// Jobs of a higher priority run first; 0 by default.
    #[schema(minimum = -1000, maximum = 1000)]
    pub priority: Option<i64>,
    /// When a job must have been started; otherwise it fails with the code `deadline`.
    pub deadline: Option<Timestamp>,
    /// Largest estimated wall time (s) of all jobs together that is accepted.
    pub max_cost: Option<f64>,
}

/// Jobs that were submitted as one.
#[derive(Debug, Serialize, ToSchema)]
pub struct Sweep {
    pub id: Uuid,
    pub name: String,
    pub created_at: Timestamp,
    /// Number of jobs.
    pub total: u64,
    /// Number of jobs by status. Jobs that were deleted no longer count.
    pub jobs: BTreeMap<&'static str, u64>,
    /// Share of the simulated time that is done, 0 to 1.
    pub fraction: f64,
    /// True once all jobs have ended.
    pub ended: bool,
}

impl From<store::Sweep> for Sweep {
    fn from(sweep: store::Sweep) -> Self {
        let ended = sweep.has_ended();
        let store::Sweep { id, name, created_at, jobs, fraction } = sweep;
        Self { id, name, created_at, total: jobs.values().sum(), jobs, fraction, ended }
    }
}

/// A page of sweeps, newest first.
#[derive(Debug, Serialize, ToSchema)]
pub struct SweepList {
    pub sweeps: Vec<Sweep>,
    /// Asks for the next page; null on the last one.
    #[schema(required)]
    pub next_cursor: Option<String>,
}

/// Which sweeps to list.
#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub struct ListSweeps {
    /// Sweeps a page; 50 by default.
    #[param(minimum = 1, maximum = 200)]
    pub limit: Option<i64>,
    /// `next_cursor` of the page before.
    pub cursor: Option<String>,
}

/// A sweep found valid, and what it costs.
#[derive(Debug, Serialize, ToSchema)]
pub struct ValidSweep {
    pub valid: bool,
    /// Estimated wall time of all jobs together, one after the other, on two cores of a server (s).
    pub estimate_s: f64,
    /// All jobs, in their order.
    pub jobs: Vec<ValidSweepJob>,
}

/// A job that a sweep would have.
#[derive(Debug, Serialize, ToSchema)]
pub struct ValidSweepJob {
    pub name: String,
    /// What takes the place of the scene's values, by path.
    #[schema(value_type = Object)]
    pub values: BTreeMap<String, Value>,
    pub particles: u64,
    /// Estimated wall time on two cores of a server (s).
    pub estimate_s: f64,
}

/// What the jobs of a sweep have come to.
#[derive(Debug, Serialize, ToSchema)]
pub struct SweepResults {
    /// All jobs, in the order of the values.
    pub jobs: Vec<SweepResult>,
}

/// What a job of a sweep has come to.
#[derive(Debug, Serialize, ToSchema)]
pub struct SweepResult {
    pub id: Uuid,
    pub name: String,
    pub status: Status,
    /// What took the place of the scene's values, by path.
    #[schema(value_type = Object)]
    pub values: BTreeMap<String, Value>,
    pub progress: dto::Progress,
    /// Wall time of the run so far (s), without the time to load the scene.
    pub run_s: f64,
    /// Of each column of the job's diagnostics so far; empty before its first frame.
    pub diagnostics: BTreeMap<String, Summary>,
}

/// Submits a scene with many values. All jobs are judged first, and all are accepted or none.
#[utoipa::path(post, path = "/v1/sweeps", tag = "sweeps", request_body = SubmitSweep, params(
    ("Idempotency-Key" = Option<String>, Header,
        description = "1 to 255 printable characters of your choice. \
            A request repeated under the same key is accepted once."),
), responses(
    (status = 202, body = Sweep, headers(("Location" = String, description = "Path of the sweep"))),
    (status = 422, body = dto::Problem, content_type = PROBLEM,
        description = "`invalid_scene` with all `faults` of the first job that has some, `invalid_request`, \
            `cost_exceeded`, `idempotency_key_reused`"),
    (status = 507, body = dto::Problem, content_type = PROBLEM, description = "`disk_low`"),
    (status = 429, body = dto::Problem, content_type = PROBLEM, description = "`queue_full`",
        headers(("Retry-After" = u32, description = "Seconds"))),
))]
pub async fn submit_sweep(
    State(api): State<Api>,
    caller: Caller,
    headers: HeaderMap,
    JsonBody(request, _room): JsonBody<SubmitSweep>,
) -> Result<Response, Problem> {
    require_space(&api)?;
    require_rest(&api, &caller, 0).await?;
    let idempotency_key = idempotency_key(&headers)?;
    let request_sha256 = sha256_hex(&serde_json::to_vec(&request).map_err(internal)?);
    let (name, jobs) = judged(&api, &caller, &request).await?;
    let new = NewSweep { owner: caller.owner(), name, jobs, idempotency_key, request_sha256 };
    let sweep = accepted(&api, api.store.submit_sweep(&new, api.config.max_queued).await?)?;
    let location = format!("/v1/sweeps/{sweep}");
    Ok((StatusCode::ACCEPTED, [(header::LOCATION, location)], Json(found(&api, sweep).await?)).into_response())
}

/// Judges a sweep without running it: what its jobs cost together, or all faults of the first job that has some.
/// Takes the body of a submission.
#[utoipa::path(post, path = "/v1/sweeps:validate", tag = "sweeps", request_body = SubmitSweep, responses(
    (status = 200, body = ValidSweep),
    (status = 422, body = dto::Problem, content_type = PROBLEM,
        description = "`invalid_scene` with all `faults` of the first job that has some, `invalid_request`, \
            `cost_exceeded`"),
))]
pub async fn validate_sweep(
    State(api): State<Api>,
    caller: Caller,
    JsonBody(request, _room): JsonBody<SubmitSweep>,
) -> Result<Json<ValidSweep>, Problem> {
    let (_, jobs) = judged(&api, &caller, &request).await?;
    let job = |job: NewJob| ValidSweepJob {
        name: job.name,
        values: job.sweep_values,
        particles: job.particles,
        estimate_s: job.estimate_s.unwrap_or(0.0),
    };
    let jobs: Vec<ValidSweepJob> = jobs.into_iter().map(job).collect();
    Ok(Json(ValidSweep { valid: true, estimate_s: jobs.iter().map(|job| job.estimate_s).sum(), jobs }))
}

/// The name of a sweep, and its jobs.
async fn judged(api: &Api, caller: &Caller, request: &SubmitSweep) -> Result<(String, Vec<NewJob>), Problem> {
    let name = request.name.clone().or_else(|| request.scene.as_ref()?["name"].as_str().map(str::to_owned));
    let name = valid_name(name.unwrap_or_else(|| "sweep".into()))?;
    let combinations = combinations(request)?;
    let max_cost = valid_max_cost(request.max_cost)?;
    let (mut jobs, mut estimate_s) = (Vec::new(), 0.0);
    for (i, values) in combinations.iter().enumerate() {
        let values_text: Vec<String> = values.iter().map(|(path, value)| format!("{path}={value}")).collect();
        let label = format!("{name} {}", values_text.join(" "));
        let overrides = request.overrides.iter().chain(values.iter().copied());
        let job = SubmitJob {
            start_from: None,
            scene: request.scene.clone(),
            scene_id: request.scene_id.clone(),
            name: Some(label.chars().filter(|c| !c.is_control()).take(200).collect::<String>().trim().to_owned()),
            overrides: overrides.map(|(path, value)| (path.clone(), value.clone())).collect(),
            tags: request.tags.clone(),
            priority: request.priority,
            deadline: request.deadline,
            max_cost: None,
            reuse: false,
        };
        let of = format!("job {} of {} ({})", i + 1, combinations.len(), values_text.join(", "));
        let mut job = prepare(api, caller, job, Room::default(), None).await.map_err(|problem| problem.of(&of))?;
        estimate_s += job.estimate_s.unwrap_or(0.0);
        affordable(estimate_s, max_cost)?;
        job.sweep_values = values.iter().map(|(path, value)| ((*path).clone(), (*value).clone())).collect();
        jobs.push(job);
    }
    Ok((name, jobs))
}

type Values<'a> = Vec<(&'a String, &'a Value)>;

/// The overrides of each job.
fn combinations(request: &SubmitSweep) -> Result<Vec<Values<'_>>, Problem> {
    let mut all: Vec<Values> = match request.list.as_slice() {
        [] => vec![Vec::new()],
        list => list.iter().map(|overrides| overrides.iter().collect()).collect(),
    };
    let many = |n: usize| {
        let detail = format!("/grid, /list: {n} jobs; a sweep has at most {MAX_JOBS}. Split it");
        Err(Problem::new(Code::InvalidRequest, detail))
    };
    for (path, values) in &request.grid {
        let n = all.len() * values.len();
        if n > MAX_JOBS {
            return many(n);
        }
        all = all.iter().flat_map(|rest| values.iter().map(|value| [&rest[..], &[(path, value)]].concat())).collect();
    }
    match all.len() {
        0 => Err(Problem::new(Code::InvalidRequest, "/grid: a path has no values; give some or leave it out")),
        n if n > MAX_JOBS => many(n),
        1 if all[0].is_empty() => Err(Problem::new(Code::InvalidRequest, "/grid: give values here or in /list")),
        _ => Ok(all),
    }
}

/// Lists sweeps, newest first. Those whose jobs were all deleted are left out.
#[utoipa::path(get, path = "/v1/sweeps", tag = "sweeps", params(ListSweeps), responses(
    (status = 200, body = SweepList),
    (status = 400, body = dto::Problem, content_type = PROBLEM, description = "`invalid_query`"),
))]
pub async fn list_sweeps(
    State(api): State<Api>,
    caller: Caller,
    Query(query): Query<ListSweeps>,
) -> Result<Json<SweepList>, Problem> {
    let page = Page::of(query.limit, query.cursor.as_ref())?;
    let sweeps = api.store.sweeps(caller.confined_to(), page.after, page.wanted()).await?;
    let (sweeps, next_cursor) = page.cut(sweeps, |sweep| sweep.id);
    Ok(Json(SweepList { sweeps: sweeps.into_iter().map(Sweep::from).collect(), next_cursor }))
}

/// A sweep as it stands. `GET /v1/jobs?sweep={id}` lists its jobs.
#[utoipa::path(get, path = "/v1/sweeps/{id}", tag = "sweeps", params(("id" = Uuid, Path)), responses(
    (status = 200, body = Sweep),
    (status = 404, body = dto::Problem, content_type = PROBLEM, description = "`sweep_not_found`"),
))]
pub async fn get_sweep(State(api): State<Api>, JobId(id): JobId) -> Result<Json<Sweep>, Problem> {
    Ok(Json(found(&api, id).await?))
}

/// What the jobs of a sweep have come to, for tables and plots over its values.
#[utoipa::path(get, path = "/v1/sweeps/{id}/results", tag = "sweeps", operation_id = "get_sweep_results",
    params(("id" = Uuid, Path)),
    responses(
        (status = 200, body = SweepResults),
        (status = 404, body = dto::Problem, content_type = PROBLEM, description = "`sweep_not_found`"),
    ))]
pub async fn results(State(api): State<Api>, JobId(id): JobId) -> Result<Json<SweepResults>, Problem> {
    found(&api, id).await?;
    let jobs = api.store.list(&Filter { sweep: Some(id), ..Filter::default() }, None, MAX_JOBS as i64).await?;
    let mut results = Vec::with_capacity(jobs.len());
    // The newest is the last that was submitted.
    for job in jobs.into_iter().rev() {
        let diagnostics = summaries(&api, &job).await?;
        let progress = dto::Progress::new(&job);
        let store::Job { id, name, status, sweep_values: values, progress: store::Progress { run_s, .. }, .. } = job;
        results.push(SweepResult { id, name, status, values, progress, run_s, diagnostics });
    }
    Ok(Json(SweepResults { jobs: results }))
}

/// Cancels all jobs of a sweep.
#[utoipa::path(post, path = "/v1/sweeps/{id}/cancel", tag = "sweeps", params(("id" = Uuid, Path)), responses(
    (status = 200, body = Sweep, description = "All jobs have ended"),
    (status = 202, body = Sweep, description = "A job is running and will stop"),
    (status = 404, body = dto::Problem, content_type = PROBLEM, description = "`sweep_not_found`"),
))]
pub async fn cancel_sweep(State(api): State<Api>, JobId(id): JobId) -> Result<(StatusCode, Json<Sweep>), Problem> {
    found(&api, id).await?;
    api.store.cancel_all(&Filter { sweep: Some(id), ..Filter::default() }).await?;
    let sweep = found(&api, id).await?;
    Ok((if sweep.ended { StatusCode::OK } else { StatusCode::ACCEPTED }, Json(sweep)))
}

async fn found(api: &Api, id: Uuid) -> Result<Sweep, Problem> {
    let sweep = api.store.sweep(id).await?;
    sweep.map(Sweep::from).ok_or_else(|| Problem::sweep_not_found(id))
}
