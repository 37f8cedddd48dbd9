//! Rows of new jobs, many in one statement.

use std::collections::HashMap;

use jiff::Timestamp;
use sqlx::any::Any;
use sqlx::{AssertSqlSafe, Transaction};
use uuid::Uuid;

use super::{Job, NewJob, Progress, Status};

/// Rows of one statement. Few different numbers, so that the database prepares few different statements.
const SIZES: [usize; 4] = [64, 16, 4, 1];

const JOB_COLUMNS: &str = "id, name, scene_sha256, idempotency_key, request_sha256, status, created_at, particles, \
    frames, end_time_s, integrator, integrator_reason, notices, priority, tags, deadline, estimate_s, sweep, \
    sweep_values, key_id";
const JOB_VALUES: usize = 20;

/// Adds jobs to the table in order. The caller holds the queue's lock.
pub(super) async fn insert(
    tx: &mut Transaction<'static, Any>,
    new: &[&NewJob],
    sweep: Option<Uuid>,
    now: i64,
) -> sqlx::Result<Vec<Job>> {
    let mut jobs = Vec::with_capacity(new.len());
    for new in pieces(new) {
        let ids: Vec<Uuid> = new.iter().map(|_| Uuid::now_v7()).collect();
        let mut seqs = insert_rows(tx, new, &ids, sweep, now).await?;
        for (new, id) in new.iter().zip(ids) {
            let seq = seqs.remove(&id.to_string()).ok_or(sqlx::Error::RowNotFound)?;
            jobs.push(queued(new, seq, id, sweep, now)?);
        }
    }
    let scenes: Vec<(i64, &str)> = jobs.iter().zip(new).map(|(job, new)| (job.seq, new.scene.as_str())).collect();
    insert_pairs(tx, "job_scenes (seq, scene)", &scenes).await?;
    let tags: Vec<(i64, &str)> =
        jobs.iter().flat_map(|job| job.tags.iter().map(|tag| (job.seq, tag.as_str()))).collect();
    insert_pairs(tx, "job_tags (seq, tag)", &tags).await?;
    Ok(jobs)
}

/// The numbers of the new rows by the jobs' ids: a database need not return rows in their order.
async fn insert_rows(
    tx: &mut Transaction<'static, Any>,
    new: &[&NewJob],
    ids: &[Uuid],
    sweep: Option<Uuid>,
    now: i64,
) -> sqlx::Result<HashMap<String, i64>> {
    let rows = rows(new.len(), JOB_VALUES);
    let statement = format!("INSERT INTO jobs ({JOB_COLUMNS}) VALUES {rows} RETURNING id, seq");
    let mut query = sqlx::query_as(AssertSqlSafe(statement));
    for (new, id) in new.iter().zip(ids) {
        query = query
            .bind(id.to_string())
            .bind(&new.name)
            .bind(&new.scene_sha256)
            .bind(new.owner.mark(&new.idempotency_key))
            .bind(&new.request_sha256)
            .bind(Status::Queued.as_str())
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
            .bind(serde_json::to_string(&new.sweep_values).expect("values were JSON"))
            .bind(&new.owner.key);
    }
    Ok(query.fetch_all(&mut **tx).await?.into_iter().collect())
}

async fn insert_pairs(tx: &mut Transaction<'static, Any>, into: &str, pairs: &[(i64, &str)]) -> sqlx::Result<()> {
    for pairs in pieces(pairs) {
        let statement = format!("INSERT INTO {into} VALUES {}", rows(pairs.len(), 2));
        let mut query = sqlx::query(AssertSqlSafe(statement));
        for &(seq, text) in pairs {
            query = query.bind(seq).bind(text);
        }
        query.execute(&mut **tx).await?;
    }
    Ok(())
}

/// A job that was added just now, as the table has it.
fn queued(new: &NewJob, seq: i64, id: Uuid, sweep: Option<Uuid>, now: i64) -> sqlx::Result<Job> {
    Ok(Job {
        seq,
        id,
        key: Some(new.owner.key.clone()).filter(|key| !key.is_empty()),
        name: new.name.clone(),
        tags: new.tags.clone(),
        priority: new.priority,
        deadline: new.deadline,
        estimate_s: new.estimate_s,
        sweep,
        sweep_values: new.sweep_values.clone(),
        status: Status::Queued,
        created_at: Timestamp::from_microsecond(now).map_err(|error| sqlx::Error::Encode(error.into()))?,
        started_at: None,
        finished_at: None,
        attempt: 0,
        deaths: 0,
        checkpoint_frame: None,
        cancel_requested: false,
        queue_position: None,
        particles: new.particles,
        frames: new.frames,
        end_time_s: new.end_time_s,
        integrator: new.integrator.clone(),
        integrator_reason: new.integrator_reason.clone(),
        notices: new.notices.clone(),
        progress: Progress::default(),
        backend: None,
        cluster_job: None,
        failure: None,
    })
}

/// `($1, $2), ($3, $4)`: this many rows of so many values.
pub(super) fn rows(rows: usize, values: usize) -> String {
    let row = |row: usize| {
        let values: Vec<String> = (1..=values).map(|value| format!("${}", row * values + value)).collect();
        format!("({})", values.join(", "))
    };
    (0..rows).map(row).collect::<Vec<_>>().join(", ")
}

/// All of a list, in pieces of the [`SIZES`].
pub(super) fn pieces<T>(mut list: &[T]) -> impl Iterator<Item = &[T]> {
    std::iter::from_fn(move || {
        let size = SIZES.into_iter().find(|&size| size <= list.len())?;
        let (piece, rest) = list.split_at(size);
        list = rest;
        Some(piece)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pieces_are_the_whole_list_in_order() {
        for length in [0, 1, 3, 4, 63, 64, 87, 300] {
            let list: Vec<usize> = (0..length).collect();
            assert_eq!(pieces(&list).flatten().copied().collect::<Vec<_>>(), list);
        }
        assert_eq!(pieces(&[0; 87]).map(<[_]>::len).collect::<Vec<_>>(), [64, 16, 4, 1, 1, 1]);
    }

    #[test]
    fn rows_number_their_values() {
        assert_eq!(rows(2, 3), "($1, $2, $3), ($4, $5, $6)");
    }
}
