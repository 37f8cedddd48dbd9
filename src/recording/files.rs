//! Files that other processes see complete or not at all, and what can go wrong with them.

use std::io;
use std::path::{Path, PathBuf};

/// Failures to write or to recover a recording.
#[derive(Debug, thiserror::Error)]
pub enum RecordingError {
    #[error("cannot {action} {path}: {source}")]
    Io { action: &'static str, path: PathBuf, source: io::Error },
    #[error("cannot write {path}: {}", cause(source))]
    Mcap { path: PathBuf, source: mcap::McapError },
    #[error("{path} is not a recording: {reason}")]
    Damaged { path: PathBuf, reason: String },
    #[error("{path} is not a whole checkpoint: {reason}")]
    Checkpoint { path: PathBuf, reason: String },
}

/// What the system says, where it is the system that failed.
fn cause(error: &mcap::McapError) -> String {
    match error {
        mcap::McapError::Io(error) => error.to_string(),
        other => other.to_string(),
    }
}

impl RecordingError {
    /// Adds to an I/O error what was being done, and to which file.
    pub fn io(action: &'static str, path: &Path) -> impl FnOnce(io::Error) -> Self {
        move |source| Self::Io { action, path: path.to_owned(), source }
    }
}

/// Path of a recording that is being written: the target with `.partial` added to its name.
pub fn partial_path(target: &Path) -> PathBuf {
    let mut name = target.as_os_str().to_owned();
    name.push(".partial");
    name.into()
}

/// Writes a whole file. Other processes see it complete or not at all.
///
/// # Errors
/// When the file cannot be written, synced or renamed.
pub fn write_file(target: &Path, bytes: &[u8]) -> Result<(), RecordingError> {
    let partial = partial_path(target);
    std::fs::write(&partial, bytes).map_err(RecordingError::io("write", &partial))?;
    publish(&partial, target)
}

/// Writes a whole file by a function that gets the open file and its path meanwhile. Other processes see it complete or
/// not at all.
///
/// # Errors
/// When the file cannot be created, synced or renamed, and those of the function.
pub fn write_atomically<T, E: From<RecordingError>>(
    target: &Path,
    write: impl FnOnce(std::fs::File, &Path) -> Result<T, E>,
) -> Result<T, E> {
    let partial = partial_path(target);
    let file = std::fs::File::create(&partial).map_err(RecordingError::io("create", &partial))?;
    let written = write(file, &partial);
    if written.is_err() {
        // The reason is what matters.
        let _ = std::fs::remove_file(&partial);
        return written;
    }
    publish(&partial, target)?;
    written
}

/// Waits until a file is on the disk. Returns its length (bytes).
pub fn sync(path: &Path) -> Result<u64, RecordingError> {
    let file = std::fs::File::open(path).map_err(RecordingError::io("open", path))?;
    let length = file.sync_all().and_then(|()| file.metadata()).map_err(RecordingError::io("sync", path))?;
    Ok(length.len())
}

/// Makes a written file durable and gives it its final name, atomically for every reader.
pub fn publish(partial: &Path, target: &Path) -> Result<(), RecordingError> {
    sync(partial)?;
    std::fs::rename(partial, target).map_err(RecordingError::io("rename", partial))?;
    // The new name is durable once its directory is synced; only Unix can sync a directory.
    #[cfg(unix)]
    {
        let directory = target.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let handle = std::fs::File::open(directory).map_err(RecordingError::io("open", directory))?;
        handle.sync_all().map_err(RecordingError::io("sync", directory))?;
    }
    Ok(())
}
