//! What keys have had, and what is theirs.

use sqlx::any::AnyRow;
use sqlx::{AssertSqlSafe, FromRow, Row};
use uuid::Uuid;

use super::keys::KeyRow;
use super::row::uuid;
use super::{JobStore, Key, Result};

/// Days that the quota of time on devices is of.
pub const USAGE_DAYS: i64 = 30;
const DAY_US: i64 = 86_400_000_000;
/// How long after a job's end its outputs are measured: its worker may still be tidying up.
const SETTLED_US: i64 = 2_000_000;

/// The first of the days that count, numbered from the Unix epoch.
pub(super) fn first_day(now: i64) -> i64 {
    now / DAY_US - (USAGE_DAYS - 1)
}

/// What a key has had.
#[derive(Clone, Debug, PartialEq)]
pub struct Usage {
    pub key: Key,
    pub queued: i64,
    pub running: i64,
    /// Accepted within [`USAGE_DAYS`].
    pub jobs: i64,
    /// Within [`USAGE_DAYS`].
    pub device_s: f64,
    /// Ever.
    pub total_device_s: f64,
    /// Of the outputs of jobs that have ended, and of uploads.
    pub bytes: i64,
}

impl FromRow<'_, AnyRow> for Usage {
    fn from_row(row: &AnyRow) -> sqlx::Result<Self> {
        let seconds = |column| Ok::<_, sqlx::Error>(row.try_get::<i64, _>(column)? as f64 / 1e6);
        Ok(Self {
            key: KeyRow::from_row(row)?.0,
            queued: row.try_get("queued")?,
            running: row.try_get("running")?,
            jobs: row.try_get("recent_jobs")?,
            device_s: seconds("recent_us")?,
            total_device_s: seconds("device_us")?,
            bytes: row.try_get("bytes")?,
        })
    }
}

/// What a key may hold besides jobs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Upload {
    Asset,
    Scene,
}

impl Upload {
    fn as_str(self) -> &'static str {
        match self {
            Self::Asset => "asset",
            Self::Scene => "scene",
        }
    }
}

impl JobStore {
    /// What a key has had, or all keys, by name.
    pub async fn usage(&self, key: Option<&str>) -> Result<Vec<Usage>> {
        let count = |status: &str| {
            format!("(SELECT count(*) FROM jobs WHERE jobs.key_id = keys.id AND status = '{status}') AS {status}")
        };
        let recent = |column: &str, name: &str| {
            format!(
                "(SELECT CAST(coalesce(sum(key_usage.{column}), 0) AS BIGINT) FROM key_usage \
                 WHERE key_id = keys.id AND day >= $1) AS {name}"
            )
        };
        let sql = format!(
            "SELECT keys.*, {}, {}, {}, {} FROM keys WHERE $2 = '' OR id = $2 ORDER BY name",
            count("queued"),
            count("running"),
            recent("jobs", "recent_jobs"),
            recent("device_us", "recent_us")
        );
        let query = sqlx::query_as(AssertSqlSafe(sql)).bind(first_day(self.clock.now())).bind(key.unwrap_or_default());
        Ok(query.fetch_all(&self.database.reader).await?)
    }

    /// The id of the key that a job is of, empty for nobody's; none if there is no such job.
    pub async fn owner_of_job(&self, id: Uuid) -> Result<Option<String>> {
        self.owner_in("jobs", id).await
    }

    /// The same for a sweep.
    pub async fn owner_of_sweep(&self, id: Uuid) -> Result<Option<String>> {
        self.owner_in("sweeps", id).await
    }

    async fn owner_in(&self, table: &str, id: Uuid) -> Result<Option<String>> {
        let sql = format!("SELECT key_id FROM {table} WHERE id = $1");
        let key = sqlx::query_scalar(AssertSqlSafe(sql)).bind(id.to_string());
        Ok(key.fetch_optional(&self.database.reader).await?)
    }

    /// Notes that a key has sent a file. Returns false if it had before.
    pub async fn hold(&self, key: &str, kind: Upload, id: &str, bytes: u64) -> Result<bool> {
        let sql = "INSERT INTO key_files (key_id, kind, id, bytes) VALUES ($1, $2, $3, $4) ON CONFLICT DO NOTHING";
        let held = sqlx::query(sql).bind(key).bind(kind.as_str()).bind(id).bind(bytes as i64);
        Ok(held.execute(&self.database.writer).await?.rows_affected() > 0)
    }

    /// Whether a key has sent a file.
    pub async fn holds(&self, key: &str, kind: Upload, id: &str) -> Result<bool> {
        let sql = "SELECT bytes FROM key_files WHERE key_id = $1 AND kind = $2 AND id = $3";
        let held = sqlx::query_scalar::<_, i64>(sql).bind(key).bind(kind.as_str()).bind(id);
        Ok(held.fetch_optional(&self.database.reader).await?.is_some())
    }

    /// The ids of all files that a key has sent.
    pub async fn held(&self, key: &str, kind: Upload) -> Result<Vec<String>> {
        let sql = "SELECT id FROM key_files WHERE key_id = $1 AND kind = $2 ORDER BY id";
        Ok(sqlx::query_scalar(sql).bind(key).bind(kind.as_str()).fetch_all(&self.database.reader).await?)
    }

    /// Ended jobs of keys whose outputs, on the server of that name or its cluster, are yet to be measured.
    pub async fn to_measure(&self, owner: &str, limit: i64) -> Result<Vec<Uuid>> {
        let ids: Vec<String> = sqlx::query_scalar(
            "SELECT id FROM jobs WHERE bytes IS NULL AND finished_at IS NOT NULL AND key_id <> '' \
             AND finished_at < $1 AND (owner = $2 OR owner IS NULL OR cluster_job IS NOT NULL) ORDER BY seq LIMIT $3",
        )
        .bind(self.clock.now() - SETTLED_US)
        .bind(owner)
        .bind(limit)
        .fetch_all(&self.database.reader)
        .await?;
        Ok(ids.into_iter().map(uuid).collect::<sqlx::Result<_>>()?)
    }

    /// Notes how much room (bytes) the outputs of a job take.
    pub async fn measured(&self, id: Uuid, bytes: u64) -> Result<()> {
        let noted = sqlx::query("UPDATE jobs SET bytes = $1 WHERE id = $2").bind(bytes as i64).bind(id.to_string());
        noted.execute(&self.database.writer).await?;
        Ok(())
    }
}
