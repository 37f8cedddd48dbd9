//! Scenes: are they valid, what do they cost, and what may they contain?

use std::time::Instant;

use axum::Json;
use axum::extract::State;
use axum::http::header;
use axum::response::IntoResponse;
use tokio::sync::OwnedSemaphorePermit;
use tokio::time::timeout;

use super::dto::{self, SubmitJob, ValidScene};
use super::extract::{JsonBody, Room};
use super::openapi::PROBLEM;
use super::problem::{Code, Problem, internal};
use super::state::Api;
use crate::jobs::admission::{Admitted, admit};
use gridfall_scene::{self as scene, Limits};

/// Judges a scene without running it: what it costs, or all its faults. Takes the body of a submission.
#[utoipa::path(post, path = "/v1/scenes:validate", tag = "scenes", request_body = SubmitJob,
    responses(
        (status = 200, body = ValidScene),
        (status = 422, body = dto::Problem, content_type = PROBLEM,
            description = "`invalid_scene` with all its `faults`, `invalid_request`"),
    ))]
pub async fn validate(
    State(api): State<Api>,
    JsonBody(request, room): JsonBody<SubmitJob>,
) -> Result<Json<ValidScene>, Problem> {
    let judged = |Admitted { problem, .. }: Admitted| {
        let estimate = scene::estimate::estimate(&problem).into();
        let notices = problem.setup.notices.into_iter().map(dto::Notice::from).collect();
        ValidScene { valid: true, notices, estimate }
    };
    Ok(Json(judge(&api, request, room, judged).await?))
}

/// Waits for permission to check a scene; only a limited number is checked at a time.
pub async fn permit(api: &Api) -> Result<OwnedSemaphorePermit, Problem> {
    match timeout(api.config.validation_wait, api.validations.clone().acquire_owned()).await {
        Ok(permit) => permit.map_err(internal),
        Err(_) => Err(Problem::new(Code::Overloaded, "too many scenes wait to be judged").retry_after(10)),
    }
}

/// Checks the scene of a request off the runtime, a limited number at a time. Passes valid scenes
/// to `with`.
pub async fn judge<T: Send + 'static>(
    api: &Api,
    request: SubmitJob,
    room: Room,
    with: impl FnOnce(Admitted) -> T + Send + 'static,
) -> Result<T, Problem> {
    let permit = permit(api).await?;
    let limits = Limits { max_work: api.config.max_work, ..api.config.limits };
    let (assets, counters, span) = (api.data.assets(), api.worker.counters.clone(), tracing::Span::current());
    let judged = tokio::task::spawn_blocking(move || {
        // Held here and not by the request: a client that disconnects does not make the work
        // cheaper.
        let (_permit, _room) = (permit, room);
        let _span = span.entered();
        let started = Instant::now();
        let overrides: Vec<String> = request.overrides.iter().map(|(path, value)| format!("{path}={value}")).collect();
        let judged = admit(request.scene, &overrides, &limits, &assets);
        counters.stage("validate", started.elapsed());
        judged.map(with)
    });
    judged.await.map_err(internal)?.map_err(Problem::invalid_scene)
}

/// The JSON Schema of scenes.
#[utoipa::path(get, path = "/v1/schema/scene", tag = "scenes",
    responses((status = 200, body = Object, content_type = "application/schema+json")))]
pub async fn schema() -> impl IntoResponse {
    ([(header::CONTENT_TYPE, "application/schema+json")], scene::schema::json_schema())
}
