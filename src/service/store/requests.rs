//! What clients ask of the table of jobs.

use std::collections::{BTreeSet, HashMap, HashSet};
use std::sync::Arc;

use uuid::Uuid;

use super::insertion::{pieces, rows};
use super::row::{JobRow, select_jobs};
use super::submissions::with_place;
use super::{Deletion, Job, JobStore, Result, Status, build};

impl JobStore {
    pub async fn get(&self, id: Uuid) -> Result<Option<Job>> {
        let all = |store: Self, ids: Arc<Vec<Uuid>>| async move { store.get_all(&ids).await };
        self.reads.answer(self, id, all).await
    }

    /// The jobs with these ids, among which one may be more than once.
    async fn get_all(&self, ids: &[Uuid]) -> Result<Vec<Option<Job>>> {
        let wanted: Vec<String> = ids.iter().collect::<BTreeSet<_>>().into_iter().map(Uuid::to_string).collect();
        let mut found = HashMap::new();
        for ids in pieces(&wanted) {
            let clause = format!("WHERE id IN {}", rows(1, ids.len()));
            let mut query = sqlx::query_as(select_jobs(&clause));
            for id in ids {
                query = query.bind(id);
            }
            let jobs: Vec<JobRow> = query.fetch_all(&self.database.reader).await?;
            for JobRow(job) in jobs {
                let job = with_place(&self.database.reader, self.database.along_queue(), job).await?;
                found.insert(job.id, job);
            }
        }
        Ok(ids.iter().map(|id| found.get(id).cloned()).collect())
    }

    /// The scene of a job.
    pub async fn scene(&self, id: Uuid) -> Result<Option<String>> {
        let scene = sqlx::query_scalar(
            "SELECT scene FROM job_scenes JOIN jobs ON jobs.seq = job_scenes.seq WHERE jobs.id = $1",
        );
        Ok(scene.bind(id.to_string()).fetch_optional(&self.database.reader).await?)
    }

    /// The newest job of a key, or of nobody, that has run a scene to its end in this build, on the server of that
    /// name.
    pub async fn finished(&self, scene_sha256: &str, owner: &str, key: &str) -> Result<Option<Job>> {
        let row: Option<JobRow> = sqlx::query_as(select_jobs(
            "WHERE scene_sha256 = $1 AND status = 'succeeded' AND build = $2 AND owner = $3 AND key_id = $4 \
             ORDER BY jobs.seq DESC LIMIT 1",
        ))
        .bind(scene_sha256)
        .bind(build())
        .bind(owner)
        .bind(key)
        .fetch_optional(&self.database.reader)
        .await?;
        Ok(row.map(|row| row.0))
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
