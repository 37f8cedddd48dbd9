//! Copies of what the object storage has, in the data directory.
//!
//! The folder of an attempt that runs on this machine has no list of what is elsewhere (`remote.json`); then it has all
//! there is, and nothing is fetched. The folders of others have one, and so have those of attempts that were published.

use std::collections::{HashMap, HashSet};
use std::fs::{self, File};
use std::io;
use std::path::Path;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant, SystemTime};

use tokio::sync::Mutex as AsyncMutex;
use uuid::Uuid;

use super::lists::{Entry, LOG, List};
use super::{Objects, ObjectsError, Result};
use crate::store::JobFiles;

const LIST: &str = "remote.json";
/// Files that may be removed to make room: they are fetched again when somebody asks for them.
const LARGE: [&str; 2] = ["recording.mcap", "state.npz"];
/// How long they stay at least.
const STAYS: Duration = Duration::from_secs(10);
/// Room that is left on the disk (bytes).
const SPARE_BYTES: u64 = 64 << 20;
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
    /// Makes the folder of an attempt that runs, or ran (`ended`), on another machine as it is there, as far as that
    /// was told, with the outputs of these names, and the log. Files of attempts that run here are left alone.
    pub async fn fetch(&self, files: &JobFiles, attempt: i64, ended: bool, names: &[&str]) -> Result<()> {
        let dir = files.attempt(attempt).folder();
        let known = known(&dir)?;
        if known.is_none() && dir.exists() {
            return Ok(());
        }
        if known.as_ref().is_some_and(|list| list.published.is_some() && is_here(list, &dir, names)) {
            return Ok(());
        }
        // On a task of its own: whoever gives up waiting leaves the rest to the next one who asks.
        let (own, files) = (self.clone(), files.clone());
        let names = names.iter().map(|&name| name.to_owned()).collect();
        let fetched = tokio::spawn(async move { own.fetch_in_turn(&files, attempt, ended, names).await });
        fetched.await.unwrap_or_else(|error| Err(ObjectsError::io(&dir)(io::Error::other(error))))
    }

    async fn fetch_in_turn(&self, files: &JobFiles, attempt: i64, ended: bool, names: Vec<String>) -> Result<()> {
        let dir = files.attempt(attempt).folder();
        let turn = self.turns.of(files.id());
        let mut looked = turn.lock().await;
        let mut list = known(&dir)?.filter(|list| list.published.is_some());
        if list.is_none() && !ended && looked.is_some_and(|looked| looked.elapsed() < INTERVAL) {
            return Ok(());
        }
        for left in (0..TRIES).rev() {
            if list.is_none() {
                list = self.published(files.id(), attempt).await?;
            }
            if list.is_none() {
                list = self.progress(files.id(), attempt).await?;
            }
            let Some(list) = list.take() else {
                *looked = Some(Instant::now());
                return Ok(());
            };
            match self.make(files, attempt, &list, |entry| is_wanted(entry, &names)).await {
                // It has got on, or ended, since the list was read.
                Err(error) if error.is_missing() && left > 0 => {}
                made => {
                    made?;
                    *looked = Some(Instant::now());
                    return Ok(());
                }
            }
        }
        Ok(())
    }

    /// Fetches what an attempt may go on from: the last checkpoints of the attempts before it on other machines.
    pub async fn fetch_checkpoints(&self, files: &JobFiles, attempt: i64) -> Result<()> {
        for earlier in self.attempts(files.id()).await?.into_iter().filter(|&earlier| earlier < attempt) {
            self.fetch_progress(files, earlier, |_| true).await?;
        }
        Ok(())
    }

    /// Fetches what a job that has ended with this attempt has left, if that was not published: the last that was told
    /// of it or of an attempt before. Returns false if it was published.
    pub async fn fetch_rest(&self, files: &JobFiles, attempt: i64) -> Result<bool> {
        if self.published(files.id(), attempt).await?.is_some() {
            return Ok(false);
        }
        for earlier in self.attempts(files.id()).await?.into_iter().filter(|&earlier| earlier <= attempt) {
            if self.fetch_progress(files, earlier, |entry| !entry.is_checkpoint()).await? {
                break;
            }
        }
        Ok(true)
    }

    /// Makes the folder of an attempt on another machine as its last checkpoint was. Returns false if there was none.
    async fn fetch_progress(&self, files: &JobFiles, attempt: i64, wanted: impl Fn(&Entry) -> bool) -> Result<bool> {
        let dir = files.attempt(attempt).folder();
        if dir.exists() && known(&dir)?.is_none() {
            return Ok(true);
        }
        let turn = self.turns.of(files.id());
        let _turn = turn.lock().await;
        for left in (0..TRIES).rev() {
            let Some(list) = self.progress(files.id(), attempt).await? else { return Ok(false) };
            match self.make(files, attempt, &list, &wanted).await {
                // Its process lives on.
                Err(error) if error.is_missing() && left > 0 => {}
                made => return made.map(|()| true),
            }
        }
        Ok(false)
    }

    /// Fetches what is not here yet of the files that are wanted.
    async fn make(&self, files: &JobFiles, attempt: i64, list: &List, wanted: impl Fn(&Entry) -> bool) -> Result<()> {
        let (folder, dir) = (list.folder(files.id(), attempt), files.attempt(attempt).folder());
        let io = ObjectsError::io;
        fs::create_dir_all(dir.join("checkpoints")).map_err(io(&dir))?;
        // First of all: the folder is not one that an attempt here writes to.
        self.note(&dir, list)?;
        let have = |entry: &Entry| dir.join(&entry.name).metadata().map_or(0, |metadata| metadata.len());
        let whole = |entry: &Entry| entry.parts.is_empty();
        let lacks = |entry: &&Entry| {
            let path = dir.join(&entry.name);
            (entry.name == LOG || wanted(entry))
                && if whole(entry) { !entry.is(&path) } else { have(entry) < entry.bytes }
        };
        let lacking: Vec<&Entry> = list.files.iter().filter(lacks).collect();
        let bytes =
            lacking.iter().map(|entry| if whole(entry) { entry.bytes } else { entry.bytes - have(entry) }).sum();
        if fs4::available_space(&dir).map_err(io(&dir))? < bytes + SPARE_BYTES {
            return Err(ObjectsError::Full { path: dir, bytes });
        }
        for entry in lacking {
            let path = dir.join(&entry.name);
            if whole(entry) {
                let partial = dir.join(format!("{}.fetched", entry.name));
                if let Err(error) = self.copy(&folder, entry, &partial).await {
                    let _ = fs::remove_file(&partial);
                    return Err(error);
                }
                if entry.name == LOG {
                    tell(&partial, &files.log())?;
                }
                fs::rename(&partial, &path).map_err(io(&path))?;
                continue;
            }
            for (object, range) in entry.objects() {
                let have = have(entry);
                if have >= range.start && have < range.end {
                    let rest = have - range.start..range.end - range.start;
                    self.bucket.append(&format!("{folder}/{object}"), rest, &path).await?;
                }
            }
        }
        if list.published.is_some() {
            // Copies from when it ran.
            for name in ["recording.mcap.partial", "checkpoints"].map(|name| dir.join(name)) {
                let _ = if name.is_dir() { fs::remove_dir_all(name) } else { fs::remove_file(name) };
            }
        }
        forget_copies_before(files, attempt).map_err(io(&dir))
    }

    async fn copy(&self, folder: &str, entry: &Entry, to: &Path) -> Result<()> {
        // What an earlier try has left is begun anew.
        File::create(to).map_err(ObjectsError::io(to))?;
        self.bucket.append(&format!("{folder}/{}", entry.name), 0..entry.bytes, to).await?;
        let file = File::options().append(true).open(to).map_err(ObjectsError::io(to))?;
        file.set_modified(entry.modified()).map_err(ObjectsError::io(to))
    }

    /// Notes in the folder of an attempt what the object storage has of it.
    pub(super) fn note(&self, dir: &Path, list: &List) -> Result<()> {
        let (path, partial) = (dir.join(LIST), dir.join(format!("{LIST}.partial")));
        let bytes = serde_json::to_vec(list).expect("a list is plain data");
        fs::write(&partial, bytes).and_then(|()| fs::rename(&partial, &path)).map_err(ObjectsError::io(&path))
    }
}

/// Whether a file is one of these outputs, or what becomes one.
fn is_wanted(entry: &Entry, names: &[String]) -> bool {
    let name = entry.name.strip_suffix(".partial").unwrap_or(&entry.name);
    names.iter().any(|wanted| wanted == name)
}

/// Whether a folder has the outputs of these names as a list tells of them, and the log.
fn is_here(list: &List, dir: &Path, names: &[&str]) -> bool {
    let wanted = |entry: &&Entry| entry.name == LOG || names.contains(&entry.name.as_str());
    list.files.iter().filter(wanted).all(|entry| entry.is(&dir.join(&entry.name)))
}

/// Adds the lines of another machine's log that are new to the log of the job here.
fn tell(other: &Path, log: &Path) -> Result<()> {
    let told = fs::read_to_string(log).unwrap_or_default();
    let told: HashSet<&str> = told.lines().collect();
    let add = || {
        let lines = fs::read_to_string(other)?;
        let new: String = lines.lines().filter(|line| !told.contains(line)).flat_map(|line| [line, "\n"]).collect();
        let mut log = File::options().create(true).append(true).open(log)?;
        io::Write::write_all(&mut log, new.as_bytes())
    };
    add().map_err(ObjectsError::io(log))
}

/// Removes the copies of attempts before this one: no one asks for them any more.
fn forget_copies_before(files: &JobFiles, attempt: i64) -> io::Result<()> {
    for earlier in files.attempts()?.into_iter().filter(|&earlier| earlier < attempt) {
        let dir = files.attempt(earlier).folder();
        if dir.join(LIST).exists() {
            fs::remove_dir_all(dir)?;
        }
    }
    Ok(())
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
                    let came = metadata.created().or_else(|_| metadata.modified())?;
                    copies.push((came, metadata.len(), path));
                }
            }
        }
    }
    copies.sort();
    let mut taken: u64 = copies.iter().map(|(_, bytes, _)| bytes).sum();
    let mut removed = 0;
    for (came, bytes, path) in copies {
        // Somebody waits for those that have just come.
        if taken <= most || came.elapsed().is_ok_and(|since| since < STAYS) {
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
