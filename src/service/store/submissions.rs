//! Adding jobs to the table.

use sqlx::any::Any;
use sqlx::{Executor, Transaction};
use uuid::Uuid;

use super::row::{JobRow, select_jobs};
use super::{Job, JobStore, NewJob, Result, Submission};

impl JobStore {
    /// Adds a job to the queue unless `max_queued` jobs are waiting already.
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
                return Ok(Submission::Repeated(fetch(&mut tx, &id).await?));
            }
        }
        if queued(&mut tx).await? >= max_queued {
            return Ok(Submission::QueueFull);
        }
        let id = insert(&mut tx, new, None, self.clock.now()).await?;
        let job = fetch(&mut tx, &id).await?;
        tx.commit().await?;
        Ok(Submission::Accepted(job))
    }

    /// Adds all jobs of a sweep to the queue, or none if it has no room for all. Returns the sweep's id.
    pub async fn submit_sweep(&self, name: &str, new: &[NewJob], max_queued: i64) -> Result<Option<Uuid>> {
        let sweep = Uuid::now_v7();
        let mut tx = self.database.lock_queue().await?;
        if queued(&mut tx).await? + new.len() as i64 > max_queued {
            return Ok(None);
        }
        let now = self.clock.now();
        sqlx::query("INSERT INTO sweeps (id, name, created_at) VALUES ($1, $2, $3)")
            .bind(sweep.to_string())
            .bind(name)
            .bind(now)
            .execute(&mut *tx)
            .await?;
        for job in new {
            insert(&mut tx, job, Some(sweep), now).await?;
        }
        tx.commit().await?;
        Ok(Some(sweep))
    }
}

async fn queued(tx: &mut Transaction<'static, Any>) -> sqlx::Result<i64> {
    sqlx::query_scalar("SELECT count(*) FROM jobs WHERE status = 'queued'").fetch_one(&mut **tx).await
}

/// A job with its place in the queue.
async fn fetch(tx: &mut Transaction<'static, Any>, id: &str) -> sqlx::Result<Job> {
    let row: JobRow = sqlx::query_as(select_jobs("WHERE id = $1")).bind(id).fetch_one(&mut **tx).await?;
    with_place(&mut **tx, row.0).await
}

/// Adds the place in the queue to a job that waits.
pub(super) async fn with_place<'c>(executor: impl Executor<'c, Database = Any>, mut job: Job) -> sqlx::Result<Job> {
    if job.status == super::Status::Queued {
        let place: i64 = sqlx::query_scalar(
            "SELECT count(*) FROM jobs WHERE status = 'queued' AND (priority > $1 OR (priority = $1 AND seq <= $2))",
        )
        .bind(job.priority)
        .bind(job.seq)
        .fetch_one(executor)
        .await?;
        // It may have been claimed between the two queries.
        job.queue_position = Some(place.max(1));
    }
    Ok(job)
}

async fn insert(
    tx: &mut Transaction<'static, Any>,
    new: &NewJob,
    sweep: Option<Uuid>,
    now: i64,
) -> sqlx::Result<String> {
    let id = Uuid::now_v7().to_string();
    let seq: i64 = sqlx::query_scalar(
        "INSERT INTO jobs (id, name, scene_sha256, idempotency_key, request_sha256, status, created_at, particles, \
         frames, end_time_s, integrator, integrator_reason, notices, priority, tags, deadline, estimate_s, sweep) \
         VALUES ($1, $2, $3, $4, $5, 'queued', $6, $7, $8, $9, $10, $11, $12, $13, $14, $15, $16, $17) RETURNING seq",
    )
    .bind(&id)
    .bind(&new.name)
    .bind(&new.scene_sha256)
    .bind(&new.idempotency_key)
    .bind(&new.request_sha256)
    .bind(now)
    .bind(new.particles as i64)
    .bind(new.frames as i64)
    .bind(new.end_time_s)
    .bind(&new.integrator)
    .bind(&new.integrator_reason)
    .bind(serde_json::to_string(&new.notices).expect("notices are plain text"))
    .bind(new.priority)
    .bind(serde_json::to_string(&new.tags).expect("tags are plain text"))
    .bind(new.deadline.map(|time| time.as_microsecond()))
    .bind(new.estimate_s)
    .bind(sweep.map(|sweep| sweep.to_string()))
    .fetch_one(&mut **tx)
    .await?;
    sqlx::query("INSERT INTO job_scenes (seq, scene) VALUES ($1, $2)")
        .bind(seq)
        .bind(&new.scene)
        .execute(&mut **tx)
        .await?;
    for tag in &new.tags {
        sqlx::query("INSERT INTO job_tags (tag, seq) VALUES ($1, $2)").bind(tag).bind(seq).execute(&mut **tx).await?;
    }
    Ok(id)
}
