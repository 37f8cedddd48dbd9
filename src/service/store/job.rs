//! A job as it is stored.

use std::collections::BTreeMap;
use std::fmt;
use std::str::FromStr;

use jiff::Timestamp;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use uuid::Uuid;

use gridfall_core::sim::notice::Notice;
use gridfall_engine::Backend;

/// `queued → running → succeeded | failed | canceled`; a running job goes back to `queued` when its server stops.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize, utoipa::ToSchema)]
#[serde(rename_all = "lowercase")]
pub enum Status {
    Queued,
    Running,
    Succeeded,
    Failed,
    Canceled,
}

impl Status {
    pub const ALL: [Self; 5] = [Self::Queued, Self::Running, Self::Succeeded, Self::Failed, Self::Canceled];

    pub fn as_str(self) -> &'static str {
        match self {
            Self::Queued => "queued",
            Self::Running => "running",
            Self::Succeeded => "succeeded",
            Self::Failed => "failed",
            Self::Canceled => "canceled",
        }
    }

    /// True if nothing about the job will change any more.
    pub fn is_terminal(self) -> bool {
        !matches!(self, Self::Queued | Self::Running)
    }
}

impl fmt::Display for Status {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.as_str())
    }
}

impl FromStr for Status {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        Self::ALL
            .into_iter()
            .find(|status| status.as_str() == text)
            .ok_or_else(|| format!("{text:?} is no status; there are queued, running, succeeded, failed and canceled"))
    }
}

/// Why a job failed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Failure {
    /// Stable, for programs.
    pub code: String,
    /// For people.
    pub message: String,
}

impl Failure {
    pub fn new(code: impl Into<String>, message: impl Into<String>) -> Self {
        Self { code: code.into(), message: message.into() }
    }
}

/// Progress of an attempt.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Progress {
    pub sim_time_s: f64,
    pub step: u64,
    pub frames_written: u64,
    /// Wall time since the engine was loaded (s).
    pub run_s: f64,
}

/// Whose a job or a sweep is.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Owner {
    /// The id of a key; empty where nobody was asked for one.
    pub key: String,
    /// Most jobs of the key that may wait.
    pub max_queued: Option<i64>,
}

impl Owner {
    /// An idempotency key as the table has it: that of one owner is none of another's. Clients can send no line break.
    pub(super) fn mark(&self, idempotency_key: &Option<String>) -> Option<String> {
        let marked =
            |given: &String| if self.key.is_empty() { given.clone() } else { format!("{}\n{given}", self.key) };
        idempotency_key.as_ref().map(marked)
    }
}

/// A client's request, already found valid.
#[derive(Clone, Debug, Default)]
pub struct NewJob {
    pub owner: Owner,
    pub name: String,
    pub tags: Vec<String>,
    /// Higher ones run first.
    pub priority: i64,
    /// Not started by then, the job fails.
    pub deadline: Option<Timestamp>,
    /// Foretold wall time (s).
    pub estimate_s: Option<f64>,
    /// The scene document with overrides applied.
    pub scene: String,
    /// The SHA-256 of that document.
    pub scene_sha256: String,
    pub particles: u64,
    /// Number of frames to be written, frame 0 included.
    pub frames: u64,
    pub end_time_s: f64,
    /// `explicit` or `implicit`, and why.
    pub integrator: String,
    pub integrator_reason: String,
    /// What the user should know of the scene.
    pub notices: Vec<Notice>,
    /// What its sweep put in the place of the scene's values, by path.
    pub sweep_values: BTreeMap<String, Value>,
    /// The client's idempotency key, so that a repeated request is accepted once.
    pub idempotency_key: Option<String>,
    /// Hash of the request, to distinguish a repetition from another request under the same key.
    pub request_sha256: String,
}

/// A client's request to run many jobs as one.
#[derive(Clone, Debug, Default)]
pub struct NewSweep {
    pub owner: Owner,
    /// Of the same owner.
    pub jobs: Vec<NewJob>,
    pub name: String,
    /// As that of a [`NewJob`].
    pub idempotency_key: Option<String>,
    pub request_sha256: String,
}

#[derive(Clone, Debug, PartialEq)]
pub struct Job {
    /// Order of acceptance.
    pub seq: i64,
    pub id: Uuid,
    /// The id of the key that it is of; none where nobody was asked for one.
    pub key: Option<String>,
    pub name: String,
    pub tags: Vec<String>,
    /// Higher ones run first.
    pub priority: i64,
    pub deadline: Option<Timestamp>,
    /// Foretold wall time (s).
    pub estimate_s: Option<f64>,
    /// The sweep that the job is of.
    pub sweep: Option<Uuid>,
    /// What the sweep put in the place of the scene's values, by path.
    pub sweep_values: BTreeMap<String, Value>,
    pub status: Status,
    pub created_at: Timestamp,
    pub started_at: Option<Timestamp>,
    pub finished_at: Option<Timestamp>,
    /// Counts claims by a worker.
    pub attempt: i64,
    /// Attempts in a row that died with their process or device, without a newer checkpoint between
    /// them.
    pub deaths: i64,
    /// The newest frame that an attempt can go on from.
    pub checkpoint_frame: Option<u64>,
    pub cancel_requested: bool,
    /// 1 for the job of its key that runs next; `None` unless queued.
    pub queue_position: Option<i64>,
    pub particles: u64,
    pub frames: u64,
    pub end_time_s: f64,
    /// `explicit` or `implicit`, and why.
    pub integrator: String,
    pub integrator_reason: String,
    /// What the user should know of the scene.
    pub notices: Vec<Notice>,
    pub progress: Progress,
    pub backend: Option<Backend>,
    /// What a cluster's scheduler calls the last attempt that it was offered.
    pub cluster_job: Option<String>,
    pub failure: Option<Failure>,
}
