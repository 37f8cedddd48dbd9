//! What is kept: jobs that ended long ago, or whose files take too much room, are removed.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use jiff::Timestamp;

use crate::store::{DataDir, Filter, JobStore, Status, StoreError};

/// Jobs that are removed in one transaction.
const BATCH: i64 = 100;

/// How much is kept; without limits, everything.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Keep {
    /// For how long after their end.
    pub time: Option<Duration>,
    /// How much room (bytes) the files of all jobs may take. Those of jobs that wait or run count, too, but
    /// stay.
    pub bytes: Option<u64>,
}

/// Removes the ended jobs that are not to be kept, oldest first, and their files. Returns their number.
pub async fn tidy(store: &JobStore, data: &Arc<DataDir>, keep: Keep) -> Result<usize, StoreError> {
    let mut removed = 0;
    if let Some(time) = keep.time {
        let before = Timestamp::now().checked_sub(time).unwrap_or(Timestamp::MIN);
        loop {
            let ended = store.delete_ended_before(before, BATCH).await?;
            if ended.is_empty() {
                break;
            }
            for id in ended {
                removed += 1;
                data.remove(id).await?;
            }
        }
    }
    if let Some(most) = keep.bytes {
        let mut taken = match data.objects() {
            Some(objects) => objects.all_bytes().await?,
            None => walked(data.jobs()).await?,
        };
        while taken > most {
            let ended =
                Filter { statuses: Status::ALL.into_iter().filter(|s| s.is_terminal()).collect(), ..Filter::default() };
            let Some(&id) = store.delete_all(&ended, 1).await?.first() else { break };
            removed += 1;
            // Of what cannot be looked at, the next round knows.
            taken = taken.saturating_sub(taken_by(data, id).await.unwrap_or(0));
            data.remove(id).await?;
        }
    }
    Ok(removed)
}

/// Notes how much room the outputs of ended jobs take, on the server of that name, for the quotas of their keys.
pub async fn measure(store: &JobStore, data: &Arc<DataDir>, owner: &str) -> Result<(), StoreError> {
    for id in store.to_measure(owner, BATCH).await? {
        store.measured(id, taken_by(data, id).await?).await?;
    }
    Ok(())
}

/// What the outputs of a job take (bytes).
async fn taken_by(data: &Arc<DataDir>, id: uuid::Uuid) -> Result<u64, StoreError> {
    match data.objects() {
        Some(objects) => Ok(objects.bytes(id).await?),
        None => walked(data.job(id).folder()).await,
    }
}

/// The same of a folder.
async fn walked(folder: PathBuf) -> Result<u64, StoreError> {
    let at = |error| StoreError::Io { path: folder.clone(), error };
    let own = folder.clone();
    let walked = tokio::task::spawn_blocking(move || bytes(&own)).await;
    walked.map_err(|error| at(io::Error::other(error)))?.map_err(at)
}

/// Size of everything in a folder; 0 if it is gone.
fn bytes(folder: &Path) -> io::Result<u64> {
    let entries = match fs::read_dir(folder) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(0),
        entries => entries?,
    };
    let mut sum = 0;
    for entry in entries {
        let entry = entry?;
        match entry.metadata() {
            // Removed meanwhile.
            Err(error) if error.kind() == io::ErrorKind::NotFound => {}
            Err(error) => return Err(error),
            Ok(metadata) if metadata.is_dir() => sum += bytes(&entry.path())?,
            Ok(metadata) => sum += metadata.len(),
        }
    }
    Ok(sum)
}
