//! Many jobs at once: lists, sweeps, changes by filter, and what is kept for how long.

use std::collections::{BTreeMap, HashMap};

use jiff::Timestamp;
use sqlx::AssertSqlSafe;
use uuid::Uuid;

use super::filter::{Along, Value, Values, Way};
use super::insertion::{pieces, rows};
use super::row::{JobRow, select_jobs, uuid};
use super::{Filter, Job, JobStore, Result, Status, known};

/// So many jobs are not counted further, where the count is to find what is rare.
const MANY: i64 = 1000;

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

impl Sweep {
    /// Whether all its jobs have ended.
    pub fn has_ended(&self) -> bool {
        !self.jobs.contains_key(Status::Queued.as_str()) && !self.jobs.contains_key(Status::Running.as_str())
    }
}

impl JobStore {
    /// Newest first; if `before` (a [`Job::seq`]) is given, only those accepted before it.
    pub async fn list(&self, filter: &Filter, before: Option<i64>, limit: i64) -> Result<Vec<Job>> {
        let (filter, way) = self.way(filter, before.unwrap_or(i64::MAX)).await?;
        let mut values = Values::default();
        let newest = filter.newest(way, limit, &mut values);
        let limit = values.int(limit);
        let sql = select_jobs(&format!("WHERE jobs.seq IN ({newest}) ORDER BY jobs.seq DESC LIMIT {limit}"));
        let rows: Vec<JobRow> = values.bind_as(sqlx::query_as(sql)).fetch_all(&self.database.reader).await?;
        let mut jobs: Vec<Job> = rows.into_iter().map(|row| row.0).collect();
        self.place(&mut jobs).await?;
        Ok(jobs)
    }

    /// The way to the newest jobs of a filter, and the filter with the rarest tag first. A search along what is
    /// frequent would pass by all that has it but not the rest.
    async fn way(&self, filter: &Filter, before: i64) -> Result<(Filter, Way)> {
        let mut filter = filter.clone();
        let mut way = Way { along: Along::Tag, names_are_many: false, after: 0, before };
        // Jobs are numbered as they are created, so that times are numbers.
        if let Some(time) = filter.created_after {
            let sql = "SELECT seq FROM jobs WHERE created_at > $1 ORDER BY created_at, seq LIMIT 1";
            way.after = self.one(sql, Value::Int(time.as_microsecond())).await?.map_or(i64::MAX, |seq| seq - 1);
        }
        if let Some(time) = filter.created_before {
            let sql = "SELECT seq FROM jobs WHERE created_at < $1 ORDER BY created_at DESC, seq DESC LIMIT 1";
            let last = self.one(sql, Value::Int(time.as_microsecond())).await?;
            way.before = before.min(last.map_or(0, |seq| seq + 1));
        }
        if let Some(prefix) = filter.name.as_ref().and_then(|name| name.strip_suffix('*')) {
            let sql = "SELECT count(*) FROM \
                (SELECT 1 FROM jobs WHERE name >= $1 AND name < $1 || '\u{10FFFF}' LIMIT 1000) AS few";
            way.names_are_many = self.one(sql, Value::Text(prefix.into())).await? == Some(MANY);
        }
        // A tag may be that of many jobs of other keys.
        let conditions = filter.tags.len() + filter.statuses.len() + usize::from(filter.key.is_some());
        if filter.tags.is_empty() || conditions < 2 {
            return Ok((filter, way));
        }
        let mut tags = Vec::new();
        for tag in filter.tags {
            let sql = "SELECT count(*) FROM (SELECT 1 FROM job_tags WHERE tag = $1 LIMIT 1000) AS few";
            tags.push((self.one(sql, Value::Text(tag.clone())).await?, tag));
        }
        tags.sort();
        let mut of_statuses = if filter.statuses.is_empty() { MANY } else { 0 };
        for status in &filter.statuses {
            let sql = "SELECT count(*) FROM (SELECT 1 FROM jobs WHERE status = $1 LIMIT 1000) AS few";
            of_statuses += self.one(sql, Value::Text(status.to_string())).await?.unwrap_or(0);
        }
        if tags[0].0 > Some(of_statuses) {
            way.along = Along::Status;
        }
        filter.tags = tags.into_iter().map(|(_, tag)| tag).collect();
        Ok((filter, way))
    }

    /// The number that a query with one value finds.
    async fn one(&self, sql: &'static str, value: Value) -> Result<Option<i64>> {
        let query = sqlx::query_as::<_, (i64,)>(sql);
        let found = Values(vec![value]).bind_as(query).fetch_optional(&self.database.reader).await?;
        Ok(found.map(|(number,)| number))
    }

    /// Adds their places in the queue to jobs that wait: for each key and priority the place of the first, and from
    /// there on a walk along the queue to the last.
    async fn place(&self, jobs: &mut [Job]) -> Result<()> {
        let mut ranges: BTreeMap<(String, i64), (i64, i64)> = BTreeMap::new();
        for job in jobs.iter().filter(|job| job.status == Status::Queued) {
            let line = (job.key.clone().unwrap_or_default(), job.priority);
            let (first, last) = ranges.entry(line).or_insert((job.seq, job.seq));
            (*first, *last) = (job.seq.min(*first), job.seq.max(*last));
        }
        let along_queue = self.database.along_queue();
        let mut places: BTreeMap<i64, i64> = BTreeMap::new();
        for ((key, priority), (first, last)) in ranges {
            let found: Vec<(i64, i64)> = sqlx::query_as(AssertSqlSafe(format!(
                "SELECT seq, row_number() OVER (ORDER BY seq) + \
                   (SELECT count(*) FROM jobs {along_queue} \
                     WHERE status = 'queued' AND key_id = $4 AND priority > $1) + \
                   (SELECT count(*) FROM jobs {along_queue} \
                     WHERE status = 'queued' AND key_id = $4 AND priority = $1 AND seq < $2) \
                 FROM jobs {along_queue} WHERE status = 'queued' AND key_id = $4 AND priority = $1 \
                   AND seq BETWEEN $2 AND $3"
            )))
            .bind(priority)
            .bind(first)
            .bind(last)
            .bind(key)
            .fetch_all(&self.database.reader)
            .await?;
            places.extend(found);
        }
        for job in jobs.iter_mut().filter(|job| job.status == Status::Queued) {
            // One that has just been claimed was next.
            job.queue_position = Some(places.get(&job.seq).copied().unwrap_or(1));
        }
        Ok(())
    }

    pub async fn sweep(&self, id: Uuid) -> Result<Option<Sweep>> {
        let row: Option<(String, String, i64)> =
            sqlx::query_as("SELECT id, name, created_at FROM sweeps WHERE id = $1")
                .bind(id.to_string())
                .fetch_optional(&self.database.reader)
                .await?;
        Ok(self.counted(row.into_iter().collect()).await?.pop())
    }

    /// Newest first; if `key` is given, those of that key, and if `before` is, only those accepted before that one.
    /// Those without jobs are left out.
    pub async fn sweeps(&self, key: Option<&str>, before: Option<Uuid>, limit: i64) -> Result<Vec<Sweep>> {
        // Ids begin with the time, and `g` is after all of them.
        let mut values = Values::default();
        let before = values.text(before.map_or_else(|| "g".to_owned(), |id| id.to_string()));
        let of_key = key.map_or_else(String::new, |key| format!("key_id = {} AND", values.text(key)));
        let limit = values.int(limit);
        let sql = format!(
            "SELECT id, name, created_at FROM sweeps WHERE {of_key} id < {before} \
             AND EXISTS (SELECT 1 FROM jobs WHERE jobs.sweep = sweeps.id) ORDER BY id DESC LIMIT {limit}"
        );
        let query = sqlx::query_as::<_, (String, String, i64)>(AssertSqlSafe(sql));
        self.counted(values.bind_as(query).fetch_all(&self.database.reader).await?).await
    }

    /// Sweeps with how far they are.
    async fn counted(&self, sweeps: Vec<(String, String, i64)>) -> Result<Vec<Sweep>> {
        let mut counts: HashMap<String, Vec<(String, i64, f64)>> = HashMap::new();
        let ids: Vec<&str> = sweeps.iter().map(|(id, ..)| id.as_str()).collect();
        for ids in pieces(&ids) {
            let mut query = sqlx::query_as(AssertSqlSafe(format!(
                "SELECT sweep, status, count(*), sum(CASE WHEN status IN ('queued', 'running') AND end_time_s > 0.0 \
                   THEN sim_time_s / end_time_s ELSE 1.0 END) \
                 FROM jobs WHERE sweep IN {} GROUP BY sweep, status",
                rows(1, ids.len())
            )));
            for id in ids {
                query = query.bind(*id);
            }
            let found: Vec<(String, String, i64, f64)> = query.fetch_all(&self.database.reader).await?;
            for (sweep, status, n, done) in found {
                counts.entry(sweep).or_default().push((status, n, done));
            }
        }
        let made = sweeps.into_iter().map(|(id, name, created_at)| {
            let counts = counts.remove(&id).unwrap_or_default();
            let total: i64 = counts.iter().map(|(_, n, _)| n).sum();
            let done: f64 = counts.iter().map(|(_, _, done)| done).sum();
            Ok(Sweep {
                id: uuid(id)?,
                name,
                created_at: Timestamp::from_microsecond(created_at)
                    .map_err(|error| sqlx::Error::Decode(error.into()))?,
                fraction: if total == 0 { 1.0 } else { (done / total as f64).clamp(0.0, 1.0) },
                jobs: counts.into_iter().map(|(status, n, _)| (known(status).as_str(), n as u64)).collect(),
            })
        });
        made.collect()
    }

    /// Cancels the jobs of a filter, as [`JobStore::cancel`] does one. Returns their number.
    pub async fn cancel_all(&self, filter: &Filter) -> Result<u64> {
        let (filter, way) = self.way(filter, i64::MAX).await?;
        let mut values = Values::default();
        let now = values.int(self.clock.now());
        let status = filter.status_in(&[Status::Queued, Status::Running]);
        let condition = filter.condition(way, &mut values);
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
        let (filter, way) = self.way(filter, i64::MAX).await?;
        let mut values = Values::default();
        let status = filter.status_in(&[Status::Succeeded, Status::Failed, Status::Canceled]);
        let condition = filter.condition(way, &mut values);
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
