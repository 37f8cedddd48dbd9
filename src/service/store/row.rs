//! Converts rows of the table to jobs.

use std::error::Error;

use jiff::Timestamp;
use sqlx::any::AnyRow;
use sqlx::{AssertSqlSafe, FromRow, Row};
use uuid::Uuid;

use super::{Claim, Failure, Job, Progress};

/// What [`JobRow`] reads.
pub(super) const COLUMNS: &str = "jobs.seq, jobs.id, name, status, created_at, started_at, finished_at, attempt, \
    deaths, checkpoint_frame, cancel_requested, particles, frames, end_time_s, sim_time_s, step, frames_written, \
    run_s, integrator, integrator_reason, notices, backend, failure_code, failure_message, priority, tags, deadline, \
    estimate_s, sweep, sweep_values, cluster_job, jobs.key_id";

/// `SELECT` of jobs, followed by the given clauses, which hold no text of a client.
pub(super) fn select_jobs(clauses: &str) -> AssertSqlSafe<String> {
    AssertSqlSafe(format!("SELECT {COLUMNS} FROM jobs {clauses}"))
}

/// A job but for its place in the queue.
pub(super) struct JobRow(pub Job);

impl FromRow<'_, AnyRow> for JobRow {
    fn from_row(row: &AnyRow) -> sqlx::Result<Self> {
        let failure_code: Option<String> = row.try_get("failure_code")?;
        let failure_message: Option<String> = row.try_get("failure_message")?;
        Ok(Self(Job {
            seq: row.try_get("seq")?,
            id: uuid(row.try_get("id")?)?,
            name: row.try_get("name")?,
            key: Some(row.try_get("key_id")?).filter(|key: &String| !key.is_empty()),
            status: row.try_get::<String, _>("status")?.parse().map_err(decode::<String>)?,
            created_at: timestamp(row.try_get("created_at")?)?,
            started_at: row.try_get::<Option<i64>, _>("started_at")?.map(timestamp).transpose()?,
            finished_at: row.try_get::<Option<i64>, _>("finished_at")?.map(timestamp).transpose()?,
            attempt: row.try_get("attempt")?,
            deaths: row.try_get("deaths")?,
            checkpoint_frame: row.try_get::<Option<i64>, _>("checkpoint_frame")?.map(|frame| frame as u64),
            cancel_requested: row.try_get::<i64, _>("cancel_requested")? != 0,
            queue_position: None,
            priority: row.try_get("priority")?,
            tags: serde_json::from_str(&row.try_get::<String, _>("tags")?).map_err(decode)?,
            deadline: row.try_get::<Option<i64>, _>("deadline")?.map(timestamp).transpose()?,
            estimate_s: row.try_get("estimate_s")?,
            sweep: row.try_get::<Option<String>, _>("sweep")?.map(uuid).transpose()?,
            sweep_values: serde_json::from_str(&row.try_get::<String, _>("sweep_values")?).map_err(decode)?,
            particles: row.try_get::<i64, _>("particles")? as u64,
            frames: row.try_get::<i64, _>("frames")? as u64,
            end_time_s: row.try_get("end_time_s")?,
            integrator: row.try_get("integrator")?,
            integrator_reason: row.try_get("integrator_reason")?,
            notices: serde_json::from_str(&row.try_get::<String, _>("notices")?).map_err(decode)?,
            progress: Progress {
                sim_time_s: row.try_get("sim_time_s")?,
                step: row.try_get::<i64, _>("step")? as u64,
                frames_written: row.try_get::<i64, _>("frames_written")? as u64,
                run_s: row.try_get("run_s")?,
            },
            backend: row
                .try_get::<Option<String>, _>("backend")?
                .map(|json| serde_json::from_str(&json))
                .transpose()
                .map_err(decode)?,
            cluster_job: row.try_get("cluster_job")?,
            failure: failure_code.zip(failure_message).map(|(code, message)| Failure { code, message }),
        }))
    }
}

pub(super) struct ClaimRow(pub Claim);

impl FromRow<'_, AnyRow> for ClaimRow {
    fn from_row(row: &AnyRow) -> sqlx::Result<Self> {
        Ok(Self(Claim {
            id: uuid(row.try_get("id")?)?,
            attempt: row.try_get("attempt")?,
            scene: row.try_get("scene")?,
            deaths: row.try_get("deaths")?,
        }))
    }
}

/// An attempt whose lease is over.
pub(super) struct LostRow {
    pub id: Uuid,
    pub attempt: i64,
    pub deaths: i64,
    pub frames_written: i64,
    pub checkpoint_frame: Option<i64>,
}

impl FromRow<'_, AnyRow> for LostRow {
    fn from_row(row: &AnyRow) -> sqlx::Result<Self> {
        Ok(Self {
            id: uuid(row.try_get("id")?)?,
            attempt: row.try_get("attempt")?,
            deaths: row.try_get("deaths")?,
            frames_written: row.try_get("frames_written")?,
            checkpoint_frame: row.try_get("checkpoint_frame")?,
        })
    }
}

pub(super) fn uuid(text: String) -> sqlx::Result<Uuid> {
    Uuid::parse_str(&text).map_err(decode)
}

pub(super) fn timestamp(us: i64) -> sqlx::Result<Timestamp> {
    Timestamp::from_microsecond(us).map_err(decode)
}

pub(super) fn decode<E: Into<Box<dyn Error + Send + Sync>>>(error: E) -> sqlx::Error {
    sqlx::Error::Decode(error.into())
}
