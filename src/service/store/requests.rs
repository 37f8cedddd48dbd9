//! What clients ask of the table of jobs.

use std::collections::HashSet;

use uuid::Uuid;

use super::row::{JobRow, select_jobs};
use super::{Deletion, Job, JobStore, NewJob, Result, Status, Submission};

impl JobStore {
    /// Puts a job at the end of the queue unless `max_queued` jobs are waiting already.
    pub async fn submit(&self, new: &NewJob, max_queued: i64) -> Result<Submission> {
        let mut tx = self.database.lock_queue().await?;
        if let Some(key) = &new.idempotency_key {
            let earlier: Option<(String, String)> =
                sqlx::query_as("SELECT id, request_sha256 FROM jobs WHERE idempotency_key = $1")
                    .bind(key)
                    .fetch_optional(&mut *tx)
                    .await?;
            if let Some((id, request_sha256)) = earlier {
                if request_sha256 != new.request_sha256 {
                    return Ok(Submission::KeyReused);
                }
                let row: JobRow = sqlx::query_as(select_jobs!("WHERE id = $1")).bind(id).fetch_one(&mut *tx).await?;
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
             VALUES ($1, $2, $3, $4, $5, 'queued', $6, $7, $8, $9, $10, $11, $12)",
        )
        .bind(&id)
        .bind(&new.name)
        .bind(&new.scene)
        .bind(&new.idempotency_key)
        .bind(&new.request_sha256)
        .bind(self.clock.now())
        .bind(new.particles as i64)
        .bind(new.frames as i64)
        .bind(new.end_time_s)
        .bind(&new.integrator)
        .bind(&new.integrator_reason)
        .bind(serde_json::to_string(&new.notices).expect("notices are plain text"))
        .execute(&mut *tx)
        .await?;
        let row: JobRow = sqlx::query_as(select_jobs!("WHERE id = $1")).bind(id).fetch_one(&mut *tx).await?;
        tx.commit().await?;
        Ok(Submission::Accepted(row.0))
    }

    pub async fn get(&self, id: Uuid) -> Result<Option<Job>> {
        let row: Option<JobRow> = sqlx::query_as(select_jobs!("WHERE id = $1"))
            .bind(id.to_string())
            .fetch_optional(&self.database.reader)
            .await?;
        Ok(row.map(|row| row.0))
    }

    /// Newest first; if `before` (a [`Job::seq`]) is given, only those accepted before it.
    pub async fn list(&self, status: Option<Status>, before: Option<i64>, limit: i64) -> Result<Vec<Job>> {
        let rows: Vec<JobRow> =
            sqlx::query_as(select_jobs!("WHERE ($1 = '' OR status = $1) AND seq < $2 ORDER BY seq DESC LIMIT $3"))
                .bind(status.map_or("", Status::as_str))
                .bind(before.unwrap_or(i64::MAX))
                .bind(limit)
                .fetch_all(&self.database.reader)
                .await?;
        Ok(rows.into_iter().map(|row| row.0).collect())
    }

    /// Number of jobs in each status.
    pub async fn counts(&self) -> Result<[(Status, i64); 5]> {
        let rows: Vec<(String, i64)> = sqlx::query_as("SELECT status, count(*) FROM jobs GROUP BY status")
            .fetch_all(&self.database.reader)
            .await?;
        Ok(Status::ALL
            .map(|status| (status, rows.iter().find(|(name, _)| name == status.as_str()).map_or(0, |(_, n)| *n))))
    }

    /// Ends a queued job; asks the worker of a running one to stop. Does nothing to a job that has
    /// ended.
    pub async fn cancel(&self, id: Uuid) -> Result<Option<Job>> {
        sqlx::query(
            "UPDATE jobs SET cancel_requested = 1, \
               finished_at = CASE status WHEN 'queued' THEN $1 END, \
               status = CASE status WHEN 'queued' THEN 'canceled' ELSE status END \
             WHERE id = $2 AND status IN ('queued', 'running')",
        )
        .bind(self.clock.now())
        .bind(id.to_string())
        .execute(&self.database.writer)
        .await?;
        self.get(id).await
    }

    /// Deletes a job that has ended; the caller removes its files.
    pub async fn delete(&self, id: Uuid) -> Result<Deletion> {
        let deleted = sqlx::query("DELETE FROM jobs WHERE id = $1 AND status NOT IN ('queued', 'running')")
            .bind(id.to_string())
            .execute(&self.database.writer)
            .await?
            .rows_affected();
        if deleted > 0 {
            return Ok(Deletion::Deleted);
        }
        Ok(self.get(id).await?.map_or(Deletion::NotFound, |job| Deletion::NotFinished(job.status)))
    }

    /// The ids of all jobs.
    pub async fn ids(&self) -> Result<HashSet<Uuid>> {
        let ids: Vec<String> = sqlx::query_scalar("SELECT id FROM jobs").fetch_all(&self.database.reader).await?;
        Ok(ids.iter().filter_map(|id| Uuid::parse_str(id).ok()).collect())
    }
}
