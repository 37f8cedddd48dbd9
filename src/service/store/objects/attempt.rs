//! The files of an attempt on their way to the object storage.
//!
//! While it runs, each checkpoint goes there with what the growing files have gained since the one before, and after
//! both, over the one before, the list of them (`progress.json`): another machine can go on from it. When it has ended,
//! its outputs go there as they are, and at last the list of those (`published.json`), which is created once: nobody
//! reads outputs that no list names. What only the progress needed is removed once the job has ended.

use std::collections::HashSet;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use uuid::Uuid;

use super::lists::{Entry, GROWING, LOG, List, OUTPUTS, PROGRESS, PUBLISHED, key, part};
use super::{Objects, ObjectsError, Result};
use crate::store::JobFiles;

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
            let mut now = Entry::of(name, &path)?;
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
        list.files.push(put(&self.objects, &self.key, &format!("checkpoints/{name}"), checkpoint).await?);
        if self.files.log().exists() {
            list.files.push(put(&self.objects, &self.key, LOG, &self.files.log()).await?);
        }
        let bytes = serde_json::to_vec(&list).expect("a list is plain data");
        bucket.put(&format!("{}/{PROGRESS}", self.key), bytes).await?;
        let kept: HashSet<&str> = list.files.iter().map(|entry| entry.name.as_str()).collect();
        let gone = self.last.files.iter().filter(|entry| entry.parts.is_empty() && !kept.contains(entry.name.as_str()));
        bucket.delete(gone.map(|entry| format!("{}/{}", self.key, entry.name)).collect()).await?;
        self.last = list;
        Ok(())
    }
}

async fn put(objects: &Objects, key: &str, name: &str, path: &Path) -> Result<Entry> {
    let entry = Entry::of(name, path)?;
    objects.bucket.put_file(&format!("{key}/{name}"), path, 0..entry.bytes).await?;
    Ok(entry)
}

/// Takes the outputs of an attempt that has ended to the object storage.
#[derive(Debug)]
pub struct Publisher {
    objects: Objects,
    files: JobFiles,
    attempt: i64,
    /// Those that are there.
    list: List,
}

impl Publisher {
    pub fn new(objects: &Objects, files: &JobFiles, attempt: i64) -> Self {
        let list = List { published: Some(Uuid::now_v7().to_string()), files: Vec::new() };
        Self { objects: objects.clone(), files: files.clone(), attempt, list }
    }

    /// May be repeated, and goes on where it failed. Fails with [`ObjectsError::Taken`] if another process has
    /// published the same attempt, and changes nothing of that.
    pub async fn publish(&mut self) -> Result<()> {
        let (job, dir) = (self.files.id(), self.files.attempt(self.attempt).folder());
        let folder = self.list.folder(job, self.attempt);
        let outputs = OUTPUTS.map(|name| (name, dir.join(name)));
        for (name, path) in outputs.into_iter().chain([(LOG, self.files.log())]).filter(|(_, path)| path.exists()) {
            if self.list.entry(name).is_none() {
                self.list.files.push(put(&self.objects, &folder, name, &path).await?);
            }
        }
        let bytes = serde_json::to_vec(&self.list).expect("a list is plain data");
        let at = format!("{}/{PUBLISHED}", key(job, self.attempt));
        if !self.objects.bucket.create(&at, bytes).await? {
            match self.objects.published(job, self.attempt).await? {
                // By a request whose answer was lost.
                Some(there) if there.published == self.list.published => {}
                Some(_) => {
                    self.objects.bucket.delete_below(&folder).await?;
                    return Err(ObjectsError::Taken(at));
                }
                // Somebody was writing it, and has not.
                None => return Err(ObjectsError::Busy(at)),
            }
        }
        self.objects.note(&dir, &self.list)
    }
}

impl Objects {
    /// Removes what nobody needs of a job that has ended with this attempt.
    pub async fn tidy(&self, job: Uuid, attempt: i64) -> Result<()> {
        self.forget_before(job, attempt).await?;
        let Some(list) = self.published(job, attempt).await? else { return Ok(()) };
        let (key, own) = (key(job, attempt), format!("{}/", list.published.unwrap_or_default()));
        let there = self.bucket.list(&key).await?.into_iter();
        let rest = there.filter(|(name, _)| name != PUBLISHED && !name.starts_with(&own));
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

    /// The outputs that an attempt has published.
    pub async fn outputs(&self, job: Uuid, attempt: i64) -> Result<Vec<Remote>> {
        let list = self.published(job, attempt).await?.unwrap_or_default();
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
