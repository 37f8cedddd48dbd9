//! Scenes: are they valid, what do they cost, and what may they contain?

use std::io;
use std::time::Instant;

use axum::Json;
use axum::extract::State;
use axum::http::{HeaderMap, Method, StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde_json::{Value, json};
use tokio::sync::{OwnedSemaphorePermit, oneshot};
use tokio::time::timeout;
use uuid::Uuid;

use super::caller::Caller;
use super::conditional::Version;
use super::dto::{self, KeepScene, KeptScene, SceneList, SubmitJob, ValidScene};
use super::extract::{AssetBody, AssetId, JsonBody, Room};
use super::health::require_space;
use super::holdings::{Holdings, hold};
use super::openapi::PROBLEM;
use super::outputs::STATE;
use super::problem::{Code, Problem, internal};
use super::state::Api;
use super::submission::check_wishes;
use super::usage::{require_particles, require_rest};
use crate::jobs::admission::{Admitted, admit};
use crate::store::{Status, Upload};
use gridfall_recording::embedded;
use gridfall_scene::{self as scene, Limits};

/// Judges a scene without running it: what it costs, or all its faults. Takes the body of a submission.
#[utoipa::path(post, path = "/v1/scenes:validate", tag = "scenes", operation_id = "validate_scene",
    request_body = SubmitJob,
    responses(
        (status = 200, body = ValidScene),
        (status = 422, body = dto::Problem, content_type = PROBLEM,
            description = "`invalid_scene` with all its `faults`, `invalid_request`"),
    ))]
pub async fn validate(
    State(api): State<Api>,
    caller: Caller,
    JsonBody(request, room): JsonBody<SubmitJob>,
) -> Result<Json<ValidScene>, Problem> {
    check_wishes(&request)?;
    let judged = |Admitted { problem, .. }: Admitted| {
        let particles = problem.setup.total_particles() as u64;
        let estimate = scene::estimate::estimate(&problem).into();
        let notices = problem.setup.notices.into_iter().map(dto::Notice::from).collect();
        (ValidScene { valid: true, notices, estimate }, particles)
    };
    let (valid, particles) = judge(&api, &caller, request, room, judged).await?;
    require_particles(&caller, particles)?;
    Ok(Json(valid))
}

/// Waits for permission to check a scene; only a limited number is checked at a time.
async fn permit(api: &Api) -> Result<OwnedSemaphorePermit, Problem> {
    match timeout(api.config.validation_wait, api.validations.clone().acquire_owned()).await {
        Ok(permit) => permit.map_err(internal),
        Err(_) => Err(Problem::new(Code::Overloaded, "too many scenes wait to be judged").retry_after(10)),
    }
}

/// Checks the scene of a request off the runtime, a limited number at a time. Passes valid scenes
/// to `with`.
pub async fn judge<T: Send + 'static>(
    api: &Api,
    caller: &Caller,
    request: SubmitJob,
    room: Room,
    with: impl FnOnce(Admitted) -> T + Send + 'static,
) -> Result<T, Problem> {
    let start = match request.start_from {
        Some(id) => Some(last_state(api, caller, id).await?),
        None => None,
    };
    let limits = Limits { max_work: api.config.max_work, ..api.config.limits };
    let (own, counters, span) = (Holdings::of(api, caller), api.worker.counters.clone(), tracing::Span::current());
    let judged = move || {
        let started = Instant::now();
        let overrides: Vec<String> = request.overrides.iter().map(|(path, value)| format!("{path}={value}")).collect();
        let mut document = document(request.scene, request.scene_id, &own)?;
        if let Some(asset) = start {
            begin_with(&mut document, &asset);
        }
        let judged = admit(document, &overrides, &limits, &own).map(with);
        counters.stage("validate", started.elapsed());
        judged.map_err(Problem::invalid_scene)
    };
    by_judges(api, room, move || {
        let _span = span.entered();
        judged()
    })
    .await?
}

/// Does work on the threads that judge scenes, a limited number of pieces at a time.
pub async fn by_judges<T: Send + 'static>(
    api: &Api,
    room: Room,
    work: impl FnOnce() -> T + Send + 'static,
) -> Result<T, Problem> {
    let permit = permit(api).await?;
    let (answer, answered) = oneshot::channel();
    // All of it on these threads: what is computed elsewhere waits for threads that a simulation keeps busy.
    api.judges.spawn(move || {
        // Held here and not by the request: a client that disconnects does not make the work
        // cheaper.
        let (_permit, _room) = (permit, room);
        // A client that has left needs no answer.
        let _ = answer.send(work());
    });
    // Without an answer where a judge panicked, which its log tells.
    answered.await.map_err(internal)
}

/// Makes the last state of a job an asset, and returns its id.
async fn last_state(api: &Api, caller: &Caller, id: Uuid) -> Result<String, Problem> {
    let refused = |why: &str| Problem::new(Code::InvalidRequest, format!("/start_from: {why}"));
    let job = if api.may_see_job(caller, id).await? { api.store.get(id).await? } else { None };
    let job = job.ok_or_else(|| refused(&format!("there is no job {id}")))?;
    api.data.fetch(&job, &[STATE]).await?;
    let (state, assets) = (api.data.job(id).attempt(job.attempt).state(), api.data.assets());
    if job.status != Status::Succeeded || !state.exists() {
        return Err(refused(&format!(
            "the job {id} left no state; run its scene with \"output\": {{\"state\": true}} to the end first"
        )));
    }
    let kept = tokio::task::spawn_blocking(move || assets.keep(&state, "npz")).await.map_err(internal)?;
    let (asset, new) = kept?;
    hold(api, caller, (Upload::Asset, &asset.id, asset.bytes), new).await?;
    Ok(asset.id)
}

/// Makes a state the one that a scene begins with.
fn begin_with(document: &mut Value, asset: &str) {
    // In place of an earlier job's, when a job is run again.
    if let Some(scene) = document.as_object_mut() {
        scene.insert("start".into(), json!({ "asset": asset }));
    }
}

/// The scene that a request has or names.
fn document(scene: Option<Value>, id: Option<String>, own: &Holdings) -> Result<Value, Problem> {
    match (scene, id) {
        (Some(scene), None) => Ok(scene),
        (None, Some(id)) => {
            let missing = || {
                let detail = format!("/scene_id: there is no scene {id}; keep it with POST /v1/scenes first");
                Problem::new(Code::InvalidRequest, detail)
            };
            serde_json::from_str(&own.scene(&id)?.ok_or_else(missing)?).map_err(internal)
        }
        _ => {
            Err(Problem::new(Code::InvalidRequest, "give one of `scene`, a document, and `scene_id`, one that is kept"))
        }
    }
}

/// Keeps a scene, to be run by its id as often as wanted. It is judged like one that is submitted.
/// The same scene twice is one.
#[utoipa::path(post, path = "/v1/scenes", tag = "scenes", operation_id = "keep_scene", request_body = KeepScene,
    responses(
        (status = 200, body = KeptScene, description = "It was there already"),
        (status = 201, body = KeptScene, description = "Kept",
            headers(("Location" = String, description = "Path of the scene"))),
        (status = 422, body = dto::Problem, content_type = PROBLEM,
            description = "`invalid_scene` with all its `faults`, `invalid_request`"),
        (status = 507, body = dto::Problem, content_type = PROBLEM, description = "`disk_low`"),
    ))]
pub async fn keep(
    State(api): State<Api>,
    caller: Caller,
    JsonBody(KeepScene { scene }, room): JsonBody<KeepScene>,
) -> Result<Response, Problem> {
    require_space(&api)?;
    keep_judged(&api, &caller, scene, room).await
}

/// Keeps the scene that a recording carries, to be run again. The beginning of the recording is enough: its first MiB,
/// unless the scene is longer. It is judged like one that is submitted.
#[utoipa::path(put, path = "/v1/scenes", tag = "scenes", operation_id = "keep_scene_of_recording",
    request_body(content = dto::Bytes, content_type = "application/octet-stream"),
    responses(
        (status = 200, body = KeptScene, description = "It was there already"),
        (status = 201, body = KeptScene, description = "Kept",
            headers(("Location" = String, description = "Path of the scene"))),
        (status = 422, body = dto::Problem, content_type = PROBLEM,
            description = "`invalid_recording`; `invalid_scene` with all its `faults`"),
        (status = 507, body = dto::Problem, content_type = PROBLEM, description = "`disk_low`"),
    ))]
pub async fn keep_of_recording(
    State(api): State<Api>,
    caller: Caller,
    AssetBody(bytes, room): AssetBody,
) -> Result<Response, Problem> {
    require_space(&api)?;
    let refused = |reason: String| Problem::new(Code::InvalidRecording, reason);
    let text = embedded::scene(&bytes).map_err(refused)?;
    let scene = serde_json::from_str(&text).map_err(|error| refused(format!("its scene is no JSON: {error}")))?;
    keep_judged(&api, &caller, scene, room).await
}

async fn keep_judged(api: &Api, caller: &Caller, scene: Value, room: Room) -> Result<Response, Problem> {
    let bytes = scene.to_string().len() as u64;
    let request = SubmitJob { scene: Some(scene), ..SubmitJob::default() };
    let files = api.data.scenes();
    require_rest(api, caller, bytes).await?;
    let kept = judge(api, caller, request, room, move |admitted| {
        let (id, new) = files.put(&admitted.document)?;
        let particles = admitted.problem.setup.total_particles() as u64;
        io::Result::Ok((KeptScene { id, name: admitted.scene.name, particles }, new))
    });
    let (scene, new) = kept.await??;
    let new = hold(api, caller, (Upload::Scene, &scene.id, bytes), new).await?;
    let status = if new { StatusCode::CREATED } else { StatusCode::OK };
    let location = format!("/v1/scenes/{}", scene.id);
    Ok((status, [(header::LOCATION, location)], Json(scene)).into_response())
}

/// Lists the scenes that are kept, by id.
#[utoipa::path(get, path = "/v1/scenes", tag = "scenes", operation_id = "list_scenes",
    responses((status = 200, body = SceneList)))]
pub async fn list(State(api): State<Api>, caller: Caller) -> Result<Json<SceneList>, Problem> {
    if let Some(key) = caller.confined_to() {
        return Ok(Json(SceneList { ids: api.store.held(key, Upload::Scene).await? }));
    }
    let files = api.data.scenes();
    let ids = tokio::task::spawn_blocking(move || files.list()).await.map_err(internal)??;
    Ok(Json(SceneList { ids }))
}

/// The document of a scene that is kept.
#[utoipa::path(get, path = "/v1/scenes/{id}", tag = "scenes", operation_id = "get_scene",
    params(
        ("id" = String, Path, description = "`sha256:` and 64 hexadecimal digits"),
        ("If-None-Match" = Option<String>, Header, description = "`ETag` of an earlier answer"),
    ),
    responses(
        (status = 200, body = Object, headers(("ETag" = String))),
        (status = 304, description = "The client has it"),
    ))]
pub async fn get(State(api): State<Api>, AssetId(id): AssetId, headers: HeaderMap) -> Result<Response, Problem> {
    let (files, wanted) = (api.data.scenes(), id.to_ascii_lowercase());
    let found = tokio::task::spawn_blocking(move || files.get(&wanted)).await.map_err(internal)??;
    let document = found.ok_or_else(|| Problem::scene_not_found(&id))?;
    let version = Version::of_tag(format!("\"{id}\""));
    if let Some(answer) = version.judge(&Method::GET, &headers)? {
        return Ok(answer);
    }
    let mut answer = ([(header::CONTENT_TYPE, "application/json")], document).into_response();
    version.write(answer.headers_mut());
    Ok(answer)
}

/// The JSON Schema of scenes.
#[utoipa::path(get, path = "/v1/schema/scene", tag = "scenes", operation_id = "get_scene_schema",
    responses((status = 200, body = Object, content_type = "application/schema+json")))]
pub async fn schema() -> impl IntoResponse {
    ([(header::CONTENT_TYPE, "application/schema+json")], scene::contract::json_schema())
}
