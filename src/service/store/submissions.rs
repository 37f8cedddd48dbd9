//! Adding jobs to the table.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

use sqlx::any::Any;
use sqlx::{AssertSqlSafe, Executor, Transaction};
use tokio::sync::oneshot;
use uuid::Uuid;

use super::database::Database;
use super::row::{COLUMNS, JobRow, select_jobs};
use super::{Job, JobStore, NewJob, Result, StoreError, Submission};

/// Most submissions of one transaction.
const MOST_AT_ONCE: usize = 256;

/// Submissions that wait for a transaction. One commit, and so one write that the disk confirms, is for
/// all that came while the one before was on its way.
#[derive(Clone, Debug, Default)]
pub(super) struct Submissions {
    waiting: Arc<Mutex<Vec<Waiting>>>,
    /// Held by whoever writes.
    turn: Arc<tokio::sync::Mutex<()>>,
}

#[derive(Debug)]
struct Waiting {
    new: NewJob,
    max_queued: i64,
    answer: oneshot::Sender<Result<Submission>>,
}

impl Submissions {
    fn waiting(&self) -> std::sync::MutexGuard<'_, Vec<Waiting>> {
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl JobStore {
    /// Adds a job to the queue unless `max_queued` jobs are waiting already. Once this returns, the job
    /// survives a power failure.
    pub async fn submit(&self, new: &NewJob, max_queued: i64) -> Result<Submission> {
        let (answer, answered) = oneshot::channel();
        self.submissions.waiting().push(Waiting { new: new.clone(), max_queued, answer });
        // In a task of its own, which goes on for the others if this client leaves.
        let store = self.clone();
        tokio::spawn(async move { store.submit_waiting().await });
        answered.await.unwrap_or_else(|_| Err(StoreError::Database(sqlx::Error::WorkerCrashed)))
    }

    async fn submit_waiting(&self) {
        let _turn = self.submissions.turn.lock().await;
        let batch: Vec<Waiting> = {
            let mut waiting = self.submissions.waiting();
            let most = waiting.len().min(MOST_AT_ONCE);
            waiting.drain(..most).collect()
        };
        if batch.is_empty() {
            return;
        }
        match self.submit_all(&batch).await {
            Ok(submissions) => {
                for (waiting, submission) in batch.into_iter().zip(submissions) {
                    // A client that has left needs no answer.
                    let _ = waiting.answer.send(Ok(submission));
                }
            }
            // It may be the fault of one of them.
            Err(_) => {
                for waiting in batch {
                    let alone = self.submit_all(std::slice::from_ref(&waiting)).await;
                    let _ = waiting.answer.send(alone.map(|mut submissions| submissions.remove(0)));
                }
            }
        }
    }

    /// In one transaction, in order.
    async fn submit_all(&self, batch: &[Waiting]) -> Result<Vec<Submission>> {
        let mut tx = self.database.lock_queue().await?;
        let mut queue = Queue { waiting: queued(&mut tx).await?, places: BTreeMap::new() };
        let mut submissions = Vec::with_capacity(batch.len());
        for Waiting { new, max_queued, .. } in batch {
            submissions.push(self.submit_one(&mut tx, &mut queue, new, *max_queued).await?);
        }
        tx.commit().await?;
        Ok(submissions)
    }

    async fn submit_one(
        &self,
        tx: &mut Transaction<'static, Any>,
        queue: &mut Queue,
        new: &NewJob,
        max_queued: i64,
    ) -> Result<Submission> {
        if let Some(key) = &new.idempotency_key {
            let earlier: Option<(String, String)> =
                sqlx::query_as("SELECT id, request_sha256 FROM jobs WHERE idempotency_key = $1")
                    .bind(key)
                    .fetch_optional(&mut **tx)
                    .await?;
            if let Some((id, request_sha256)) = earlier {
                if request_sha256 != new.request_sha256 {
                    return Ok(Submission::KeyReused);
                }
                return Ok(Submission::Repeated(fetch(&self.database, tx, &id).await?));
            }
        }
        if queue.waiting >= max_queued {
            return Ok(Submission::QueueFull);
        }
        let job = insert(tx, new, None, self.clock.now()).await?;
        let place = queue.place(&self.database, tx, &job).await?;
        Ok(Submission::Accepted(Job { queue_position: Some(place), ..job }))
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

/// The queue as a transaction sees it, which keeps everybody else from adding to it.
struct Queue {
    waiting: i64,
    /// The last place of each priority that was asked for.
    places: BTreeMap<i64, i64>,
}

impl Queue {
    /// The place of a job that was added just now.
    async fn place(&mut self, database: &Database, tx: &mut Transaction<'static, Any>, job: &Job) -> sqlx::Result<i64> {
        self.waiting += 1;
        for (_, place) in self.places.range_mut(..=job.priority) {
            *place += 1;
        }
        if let Some(place) = self.places.get(&job.priority) {
            return Ok(*place);
        }
        let place = place(&mut **tx, database.along_queue(), job).await?;
        self.places.insert(job.priority, place);
        Ok(place)
    }
}

async fn queued(tx: &mut Transaction<'static, Any>) -> sqlx::Result<i64> {
    sqlx::query_scalar("SELECT count(*) FROM jobs WHERE status = 'queued'").fetch_one(&mut **tx).await
}

/// A job with its place in the queue.
async fn fetch(database: &Database, tx: &mut Transaction<'static, Any>, id: &str) -> sqlx::Result<Job> {
    let row: JobRow = sqlx::query_as(select_jobs("WHERE id = $1")).bind(id).fetch_one(&mut **tx).await?;
    with_place(&mut **tx, database.along_queue(), row.0).await
}

/// Adds the place in the queue to a job that waits.
pub(super) async fn with_place<'c>(
    executor: impl Executor<'c, Database = Any>,
    along_queue: &str,
    mut job: Job,
) -> sqlx::Result<Job> {
    if job.status == super::Status::Queued {
        job.queue_position = Some(place(executor, along_queue, &job).await?);
    }
    Ok(job)
}

async fn place<'c>(executor: impl Executor<'c, Database = Any>, along_queue: &str, job: &Job) -> sqlx::Result<i64> {
    // Two counts along the index of the queue, which has no need of the jobs' rows.
    let place: i64 = sqlx::query_scalar(AssertSqlSafe(format!(
        "SELECT (SELECT count(*) FROM jobs {along_queue} WHERE status = 'queued' AND priority > $1) + \
         (SELECT count(*) FROM jobs {along_queue} WHERE status = 'queued' AND priority = $1 AND seq <= $2)"
    )))
    .bind(job.priority)
    .bind(job.seq)
    .fetch_one(executor)
    .await?;
    // It may have been claimed since it was read.
    Ok(place.max(1))
}

async fn insert(tx: &mut Transaction<'static, Any>, new: &NewJob, sweep: Option<Uuid>, now: i64) -> sqlx::Result<Job> {
    let row: JobRow = sqlx::query_as(AssertSqlSafe(format!(
        "INSERT INTO jobs (id, name, scene_sha256, idempotency_key, request_sha256, status, created_at, particles, \
         frames, end_time_s, integrator, integrator_reason, notices, priority, tags, deadline, estimate_s, sweep) \
         VALUES ($1, $2, $3, $4, $5, 'queued', $6, $7, $8, $9, $10, $11, $12, $13, $14, $15, $16, $17) \
         RETURNING {COLUMNS}"
    )))
    .bind(Uuid::now_v7().to_string())
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
        .bind(row.0.seq)
        .bind(&new.scene)
        .execute(&mut **tx)
        .await?;
    for tag in &new.tags {
        sqlx::query("INSERT INTO job_tags (tag, seq) VALUES ($1, $2)")
            .bind(tag)
            .bind(row.0.seq)
            .execute(&mut **tx)
            .await?;
    }
    Ok(row.0)
}
