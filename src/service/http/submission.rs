//! From a request to a job that the store accepts.

use std::collections::BTreeMap;

use axum::Json;
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use sha2::{Digest, Sha256};

use super::caller::Caller;
use super::dto::{self, SubmitJob};
use super::extract::Room;
use super::problem::{Code, Problem, internal};
use super::scenes::judge;
use super::state::Api;
use super::usage::require_particles;
use crate::jobs::DeviceState;
use crate::jobs::admission::Admitted;
use crate::store::{Job, NewJob, Submission};
use gridfall_core::sim::settings::Integrator;
use gridfall_scene::{estimate, hidden};

const MAX_NAME_CHARS: usize = 200;
const MAX_TAGS: usize = 16;
const MAX_TAG_CHARS: usize = 64;
const MAX_PRIORITY: i64 = 1000;

/// Judges a request and turns it into a job.
pub async fn prepare(
    api: &Api,
    caller: &Caller,
    request: SubmitJob,
    room: Room,
    idempotency_key: Option<String>,
) -> Result<NewJob, Problem> {
    let owner = caller.owner();
    let request_sha256 = sha256_hex(&serde_json::to_vec(&request).map_err(internal)?);
    let name = request.name.clone().map(valid_name).transpose()?;
    let tags = valid_tags(request.tags.clone())?;
    let priority = valid_priority(request.priority)?;
    let (deadline, max_cost) = (request.deadline, valid_max_cost(request.max_cost)?);
    let new = judge(api, caller, request, room, move |admitted| {
        let estimate_s = estimate_s(&admitted);
        let Admitted { document, scene, problem } = admitted;
        NewJob {
            owner,
            name: name.unwrap_or(scene.name),
            tags,
            priority,
            deadline,
            estimate_s: Some(estimate_s),
            scene_sha256: sha256_hex(document.as_bytes()),
            scene: document,
            particles: problem.setup.total_particles() as u64,
            frames: u64::from(problem.setup.frames) + 1,
            end_time_s: f64::from(problem.setup.frames) * problem.setup.frame_s,
            integrator: problem.setup.integrator.name().into(),
            integrator_reason: problem.setup.integrator_reason,
            notices: problem.setup.notices,
            sweep_values: BTreeMap::new(),
            idempotency_key,
            request_sha256,
        }
    })
    .await?;
    require_particles(caller, new.particles)?;
    affordable(new.estimate_s.unwrap_or(0.0), max_cost)?;
    Ok(new)
}

/// Judges all of a request but its scene.
pub fn check_wishes(request: &SubmitJob) -> Result<(), Problem> {
    request.name.clone().map(valid_name).transpose()?;
    valid_tags(request.tags.clone())?;
    valid_priority(request.priority)?;
    valid_max_cost(request.max_cost)?;
    Ok(())
}

/// Refuses what is estimated to take longer than allowed.
pub fn affordable(estimate_s: f64, max_cost: Option<f64>) -> Result<(), Problem> {
    match max_cost {
        Some(max) if estimate_s > max => {
            let detail = format!(
                "/max_cost: the run is estimated to take {estimate_s:.3} s, and {max} s are allowed; allow more, or \
                 coarsen or shorten the scene"
            );
            Err(Problem::new(Code::CostExceeded, detail))
        }
        _ => Ok(()),
    }
}

/// Puts a job into the queue and answers.
pub async fn accept(api: &Api, new: &NewJob) -> Result<Response, Problem> {
    let job = accepted(api, api.store.submit(new, api.config.max_queued).await?)?;
    Ok(answer(StatusCode::ACCEPTED, job))
}

/// What became of a submission, for the worker and the client.
pub fn accepted<T>(api: &Api, submission: Submission<T>) -> Result<T, Problem> {
    match submission {
        Submission::Accepted(new) | Submission::Repeated(new) => {
            api.worker.wake();
            Ok(new)
        }
        Submission::KeyReused => Err(Problem::new(
            Code::IdempotencyKeyReused,
            "a different request was accepted under this Idempotency-Key; take a new key",
        )),
        Submission::QueueFull => {
            let most = api.config.max_queued;
            let detail = format!("{most} jobs may wait, and there is no room for more; try again later");
            Err(Problem::new(Code::QueueFull, detail).retry_after(30))
        }
        Submission::OwnerFull(most) => {
            let detail = format!(
                "{most} jobs of this key may wait (its quota `queued`), and there is no room for more; try again \
                 later, cancel some, or ask for a larger quota"
            );
            Err(Problem::new(Code::QueueFull, detail).retry_after(30))
        }
    }
}

pub fn answer(status: StatusCode, job: Job) -> Response {
    let location = format!("/v1/jobs/{}", job.id);
    (status, [(header::LOCATION, location)], Json(dto::Job::from(job))).into_response()
}

/// A finished job that leaves what a new one would: the same scene and build, on the devices that are open.
pub async fn finished(api: &Api, new: &NewJob) -> Result<Option<Job>, Problem> {
    let DeviceState::Ready(devices) = api.worker.device() else { return Ok(None) };
    let data = api.data.clone();
    let owner = tokio::task::spawn_blocking(move || data.owner()).await.map_err(internal)??;
    let job = api.store.finished(&new.scene_sha256, &owner, &new.owner.key).await?;
    Ok(job.filter(|job| {
        job.backend.as_ref().is_some_and(|backend| match backend.kind.as_str() {
            // With a GPU at hand, a job that once had to run on the CPU would run there.
            "cpu" => devices.starts_with("the CPU: "),
            _ => devices.starts_with(&format!("{}: ", backend.device)),
        })
    }))
}

fn estimate_s(admitted: &Admitted) -> f64 {
    let estimate = estimate::estimate(&admitted.problem);
    match (estimate.integrator, &estimate.implicit) {
        (Integrator::Implicit, Some(implicit)) => implicit.two_cores_s,
        _ => estimate.explicit.two_cores_s,
    }
}

/// The key under which a request is accepted once.
pub fn idempotency_key(headers: &HeaderMap) -> Result<Option<String>, Problem> {
    let Some(value) = headers.get("idempotency-key") else { return Ok(None) };
    match value.to_str() {
        Ok(key) if (1..=255).contains(&key.len()) => Ok(Some(key.to_owned())),
        _ => Err(Problem::new(Code::InvalidHeader, "an Idempotency-Key has 1 to 255 printable ASCII characters")),
    }
}

pub fn valid_name(name: String) -> Result<String, Problem> {
    if name.trim().is_empty() || name.chars().count() > MAX_NAME_CHARS {
        let detail = format!("/name: a name has 1 to {MAX_NAME_CHARS} characters; leave it out to use the scene's");
        return Err(Problem::new(Code::InvalidRequest, detail));
    }
    if let Some(code) = hidden(&name) {
        let detail = format!("/name: has the character {code}, which controls terminals, lines or text; take it out");
        return Err(Problem::new(Code::InvalidRequest, detail));
    }
    Ok(name)
}

fn valid_tags(mut tags: Vec<String>) -> Result<Vec<String>, Problem> {
    let refused = |detail: String| Err(Problem::new(Code::InvalidRequest, detail));
    if tags.len() > MAX_TAGS {
        return refused(format!("/tags: {} tags; a job has at most {MAX_TAGS}", tags.len()));
    }
    for (i, tag) in tags.iter().enumerate() {
        if tag.trim().is_empty() || tag.chars().count() > MAX_TAG_CHARS || tag.contains(',') || hidden(tag).is_some() {
            return refused(format!(
                "/tags/{i}: a tag has 1 to {MAX_TAG_CHARS} characters, none of which is a comma or controls terminals, \
                 lines or text; change the tag"
            ));
        }
    }
    tags.sort();
    tags.dedup();
    Ok(tags)
}

fn valid_priority(priority: Option<i64>) -> Result<i64, Problem> {
    match priority.unwrap_or(0) {
        priority if (-MAX_PRIORITY..=MAX_PRIORITY).contains(&priority) => Ok(priority),
        priority => {
            let detail = format!("/priority: is {priority}; it may be -{MAX_PRIORITY} to {MAX_PRIORITY}");
            Err(Problem::new(Code::InvalidRequest, detail))
        }
    }
}

pub fn valid_max_cost(max_cost: Option<f64>) -> Result<Option<f64>, Problem> {
    match max_cost {
        Some(max) if max.is_nan() || max <= 0.0 => {
            let detail = format!("/max_cost: is {max}; give seconds above 0, or leave it out");
            Err(Problem::new(Code::InvalidRequest, detail))
        }
        max => Ok(max),
    }
}

pub fn sha256_hex(bytes: &[u8]) -> String {
    Sha256::digest(bytes).iter().map(|byte| format!("{byte:02x}")).collect()
}
