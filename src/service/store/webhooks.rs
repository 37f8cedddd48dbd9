//! Webhooks: who is told of what happens to jobs, and what is to be told.
//!
//! Triggers of the database note what happens, in the transaction in which it does (`migrations/*_webhooks.sql`). A
//! server makes deliveries of that, one a webhook.

use std::collections::HashSet;

use jiff::Timestamp;
use serde::{Deserialize, Serialize};
use sqlx::any::AnyRow;
use sqlx::{AssertSqlSafe, FromRow, Row};
use uuid::Uuid;

use super::row::{JobRow, decode, timestamp, uuid};
use super::{Job, JobStore, Result, Status, Sweep};

/// Events that are made deliveries of in one transaction.
const BATCH: i64 = 100;

/// What webhooks are told of.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize, utoipa::ToSchema)]
pub enum EventType {
    #[serde(rename = "job.queued")]
    JobQueued,
    #[serde(rename = "job.started")]
    JobStarted,
    #[serde(rename = "job.succeeded")]
    JobSucceeded,
    #[serde(rename = "job.failed")]
    JobFailed,
    #[serde(rename = "job.canceled")]
    JobCanceled,
    #[serde(rename = "sweep.finished")]
    SweepFinished,
    /// Only when somebody asks for it.
    #[serde(rename = "webhook.test")]
    WebhookTest,
}

impl EventType {
    pub const ALL: [Self; 7] = [
        Self::JobQueued,
        Self::JobStarted,
        Self::JobSucceeded,
        Self::JobFailed,
        Self::JobCanceled,
        Self::SweepFinished,
        Self::WebhookTest,
    ];

    pub fn as_str(self) -> &'static str {
        match self {
            Self::JobQueued => "job.queued",
            Self::JobStarted => "job.started",
            Self::JobSucceeded => "job.succeeded",
            Self::JobFailed => "job.failed",
            Self::JobCanceled => "job.canceled",
            Self::SweepFinished => "sweep.finished",
            Self::WebhookTest => "webhook.test",
        }
    }

    pub(super) fn known(name: &str) -> sqlx::Result<Self> {
        let found = Self::ALL.into_iter().find(|known| known.as_str() == name);
        found.ok_or_else(|| decode(format!("{name:?} is no type of events")))
    }
}

impl From<Status> for EventType {
    fn from(status: Status) -> Self {
        match status {
            Status::Queued => Self::JobQueued,
            Status::Running => Self::JobStarted,
            Status::Succeeded => Self::JobSucceeded,
            Status::Failed => Self::JobFailed,
            Status::Canceled => Self::JobCanceled,
        }
    }
}

/// A webhook to be added.
#[derive(Clone, Debug)]
pub struct NewWebhook {
    pub url: String,
    /// `whsec_` and the key in base64.
    pub secret: String,
    /// Types of events that it is told of; all without any.
    pub events: Vec<EventType>,
}

/// Who is told of what happens to jobs.
#[derive(Clone, Debug, PartialEq)]
pub struct Webhook {
    pub id: Uuid,
    pub url: String,
    /// `whsec_` and the key in base64.
    pub secret: String,
    /// Types of events that it is told of; all without any.
    pub events: Vec<EventType>,
    pub created_at: Timestamp,
    /// False once its receiver wants no more.
    pub enabled: bool,
}

impl Webhook {
    fn wants(&self, event: EventType, at: Timestamp) -> bool {
        (self.events.is_empty() || self.events.contains(&event)) && self.created_at <= at
    }
}

/// What an event is about, as it was then.
#[derive(Clone, Debug, PartialEq)]
pub enum Subject {
    Job(Box<Job>),
    Sweep(Sweep),
}

/// What happened to a job, and the job as it was then.
struct Event {
    number: i64,
    at: Timestamp,
    job: Job,
}

impl FromRow<'_, AnyRow> for Event {
    fn from_row(row: &AnyRow) -> sqlx::Result<Self> {
        Ok(Self { number: row.try_get("event")?, at: timestamp(row.try_get("at")?)?, job: JobRow::from_row(row)?.0 })
    }
}

pub(super) struct WebhookRow(pub Webhook);

impl FromRow<'_, AnyRow> for WebhookRow {
    fn from_row(row: &AnyRow) -> sqlx::Result<Self> {
        Ok(Self(Webhook {
            id: uuid(row.try_get("id")?)?,
            url: row.try_get("url")?,
            secret: row.try_get("secret")?,
            events: serde_json::from_str(&row.try_get::<String, _>("events")?).map_err(decode)?,
            created_at: timestamp(row.try_get("created_at")?)?,
            enabled: row.try_get::<i64, _>("enabled")? != 0,
        }))
    }
}

impl JobStore {
    /// Adds a webhook, unless there are `most` already. It is told of what happens from now on.
    pub async fn add_webhook(&self, new: &NewWebhook, most: i64) -> Result<Option<Webhook>> {
        let row: Option<WebhookRow> = sqlx::query_as(
            "INSERT INTO webhooks (id, url, secret, events, created_at) SELECT $1, $2, $3, $4, $5 \
             WHERE (SELECT count(*) FROM webhooks) < $6 RETURNING *",
        )
        .bind(Uuid::now_v7().to_string())
        .bind(&new.url)
        .bind(&new.secret)
        .bind(serde_json::to_string(&new.events).expect("types are plain text"))
        .bind(self.clock.now())
        .bind(most)
        .fetch_optional(&self.database.writer)
        .await?;
        Ok(row.map(|row| row.0))
    }

    /// All webhooks, oldest first.
    pub async fn webhooks(&self) -> Result<Vec<Webhook>> {
        let rows: Vec<WebhookRow> =
            sqlx::query_as("SELECT * FROM webhooks ORDER BY id").fetch_all(&self.database.reader).await?;
        Ok(rows.into_iter().map(|row| row.0).collect())
    }

    pub async fn webhook(&self, id: Uuid) -> Result<Option<Webhook>> {
        let row: Option<WebhookRow> = sqlx::query_as("SELECT * FROM webhooks WHERE id = $1")
            .bind(id.to_string())
            .fetch_optional(&self.database.reader)
            .await?;
        Ok(row.map(|row| row.0))
    }

    /// Removes a webhook and its deliveries. Returns false if there was none.
    pub async fn remove_webhook(&self, id: Uuid) -> Result<bool> {
        let removed = sqlx::query("DELETE FROM webhooks WHERE id = $1").bind(id.to_string());
        Ok(removed.execute(&self.database.writer).await?.rows_affected() > 0)
    }

    /// Makes deliveries of what has happened, the oldest first, and returns how many events that were. What is sent of
    /// each is up to `payload`.
    pub async fn spread_events(
        &self,
        payload: impl Fn(EventType, Timestamp, &Subject) -> String + Send + Sync,
    ) -> Result<usize> {
        let waiting = sqlx::query("SELECT event FROM webhook_events LIMIT 1");
        if waiting.fetch_optional(&self.database.reader).await?.is_none() {
            return Ok(0);
        }
        // An event is gone if, and only if, its deliveries are there.
        let mut tx = self.database.writer.begin().await?;
        let mut events: Vec<Event> = sqlx::query_as(AssertSqlSafe(format!(
            "DELETE FROM webhook_events WHERE event IN \
               (SELECT event FROM webhook_events ORDER BY event LIMIT $1 {}) RETURNING *",
            self.database.skip_locked()
        )))
        .bind(BATCH)
        .fetch_all(&mut *tx)
        .await?;
        events.sort_by_key(|event| event.number);
        let webhooks: Vec<WebhookRow> =
            sqlx::query_as("SELECT * FROM webhooks WHERE enabled = 1 ORDER BY id").fetch_all(&mut *tx).await?;
        let (spread, mut sweeps) = (events.len(), HashSet::new());
        let mut told = Vec::new();
        // From the last one, so that a sweep ends with the last of its jobs.
        for Event { at, job, .. } in events.into_iter().rev() {
            if let Some(sweep) = job.sweep.filter(|_| job.status.is_terminal())
                && sweeps.insert(sweep)
                && let Some(sweep) = self.sweep(sweep).await?
                && sweep.has_ended()
            {
                told.push((EventType::SweepFinished, at, Subject::Sweep(sweep)));
            }
            told.push((EventType::from(job.status), at, Subject::Job(Box::new(job))));
        }
        let now = self.clock.now();
        for (event, at, subject) in told.into_iter().rev() {
            let wanted: Vec<&Webhook> = webhooks.iter().map(|row| &row.0).filter(|row| row.wants(event, at)).collect();
            if wanted.is_empty() {
                continue;
            }
            let payload = payload(event, at, &subject);
            let subject = match subject {
                Subject::Job(job) => job.id,
                Subject::Sweep(sweep) => sweep.id,
            };
            for webhook in wanted {
                super::deliveries::insert(&mut *tx, webhook.id, (event, subject), &payload, now).await?;
            }
        }
        tx.commit().await?;
        Ok(spread)
    }
}
