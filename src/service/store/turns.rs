//! Whose turn it is. Each key has a line of its own, and so have the jobs of nobody. Of the lines that have a job, the
//! next is the one with the fewest jobs running; of those, the one that has had least of the devices (`turn_us`). A
//! line that was empty begins where the others are (`catch_up`), so that no time without jobs is made up for: whoever
//! comes back waits for at most one job of each other key, and takes nobody's turns.

use sqlx::any::Any;
use sqlx::{AssertSqlSafe, Executor, FromRow, Transaction};

use super::Result;
use super::database::Database;
use super::usage::first_day;

/// A line with jobs.
#[derive(Debug, FromRow)]
pub(super) struct Line {
    /// Empty for nobody's.
    pub key: String,
    /// Jobs that run, or that a cluster's scheduler has.
    pub busy: i64,
    max_running: Option<i64>,
    device_s: i64,
    max_device_s: Option<i64>,
    turn_us: i64,
    /// Of the first job.
    priority: i64,
    seq: i64,
}

impl Line {
    /// Whether another one may run.
    pub fn has_room(&self) -> bool {
        let below = |used: i64, most: Option<i64>| most.is_none_or(|most| used < most);
        below(self.busy, self.max_running) && below(self.device_s, self.max_device_s)
    }

    /// The least is next.
    pub fn rank(&self) -> impl Ord + use<> {
        (self.busy, self.turn_us, -self.priority, self.seq)
    }
}

/// The lines with jobs, in no order.
pub(super) async fn lines<'c>(
    executor: impl Executor<'c, Database = Any>,
    database: &Database,
    now: i64,
) -> Result<Vec<Line>> {
    let along_queue = database.along_queue();
    let first = |column: &str| {
        format!(
            "(SELECT {column} FROM jobs {along_queue} WHERE status = 'queued' AND key_id = line.id \
             ORDER BY priority DESC, seq LIMIT 1)"
        )
    };
    let lines = sqlx::query_as(AssertSqlSafe(format!(
        "SELECT * FROM (SELECT line.id AS key, \
           (SELECT count(*) FROM jobs WHERE status = 'running' AND key_id = line.id) + \
             (SELECT count(*) FROM jobs {} WHERE offered_attempt IS NOT NULL AND status = 'queued' \
              AND key_id = line.id) AS busy, \
           line.max_running, \
           CASE WHEN line.max_device_s IS NULL THEN 0 ELSE \
             (SELECT CAST(coalesce(sum(device_us), 0) / 1000000 AS BIGINT) FROM key_usage \
              WHERE key_id = line.id AND day >= $1) END AS device_s, \
           line.max_device_s, line.turn_us, {} AS priority, {} AS seq \
         FROM (SELECT id, max_running, max_device_s, turn_us FROM keys \
               UNION ALL SELECT '', NULL, NULL, 0) AS line) AS lines WHERE seq IS NOT NULL",
        database.along_offers(),
        first("priority"),
        first("seq")
    )));
    Ok(lines.bind(first_day(now)).fetch_all(executor).await?)
}

/// The keys whose jobs may be started, the next one first; empty for nobody's. The caller holds the queue's lock.
pub(super) async fn next(tx: &mut Transaction<'static, Any>, database: &Database, now: i64) -> Result<Vec<String>> {
    let mut lines = lines(&mut **tx, database, now).await?;
    lines.retain(Line::has_room);
    lines.sort_by_key(Line::rank);
    Ok(lines.into_iter().map(|line| line.key).collect())
}

/// Lets a key without jobs that wait or run begin where those are that have some or, without any, where the one is that
/// has had most: what it had while nobody waited is held against nobody. Called before the key's job is added, by
/// whoever holds the queue's lock.
pub(super) async fn catch_up(tx: &mut Transaction<'static, Any>, key: &str) -> sqlx::Result<()> {
    let active = "EXISTS (SELECT 1 FROM jobs WHERE jobs.key_id = keys.id AND jobs.status IN ('queued', 'running'))";
    sqlx::query(AssertSqlSafe(format!(
        "UPDATE keys SET turn_us = (SELECT CASE WHEN start.turn_us > keys.turn_us THEN start.turn_us \
             ELSE keys.turn_us END FROM (SELECT coalesce(\
               (SELECT min(turn_us) FROM keys WHERE id <> $1 AND {active}), \
               (SELECT max(turn_us) FROM keys)) AS turn_us) AS start) \
         WHERE id = $1 AND NOT {active}"
    )))
    .bind(key)
    .execute(&mut **tx)
    .await?;
    Ok(())
}
