//! The files of an attempt in the object storage.
//!
//! While it runs, each checkpoint goes there with what the growing files have gained since the one before, and after
//! both, over the one before, the list of them (`progress.json`): another machine can go on from it. When it has ended,
//! its outputs go there as they are, and at last the list of those (`published.json`), which is created once: nobody
//! reads outputs that no list names. What only the progress needed is removed then.

use std::collections::HashSet;
use std::io;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use serde::{Deserialize, Serialize};
use uuid::Uuid;

use super::{Objects, ObjectsError, Result};
use crate::store::JobFiles;

const PROGRESS: &str = "progress.json";
const PUBLISHED: &str = "published.json";
/// The log of the job, as the machine of the attempt has it.
const LOG: &str = "log.txt";
/// The outputs of an attempt that has ended.
const OUTPUTS: [&str; 5] = ["recording.mcap", "thumbnail.png", "diagnostics.csv", "solver.csv", "state.npz"];
/// What grows while an attempt runs, and ends where a checkpoint says.
const GROWING: [&str; 3] = ["recording.mcap.partial", "diagnostics.csv", "solver.csv"];

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

    /// What is before the names of objects in their keys.
    pub fn folder(&self, job: Uuid, attempt: i64) -> String {
        let key = key(job, attempt);
        self.published.as_ref().map_or_else(|| key.clone(), |own| format!("{key}/{own}"))
    }
}

impl Entry {
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

fn part(name: &str, start: u64) -> String {
    format!("{name}.parts/{start:020}")
}

pub(super) fn key(job: Uuid, attempt: i64) -> String {
    format!("jobs/{job}/{attempt}")
}

/// The entry of a file as it is.
fn entry(name: &str, path: &Path) -> io::Result<Entry> {
    let metadata = path.metadata()?;
    let since = metadata.modified()?.duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
    Ok(Entry { name: name.to_owned(), bytes: metadata.len(), modified_ns: since.as_nanos() as u64, parts: Vec::new() })
}

/// An output in the object storage.
#[derive(Clone, Debug)]
pub struct Remote {
    objects: Objects,
    key: String,
    pub name: String,
    pub bytes: u64,
    pub modified: SystemTime,
}

impl Remote {
    /// Bytes from `range`, at least one of them and not more than are good to hold.
    pub async fn read(&self, range: Range<u64>) -> Result<bytes::Bytes> {
        self.objects.bucket.range(&self.key, range).await
    }

    /// An address by which anyone can read it for a while.
    pub async fn signed(&self, time: Duration) -> Result<String> {
        self.objects.bucket.signed(&self.key, time).await
    }
}

/// Takes the checkpoints of an attempt to the object storage.
#[derive(Debug)]
pub struct Saver {
    objects: Objects,
    files: JobFiles,
    key: String,
    dir: PathBuf,
    last: List,
}

impl Saver {
    pub fn new(objects: &Objects, files: &JobFiles, attempt: i64) -> Self {
        let dir = files.attempt(attempt).folder();
        let (objects, files) = (objects.clone(), files.clone());
        Self { key: key(files.id(), attempt), objects, files, dir, last: List::default() }
    }

    /// A checkpoint, by its path, and the files that it needs, as far as it needs them: the recording, the diagnostics
    /// and the solver's.
    pub async fn save(&mut self, checkpoint: &Path, lengths: [u64; 3]) -> Result<()> {
        let bucket = &self.objects.bucket;
        let mut list = List::default();
        for (name, length) in GROWING.into_iter().zip(lengths) {
            let path = self.dir.join(name);
            if !path.exists() {
                continue;
            }
            let mut now = entry(name, &path).map_err(ObjectsError::io(&path))?;
            now.bytes = length;
            let known = self.last.entry(name).filter(|known| known.bytes <= length);
            now.parts = known.map(|known| known.parts.clone()).unwrap_or_default();
            let sent = known.map_or(0, |known| known.bytes);
            if sent < length || now.parts.is_empty() {
                bucket.put_file(&format!("{}/{}", self.key, part(name, sent)), &path, sent..length).await?;
                now.parts.push(sent);
            }
            list.files.push(now);
        }
        let name = checkpoint.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
        list.files.push(self.put(&format!("checkpoints/{name}"), checkpoint).await?);
        if self.files.log().exists() {
            list.files.push(self.put(LOG, &self.files.log()).await?);
        }
        let bytes = serde_json::to_vec(&list).expect("a list is plain data");
        bucket.put(&format!("{}/{PROGRESS}", self.key), bytes).await?;
        let kept: HashSet<&str> = list.files.iter().map(|entry| entry.name.as_str()).collect();
        let gone = self.last.files.iter().filter(|entry| entry.parts.is_empty() && !kept.contains(entry.name.as_str()));
        bucket.delete(gone.map(|entry| format!("{}/{}", self.key, entry.name)).collect()).await?;
        self.last = list;
        Ok(())
    }

    async fn put(&self, name: &str, path: &Path) -> Result<Entry> {
        put(&self.objects, &self.key, name, path).await
    }
}

async fn put(objects: &Objects, key: &str, name: &str, path: &Path) -> Result<Entry> {
    let entry = entry(name, path).map_err(ObjectsError::io(path))?;
    objects.bucket.put_file(&format!("{key}/{name}"), path, 0..entry.bytes).await?;
    Ok(entry)
}

impl Objects {
    /// Takes the outputs of an attempt that has ended to the object storage. May be repeated. Fails with
    /// [`ObjectsError::Taken`] if another process has done so for the same attempt, and changes nothing of that.
    pub async fn publish(&self, files: &JobFiles, attempt: i64) -> Result<()> {
        let (key, dir) = (key(files.id(), attempt), files.attempt(attempt).folder());
        let mut list = List { published: Some(Uuid::now_v7().to_string()), files: Vec::new() };
        let folder = list.folder(files.id(), attempt);
        let outputs = OUTPUTS.map(|name| (name, dir.join(name)));
        for (name, path) in outputs.into_iter().chain([(LOG, files.log())]).filter(|(_, path)| path.exists()) {
            list.files.push(put(self, &folder, name, &path).await?);
        }
        let bytes = serde_json::to_vec(&list).expect("a list is plain data");
        let at = format!("{key}/{PUBLISHED}");
        if !self.bucket.create(&at, bytes).await? {
            self.bucket.delete_below(&folder).await?;
            // Perhaps by an earlier try of this process, whose answer was lost; its log has got longer since.
            let there = self.list(&at).await?.unwrap_or_default();
            let outputs =
                |list: &List| list.files.iter().filter(|entry| entry.name != LOG).cloned().collect::<Vec<_>>();
            if outputs(&there) != outputs(&list) {
                return Err(ObjectsError::Taken(at));
            }
            list = there;
        }
        self.note(&dir, &list)?;
        let own = format!("{}/", list.published.as_deref().unwrap_or_default());
        let rest =
            self.bucket.list(&key).await?.into_iter().filter(|(name, _)| name != PUBLISHED && !name.starts_with(&own));
        self.bucket.delete(rest.map(|(name, _)| format!("{key}/{name}")).collect()).await
    }

    /// Removes what the attempts before this one have there.
    pub async fn forget_before(&self, job: Uuid, attempt: i64) -> Result<()> {
        for earlier in self.attempts(job).await?.into_iter().filter(|&earlier| earlier < attempt) {
            self.bucket.delete_below(&key(job, earlier)).await?;
        }
        Ok(())
    }

    /// Removes all that a job has there.
    pub async fn remove(&self, job: Uuid) -> Result<()> {
        self.bucket.delete_below(&format!("jobs/{job}")).await
    }

    /// The jobs that have something there.
    pub async fn jobs(&self) -> Result<Vec<Uuid>> {
        let folders = self.bucket.folders("jobs").await?;
        Ok(folders.iter().filter_map(|name| Uuid::parse_str(name).ok()).collect())
    }

    /// What the outputs of a job take there (bytes).
    pub async fn bytes(&self, job: Uuid) -> Result<u64> {
        Ok(self.bucket.list(&format!("jobs/{job}")).await?.iter().map(|(_, bytes)| bytes).sum())
    }

    /// What the outputs of all jobs take there (bytes).
    pub async fn all_bytes(&self) -> Result<u64> {
        Ok(self.bucket.list("jobs").await?.iter().map(|(_, bytes)| bytes).sum())
    }

    /// The attempts at a job that have something there.
    pub(super) async fn attempts(&self, job: Uuid) -> Result<Vec<i64>> {
        let folders = self.bucket.folders(&format!("jobs/{job}")).await?;
        Ok(folders.iter().filter_map(|name| name.parse().ok()).collect())
    }

    /// What an attempt has there: its outputs if it has published them, what it can be gone on from if not.
    pub(super) async fn listed(&self, job: Uuid, attempt: i64) -> Result<Option<List>> {
        let key = key(job, attempt);
        match self.list(&format!("{key}/{PUBLISHED}")).await? {
            None => self.list(&format!("{key}/{PROGRESS}")).await,
            published => Ok(published),
        }
    }

    async fn list(&self, key: &str) -> Result<Option<List>> {
        let Some(bytes) = self.bucket.get(key).await? else { return Ok(None) };
        serde_json::from_slice(&bytes).map(Some).map_err(|_| ObjectsError::Damaged(key.to_owned()))
    }

    /// The outputs that an attempt has published.
    pub async fn outputs(&self, job: Uuid, attempt: i64) -> Result<Vec<Remote>> {
        let list = self.list(&format!("{}/{PUBLISHED}", key(job, attempt))).await?.unwrap_or_default();
        let remote = |entry: &Entry| Remote {
            objects: self.clone(),
            key: format!("{}/{}", list.folder(job, attempt), entry.name),
            name: entry.name.clone(),
            bytes: entry.bytes,
            modified: entry.modified(),
        };
        Ok(list.files.iter().filter(|entry| entry.name != LOG).map(remote).collect())
    }
}
