//! What is kept: jobs that ended long ago, or whose files take too much room, are removed.

use std::fs;
use std::io;
use std::path::Path;
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
                remove(data, id)?;
            }
        }
    }
    if let Some(most) = keep.bytes {
        let root = data.jobs();
        let walked = tokio::task::spawn_blocking(move || bytes(&root)).await;
        let at = |error| StoreError::Io { path: data.jobs(), error };
        let mut taken = walked.map_err(|error| at(io::Error::other(error)))?.map_err(at)?;
        while taken > most {
            let ended =
                Filter { statuses: Status::ALL.into_iter().filter(|s| s.is_terminal()).collect(), ..Filter::default() };
            let Some(&id) = store.delete_all(&ended, 1).await?.first() else { break };
            removed += 1;
            taken = taken.saturating_sub(bytes(&data.job(id).folder()).map_err(at)?);
            remove(data, id)?;
        }
    }
    Ok(removed)
}

/// Notes how much room the outputs of ended jobs take, on the server of that name, for the quotas of their keys.
pub async fn measure(store: &JobStore, data: &Arc<DataDir>, owner: &str) -> Result<(), StoreError> {
    for id in store.to_measure(owner, BATCH).await? {
        let folder = data.job(id).folder();
        let at = |error| StoreError::Io { path: data.job(id).folder(), error };
        let taken = tokio::task::spawn_blocking(move || bytes(&folder)).await;
        store.measured(id, taken.map_err(|error| at(io::Error::other(error)))?.map_err(at)?).await?;
    }
    Ok(())
}

fn remove(data: &DataDir, id: uuid::Uuid) -> Result<(), StoreError> {
    let files = data.job(id);
    files.remove().map_err(|error| StoreError::Io { path: files.folder(), error })
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
