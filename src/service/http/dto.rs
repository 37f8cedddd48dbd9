//! Request and response types. They are separate from the store's records and the scene's schema,
//! so that each can change on its own.

use std::collections::BTreeMap;

use jiff::Timestamp;
use serde::{Deserialize, Serialize};
use utoipa::{IntoParams, ToSchema};
use uuid::Uuid;

pub use super::estimate::ValidScene;
use super::problem::Code;
use crate::store::{self, Status};
use gridfall_core::sim::notice;
use gridfall_engine as engine;
use gridfall_scene as scene;

/// A request to run a scene.
#[derive(Debug, Default, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct SubmitJob {
    /// The scene document; its JSON Schema is at `/v1/schema/scene`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(value_type = Option<Scene>)]
    pub scene: Option<serde_json::Value>,
    /// Instead of `scene`: the id of one that was kept (`POST /v1/scenes`).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scene_id: Option<String>,
    /// Begin with the last state of this job, whose scene had `output.state`. It becomes the scene's `start`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub start_from: Option<Uuid>,
    /// Name of the job; the scene's by default.
    #[schema(min_length = 1, max_length = 200)]
    pub name: Option<String>,
    /// Values that replace those of the scene, by path.
    #[serde(default)]
    #[schema(example = json!({"solver.kernel": "quadratic"}))]
    pub overrides: BTreeMap<String, serde_json::Value>,
    /// Words to find the job by: at most 16, of 1 to 64 characters, without commas.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schema(max_items = 16)]
    pub tags: Vec<String>,
    /// Jobs of a higher priority run first; 0 by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = -1000, maximum = 1000)]
    pub priority: Option<i64>,
    /// When the job must have been started; otherwise it fails with the code `deadline`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub deadline: Option<Timestamp>,
    /// Largest estimated wall time (s) that is accepted.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub max_cost: Option<f64>,
    /// Take the result of a finished job, if one has run the same scene (seed included) in the same build on a
    /// device that this server would take now: the answer is then 200 and that job.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub reuse: bool,
}

/// A request to run the scene of a job again.
#[derive(Debug, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct RerunJob {
    /// Begin with the last state of this job, which may be the one that is run again.
    pub start_from: Option<Uuid>,
    /// Name of the new job; the old one's by default.
    #[schema(max_length = 200)]
    pub name: Option<String>,
    /// Values that replace those of the scene, by path.
    #[serde(default)]
    pub overrides: BTreeMap<String, serde_json::Value>,
    /// The old job's by default.
    #[schema(max_items = 16)]
    pub tags: Option<Vec<String>>,
    /// The old job's by default.
    #[schema(minimum = -1000, maximum = 1000)]
    pub priority: Option<i64>,
    /// When the job must have been started; otherwise it fails with the code `deadline`.
    pub deadline: Option<Timestamp>,
    /// Largest estimated wall time (s) that is accepted.
    pub max_cost: Option<f64>,
}

/// Described by the scene's own schema.
#[derive(ToSchema)]
pub struct Scene {}

/// A job.
#[derive(Debug, Serialize, ToSchema)]
pub struct Job {
    pub id: Uuid,
    /// The id of the key that the job belongs to; null where nobody was asked for one.
    #[schema(required)]
    pub key: Option<String>,
    pub name: String,
    pub status: Status,
    pub created_at: Timestamp,
    /// When the current attempt started.
    #[schema(required)]
    pub started_at: Option<Timestamp>,
    #[schema(required)]
    pub finished_at: Option<Timestamp>,
    /// How many times a worker has taken the job up.
    pub attempt: i64,
    /// True once canceling was asked for.
    pub cancel_requested: bool,
    /// 1 for the job of its key that runs next; null unless queued.
    #[schema(required)]
    pub queue_position: Option<i64>,
    pub particles: u64,
    pub progress: Progress,
    pub tags: Vec<String>,
    /// Jobs of a higher priority run first.
    pub priority: i64,
    /// When the job must have been started.
    #[schema(required)]
    pub deadline: Option<Timestamp>,
    /// Estimated wall time on two cores of a server (s); null for jobs of old releases.
    #[schema(required)]
    pub estimate_s: Option<f64>,
    /// Wall time of the run so far (s), without the time to load the scene.
    pub run_s: f64,
    /// The sweep that the job is of.
    #[schema(required)]
    pub sweep: Option<Uuid>,
    /// What the sweep put in the place of the scene's values, by path; empty without a sweep.
    #[schema(value_type = Object)]
    pub sweep_values: BTreeMap<String, serde_json::Value>,
    /// How the job is integrated: `explicit` or `implicit`.
    pub integrator: String,
    /// Why, in a sentence.
    pub integrator_reason: String,
    /// What was mended in the scene, and what may not be what was meant.
    pub notices: Vec<Notice>,
    /// What the attempt runs on; null before it has started.
    #[schema(required)]
    pub backend: Option<Backend>,
    /// What the cluster's scheduler calls the job's last attempt, such as the number of a Slurm job; null where the
    /// server runs jobs itself.
    #[schema(required)]
    pub cluster_job: Option<String>,
    #[schema(required)]
    pub failure: Option<Failure>,
}

/// How far a job's current attempt has come.
#[derive(Debug, Serialize, ToSchema)]
pub struct Progress {
    /// Simulated time (s).
    pub sim_time: f64,
    /// Simulated time at the end of the job (s).
    pub end_time: f64,
    /// Sub-steps done.
    pub step: u64,
    pub frames_written: u64,
    /// Frames at the end of the job, frame 0 included.
    pub frames: u64,
    /// Share of the simulated time that is done, 0 to 1.
    pub fraction: f64,
    /// Estimated wall time to the end (s); null unless running.
    #[schema(required)]
    pub eta_s: Option<f64>,
    /// Mean speed of the attempt.
    #[schema(required)]
    pub particle_steps_per_s: Option<f64>,
}

/// What a job runs on.
#[derive(Debug, Serialize, ToSchema)]
pub struct Backend {
    /// `cpu` or `gpu`.
    pub kind: String,
    /// Processor or adapter name.
    pub device: String,
    /// Driver name and version; empty on the CPU.
    pub driver: String,
    /// True for a Vulkan driver that runs on the CPU.
    pub software: bool,
    /// Why this device was chosen.
    pub reason: String,
}

/// What jobs run on.
#[derive(Debug, Serialize, ToSchema)]
pub struct DeviceList {
    /// `ready`, `opening`, `unusable` or `stopped`.
    pub state: &'static str,
    /// Which devices were taken and why, or why none can be used.
    pub reason: String,
    /// The preferred one first; scenes that it cannot run go to the next.
    pub devices: Vec<Backend>,
}

/// How to read a recording.
#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub struct RecordingQuery {
    /// Of a job that has not ended: send the recording as it grows, until it is complete.
    #[serde(default)]
    pub follow: bool,
}

/// Why a job failed.
#[derive(Debug, Serialize, ToSchema)]
pub struct Failure {
    /// Stable, for programs.
    pub code: String,
    pub message: String,
    /// What to do about failures of this code; null for one that this release does not know.
    #[schema(required)]
    pub remedy: Option<&'static str>,
}

impl From<store::Failure> for Failure {
    fn from(failure: store::Failure) -> Self {
        Self { remedy: super::docs::remedy(&failure.code), code: failure.code, message: failure.message }
    }
}

/// A file that scenes can name.
#[derive(Debug, Serialize, ToSchema)]
pub struct Asset {
    /// `sha256:` and the 64 hexadecimal digits of the SHA-256 of its bytes.
    pub id: String,
    pub bytes: u64,
    /// `stl`, `obj`, `ply`, `gltf` or `npz`.
    pub kind: String,
}

impl From<store::Asset> for Asset {
    fn from(asset: store::Asset) -> Self {
        Self { id: asset.id, bytes: asset.bytes, kind: asset.kind }
    }
}

/// All assets.
#[derive(Debug, Serialize, ToSchema)]
pub struct AssetList {
    pub assets: Vec<Asset>,
}

/// A scene to be kept.
#[derive(Debug, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct KeepScene {
    /// The scene document; its JSON Schema is at `/v1/schema/scene`.
    #[schema(value_type = Scene)]
    pub scene: serde_json::Value,
}

/// A scene that is kept.
#[derive(Debug, Serialize, ToSchema)]
pub struct KeptScene {
    /// `sha256:` and the 64 hexadecimal digits of the SHA-256 of the document as it is kept: in
    /// compact JSON with sorted names.
    pub id: String,
    pub name: String,
    pub particles: u64,
}

/// All scenes that are kept.
#[derive(Debug, Serialize, ToSchema)]
pub struct SceneList {
    pub ids: Vec<String>,
}

/// A page of jobs, newest first.
#[derive(Debug, Serialize, ToSchema)]
pub struct JobList {
    pub jobs: Vec<Job>,
    /// Asks for the next page; null on the last one.
    #[schema(required)]
    pub next_cursor: Option<String>,
}

/// Proof of life.
#[derive(Debug, Serialize, ToSchema)]
pub struct Live {
    /// `live`.
    pub status: &'static str,
    pub version: &'static str,
}

/// That the server can take and run jobs.
#[derive(Debug, Serialize, ToSchema)]
pub struct Ready {
    /// `ready`.
    pub status: &'static str,
    pub checks: Vec<Check>,
}

/// One condition of readiness.
#[derive(Debug, Serialize, ToSchema)]
pub struct Check {
    /// `store`, `worker`, `device` or `disk`.
    pub name: &'static str,
    pub ok: bool,
    pub detail: String,
}

/// An error (RFC 9457).
#[derive(Debug, Serialize, ToSchema)]
pub struct Problem {
    /// Where the code is explained, on the same server: `/docs/errors#` and the code.
    #[serde(rename = "type")]
    pub kind: String,
    pub title: &'static str,
    pub status: u16,
    pub code: Code,
    /// What went wrong this time, and what to do about it.
    pub detail: String,
    /// All faults of the scene, for `invalid_scene`.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    #[schema(required = false)]
    pub faults: Vec<Fault>,
    /// For `not_ready`.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    #[schema(required = false)]
    pub checks: Vec<Check>,
}

/// One fault of a scene.
#[derive(Debug, Serialize, ToSchema)]
pub struct Fault {
    /// JSON pointer (RFC 6901) into the request's body.
    pub pointer: String,
    /// Stable, for programs.
    pub code: String,
    /// What is wrong.
    pub reason: String,
    /// What to change.
    pub remedy: String,
}

/// What a user should know of a scene that is run all the same.
#[derive(Debug, Serialize, ToSchema)]
pub struct Notice {
    /// JSON pointer (RFC 6901) into the scene.
    pub pointer: String,
    /// Stable, for programs.
    pub code: String,
    /// What was found, and what was made of it.
    pub reason: String,
    /// What to change if that is not what was meant.
    pub remedy: String,
}

impl From<notice::Notice> for Notice {
    fn from(notice: notice::Notice) -> Self {
        let notice::Notice { pointer, code, reason, remedy } = notice;
        Self { pointer, code, reason, remedy }
    }
}

impl From<scene::Fault> for Fault {
    fn from(fault: scene::Fault) -> Self {
        Self { pointer: fault.pointer, code: fault.code.to_string(), reason: fault.reason, remedy: fault.remedy }
    }
}

impl From<store::Job> for Job {
    fn from(job: store::Job) -> Self {
        let progress = Progress::new(&job);
        Self {
            id: job.id,
            key: job.key,
            name: job.name,
            status: job.status,
            created_at: job.created_at,
            started_at: job.started_at,
            finished_at: job.finished_at,
            attempt: job.attempt,
            cancel_requested: job.cancel_requested,
            queue_position: job.queue_position,
            particles: job.particles,
            progress,
            tags: job.tags,
            priority: job.priority,
            deadline: job.deadline,
            estimate_s: job.estimate_s,
            run_s: job.progress.run_s,
            sweep: job.sweep,
            sweep_values: job.sweep_values,
            integrator: job.integrator,
            integrator_reason: job.integrator_reason,
            notices: job.notices.into_iter().map(Notice::from).collect(),
            backend: job.backend.map(Into::into),
            cluster_job: job.cluster_job,
            failure: job.failure.map(Into::into),
        }
    }
}

impl Progress {
    pub(super) fn new(job: &store::Job) -> Self {
        let now = job.progress;
        let fraction = (now.sim_time_s / job.end_time_s).clamp(0.0, 1.0);
        let known = |value: f64| value.is_finite().then_some(value);
        Self {
            sim_time: now.sim_time_s,
            end_time: job.end_time_s,
            step: now.step,
            frames_written: now.frames_written,
            frames: job.frames,
            fraction,
            eta_s: (job.status == Status::Running).then(|| known(now.run_s * (1.0 - fraction) / fraction)).flatten(),
            particle_steps_per_s: known(job.particles as f64 * now.step as f64 / now.run_s),
        }
    }
}

impl From<engine::Backend> for Backend {
    fn from(backend: engine::Backend) -> Self {
        let engine::Backend { kind, device, driver, software, reason } = backend;
        Self { kind, device, driver, software, reason }
    }
}

/// The bytes of a file.
#[derive(ToSchema)]
#[schema(value_type = String, format = Binary)]
pub struct Bytes(());
