//! Many jobs at once: lists, sweeps, changes by filter, and what is kept for how long.

use std::collections::BTreeMap;

use jiff::Timestamp;
use sqlx::AssertSqlSafe;
use uuid::Uuid;

use super::filter::Values;
use super::row::{JobRow, select_jobs};
use super::{Filter, Job, JobStore, Result, Status, known};

/// Jobs that were submitted as one, and how far they are.
#[derive(Clone, Debug, PartialEq)]
pub struct Sweep {
    pub id: Uuid,
    pub name: String,
    pub created_at: Timestamp,
    /// Number of jobs in each status that is there.
    pub jobs: BTreeMap<&'static str, u64>,
    /// Share of the work that is done, each job's being the same, 0 to 1.
    pub fraction: f64,
}

impl JobStore {
    /// Newest first; if `before` (a [`Job::seq`]) is given, only those accepted before it.
    pub async fn list(&self, filter: &Filter, before: Option<i64>, limit: i64) -> Result<Vec<Job>> {
        let mut values = Values::default();
        let newest = filter.newest(before.unwrap_or(i64::MAX), limit, &mut values);
        let limit = values.int(limit);
        let sql = select_jobs(&format!("WHERE jobs.seq IN ({newest}) ORDER BY jobs.seq DESC LIMIT {limit}"));
        let rows: Vec<JobRow> = values.bind_as(sqlx::query_as(sql)).fetch_all(&self.database.reader).await?;
        let mut jobs: Vec<Job> = rows.into_iter().map(|row| row.0).collect();
        self.place(&mut jobs).await?;
        Ok(jobs)
    }

    /// Adds their places in the queue to jobs that wait, by one walk along it.
    async fn place(&self, jobs: &mut [Job]) -> Result<()> {
        let waiting = || jobs.iter().filter(|job| job.status == Status::Queued).map(|job| job.seq);
        let (Some(first), Some(last)) = (waiting().min(), waiting().max()) else { return Ok(()) };
        let places: Vec<(i64, i64)> = sqlx::query_as(
            "SELECT seq, place FROM (SELECT seq, row_number() OVER (ORDER BY priority DESC, seq) AS place \
             FROM jobs WHERE status = 'queued') AS queue WHERE seq BETWEEN $1 AND $2",
        )
        .bind(first)
        .bind(last)
        .fetch_all(&self.database.reader)
        .await?;
        let places: BTreeMap<i64, i64> = places.into_iter().collect();
        for job in jobs.iter_mut().filter(|job| job.status == Status::Queued) {
            // One that has just been claimed was next.
            job.queue_position = Some(places.get(&job.seq).copied().unwrap_or(1));
        }
        Ok(())
    }

    pub async fn sweep(&self, id: Uuid) -> Result<Option<Sweep>> {
        let sweep: Option<(String, i64)> = sqlx::query_as("SELECT name, created_at FROM sweeps WHERE id = $1")
            .bind(id.to_string())
            .fetch_optional(&self.database.reader)
            .await?;
        let Some((name, created_at)) = sweep else { return Ok(None) };
        let rows: Vec<(String, i64, f64)> = sqlx::query_as(
            "SELECT status, count(*), sum(CASE WHEN status IN ('queued', 'running') AND end_time_s > 0.0 \
               THEN sim_time_s / end_time_s ELSE 1.0 END) \
             FROM jobs WHERE sweep = $1 GROUP BY status",
        )
        .bind(id.to_string())
        .fetch_all(&self.database.reader)
        .await?;
        let total: i64 = rows.iter().map(|(_, n, _)| n).sum();
        let done: f64 = rows.iter().map(|(_, _, done)| done).sum();
        Ok(Some(Sweep {
            id,
            name,
            created_at: Timestamp::from_microsecond(created_at).map_err(|error| sqlx::Error::Decode(error.into()))?,
            fraction: if total == 0 { 1.0 } else { (done / total as f64).clamp(0.0, 1.0) },
            jobs: rows.into_iter().map(|(status, n, _)| (known(status).as_str(), n as u64)).collect(),
        }))
    }

    /// Cancels the jobs of a filter, as [`JobStore::cancel`] does one. Returns their number.
    pub async fn cancel_all(&self, filter: &Filter) -> Result<u64> {
        let mut values = Values::default();
        let now = values.int(self.clock.now());
        let status = filter.status_in(&[Status::Queued, Status::Running]);
        let condition = filter.condition(&mut values);
        let sql = format!(
            "UPDATE jobs SET cancel_requested = 1, \
               finished_at = CASE status WHEN 'queued' THEN {now} END, \
               status = CASE status WHEN 'queued' THEN 'canceled' ELSE status END \
             WHERE {status} AND cancel_requested = 0 AND {condition}"
        );
        let query = values.bind(sqlx::query(AssertSqlSafe(sql)));
        Ok(query.execute(&self.database.writer).await?.rows_affected())
    }

    /// Deletes the jobs of a filter that have ended, at most `limit`, oldest first. Returns them; the caller
    /// removes their files.
    pub async fn delete_all(&self, filter: &Filter, limit: i64) -> Result<Vec<Uuid>> {
        let mut values = Values::default();
        let status = filter.status_in(&[Status::Succeeded, Status::Failed, Status::Canceled]);
        let condition = filter.condition(&mut values);
        let limit = values.int(limit);
        let condition = format!("{status} AND {condition} ORDER BY jobs.seq LIMIT {limit}");
        self.delete_where(&condition, values).await
    }

    /// Deletes jobs that ended before a time, at most `limit`, oldest first. Returns them; the caller removes
    /// their files.
    pub async fn delete_ended_before(&self, time: Timestamp, limit: i64) -> Result<Vec<Uuid>> {
        let mut values = Values::default();
        let (time, limit) = (values.int(time.as_microsecond()), values.int(limit));
        let condition = format!("finished_at < {time} ORDER BY finished_at, jobs.seq LIMIT {limit}");
        self.delete_where(&condition, values).await
    }

    async fn delete_where(&self, condition: &str, values: Values) -> Result<Vec<Uuid>> {
        let sql = format!("DELETE FROM jobs WHERE seq IN (SELECT seq FROM jobs WHERE {condition}) RETURNING id, seq");
        let rows: Vec<(String, i64)> =
            values.bind_as(sqlx::query_as(AssertSqlSafe(sql))).fetch_all(&self.database.writer).await?;
        Ok(rows.iter().filter_map(|(id, _)| Uuid::parse_str(id).ok()).collect())
    }
}
