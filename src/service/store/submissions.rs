//! Adding jobs to the table.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::sync::Arc;

use sqlx::any::Any;
use sqlx::{AssertSqlSafe, Executor, Transaction};
use uuid::Uuid;

use super::database::Database;
use super::insertion::{insert, pieces, rows};
use super::row::{JobRow, select_jobs, uuid};
use super::turns::catch_up;
use super::{Job, JobStore, NewJob, NewSweep, Owner, Result, Submission};

/// A job to be added, and the most jobs that may wait.
pub(super) type NewSubmission = (NewJob, i64);

impl JobStore {
    /// Adds a job to the queue unless `max_queued` jobs are waiting already. Once this returns, the job
    /// survives a power failure.
    pub async fn submit(&self, new: &NewJob, max_queued: i64) -> Result<Submission> {
        // One commit, and so one write that the disk confirms, is for all that came during the one before.
        let all = |store: Self, batch: Arc<Vec<NewSubmission>>| async move { store.submit_all(&batch).await };
        self.submissions.answer(self, (new.clone(), max_queued), all).await
    }

    /// In one transaction, in order.
    async fn submit_all(&self, batch: &[NewSubmission]) -> Result<Vec<Submission>> {
        let mut tx = self.database.lock_queue().await?;
        let mut queue = Queue::now(&self.database, &mut tx).await?;
        let mut earlier = earlier(&mut tx, batch).await?;
        let mut accepted = Vec::new();
        let mut verdicts = Vec::with_capacity(batch.len());
        for (new, max_queued) in batch {
            let idempotency_key = new.owner.mark(&new.idempotency_key);
            let same = idempotency_key.as_ref().and_then(|key| earlier.get(key));
            verdicts.push(match same {
                Some(same) if same.request_sha256 != new.request_sha256 => Verdict::KeyReused,
                Some(same) => Verdict::Repeats(same.job.clone()),
                None if queue.waiting() >= *max_queued => Verdict::QueueFull,
                None if let Some(most) = queue.full(&new.owner, 1) => Verdict::OwnerFull(most),
                None => {
                    let job = Earlier { request_sha256: new.request_sha256.clone(), job: Known::New(accepted.len()) };
                    accepted.push(new);
                    if let Some(key) = idempotency_key {
                        earlier.insert(key, job);
                    }
                    Verdict::Accepted { place: queue.add(&new.owner, new.priority) }
                }
            });
        }
        queue.let_in(&mut tx).await?;
        let jobs = insert(&mut tx, &accepted, None, self.clock.now()).await?;
        // In the order of the verdicts that accepted them.
        let mut fresh = jobs.clone().into_iter();
        let mut submissions = Vec::with_capacity(batch.len());
        for verdict in verdicts {
            submissions.push(match verdict {
                Verdict::KeyReused => Submission::KeyReused,
                Verdict::QueueFull => Submission::QueueFull,
                Verdict::OwnerFull(most) => Submission::OwnerFull(most),
                Verdict::Accepted { place } => {
                    let job = fresh.next().expect("a job for each");
                    Submission::Accepted(Job { queue_position: Some(place), ..job })
                }
                Verdict::Repeats(Known::New(index)) => {
                    Submission::Repeated(with_place(&mut *tx, self.database.along_queue(), jobs[index].clone()).await?)
                }
                Verdict::Repeats(Known::Stored(id)) => Submission::Repeated(fetch(&self.database, &mut tx, &id).await?),
            });
        }
        tx.commit().await?;
        Ok(submissions)
    }

    /// Adds all jobs of a sweep to the queue, or none if it has no room for all. Returns the sweep's id.
    pub async fn submit_sweep(&self, new: &NewSweep, max_queued: i64) -> Result<Submission<Uuid>> {
        let mut tx = self.database.lock_queue().await?;
        let idempotency_key = new.owner.mark(&new.idempotency_key);
        let earlier: Option<(String, String)> =
            sqlx::query_as("SELECT id, request_sha256 FROM sweeps WHERE idempotency_key = $1")
                .bind(&idempotency_key)
                .fetch_optional(&mut *tx)
                .await?;
        if let Some((id, request_sha256)) = earlier {
            return Ok(match request_sha256 == new.request_sha256 {
                true => Submission::Repeated(uuid(id)?),
                false => Submission::KeyReused,
            });
        }
        let mut queue = Queue::now(&self.database, &mut tx).await?;
        let jobs = new.jobs.len() as i64;
        if queue.waiting() + jobs > max_queued {
            return Ok(Submission::QueueFull);
        }
        if let Some(most) = queue.full(&new.owner, jobs) {
            return Ok(Submission::OwnerFull(most));
        }
        queue.add(&new.owner, 0);
        queue.let_in(&mut tx).await?;
        let (id, now) = (Uuid::now_v7(), self.clock.now());
        sqlx::query(
            "INSERT INTO sweeps (id, name, created_at, idempotency_key, request_sha256, key_id) \
             VALUES ($1, $2, $3, $4, $5, $6)",
        )
        .bind(id.to_string())
        .bind(&new.name)
        .bind(now)
        .bind(&idempotency_key)
        .bind(&new.request_sha256)
        .bind(&new.owner.key)
        .execute(&mut *tx)
        .await?;
        insert(&mut tx, &new.jobs.iter().collect::<Vec<_>>(), Some(id), now).await?;
        tx.commit().await?;
        Ok(Submission::Accepted(id))
    }
}

/// The queue as a transaction sees it, which keeps everybody else from adding to it: the jobs that wait, by key and
/// priority, and the keys whose first job comes now.
struct Queue {
    lines: BTreeMap<String, BTreeMap<i64, i64>>,
    newcomers: BTreeSet<String>,
}

impl Queue {
    async fn now(database: &Database, tx: &mut Transaction<'static, Any>) -> sqlx::Result<Self> {
        let counts: Vec<(String, i64, i64)> = sqlx::query_as(AssertSqlSafe(format!(
            "SELECT key_id, priority, count(*) FROM jobs {} WHERE status = 'queued' GROUP BY key_id, priority",
            database.along_queue()
        )))
        .fetch_all(&mut **tx)
        .await?;
        let mut lines: BTreeMap<String, BTreeMap<i64, i64>> = BTreeMap::new();
        for (key, priority, jobs) in counts {
            lines.entry(key).or_default().insert(priority, jobs);
        }
        Ok(Self { lines, newcomers: BTreeSet::new() })
    }

    fn waiting(&self) -> i64 {
        self.lines.values().flat_map(BTreeMap::values).sum()
    }

    /// The most jobs of an owner that may wait, if it has no room for so many more.
    fn full(&self, owner: &Owner, more: i64) -> Option<i64> {
        let waiting: i64 = self.lines.get(&owner.key).map_or(0, |line| line.values().sum());
        owner.max_queued.filter(|most| waiting + more > *most)
    }

    /// Adds a job. Returns its place among its owner's.
    fn add(&mut self, owner: &Owner, priority: i64) -> i64 {
        if !owner.key.is_empty() && !self.lines.contains_key(&owner.key) {
            self.newcomers.insert(owner.key.clone());
        }
        let line = self.lines.entry(owner.key.clone()).or_default();
        *line.entry(priority).or_default() += 1;
        line.range(priority..).map(|(_, waiting)| waiting).sum()
    }

    /// Finds the turns of those whose first job comes.
    async fn let_in(&self, tx: &mut Transaction<'static, Any>) -> sqlx::Result<()> {
        for key in &self.newcomers {
            catch_up(tx, key).await?;
        }
        Ok(())
    }
}

/// What becomes of a submission.
enum Verdict {
    Accepted { place: i64 },
    Repeats(Known),
    KeyReused,
    QueueFull,
    OwnerFull(i64),
}

/// A job accepted under an idempotency key.
struct Earlier {
    request_sha256: String,
    job: Known,
}

#[derive(Clone)]
enum Known {
    /// The id of a job in the table.
    Stored(String),
    /// One of those that the same transaction accepts.
    New(usize),
}

/// The jobs in the table with an idempotency key of a batch.
async fn earlier(
    tx: &mut Transaction<'static, Any>,
    batch: &[NewSubmission],
) -> sqlx::Result<HashMap<String, Earlier>> {
    let keys: Vec<String> = batch.iter().filter_map(|(new, _)| new.owner.mark(&new.idempotency_key)).collect();
    let mut found = HashMap::new();
    for keys in pieces(&keys) {
        let mut query = sqlx::query_as(AssertSqlSafe(format!(
            "SELECT idempotency_key, id, request_sha256 FROM jobs WHERE idempotency_key IN {}",
            rows(1, keys.len())
        )));
        for key in keys {
            query = query.bind(key);
        }
        let jobs: Vec<(String, String, String)> = query.fetch_all(&mut **tx).await?;
        found.extend(
            jobs.into_iter().map(|(key, id, request_sha256)| (key, Earlier { request_sha256, job: Known::Stored(id) })),
        );
    }
    Ok(found)
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
        "SELECT (SELECT count(*) FROM jobs {along_queue} WHERE status = 'queued' AND key_id = $3 AND priority > $1) + \
         (SELECT count(*) FROM jobs {along_queue} WHERE status = 'queued' AND key_id = $3 AND priority = $1 \
           AND seq <= $2)"
    )))
    .bind(job.priority)
    .bind(job.seq)
    .bind(job.key.as_deref().unwrap_or_default())
    .fetch_one(executor)
    .await?;
    // It may have been claimed since it was read.
    Ok(place.max(1))
}
