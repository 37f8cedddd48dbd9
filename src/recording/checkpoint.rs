//! Checkpoints: what a run needs to go on from a frame boundary, in one file.
//!
//! A file holds the engine's state, how far the run's other files had come, which scene, build and device it is of,
//! and the SHA-256 of all that. It is written beside its name and renamed when it is on the disk, after what it
//! refers to is. The two newest of a folder are kept.

use std::fs::{self, File};
use std::io::{self, BufReader, BufWriter, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use sha2::{Digest, Sha256};

use crate::files::{RecordingError, partial_path, publish};
use crate::provenance;
use gridfall_engine::{Backend, Engine, StateError};

const MAGIC: &[u8; 8] = b"GFCHECK1";
/// SHA-256, at the end of a file.
const HASH_BYTES: u64 = 32;
/// Length of what is before the hash, and before that, as text.
const LENGTH_BYTES: u64 = 8;
/// More than any head has.
const MOST_HEAD_BYTES: u64 = 1 << 16;
/// Checkpoints of a run that are kept.
const KEPT: usize = 2;
const BUFFER_BYTES: usize = 1 << 20;
const EXTENSION: &str = "checkpoint";

/// How far a run has come.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Reached {
    /// The last frame that is complete.
    pub frame: u64,
    /// Sub-steps done.
    pub steps: u64,
    /// Lengths of the recording, the diagnostics and the solver's diagnostics (bytes).
    pub lengths: [u64; 3],
}

/// What a checkpoint must agree with: the scene, this build and the device.
pub fn key(scene_json: &str, backend: &Backend) -> String {
    let scene: String = Sha256::digest(scene_json.as_bytes()).iter().map(|byte| format!("{byte:02x}")).collect();
    let build = format!("{} {} {}", provenance::VERSION, provenance::COMMIT, provenance::TARGET);
    let Backend { kind, device, driver, .. } = backend;
    format!("scene {scene}, gridfall {build}, {kind} {device} {driver}").replace('\n', " ")
}

/// A checkpoint whose frame is not in the recording yet.
pub struct Draft {
    frame: u64,
    file: Hashed<BufWriter<File>>,
    partial: PathBuf,
    target: PathBuf,
}

impl Draft {
    /// Writes the state that `engine` has at the end of `frame`.
    pub fn write(dir: &Path, frame: u64, engine: &mut dyn Engine) -> Result<Self, StateError> {
        fs::create_dir_all(dir)?;
        let target = dir.join(format!("{frame:010}.{EXTENSION}"));
        let partial = partial_path(&target);
        let file = BufWriter::with_capacity(BUFFER_BYTES, File::create(&partial)?);
        let mut draft = Self { frame, file: Hashed { inner: file, hash: Sha256::new() }, partial, target };
        match draft.file.write_all(MAGIC).map_err(StateError::from).and_then(|()| engine.save(&mut draft.file)) {
            Ok(()) => Ok(draft),
            Err(error) => {
                // What is left of it would take room where there may be none.
                let _ = fs::remove_file(&draft.partial);
                Err(error)
            }
        }
    }

    pub fn frame(&self) -> u64 {
        self.frame
    }

    /// Completes the file, once the others are on the disk as `reached` says.
    pub fn complete(mut self, key: &str, reached: &Reached) -> Result<(), RecordingError> {
        let Reached { frame, steps, lengths: [recording, diagnostics, solver] } = reached;
        let head = format!("{key}\n{frame} {steps} {recording} {diagnostics} {solver}\n");
        let mut write = || {
            self.file.write_all(head.as_bytes())?;
            self.file.write_all(&(head.len() as u64).to_le_bytes())?;
            let hash = self.file.hash.clone().finalize();
            self.file.inner.write_all(&hash)?;
            self.file.inner.flush()
        };
        if let Err(error) = write() {
            let _ = fs::remove_file(&self.partial);
            return Err(RecordingError::io("write", &self.partial)(error));
        }
        publish(&self.partial, &self.target)?;
        let dir = self.target.parent().unwrap_or(Path::new("."));
        for old in list(dir).map_err(RecordingError::io("list", dir))?.iter().skip(KEPT) {
            fs::remove_file(old).map_err(RecordingError::io("remove", old))?;
        }
        Ok(())
    }
}

/// A checkpoint that is whole.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Checkpoint {
    path: PathBuf,
    /// Where the state ends in the file.
    state_end: u64,
    key: String,
    pub reached: Reached,
}

impl Checkpoint {
    /// Reads the whole file once, to see that it is what was written.
    ///
    /// # Errors
    /// When the file cannot be read, or is not a whole checkpoint.
    pub fn open(path: &Path) -> Result<Self, RecordingError> {
        let damaged = |reason: &str| RecordingError::Checkpoint { path: path.to_owned(), reason: reason.into() };
        let io = |error| RecordingError::io("read", path)(error);
        let mut file = File::open(path).map_err(RecordingError::io("open", path))?;
        let length = file.metadata().map_err(io)?.len();
        let least = MAGIC.len() as u64 + LENGTH_BYTES + HASH_BYTES;
        let hashed = length.checked_sub(HASH_BYTES).filter(|_| length >= least).ok_or_else(|| damaged("too short"))?;
        let mut hash = Hashed { inner: io::sink(), hash: Sha256::new() };
        io::copy(&mut BufReader::with_capacity(BUFFER_BYTES, &mut file).take(hashed), &mut hash).map_err(io)?;
        let mut tail = vec![0; (length.min(MOST_HEAD_BYTES)) as usize];
        file.seek(SeekFrom::End(-(tail.len() as i64))).and_then(|_| file.read_exact(&mut tail)).map_err(io)?;
        let (tail, expected) = tail.split_at(tail.len() - HASH_BYTES as usize);
        if hash.hash.finalize().as_slice() != expected {
            return Err(damaged("its checksum is wrong"));
        }
        let (tail, head_length) = tail.split_at(tail.len() - LENGTH_BYTES as usize);
        let head_length = u64::from_le_bytes(head_length.try_into().expect("eight bytes"));
        let start = (tail.len() as u64).checked_sub(head_length).ok_or_else(|| damaged("its head is too long"))?;
        let head = std::str::from_utf8(&tail[start as usize..]).ok().and_then(parse);
        let (key, reached) = head.ok_or_else(|| damaged("its head cannot be read"))?;
        let state_end = hashed - LENGTH_BYTES - head_length;
        let mut magic = [0; MAGIC.len()];
        file.seek(SeekFrom::Start(0)).and_then(|_| file.read_exact(&mut magic)).map_err(io)?;
        if &magic != MAGIC || state_end < MAGIC.len() as u64 {
            return Err(damaged("it is of another format"));
        }
        Ok(Self { path: path.to_owned(), state_end, key, reached })
    }

    /// Whether it is of this scene, build and device; says what it is of, if not.
    pub fn agrees(&self, key: &str) -> Result<(), String> {
        if self.key == key { Ok(()) } else { Err(format!("it is of {}; this is {key}", self.key)) }
    }

    /// Makes `engine` what it was at the end of [`Reached::frame`].
    ///
    /// # Errors
    /// See [`Engine::restore`].
    pub fn restore(&self, engine: &mut dyn Engine) -> Result<(), StateError> {
        let mut file = File::open(&self.path)?;
        file.seek(SeekFrom::Start(MAGIC.len() as u64))?;
        let mut state = BufReader::with_capacity(BUFFER_BYTES, file).take(self.state_end - MAGIC.len() as u64);
        engine.restore(&mut state)?;
        match state.limit() {
            0 => Ok(()),
            left => {
                let reason = format!("{left} bytes of the state are left over");
                Err(io::Error::new(io::ErrorKind::InvalidData, reason).into())
            }
        }
    }
}

fn parse(head: &str) -> Option<(String, Reached)> {
    let mut lines = head.lines();
    let (key, numbers) = (lines.next()?, lines.next()?);
    let numbers: Vec<u64> = numbers.split(' ').map(|number| number.parse().ok()).collect::<Option<_>>()?;
    let [frame, steps, recording, diagnostics, solver] = numbers[..] else { return None };
    Some((key.to_owned(), Reached { frame, steps, lengths: [recording, diagnostics, solver] }))
}

/// The checkpoints in a folder, newest first; none if there is no folder.
///
/// # Errors
/// When the folder cannot be read.
pub fn list(dir: &Path) -> io::Result<Vec<PathBuf>> {
    let entries = match fs::read_dir(dir) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
        entries => entries?,
    };
    let mut paths = entries.map(|entry| Ok(entry?.path())).collect::<io::Result<Vec<_>>>()?;
    paths.retain(|path| path.extension().is_some_and(|extension| extension == EXTENSION));
    // Names of one length.
    paths.sort_unstable_by(|a, b| b.cmp(a));
    Ok(paths)
}

/// Hashes what passes through.
struct Hashed<W> {
    inner: W,
    hash: Sha256,
}

impl<W: Write> Write for Hashed<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = self.inner.write(bytes)?;
        self.hash.update(&bytes[..written]);
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.inner.flush()
    }
}
