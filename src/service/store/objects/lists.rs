//! The lists of what an attempt has in the object storage.

use std::io;
use std::ops::Range;
use std::path::Path;
use std::time::{Duration, SystemTime};

use serde::{Deserialize, Serialize};
use uuid::Uuid;

use super::{Objects, ObjectsError, Result};

pub(super) const PROGRESS: &str = "progress.json";
pub(super) const PUBLISHED: &str = "published.json";
/// The log of the job, as the machine of the attempt has it.
pub(super) const LOG: &str = "log.txt";
/// The outputs of an attempt that has ended.
pub(super) const OUTPUTS: [&str; 5] = ["recording.mcap", "thumbnail.png", "diagnostics.csv", "solver.csv", "state.npz"];
/// What grows while an attempt runs, and ends where a checkpoint says.
pub(super) const GROWING: [&str; 3] = ["recording.mcap.partial", "diagnostics.csv", "solver.csv"];
const CHECKPOINTS: &str = "checkpoints/";

/// What an attempt has in the object storage.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct List {
    /// The folder of the outputs, if this is of these. Each process that publishes has its own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub published: Option<String>,
    pub files: Vec<Entry>,
}

/// A file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Entry {
    pub name: String,
    pub bytes: u64,
    /// Since the Unix epoch (ns): all copies of a file were changed at the same time, and are the same to clients.
    pub modified_ns: u64,
    /// Where the parts begin that the file is kept in; one that is kept as it is has none.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub parts: Vec<u64>,
}

impl List {
    pub fn entry(&self, name: &str) -> Option<&Entry> {
        self.files.iter().find(|entry| entry.name == name)
    }

    /// Whether all names are of files that attempts have. Others could lead out of their folder.
    fn is_sound(&self) -> bool {
        let plain =
            |name: &str| !name.is_empty() && name.bytes().all(|b| b.is_ascii_alphanumeric() || b".-".contains(&b));
        let own = |name: &str| {
            name.strip_prefix(CHECKPOINTS).is_some_and(|name| plain(name) && !name.starts_with('.'))
                || [&OUTPUTS[..], &GROWING, &[LOG]].concat().contains(&name)
        };
        self.files.iter().all(|entry| own(&entry.name)) && self.published.as_deref().is_none_or(plain)
    }

    /// What is before the names of objects in their keys.
    pub fn folder(&self, job: Uuid, attempt: i64) -> String {
        let key = key(job, attempt);
        self.published.as_ref().map_or_else(|| key.clone(), |own| format!("{key}/{own}"))
    }
}

impl Entry {
    /// The entry of a file as it is.
    pub fn of(name: &str, path: &Path) -> Result<Self> {
        let of = || {
            let metadata = path.metadata()?;
            let since = metadata.modified()?.duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
            let (name, modified_ns) = (name.to_owned(), since.as_nanos() as u64);
            io::Result::Ok(Self { name, bytes: metadata.len(), modified_ns, parts: Vec::new() })
        };
        of().map_err(ObjectsError::io(path))
    }

    /// Whether a file is this one as a whole.
    pub fn is(&self, path: &Path) -> bool {
        Self::of(&self.name, path).is_ok_and(|now| (now.bytes, now.modified_ns) == (self.bytes, self.modified_ns))
    }

    pub fn is_checkpoint(&self) -> bool {
        self.name.starts_with(CHECKPOINTS)
    }

    pub fn modified(&self) -> SystemTime {
        SystemTime::UNIX_EPOCH + Duration::from_nanos(self.modified_ns)
    }

    /// The objects and the bytes of the file in each.
    pub fn objects(&self) -> Vec<(String, Range<u64>)> {
        if self.parts.is_empty() {
            return vec![(self.name.clone(), 0..self.bytes)];
        }
        let ends = self.parts[1..].iter().copied().chain([self.bytes]);
        self.parts.iter().zip(ends).map(|(&start, end)| (part(&self.name, start), start..end)).collect()
    }
}

pub(super) fn part(name: &str, start: u64) -> String {
    format!("{name}.parts/{start:020}")
}

pub(super) fn key(job: Uuid, attempt: i64) -> String {
    format!("jobs/{job}/{attempt}")
}

impl Objects {
    /// The attempts at a job that have something there, the last one first.
    pub(super) async fn attempts(&self, job: Uuid) -> Result<Vec<i64>> {
        let folders = self.bucket.folders(&format!("jobs/{job}")).await?;
        let mut attempts: Vec<i64> = folders.iter().filter_map(|name| name.parse().ok()).collect();
        attempts.sort_unstable_by(|a, b| b.cmp(a));
        Ok(attempts)
    }

    /// The outputs of an attempt, if it has published them.
    pub(super) async fn published(&self, job: Uuid, attempt: i64) -> Result<Option<List>> {
        self.list(&format!("{}/{PUBLISHED}", key(job, attempt))).await
    }

    /// What an attempt can be gone on from.
    pub(super) async fn progress(&self, job: Uuid, attempt: i64) -> Result<Option<List>> {
        self.list(&format!("{}/{PROGRESS}", key(job, attempt))).await
    }

    async fn list(&self, key: &str) -> Result<Option<List>> {
        let Some(bytes) = self.bucket.get(key).await? else { return Ok(None) };
        let list = serde_json::from_slice(&bytes).ok().filter(List::is_sound);
        list.map(Some).ok_or_else(|| ObjectsError::Damaged(key.to_owned()))
    }
}
