//! Attempts that are offered to a cluster's scheduler, which starts a process for each.
//!
//! An offer promises nothing: the process claims the job when it runs, by the number of the attempt. Of two
//! processes that were started for one attempt, by a server that died between the offer and its note, one gets the
//! job and the other ends.

use std::collections::VecDeque;

use sqlx::any::AnyRow;
use sqlx::{AssertSqlSafe, FromRow, Row};
use uuid::Uuid;

use super::attempts::CLAIMED;
use super::row::{ClaimRow, uuid};
use super::{Claim, Failure, JobStore, LEASE, MAX_DEATHS, Result, Status, known, turns};

/// A job that waits and has not been offered.
#[derive(Clone, Debug, PartialEq)]
pub struct Candidate {
    pub id: Uuid,
    /// The number of the attempt that would run.
    pub attempt: i64,
    pub name: String,
    /// The sweep that it is of, and its name.
    pub sweep: Option<(Uuid, String)>,
    /// Foretold wall time (s).
    pub estimate_s: Option<f64>,
    /// Attempts before it that died, without a newer checkpoint between them.
    pub deaths: i64,
}

/// An attempt of which the scheduler may still have something.
#[derive(Clone, Debug, PartialEq)]
pub struct Offer {
    pub id: Uuid,
    pub sweep: Option<Uuid>,
    /// The number of the attempt.
    pub attempt: i64,
    /// The scheduler's name of it.
    pub cluster_job: String,
    /// That of the job.
    pub status: Status,
    /// The last attempt that has begun.
    pub begun: i64,
    /// Whether that is this one, in this process. If the job waits all the same, the attempt is over.
    pub claimed: bool,
    /// Whether the lease of the last attempt that has begun is over.
    pub expired: bool,
    pub cancel_requested: bool,
    /// When the job ended (µs since the Unix epoch).
    pub finished_at: Option<i64>,
}

/// Result of a claim by the number of an attempt.
#[derive(Clone, Debug)]
pub enum Taken {
    Claimed(Claim),
    /// The attempt before this one may still live.
    NotYet,
    /// The job is not to be run by this attempt, and why.
    Never(String),
}

/// What a deleted job has left with the scheduler.
#[derive(Clone, Debug, PartialEq)]
pub struct Leftover {
    /// That of the job.
    pub id: Uuid,
    pub sweep: Option<Uuid>,
    pub cluster_job: String,
}

impl Offer {
    /// Whether the job has gone on without it, such as on another server.
    pub fn is_passed(&self) -> bool {
        !self.claimed && self.begun >= self.attempt
    }
}

/// Who holds the lease of an attempt that a process of the scheduler's runs.
pub fn owner(cluster_job: &str) -> String {
    format!("cluster job {cluster_job}")
}

/// How the scheduler's part of an attempt ended.
#[derive(Clone, Debug, PartialEq)]
pub enum OfferEnd {
    /// The job has gone on without it.
    Passed,
    /// Somebody canceled it there.
    Canceled,
    /// It is over, and the job had no part in that: it is offered again.
    Interrupted,
    /// Its time was up. The job goes on in another attempt, but not for ever without a checkpoint.
    TimedOut(Failure),
    /// Its process died.
    Died(Failure),
}

impl JobStore {
    /// The next jobs to offer, at most so many: by turns of the keys that they are of, as [`JobStore::claim`] takes
    /// them. What was offered counts as what runs.
    pub async fn candidates(&self, limit: i64) -> Result<Vec<Candidate>> {
        let now = self.clock.now();
        let mut lines = Vec::new();
        for line in turns::lines(&self.database.reader, &self.database, now).await? {
            let waiting = VecDeque::from(self.candidates_of(&line.key, limit, now).await?);
            lines.push((line, waiting));
        }
        let mut candidates = Vec::new();
        while candidates.len() < limit as usize {
            let free = lines.iter_mut().filter(|(line, waiting)| line.has_room() && !waiting.is_empty());
            let Some((line, waiting)) = free.min_by_key(|(line, _)| line.rank()) else { break };
            line.busy += 1;
            candidates.extend(waiting.pop_front());
        }
        Ok(candidates)
    }

    /// The next jobs of a key to offer: those with the highest priority that have waited longest.
    async fn candidates_of(&self, key: &str, limit: i64, now: i64) -> Result<Vec<Candidate>> {
        let rows: Vec<CandidateRow> = sqlx::query_as(AssertSqlSafe(format!(
            "SELECT jobs.id, attempt, deaths, jobs.name, sweep, estimate_s, \
               (SELECT sweeps.name FROM sweeps WHERE sweeps.id = jobs.sweep) AS sweep_name FROM jobs {} \
             WHERE status = 'queued' AND jobs.key_id = $3 AND offered_attempt IS NULL \
               AND (deadline IS NULL OR deadline >= $1 OR attempt > 0) ORDER BY priority DESC, seq LIMIT $2",
            self.database.along_queue()
        )))
        .bind(now)
        .bind(limit)
        .bind(key)
        .fetch_all(&self.database.reader)
        .await?;
        Ok(rows.into_iter().map(|row| row.0).collect())
    }

    /// Notes that an attempt was offered, whose process may have begun already. Returns false if the job needs it no
    /// longer.
    pub async fn offered(&self, id: Uuid, attempt: i64, cluster_job: &str) -> Result<bool> {
        let changed = sqlx::query(
            "UPDATE jobs SET cluster_job = $1, offered_attempt = $2 \
             WHERE id = $3 AND (status = 'queued' AND attempt = $2 - 1 AND offered_attempt IS NULL \
               OR cluster_job = $1 AND offered_attempt = $2)",
        )
        .bind(cluster_job)
        .bind(attempt)
        .bind(id.to_string())
        .execute(&self.database.writer)
        .await?
        .rows_affected();
        Ok(changed > 0)
    }

    /// The attempts of which the scheduler may still have something.
    pub async fn offers(&self) -> Result<Vec<Offer>> {
        let rows: Vec<OfferRow> = sqlx::query_as(
            "SELECT id, sweep, attempt, owner, offered_attempt, cluster_job, status, cancel_requested, finished_at, \
               CASE WHEN lease_until < $1 THEN CAST(1 AS BIGINT) ELSE 0 END AS expired FROM jobs \
             WHERE offered_attempt IS NOT NULL ORDER BY seq",
        )
        .bind(self.clock.now())
        .fetch_all(&self.database.reader)
        .await?;
        Ok(rows.into_iter().map(|row| row.0).collect())
    }

    /// Claims a job for the attempt of this number, for a process of the scheduler's. Leases of others are not looked
    /// at: the process's machine may have a wrong clock.
    pub async fn take(&self, id: Uuid, attempt: i64, cluster_job: &str) -> Result<Taken> {
        let now = self.clock.now();
        let row: Option<ClaimRow> = sqlx::query_as(AssertSqlSafe(format!(
            "UPDATE jobs SET {CLAIMED}, cluster_job = $4, offered_attempt = attempt + 1 \
             WHERE id = $5 AND attempt = $6 AND status = 'queued' \
               AND (deadline IS NULL OR deadline >= $3 OR attempt > 0) \
             RETURNING id, attempt, deaths, (SELECT scene FROM job_scenes WHERE job_scenes.seq = jobs.seq) AS scene"
        )))
        .bind(owner(cluster_job))
        .bind(now + LEASE.as_micros() as i64)
        .bind(now)
        .bind(cluster_job)
        .bind(id.to_string())
        .bind(attempt - 1)
        .fetch_optional(&self.database.writer)
        .await?;
        if let Some(row) = row {
            return Ok(Taken::Claimed(row.0));
        }
        Ok(match self.get(id).await? {
            None => Taken::Never("there is no such job; it may have been deleted".into()),
            Some(job) if job.status == Status::Running && job.attempt == attempt - 1 => Taken::NotYet,
            Some(job) => Taken::Never(format!("the job is {}, at attempt {}", job.status, job.attempt)),
        })
    }

    /// What the scheduler may still have of jobs that were deleted.
    pub async fn leftovers(&self) -> Result<Vec<Leftover>> {
        let rows = sqlx::query_as("SELECT id, sweep, cluster_job FROM cluster_leftovers ORDER BY id LIMIT 1000");
        let rows: Vec<LeftoverRow> = rows.fetch_all(&self.database.reader).await?;
        Ok(rows.into_iter().map(|row| row.0).collect())
    }

    /// The scheduler was told to end these.
    pub async fn forget_leftovers(&self, leftovers: &[Leftover]) -> Result<()> {
        for Leftover { id, .. } in leftovers {
            let forget = sqlx::query("DELETE FROM cluster_leftovers WHERE id = $1").bind(id.to_string());
            forget.execute(&self.database.writer).await?;
        }
        Ok(())
    }

    /// Ends what is left of an offer. Returns the job's status, or `None` if it has moved on.
    pub async fn withdraw(&self, offer: &Offer, end: &OfferEnd) -> Result<Option<Status>> {
        // What a process died of is counted where its job was put back, or its lease ran out.
        let noted = offer.claimed && offer.status == Status::Queued;
        let (cancel, deaths, failure) = match end {
            OfferEnd::Passed => (0, 0, None),
            OfferEnd::Canceled => (1, 0, None),
            OfferEnd::Interrupted => (0, 0, None),
            OfferEnd::TimedOut(failure) => (0, 1, Some(failure)),
            OfferEnd::Died(failure) => (0, i64::from(!noted), Some(failure)),
        };
        let open = match end {
            OfferEnd::Passed => "1 = 0",
            _ => "status IN ('queued', 'running')",
        };
        let canceled = format!("{open} AND (cancel_requested = 1 OR $1 = 1)");
        let failed = format!("{open} AND $2 = 1 AND deaths + $2 >= $3");
        let status: Option<String> = sqlx::query_scalar(AssertSqlSafe(format!(
            "UPDATE jobs SET offered_attempt = NULL, \
               deaths = CASE WHEN {open} THEN deaths + $2 ELSE deaths END, \
               status = CASE WHEN {canceled} THEN 'canceled' WHEN {failed} THEN 'failed' \
                 WHEN {open} THEN 'queued' ELSE status END, \
               finished_at = CASE WHEN {canceled} OR {failed} THEN $5 ELSE finished_at END, \
               started_at = CASE WHEN {open} AND NOT ({canceled}) AND NOT ({failed}) THEN NULL ELSE started_at END, \
               failure_code = CASE WHEN {failed} AND NOT ({canceled}) THEN $6 ELSE failure_code END, \
               failure_message = CASE WHEN {failed} AND NOT ({canceled}) THEN $7 ELSE failure_message END \
             WHERE id = $8 AND cluster_job = $9 AND offered_attempt = $4 AND status = $10 AND attempt = $11 \
             RETURNING status"
        )))
        .bind(cancel)
        .bind(deaths)
        .bind(MAX_DEATHS)
        .bind(offer.attempt)
        .bind(self.clock.now())
        .bind(failure.map(|failure| failure.code.as_str()))
        .bind(failure.map(|failure| failure.message.as_str()))
        .bind(offer.id.to_string())
        .bind(&offer.cluster_job)
        .bind(offer.status.as_str())
        .bind(offer.begun)
        .fetch_optional(&self.database.writer)
        .await?;
        Ok(status.map(known))
    }
}

struct CandidateRow(Candidate);

impl FromRow<'_, AnyRow> for CandidateRow {
    fn from_row(row: &AnyRow) -> sqlx::Result<Self> {
        let sweep = row.try_get::<Option<String>, _>("sweep")?.map(uuid).transpose()?;
        Ok(Self(Candidate {
            id: uuid(row.try_get("id")?)?,
            attempt: row.try_get::<i64, _>("attempt")? + 1,
            name: row.try_get("name")?,
            sweep: sweep.zip(row.try_get("sweep_name")?),
            estimate_s: row.try_get("estimate_s")?,
            deaths: row.try_get("deaths")?,
        }))
    }
}

struct LeftoverRow(Leftover);

impl FromRow<'_, AnyRow> for LeftoverRow {
    fn from_row(row: &AnyRow) -> sqlx::Result<Self> {
        Ok(Self(Leftover {
            id: uuid(row.try_get("id")?)?,
            sweep: row.try_get::<Option<String>, _>("sweep")?.map(uuid).transpose()?,
            cluster_job: row.try_get("cluster_job")?,
        }))
    }
}

struct OfferRow(Offer);

impl FromRow<'_, AnyRow> for OfferRow {
    fn from_row(row: &AnyRow) -> sqlx::Result<Self> {
        let (attempt, begun) = (row.try_get("offered_attempt")?, row.try_get("attempt")?);
        let cluster_job: String = row.try_get("cluster_job")?;
        let holder: Option<String> = row.try_get("owner")?;
        Ok(Self(Offer {
            id: uuid(row.try_get("id")?)?,
            sweep: row.try_get::<Option<String>, _>("sweep")?.map(uuid).transpose()?,
            attempt,
            begun,
            claimed: begun == attempt && holder.is_some_and(|holder| holder == owner(&cluster_job)),
            cluster_job,
            status: known(row.try_get("status")?),
            expired: row.try_get::<i64, _>("expired")? != 0,
            cancel_requested: row.try_get::<i64, _>("cancel_requested")? != 0,
            finished_at: row.try_get("finished_at")?,
        }))
    }
}
