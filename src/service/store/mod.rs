//! Jobs in SQLite, their outputs and the uploads in a directory.
//!
//! All writes go through one connection, so that they never wait for each other inside SQLite.
//! Reads have their own connections. Every write of an attempt names the attempt (its fencing
//! token) and does nothing once the job has moved on.

mod assets;
mod files;
mod job;
mod row;
mod scenes;

use std::collections::HashSet;
use std::path::{Path, PathBuf};
use std::time::Duration;

use jiff::Timestamp;
use sqlx::sqlite::{SqliteConnectOptions, SqliteJournalMode, SqlitePool, SqlitePoolOptions, SqliteSynchronous};
use uuid::Uuid;

pub use assets::{Asset, AssetFiles};
pub use files::{AttemptFiles, DataDir, JobFiles};
pub use job::{Failure, Job, NewJob, Progress, Status};
use row::{ClaimRow, JobRow, select_jobs};
pub use scenes::SceneFiles;

use gridfall_engine::Backend;

/// A scene that brought down this many processes or devices is not tried again.
pub const MAX_LOST_ATTEMPTS: i64 = 2;

#[derive(Debug, thiserror::Error)]
pub enum StoreError {
    #[error("{path}: another gridfall server uses this data directory; stop it or give --data-dir another one")]
    Locked { path: PathBuf },
    #[error("{path}: {error}")]
    Io { path: PathBuf, error: std::io::Error },
    #[error("the job database failed: {0}")]
    Database(#[from] sqlx::Error),
    #[error("the job database cannot be brought up to date: {0}")]
    Migrate(#[from] sqlx::migrate::MigrateError),
}

type Result<T, E = StoreError> = std::result::Result<T, E>;

/// Result of a submission.
#[derive(Debug)]
pub enum Submission {
    Accepted(Job),
    /// The same request under the same idempotency key was accepted before, as this job.
    Repeated(Job),
    /// Another request was accepted under this idempotency key.
    KeyReused,
    QueueFull,
}

/// Result of a deletion.
#[derive(Debug, PartialEq, Eq)]
pub enum Deletion {
    Deleted,
    /// Queued or running: must be canceled first.
    NotFinished(Status),
    NotFound,
}

/// How an attempt ended.
#[derive(Clone, Debug, PartialEq)]
pub enum Outcome {
    Succeeded,
    Failed(Failure),
    Canceled,
}

/// A job that a worker has claimed.
#[derive(Clone, Debug)]
pub struct Claim {
    pub id: Uuid,
    pub attempt: i64,
    pub scene: String,
    pub deaths: i64,
}

/// A job that was running when its server died, and what was done about it.
#[derive(Clone, Debug, PartialEq)]
pub struct Recovered {
    pub id: Uuid,
    /// `Queued`, `Failed` or `Canceled`.
    pub status: Status,
}

/// The table of jobs.
#[derive(Clone, Debug)]
pub struct JobStore {
    writer: SqlitePool,
    reader: SqlitePool,
}

impl JobStore {
    /// Opens or creates the database and migrates its schema.
    pub async fn open(path: &Path) -> Result<Self> {
        let options = SqliteConnectOptions::new()
            .filename(path)
            .create_if_missing(true)
            .journal_mode(SqliteJournalMode::Wal)
            // An accepted job survives a power failure, not only a crash.
            .synchronous(SqliteSynchronous::Full)
            .busy_timeout(Duration::from_secs(5));
        let writer = SqlitePoolOptions::new().max_connections(1).connect_with(options.clone()).await?;
        sqlx::migrate!("store/migrations").run(&writer).await?;
        let reader = SqlitePoolOptions::new().max_connections(4).connect_with(options.read_only(true)).await?;
        Ok(Self { writer, reader })
    }

    pub async fn close(&self) {
        self.reader.close().await;
        self.writer.close().await;
    }

    /// Runs a trivial query, as proof of life.
    pub async fn ping(&self) -> Result<()> {
        sqlx::query("SELECT 1").execute(&self.reader).await?;
        Ok(())
    }

    /// Puts a job at the end of the queue unless `max_queued` jobs are waiting already.
    pub async fn submit(&self, new: &NewJob, max_queued: i64) -> Result<Submission> {
        let mut tx = self.writer.begin_with("BEGIN IMMEDIATE").await?;
        if let Some(key) = &new.idempotency_key {
            let earlier: Option<(String, String)> =
                sqlx::query_as("SELECT id, request_sha256 FROM jobs WHERE idempotency_key = ?")
                    .bind(key)
                    .fetch_optional(&mut *tx)
                    .await?;
            if let Some((id, request_sha256)) = earlier {
                if request_sha256 != new.request_sha256 {
                    return Ok(Submission::KeyReused);
                }
                let row: JobRow = sqlx::query_as(select_jobs!("WHERE id = ?")).bind(id).fetch_one(&mut *tx).await?;
                return Ok(Submission::Repeated(row.0));
            }
        }
        let queued: i64 =
            sqlx::query_scalar("SELECT count(*) FROM jobs WHERE status = 'queued'").fetch_one(&mut *tx).await?;
        if queued >= max_queued {
            return Ok(Submission::QueueFull);
        }
        let id = Uuid::now_v7().to_string();
        sqlx::query(
            "INSERT INTO jobs (id, name, scene, idempotency_key, request_sha256, status, created_at, particles, \
             frames, end_time_s, integrator, integrator_reason, notices) \
             VALUES (?, ?, ?, ?, ?, 'queued', ?, ?, ?, ?, ?, ?, ?)",
        )
        .bind(&id)
        .bind(&new.name)
        .bind(&new.scene)
        .bind(&new.idempotency_key)
        .bind(&new.request_sha256)
        .bind(now())
        .bind(new.particles as i64)
        .bind(new.frames as i64)
        .bind(new.end_time_s)
        .bind(&new.integrator)
        .bind(&new.integrator_reason)
        .bind(serde_json::to_string(&new.notices).expect("notices are plain text"))
        .execute(&mut *tx)
        .await?;
        let row: JobRow = sqlx::query_as(select_jobs!("WHERE id = ?")).bind(id).fetch_one(&mut *tx).await?;
        tx.commit().await?;
        Ok(Submission::Accepted(row.0))
    }

    pub async fn get(&self, id: Uuid) -> Result<Option<Job>> {
        let row: Option<JobRow> =
            sqlx::query_as(select_jobs!("WHERE id = ?")).bind(id.to_string()).fetch_optional(&self.reader).await?;
        Ok(row.map(|row| row.0))
    }

    /// Newest first; if `before` (a [`Job::seq`]) is given, only those accepted before it.
    pub async fn list(&self, status: Option<Status>, before: Option<i64>, limit: i64) -> Result<Vec<Job>> {
        let rows: Vec<JobRow> = sqlx::query_as(select_jobs!(
            "WHERE (?1 IS NULL OR status = ?1) AND (?2 IS NULL OR seq < ?2) ORDER BY seq DESC LIMIT ?3"
        ))
        .bind(status.map(Status::as_str))
        .bind(before)
        .bind(limit)
        .fetch_all(&self.reader)
        .await?;
        Ok(rows.into_iter().map(|row| row.0).collect())
    }

    /// Number of jobs in each status.
    pub async fn counts(&self) -> Result<[(Status, i64); 5]> {
        let rows: Vec<(String, i64)> =
            sqlx::query_as("SELECT status, count(*) FROM jobs GROUP BY status").fetch_all(&self.reader).await?;
        Ok(Status::ALL
            .map(|status| (status, rows.iter().find(|(name, _)| name == status.as_str()).map_or(0, |(_, n)| *n))))
    }

    /// Ends a queued job; asks the worker of a running one to stop. Does nothing to a job that has
    /// ended.
    pub async fn cancel(&self, id: Uuid) -> Result<Option<Job>> {
        sqlx::query(
            "UPDATE jobs SET cancel_requested = 1, \
               finished_at = CASE status WHEN 'queued' THEN ?1 END, \
               status = CASE status WHEN 'queued' THEN 'canceled' ELSE status END \
             WHERE id = ?2 AND status IN ('queued', 'running')",
        )
        .bind(now())
        .bind(id.to_string())
        .execute(&self.writer)
        .await?;
        self.get(id).await
    }

    /// Deletes a job that has ended; the caller removes its files.
    pub async fn delete(&self, id: Uuid) -> Result<Deletion> {
        let deleted = sqlx::query("DELETE FROM jobs WHERE id = ? AND status NOT IN ('queued', 'running')")
            .bind(id.to_string())
            .execute(&self.writer)
            .await?
            .rows_affected();
        if deleted > 0 {
            return Ok(Deletion::Deleted);
        }
        Ok(self.get(id).await?.map_or(Deletion::NotFound, |job| Deletion::NotFinished(job.status)))
    }

    /// Claims the job that has waited longest.
    pub async fn claim(&self) -> Result<Option<Claim>> {
        let row: Option<ClaimRow> = sqlx::query_as(
            "UPDATE jobs SET status = 'running', attempt = attempt + 1, started_at = ?, backend = NULL, \
               sim_time_s = 0, step = 0, frames_written = 0, run_s = 0 \
             WHERE seq = (SELECT min(seq) FROM jobs WHERE status = 'queued') RETURNING id, attempt, scene",
        )
        .bind(now())
        .fetch_optional(&self.writer)
        .await?;
        Ok(row.map(|row| row.0))
    }

    /// Records what an attempt runs on.
    pub async fn set_backend(&self, id: Uuid, attempt: i64, backend: &Backend) -> Result<()> {
        let backend = serde_json::to_string(backend).expect("a backend is plain data");
        sqlx::query("UPDATE jobs SET backend = ? WHERE id = ? AND attempt = ? AND status = 'running'")
            .bind(backend)
            .bind(id.to_string())
            .bind(attempt)
            .execute(&self.writer)
            .await?;
        Ok(())
    }

    /// Records an attempt's progress. Returns whether it should continue: false after a request to
    /// cancel, or if the job is no longer this attempt's.
    pub async fn heartbeat(&self, id: Uuid, attempt: i64, progress: &Progress) -> Result<bool> {
        let cancel_requested: Option<i64> = sqlx::query_scalar(
            "UPDATE jobs SET sim_time_s = ?, step = ?, frames_written = ?, run_s = ? \
             WHERE id = ? AND attempt = ? AND status = 'running' RETURNING cancel_requested",
        )
        .bind(progress.sim_time_s)
        .bind(progress.step as i64)
        .bind(progress.frames_written as i64)
        .bind(progress.run_s)
        .bind(id.to_string())
        .bind(attempt)
        .fetch_optional(&self.writer)
        .await?;
        Ok(cancel_requested == Some(0))
    }

    pub async fn checkpointed(&self, _id: Uuid, _attempt: i64, _frame: u64) -> Result<bool> {
        Ok(true)
    }

    /// Ends an attempt and its job. Returns false if the job is no longer this attempt's.
    pub async fn finish(&self, id: Uuid, attempt: i64, outcome: &Outcome) -> Result<bool> {
        let (status, failure) = match outcome {
            Outcome::Succeeded => (Status::Succeeded, None),
            Outcome::Failed(failure) => (Status::Failed, Some(failure)),
            Outcome::Canceled => (Status::Canceled, None),
        };
        let changed = sqlx::query(
            "UPDATE jobs SET status = ?, finished_at = ?, failure_code = ?, failure_message = ? \
             WHERE id = ? AND attempt = ? AND status = 'running'",
        )
        .bind(status.as_str())
        .bind(now())
        .bind(failure.map(|failure| failure.code.as_str()))
        .bind(failure.map(|failure| failure.message.as_str()))
        .bind(id.to_string())
        .bind(attempt)
        .execute(&self.writer)
        .await?
        .rows_affected();
        Ok(changed > 0)
    }

    /// Puts back the job of an attempt that its server stopped; if the job was also canceled, it
    /// ends instead. Returns the job's status.
    pub async fn put_back(&self, id: Uuid, attempt: i64) -> Result<Option<Status>> {
        let status: Option<String> = sqlx::query_scalar(
            "UPDATE jobs SET status = CASE cancel_requested WHEN 1 THEN 'canceled' ELSE 'queued' END, \
               finished_at = CASE cancel_requested WHEN 1 THEN ?1 END, \
               started_at = CASE cancel_requested WHEN 1 THEN started_at END \
             WHERE id = ?2 AND attempt = ?3 AND status = 'running' RETURNING status",
        )
        .bind(now())
        .bind(id.to_string())
        .bind(attempt)
        .fetch_optional(&self.writer)
        .await?;
        Ok(status.map(known))
    }

    /// Puts back the job of an attempt that lost its device, unless that has happened before: then
    /// the job fails with `failure`. Returns the job's status.
    pub async fn lose(&self, id: Uuid, attempt: i64, failure: &Failure) -> Result<Option<Status>> {
        let status: Option<String> = sqlx::query_scalar(
            "UPDATE jobs SET lost_attempts = lost_attempts + 1, \
               status = CASE WHEN cancel_requested THEN 'canceled' \
               WHEN lost_attempts + 1 >= ?1 THEN 'failed' ELSE 'queued' END, \
               started_at = CASE WHEN cancel_requested OR lost_attempts + 1 >= ?1 THEN started_at END, \
               finished_at = CASE WHEN cancel_requested OR lost_attempts + 1 >= ?1 THEN ?2 END, \
               failure_code = CASE WHEN NOT cancel_requested AND lost_attempts + 1 >= ?1 THEN ?3 END, \
               failure_message = CASE WHEN NOT cancel_requested AND lost_attempts + 1 >= ?1 THEN ?4 END \
             WHERE id = ?5 AND attempt = ?6 AND status = 'running' RETURNING status",
        )
        .bind(MAX_LOST_ATTEMPTS)
        .bind(now())
        .bind(&failure.code)
        .bind(&failure.message)
        .bind(id.to_string())
        .bind(attempt)
        .fetch_optional(&self.writer)
        .await?;
        Ok(status.map(known))
    }

    /// Handles the jobs that were running when the last server of this database died. Call before
    /// any claim.
    pub async fn recover(&self) -> Result<Vec<Recovered>> {
        let running: Vec<(String, i64)> =
            sqlx::query_as("SELECT id, attempt FROM jobs WHERE status = 'running'").fetch_all(&self.writer).await?;
        let failure = Failure::new(
            "crashed",
            "the server died twice while it ran this job; look at the server's log and memory, \
             or make the scene smaller",
        );
        let mut recovered = Vec::new();
        for (id, attempt) in running {
            let id = Uuid::parse_str(&id).map_err(|error| sqlx::Error::Decode(error.into()))?;
            if let Some(status) = self.lose(id, attempt, &failure).await? {
                recovered.push(Recovered { id, status });
            }
        }
        Ok(recovered)
    }

    /// The ids of all jobs.
    pub async fn ids(&self) -> Result<HashSet<Uuid>> {
        let ids: Vec<String> = sqlx::query_scalar("SELECT id FROM jobs").fetch_all(&self.reader).await?;
        Ok(ids.iter().filter_map(|id| Uuid::parse_str(id).ok()).collect())
    }
}

fn known(status: String) -> Status {
    status.parse().expect("the table's check allows no other status")
}

fn now() -> i64 {
    Timestamp::now().as_microsecond()
}

#[cfg(test)]
mod tests;
