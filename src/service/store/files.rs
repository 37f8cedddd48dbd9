//! The data directory: one folder per job, the folder of uploads, and the lock that
//! keeps a second server out.

use std::collections::HashSet;
use std::fs::{self, File, TryLockError};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use tokio::sync::Mutex;
use uuid::Uuid;

use super::objects::{self, Objects, ObjectsError};
use super::{AssetFiles, Job, SceneFiles, StoreError};

/// What the names of the folders of processes begin with.
const SCRATCH: &str = "gridfall-worker-";

/// A data directory, owned by this process for as long as the value lives, or by the server whose worker it is.
#[derive(Debug)]
pub struct DataDir {
    root: PathBuf,
    assets: AssetFiles,
    scenes: SceneFiles,
    /// Where the files are for other machines, too.
    objects: Option<Objects>,
    completing: Arc<Mutex<()>>,
    _lock: Option<File>,
}

impl DataDir {
    /// Creates the directory if necessary and locks it. Fails if another process holds the lock.
    pub fn open(root: &Path) -> Result<Self, StoreError> {
        let at = |error| StoreError::Io { path: root.to_owned(), error };
        fs::create_dir_all(root.join("jobs")).map_err(at)?;
        let lock = File::create(root.join("lock")).map_err(at)?;
        match lock.try_lock() {
            Ok(()) => {
                let assets = AssetFiles::open(root.join("assets")).map_err(at)?;
                let scenes = SceneFiles::open(root.join("scenes")).map_err(at)?;
                Ok(Self {
                    root: root.to_owned(),
                    assets,
                    scenes,
                    objects: None,
                    completing: Arc::default(),
                    _lock: Some(lock),
                })
            }
            Err(TryLockError::WouldBlock) => Err(StoreError::Locked { path: root.to_owned() }),
            Err(TryLockError::Error(error)) => Err(at(error)),
        }
    }

    /// The directory of a server, for a worker in a process of its own, on this machine or another.
    pub fn join(root: &Path) -> Result<Self, StoreError> {
        let at = |error| StoreError::Io { path: root.to_owned(), error };
        fs::read_dir(root.join("jobs")).map_err(at)?;
        let (assets, scenes) = (AssetFiles::at(root.join("assets")), SceneFiles::at(root.join("scenes")));
        Ok(Self { root: root.to_owned(), assets, scenes, objects: None, completing: Arc::default(), _lock: None })
    }

    /// A folder for one process of this machine, in `root`, for workers whose server's files are in an object storage.
    /// What processes that are gone have left there is removed.
    pub fn scratch(root: &Path, objects: Objects) -> Result<Self, StoreError> {
        let at = |error| StoreError::Io { path: root.to_owned(), error };
        for entry in fs::read_dir(root).map_err(at)?.filter_map(Result::ok) {
            let (name, folder) = (entry.file_name(), entry.path());
            let own = name.to_str().is_some_and(|name| name.starts_with(SCRATCH));
            // Without a lock, its process is about to take it.
            if own && File::open(folder.join("lock")).is_ok_and(|lock| lock.try_lock().is_ok()) {
                let _ = fs::remove_dir_all(folder);
            }
        }
        let folder = root.join(format!("{SCRATCH}{}", Uuid::now_v7()));
        Ok(Self::open(&folder)?.with_objects(objects))
    }

    /// The same, as a copy of what is in an object storage.
    pub fn with_objects(self, objects: Objects) -> Self {
        Self { assets: self.assets.with_objects(objects.clone()), objects: Some(objects), ..self }
    }

    /// Held while outputs are completed that their attempt has not.
    pub fn completing(&self) -> Arc<Mutex<()>> {
        self.completing.clone()
    }

    pub fn objects(&self) -> Option<&Objects> {
        self.objects.as_ref()
    }

    pub fn root(&self) -> &Path {
        &self.root
    }

    pub fn database(&self) -> PathBuf {
        Self::database_in(&self.root)
    }

    /// The database of a directory, whoever has it.
    pub fn database_in(root: &Path) -> PathBuf {
        root.join("gridfall.sqlite")
    }

    /// The name of the server that has this directory, the same after each restart. Whoever holds the
    /// directory's lock knows that an earlier server of this name is dead.
    pub fn owner(&self) -> Result<String, StoreError> {
        let path = self.root.join("owner");
        let read = || -> io::Result<String> {
            match fs::read_to_string(&path) {
                Ok(name) if !name.trim().is_empty() => return Ok(name.trim().to_owned()),
                Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error),
                // Not there, or a crash came between its creation and its content.
                _ => {}
            }
            let name = Uuid::now_v7().to_string();
            fs::write(&path, &name)?;
            File::open(&path)?.sync_all()?;
            Ok(name)
        };
        read().map_err(|error| StoreError::Io { path: path.clone(), error })
    }

    /// Space for more on the file system (bytes).
    pub fn free_bytes(&self) -> io::Result<u64> {
        fs4::available_space(&self.root)
    }

    pub fn assets(&self) -> AssetFiles {
        self.assets.clone()
    }

    pub fn scenes(&self) -> SceneFiles {
        self.scenes.clone()
    }

    /// The folder of all jobs' folders.
    pub fn jobs(&self) -> PathBuf {
        self.root.join("jobs")
    }

    pub fn job(&self, id: Uuid) -> JobFiles {
        JobFiles { id, dir: self.root.join("jobs").join(id.to_string()) }
    }

    /// Brings the outputs of these names here that a job's last attempt has left on other machines. See
    /// [`Objects::fetch`].
    pub async fn fetch(&self, job: &Job, names: &[&str]) -> Result<(), ObjectsError> {
        match &self.objects {
            Some(objects) if job.attempt > 0 => {
                objects.fetch(&self.job(job.id), job.attempt, job.status.is_terminal(), names).await
            }
            _ => Ok(()),
        }
    }

    /// Removes what a job has left. Where the object storage cannot be reached, the next [`Self::sweep`] does the rest.
    pub async fn remove(&self, id: Uuid) -> Result<(), StoreError> {
        let (files, objects) = (self.job(id), self.objects.clone());
        let path = files.folder();
        // On a task of its own: it goes on if nobody waits for it any more.
        let removed = tokio::spawn(async move {
            if let Some(objects) = objects
                && let Err(error) = objects.remove(id).await
            {
                tracing::warn!(job = %id, %error, "cannot remove a job's objects; it is tried again at the next start");
            }
            tokio::task::spawn_blocking(move || files.remove()).await.map_err(io::Error::other).flatten()
        });
        removed.await.map_err(io::Error::other).flatten().map_err(|error| StoreError::Io { path, error })
    }

    /// Removes large files that the object storage has, too, until the others take no more than `most` bytes.
    pub fn make_room(&self, most: u64) -> io::Result<usize> {
        if self.objects.is_some() { objects::make_room(&self.jobs(), most) } else { Ok(0) }
    }

    /// The jobs of which there is something.
    pub async fn left(&self) -> Result<HashSet<Uuid>, StoreError> {
        let at = |error| StoreError::Io { path: self.jobs(), error };
        let mut left = self.folders().map_err(at)?;
        if let Some(objects) = &self.objects {
            left.extend(objects.jobs().await?);
        }
        Ok(left)
    }

    /// Removes what is left ([`Self::left`], before) of jobs that no longer exist. If that would be all of several,
    /// none is removed: it is more likely that the database is another one. Returns whether that is so.
    pub async fn sweep(&self, left: &HashSet<Uuid>, known: &HashSet<Uuid>) -> Result<bool, StoreError> {
        if left.len() > 1 && left.is_disjoint(known) {
            return Ok(true);
        }
        for &id in left.difference(known) {
            self.remove(id).await?;
        }
        Ok(false)
    }

    /// The jobs that have a folder.
    fn folders(&self) -> io::Result<HashSet<Uuid>> {
        let mut found = HashSet::new();
        for entry in fs::read_dir(self.jobs())? {
            found.extend(entry?.file_name().to_str().and_then(|name| Uuid::parse_str(name).ok()));
        }
        Ok(found)
    }
}

/// The files of one job: a folder for the outputs of each attempt, and a log.
#[derive(Clone, Debug)]
pub struct JobFiles {
    id: Uuid,
    dir: PathBuf,
}

impl JobFiles {
    pub fn id(&self) -> Uuid {
        self.id
    }

    /// The folder of all that the job leaves.
    pub fn folder(&self) -> PathBuf {
        self.dir.clone()
    }

    /// The outputs of an attempt. Only that attempt writes them; those of the attempt that the job's row names count.
    pub fn attempt(&self, attempt: i64) -> AttemptFiles {
        let own = self.dir.join(attempt.to_string());
        // Until attempts had folders, outputs lay in the job's.
        let dir = if !own.exists() && self.dir.join("diagnostics.csv").exists() { self.dir.clone() } else { own };
        AttemptFiles { dir }
    }

    /// Attempts that left outputs, newest first.
    pub fn attempts(&self) -> io::Result<Vec<i64>> {
        let entries = match fs::read_dir(&self.dir) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
            entries => entries?,
        };
        let names = entries.map(|entry| Ok(entry?.file_name())).collect::<io::Result<Vec<_>>>()?;
        let mut attempts: Vec<i64> = names.iter().filter_map(|name| name.to_str()?.parse().ok()).collect();
        attempts.sort_unstable_by(|a, b| b.cmp(a));
        Ok(attempts)
    }

    /// Removes the outputs of the attempts before this one.
    pub fn forget_before(&self, attempt: i64) -> io::Result<()> {
        let others = self.attempts()?.into_iter().filter(|&other| other < attempt);
        others.map(|other| self.dir.join(other.to_string())).try_for_each(fs::remove_dir_all)
    }

    /// What was said of the job, by line.
    pub fn log(&self) -> PathBuf {
        self.dir.join("log.txt")
    }

    pub fn remove(&self) -> io::Result<()> {
        match fs::remove_dir_all(&self.dir) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => Err(error),
            _ => Ok(()),
        }
    }
}

/// The outputs of one attempt.
#[derive(Clone, Debug)]
pub struct AttemptFiles {
    dir: PathBuf,
}

impl AttemptFiles {
    pub fn create(&self) -> io::Result<()> {
        fs::create_dir_all(&self.dir)
    }

    pub fn folder(&self) -> PathBuf {
        self.dir.clone()
    }

    pub fn recording(&self) -> PathBuf {
        self.dir.join("recording.mcap")
    }

    /// The recording while it is being written.
    pub fn partial_recording(&self) -> PathBuf {
        self.dir.join("recording.mcap.partial")
    }

    pub fn diagnostics(&self) -> PathBuf {
        self.dir.join("diagnostics.csv")
    }

    /// The steps of the implicit integrator.
    pub fn solver(&self) -> PathBuf {
        self.dir.join("solver.csv")
    }

    pub fn thumbnail(&self) -> PathBuf {
        self.dir.join("thumbnail.png")
    }

    /// The last state, if the scene keeps it.
    pub fn state(&self) -> PathBuf {
        self.dir.join("state.npz")
    }

    /// The folder of checkpoints.
    pub fn checkpoints(&self) -> PathBuf {
        self.dir.join("checkpoints")
    }
}
