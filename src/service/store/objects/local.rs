//! Copies of what the object storage has, in the data directory.
//!
//! The folder of an attempt that runs on this machine has no list of what is elsewhere (`remote.json`); then it has all
//! there is, and nothing is fetched. The folders of others have one, and so have those of attempts that were published.

use std::collections::HashMap;
use std::fs::{self, File};
use std::io;
use std::path::Path;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant, SystemTime};

use tokio::sync::Mutex as AsyncMutex;
use uuid::Uuid;

use super::attempt::{Entry, List};
use super::{Objects, ObjectsError, Result};
use crate::store::JobFiles;

const LIST: &str = "remote.json";
const LOG: &str = "log.txt";
/// Files that may be removed to make room: they are fetched again when somebody asks for them.
const LARGE: [&str; 2] = ["recording.mcap", "state.npz"];
/// How soon after a look it is looked again what a running job has.
const INTERVAL: Duration = Duration::from_secs(2);
/// How often a list is read whose objects are gone when they are asked for.
const TRIES: usize = 5;
/// Jobs that are remembered, before those that nobody asks for are forgotten.
const REMEMBERED: usize = 1000;

/// Who fetches files of which job, so that nobody else does, and when it was last looked.
#[derive(Debug, Default)]
pub(super) struct Turns(Mutex<HashMap<Uuid, Arc<AsyncMutex<Option<Instant>>>>>);

impl Turns {
    fn of(&self, job: Uuid) -> Arc<AsyncMutex<Option<Instant>>> {
        let mut turns = self.0.lock().expect("no code panics while it holds this lock");
        if turns.len() > REMEMBERED {
            turns.retain(|_, turn| Arc::strong_count(turn) > 1);
        }
        turns.entry(job).or_default().clone()
    }
}

impl Objects {
    /// Makes the folder of an attempt that runs, or ran, on another machine as it is there, as far as that was told.
    /// Of an attempt that is published the files with these names are fetched; of one that runs, all but checkpoints.
    /// Files of attempts that run here are left alone.
    pub async fn fetch(&self, files: &JobFiles, attempt: i64, names: &[&str]) -> Result<()> {
        let dir = files.attempt(attempt).folder();
        let known = known(&dir)?;
        if known.is_none() && dir.exists() {
            return Ok(());
        }
        if let Some(list) = known.filter(|list| list.published.is_some()) {
            let here = |entry: &&Entry| !names.contains(&entry.name.as_str()) || dir.join(&entry.name).exists();
            if list.files.iter().all(|entry| here(&entry)) {
                return Ok(());
            }
        }
        // On a task of its own: whoever gives up waiting leaves the rest to the next one who asks.
        let (own, files) = (self.clone(), files.clone());
        let names = names.iter().map(|&name| name.to_owned()).collect();
        let fetched = tokio::spawn(async move { own.fetch_in_turn(&files, attempt, names).await });
        fetched.await.unwrap_or_else(|error| Err(ObjectsError::io(&dir)(io::Error::other(error))))
    }

    async fn fetch_in_turn(&self, files: &JobFiles, attempt: i64, names: Vec<String>) -> Result<()> {
        let dir = files.attempt(attempt).folder();
        let turn = self.turns.of(files.id());
        let mut looked = turn.lock().await;
        let due = looked.is_none_or(|looked| looked.elapsed() >= INTERVAL);
        let mut list = match known(&dir)? {
            Some(list) if list.published.is_some() || !due => Some(list),
            None if !due => return Ok(()),
            _ => None,
        };
        for left in (0..TRIES).rev() {
            if list.is_none() {
                *looked = Some(Instant::now());
                list = self.listed(files.id(), attempt).await?;
            }
            let Some(list) = list.take() else { return Ok(()) };
            let published = list.published.is_some();
            let wanted = |entry: &Entry| if published { names.contains(&entry.name) } else { !is_checkpoint(entry) };
            match self.make(files, attempt, &list, wanted).await {
                // It has got on, or ended, since the list was read.
                Err(error) if error.is_missing() && left > 0 => {}
                made => return made,
            }
        }
        Ok(())
    }

    /// Fetches what an attempt may go on from: the last checkpoints of the attempts before it on other machines.
    pub async fn fetch_checkpoints(&self, files: &JobFiles, attempt: i64) -> Result<()> {
        for earlier in self.attempts(files.id()).await?.into_iter().filter(|&earlier| earlier < attempt) {
            let dir = files.attempt(earlier).folder();
            if dir.exists() && known(&dir)?.is_none() {
                continue;
            }
            for left in (0..TRIES).rev() {
                let list = self.listed(files.id(), earlier).await?.filter(|list| list.published.is_none());
                let Some(list) = list else { break };
                match self.make(files, earlier, &list, |_| true).await {
                    // Its process lives on.
                    Err(error) if error.is_missing() && left > 0 => {}
                    made => {
                        made?;
                        break;
                    }
                }
            }
        }
        Ok(())
    }

    /// Fetches what is not here yet of the files that are wanted.
    async fn make(&self, files: &JobFiles, attempt: i64, list: &List, wanted: impl Fn(&Entry) -> bool) -> Result<()> {
        let (folder, dir) = (list.folder(files.id(), attempt), files.attempt(attempt).folder());
        let io = ObjectsError::io;
        fs::create_dir_all(dir.join("checkpoints")).map_err(io(&dir))?;
        // First of all: the folder is not one that an attempt here writes to.
        self.note(&dir, list)?;
        for entry in list.files.iter().filter(|entry| entry.name == LOG || wanted(entry)) {
            let path = dir.join(&entry.name);
            if entry.parts.is_empty() && (!path.exists() || entry.name == LOG) {
                let partial = dir.join(format!("{}.fetched", entry.name));
                self.copy(&folder, entry, &partial).await?;
                if entry.name == LOG {
                    self.tell(files, &partial, &path)?;
                }
                fs::rename(&partial, &path).map_err(io(&path))?;
            } else if !entry.parts.is_empty() {
                for (object, range) in entry.objects() {
                    let have = path.metadata().map_or(0, |metadata| metadata.len());
                    if have >= range.start && have < range.end {
                        let rest = have - range.start..range.end - range.start;
                        self.bucket.append(&format!("{folder}/{object}"), rest, &path).await?;
                    }
                }
            }
        }
        let partial = dir.join("recording.mcap.partial");
        if list.published.is_some() && dir.join("recording.mcap").exists() && partial.exists() {
            fs::remove_file(&partial).map_err(io(&partial))?;
        }
        Ok(())
    }

    async fn copy(&self, folder: &str, entry: &Entry, to: &Path) -> Result<()> {
        // What an earlier try has left is begun anew.
        File::create(to).map_err(ObjectsError::io(to))?;
        self.bucket.append(&format!("{folder}/{}", entry.name), 0..entry.bytes, to).await?;
        let file = File::options().append(true).open(to).map_err(ObjectsError::io(to))?;
        file.set_modified(entry.modified()).map_err(ObjectsError::io(to))
    }

    /// Adds the lines of another machine's log that are new to the job's log here.
    fn tell(&self, files: &JobFiles, now: &Path, before: &Path) -> Result<()> {
        let told = before.metadata().map_or(0, |metadata| metadata.len()) as usize;
        let lines = fs::read(now).map_err(ObjectsError::io(now))?;
        let new = &lines[told.min(lines.len())..];
        let log = files.log();
        let add = || {
            let mut log = File::options().create(true).append(true).open(&log)?;
            io::Write::write_all(&mut log, new)
        };
        add().map_err(ObjectsError::io(&log))
    }

    /// Notes in the folder of an attempt what the object storage has of it.
    pub(super) fn note(&self, dir: &Path, list: &List) -> Result<()> {
        let (path, partial) = (dir.join(LIST), dir.join(format!("{LIST}.partial")));
        let bytes = serde_json::to_vec(list).expect("a list is plain data");
        fs::write(&partial, bytes).and_then(|()| fs::rename(&partial, &path)).map_err(ObjectsError::io(&path))
    }
}

fn is_checkpoint(entry: &Entry) -> bool {
    entry.name.starts_with("checkpoints/")
}

/// What the folder of an attempt says of the object storage.
fn known(dir: &Path) -> Result<Option<List>> {
    let path = dir.join(LIST);
    match fs::read(&path) {
        // A crash may have come between its creation and its content.
        Ok(bytes) => Ok(Some(serde_json::from_slice(&bytes).unwrap_or_default())),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(ObjectsError::io(&path)(error)),
    }
}

/// Removes large files that the object storage has too, those that were fetched or made first first, until the rest of
/// them take no more than `most` bytes. Returns how many it removed.
pub fn make_room(jobs: &Path, most: u64) -> io::Result<usize> {
    let mut copies: Vec<(SystemTime, u64, std::path::PathBuf)> = Vec::new();
    for job in folders(jobs)? {
        for attempt in folders(&job)? {
            if !known(&attempt).is_ok_and(|list| list.is_some_and(|list| list.published.is_some())) {
                continue;
            }
            for path in LARGE.map(|name| attempt.join(name)) {
                if let Ok(metadata) = path.metadata() {
                    // When the file came here; when it was changed is the same everywhere.
                    copies.push((metadata.created().or_else(|_| metadata.modified())?, metadata.len(), path));
                }
            }
        }
    }
    copies.sort();
    let mut taken: u64 = copies.iter().map(|(_, bytes, _)| bytes).sum();
    let mut removed = 0;
    for (_, bytes, path) in copies {
        if taken <= most {
            break;
        }
        fs::remove_file(path)?;
        taken -= bytes;
        removed += 1;
    }
    Ok(removed)
}

fn folders(dir: &Path) -> io::Result<Vec<std::path::PathBuf>> {
    let entries = match fs::read_dir(dir) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
        entries => entries?,
    };
    let folders = entries.filter_map(|entry| entry.ok().map(|entry| entry.path()));
    Ok(folders.filter(|path| path.is_dir()).collect())
}
