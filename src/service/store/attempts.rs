//! What workers ask of the table of jobs: the life of an attempt.

use sqlx::any::Any;
use sqlx::{AssertSqlSafe, Transaction};
use uuid::Uuid;

use super::row::{ClaimRow, LostRow};
use super::{
    Claim, Failure, JobStore, LEASE, MAX_DEATHS, Outcome, Progress, Recovered, Result, Status, build, known, turns,
};
use gridfall_engine::Backend;

const LEASE_US: i64 = LEASE.as_micros() as i64;

/// What a claim sets: by the owner `$1`, until `$2`, at `$3`.
pub(super) const CLAIMED: &str = "status = 'running', attempt = attempt + 1, owner = $1, lease_until = $2, \
    beat_at = $3, started_at = CASE WHEN created_at > $3 THEN created_at ELSE $3 END, backend = NULL, \
    sim_time_s = CASE WHEN checkpoint_frame IS NULL THEN 0.0 ELSE sim_time_s END, \
    step = CASE WHEN checkpoint_frame IS NULL THEN 0 ELSE step END, \
    frames_written = CASE WHEN checkpoint_frame IS NULL THEN 0 ELSE frames_written END, \
    run_s = CASE WHEN checkpoint_frame IS NULL THEN 0.0 ELSE run_s END";

/// A time before and a time after which the end of a lease shows that nobody holds the job.
#[derive(Clone, Copy)]
struct Overdue(i64, i64);

impl Overdue {
    /// Whatever the lease says.
    const ALWAYS: Self = Self(i64::MAX, i64::MAX);

    /// By clocks that differ by less than a lease, none ends later than two leases from now. One that does was
    /// taken before the clock went back, and lives on only if it is renewed at once.
    fn at(now: i64) -> Self {
        Self(now, now.saturating_add(2 * LEASE_US))
    }
}

impl JobStore {
    /// Claims a job under a new lease: of the key whose turn it is, the one that has waited longest of those with the
    /// highest priority. Jobs whose workers are gone are among those that wait.
    pub async fn claim(&self, owner: &str) -> Result<Option<Claim>> {
        self.claim_up_to(owner, u64::MAX).await
    }

    /// The same of the jobs with no more than so many particles.
    pub async fn claim_up_to(&self, owner: &str, most_particles: u64) -> Result<Option<Claim>> {
        let most = i64::try_from(most_particles).unwrap_or(i64::MAX);
        self.expire(|_| String::new()).await?;
        self.fail_overdue().await?;
        let now = self.clock.now();
        let mut tx = self.database.lock_queue().await?;
        for key in turns::next(&mut tx, &self.database, now).await? {
            if let Some(claim) = self.claim_of(&mut tx, owner, (&key, most), now).await? {
                tx.commit().await?;
                return Ok(Some(claim));
            }
        }
        Ok(None)
    }

    /// Claims the next job of a key.
    async fn claim_of(
        &self,
        tx: &mut Transaction<'static, Any>,
        owner: &str,
        (key, most_particles): (&str, i64),
        now: i64,
    ) -> Result<Option<Claim>> {
        let row: Option<ClaimRow> = sqlx::query_as(AssertSqlSafe(format!(
            "UPDATE jobs SET {CLAIMED} WHERE seq = (SELECT seq FROM jobs {} WHERE status = 'queued' AND key_id = $4 \
               AND particles <= $5 AND (deadline IS NULL OR deadline >= $3 OR attempt > 0) \
               ORDER BY priority DESC, seq LIMIT 1 {}) \
             RETURNING id, attempt, deaths, (SELECT scene FROM job_scenes WHERE job_scenes.seq = jobs.seq) AS scene",
            self.database.along_queue(),
            self.database.skip_locked()
        )))
        .bind(owner)
        .bind(now + LEASE_US)
        .bind(now)
        .bind(key)
        .bind(most_particles)
        .fetch_optional(&mut **tx)
        .await?;
        Ok(row.map(|row| row.0))
    }

    /// Fails the jobs that should have been started by now.
    pub async fn fail_overdue(&self) -> Result<()> {
        let now = self.clock.now();
        let overdue = sqlx::query(
            "UPDATE jobs SET status = 'failed', finished_at = $1, failure_code = 'deadline', failure_message = $2 \
             WHERE status = 'queued' AND deadline < $1 AND attempt = 0",
        );
        overdue
            .bind(now)
            .bind("no worker was free to start the job before its deadline; give it more time or a higher priority")
            .execute(&self.database.writer)
            .await?;
        Ok(())
    }

    /// Records what an attempt runs on.
    pub async fn set_backend(&self, id: Uuid, attempt: i64, backend: &Backend) -> Result<()> {
        let backend = serde_json::to_string(backend).expect("a backend is plain data");
        sqlx::query("UPDATE jobs SET backend = $1, build = $2 WHERE id = $3 AND attempt = $4 AND status = 'running'")
            .bind(backend)
            .bind(build())
            .bind(id.to_string())
            .bind(attempt)
            .execute(&self.database.writer)
            .await?;
        Ok(())
    }

    /// Records an attempt's progress and renews its lease. Returns whether it should continue: false
    /// after a request to cancel, or if the job is no longer this attempt's. The time since the last one counts as
    /// that of a device, but for what is longer than a lease.
    pub async fn heartbeat(&self, id: Uuid, attempt: i64, progress: &Progress) -> Result<bool> {
        let now = self.clock.now();
        let cancel_requested: Option<i64> = sqlx::query_scalar(
            "UPDATE jobs SET sim_time_s = $1, step = $2, frames_written = $3, run_s = $4, lease_until = $5, \
               device_us = device_us + \
                 CASE WHEN $8 < beat_at THEN 0 WHEN $8 - beat_at > $9 THEN $9 ELSE $8 - beat_at END, \
               beat_at = $8 WHERE id = $6 AND attempt = $7 AND status = 'running' RETURNING cancel_requested",
        )
        .bind(progress.sim_time_s)
        .bind(progress.step as i64)
        .bind(progress.frames_written as i64)
        .bind(progress.run_s)
        .bind(now + LEASE_US)
        .bind(id.to_string())
        .bind(attempt)
        .bind(now)
        .bind(LEASE_US)
        .fetch_optional(&self.database.writer)
        .await?;
        Ok(cancel_requested == Some(0))
    }

    /// Notes that an attempt can be continued from a frame. A frame further than all before it shows
    /// that the job gets on, and forgives its deaths. Returns false if the job is no longer this
    /// attempt's.
    pub async fn checkpointed(&self, id: Uuid, attempt: i64, frame: u64) -> Result<bool> {
        let changed = sqlx::query(
            "UPDATE jobs SET deaths = CASE WHEN checkpoint_frame >= $1 THEN deaths ELSE 0 END, \
               checkpoint_frame = CASE WHEN checkpoint_frame >= $1 THEN checkpoint_frame ELSE $1 END \
             WHERE id = $2 AND attempt = $3 AND status = 'running'",
        )
        .bind(frame as i64)
        .bind(id.to_string())
        .bind(attempt)
        .execute(&self.database.writer)
        .await?
        .rows_affected();
        Ok(changed > 0)
    }

    /// Ends an attempt and its job. Returns false if the job is no longer this attempt's.
    pub async fn finish(&self, id: Uuid, attempt: i64, outcome: &Outcome) -> Result<bool> {
        let (status, failure) = match outcome {
            Outcome::Succeeded => (Status::Succeeded, None),
            Outcome::Failed(failure) => (Status::Failed, Some(failure)),
            Outcome::Canceled => (Status::Canceled, None),
        };
        let changed = sqlx::query(
            "UPDATE jobs SET status = $1, finished_at = $2, failure_code = $3, failure_message = $4 \
             WHERE id = $5 AND attempt = $6 AND status = 'running'",
        )
        .bind(status.as_str())
        .bind(self.clock.now())
        .bind(failure.map(|failure| failure.code.as_str()))
        .bind(failure.map(|failure| failure.message.as_str()))
        .bind(id.to_string())
        .bind(attempt)
        .execute(&self.database.writer)
        .await?
        .rows_affected();
        Ok(changed > 0)
    }

    /// Puts back the job of an attempt that its server stopped; if the job was also canceled, it
    /// ends instead. Returns the job's status, or `None` if the job is no longer this attempt's.
    pub async fn put_back(&self, id: Uuid, attempt: i64) -> Result<Option<Status>> {
        let status: Option<String> = sqlx::query_scalar(
            "UPDATE jobs SET status = CASE cancel_requested WHEN 1 THEN 'canceled' ELSE 'queued' END, \
               finished_at = CASE cancel_requested WHEN 1 THEN $1 END, \
               started_at = CASE cancel_requested WHEN 1 THEN started_at END \
             WHERE id = $2 AND attempt = $3 AND status = 'running' RETURNING status",
        )
        .bind(self.clock.now())
        .bind(id.to_string())
        .bind(attempt)
        .fetch_optional(&self.database.writer)
        .await?;
        Ok(status.map(known))
    }

    /// Puts back the job of an attempt that lost its device. If that was its last chance
    /// ([`MAX_DEATHS`]), the job fails with `failure`. Returns the job's status, or `None` if the job
    /// is no longer this attempt's.
    pub async fn lose(&self, id: Uuid, attempt: i64, failure: &Failure) -> Result<Option<Status>> {
        self.die(id, attempt, failure, Overdue::ALWAYS).await
    }

    /// Puts back the jobs that the server of this name was running when it died. Those that have died
    /// too often fail as `crashed`, with `tail`, the last lines of their log, behind the message. Call
    /// before any claim, and only where a lock shows that no other server has this name.
    pub async fn recover(&self, owner: &str, tail: impl Fn(Uuid) -> String + Send + Sync) -> Result<Vec<Recovered>> {
        sqlx::query("UPDATE jobs SET lease_until = 0 WHERE owner = $1 AND status = 'running'")
            .bind(owner)
            .execute(&self.database.writer)
            .await?;
        self.expire(tail).await
    }

    /// The same for all jobs whose lease is over, whoever ran them.
    pub async fn expire(&self, tail: impl Fn(Uuid) -> String + Send + Sync) -> Result<Vec<Recovered>> {
        let overdue = Overdue::at(self.clock.now());
        let lost: Vec<LostRow> = sqlx::query_as(
            "SELECT id, attempt, deaths, frames_written, checkpoint_frame FROM jobs \
             WHERE status = 'running' AND (lease_until < $1 OR lease_until > $2)",
        )
        .bind(overdue.0)
        .bind(overdue.1)
        .fetch_all(&self.database.reader)
        .await?;
        let mut recovered = Vec::new();
        for LostRow { id, attempt, deaths, frames_written, checkpoint_frame } in lost {
            let without = match checkpoint_frame {
                Some(frame) => format!("without getting past its checkpoint at frame {frame}"),
                None => "before its first checkpoint".into(),
            };
            let mut message = format!(
                "the server died {} times in a row while it ran this job, last after {frames_written} frames, \
                 {without}; look at the server's log and memory, or make the scene smaller",
                deaths + 1
            );
            let tail = tail(id);
            if !tail.is_empty() {
                message = format!("{message}. Its last words:\n{tail}");
            }
            // Unless its worker has just come back with a heartbeat.
            let status = self.die(id, attempt, &Failure::new("crashed", message), overdue).await?;
            recovered.extend(status.map(|status| Recovered { id, status }));
        }
        Ok(recovered)
    }

    /// Ends an attempt that died, if its lease is overdue.
    async fn die(&self, id: Uuid, attempt: i64, failure: &Failure, overdue: Overdue) -> Result<Option<Status>> {
        let status: Option<String> = sqlx::query_scalar(
            "UPDATE jobs SET deaths = deaths + 1, \
               status = CASE WHEN cancel_requested = 1 THEN 'canceled' \
               WHEN deaths + 1 >= $1 THEN 'failed' ELSE 'queued' END, \
               started_at = CASE WHEN cancel_requested = 1 OR deaths + 1 >= $1 THEN started_at END, \
               finished_at = CASE WHEN cancel_requested = 1 OR deaths + 1 >= $1 THEN $2 END, \
               failure_code = CASE WHEN cancel_requested = 0 AND deaths + 1 >= $1 THEN $3 END, \
               failure_message = CASE WHEN cancel_requested = 0 AND deaths + 1 >= $1 THEN $4 END \
             WHERE id = $5 AND attempt = $6 AND status = 'running' AND (lease_until < $7 OR lease_until > $8) \
             RETURNING status",
        )
        .bind(MAX_DEATHS)
        .bind(self.clock.now())
        .bind(&failure.code)
        .bind(&failure.message)
        .bind(id.to_string())
        .bind(attempt)
        .bind(overdue.0)
        .bind(overdue.1)
        .fetch_optional(&self.database.writer)
        .await?;
        Ok(status.map(known))
    }
}
