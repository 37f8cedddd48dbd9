//! What webhooks are sent.

use jiff::Timestamp;
use serde::Serialize;
use utoipa::ToSchema;

use super::Webhook;
use crate::http::dto::Job;
use crate::http::sweeps::Sweep;
use crate::store::{EventType, Subject};

/// What happened to a job: `job.queued`, `job.started`, `job.succeeded`, `job.failed` or `job.canceled`.
#[derive(Debug, Serialize, ToSchema)]
pub struct JobEvent {
    #[serde(rename = "type")]
    pub kind: EventType,
    /// When it happened.
    pub timestamp: Timestamp,
    /// The job as it was then; `queue_position` is null.
    pub data: Job,
}

/// All jobs of a sweep have ended: `sweep.finished`.
#[derive(Debug, Serialize, ToSchema)]
pub struct SweepEvent {
    #[serde(rename = "type")]
    pub kind: EventType,
    /// When the last job ended.
    pub timestamp: Timestamp,
    pub data: Sweep,
}

/// Somebody wanted to know whether this arrives: `webhook.test`.
#[derive(Debug, Serialize, ToSchema)]
pub struct TestEvent {
    #[serde(rename = "type")]
    pub kind: EventType,
    pub timestamp: Timestamp,
    /// The webhook itself.
    pub data: Webhook,
}

/// The JSON that is sent, and signed, byte by byte.
pub fn of(kind: EventType, timestamp: Timestamp, subject: &Subject) -> String {
    match subject {
        Subject::Job(job) => json(&JobEvent { kind, timestamp, data: (**job).clone().into() }),
        Subject::Sweep(sweep) => json(&SweepEvent { kind, timestamp, data: sweep.clone().into() }),
    }
}

/// The same of a test.
pub fn of_test(webhook: Webhook) -> String {
    json(&TestEvent { kind: EventType::WebhookTest, timestamp: Timestamp::now(), data: webhook })
}

fn json(event: &impl Serialize) -> String {
    serde_json::to_string(event).expect("events are plain data")
}
