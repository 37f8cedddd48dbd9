//! A frame's points out of a recording, finished or growing. A frame is one chunk to read, however far it lies in the
//! file, and what was looked at once is not looked at again.

use std::fs::File;
use std::io::{self, BufReader, Read};
use std::path::Path;

use foxglove::messages::PointCloud;
use mcap::records::Record;
use prost::Message;

use super::cloud::{Cloud, FramePoints};
use super::embedded::BODIES;
use super::files::{RecordingError, partial_path};
use super::index::{Contents, MAGIC, unfold_at};

/// Where the complete frames of a recording are.
#[derive(Clone, Debug, Default)]
pub struct FrameIndex {
    contents: Contents,
    /// The chunk of each frame's points.
    frames: Vec<usize>,
}

impl FrameIndex {
    /// Number of complete frames at the last look.
    pub fn len(&self) -> u64 {
        self.frames.len() as u64
    }

    pub fn is_empty(&self) -> bool {
        self.frames.is_empty()
    }

    /// Takes in what was written since the last look into the recording `target`, or into the unfinished one that will
    /// have its name. Always call it with the same one.
    ///
    /// # Errors
    /// When there is none, or it cannot be read.
    pub fn look(&mut self, target: &Path) -> Result<(), RecordingError> {
        let mut file = open(target)?;
        let mut beginning = [0; MAGIC.len()];
        if self.contents.end == 0 && file.read_exact(&mut beginning).is_ok() && &beginning != MAGIC {
            let reason = "it does not begin as MCAP files do".into();
            return Err(RecordingError::Damaged { path: target.to_owned(), reason });
        }
        let mut look = || self.contents.read(&mut BufReader::new(&file), file.metadata()?.len(), false);
        look().map_err(RecordingError::io("read", target))?;
        let Some(particles) = self.contents.channel("/particles") else { return Ok(()) };
        let chunks = self.contents.chunks.iter().enumerate();
        self.frames = chunks.filter(|(_, chunk)| chunk.counts.contains_key(&particles)).map(|(n, _)| n).collect();
        Ok(())
    }

    /// Names of the bodies and sources, by their numbers in the field `body`; none where the recording does not say,
    /// or was not looked at.
    ///
    /// # Errors
    /// When there is no such recording, or it cannot be read.
    pub fn bodies(&self, target: &Path) -> Result<Vec<String>, RecordingError> {
        let names = self.contents.metadata(&mut open(target)?, BODIES).map_err(RecordingError::io("read", target))?;
        Ok((0..names.len()).map_while(|n| names.get(&n.to_string()).cloned()).collect())
    }

    /// The points of a frame; `None` if it is not there at the last look.
    ///
    /// # Errors
    /// When the file cannot be read, or is damaged there.
    pub fn points(&self, target: &Path, frame: u64) -> Result<Option<Cloud>, RecordingError> {
        let chunk = usize::try_from(frame).ok().and_then(|frame| self.frames.get(frame));
        let (Some(chunk), Some(particles)) = (chunk, self.contents.channel("/particles")) else { return Ok(None) };
        let damaged = |reason: &str| RecordingError::Damaged { path: target.to_owned(), reason: reason.into() };
        let mut found = None;
        let whole = unfold_at(&mut open(target)?, &self.contents.chunks[*chunk], |record| match record {
            Record::Message { header, data } if header.channel_id == particles && header.sequence == frame as u32 => {
                found = Some((header.log_time, data.into_owned()));
            }
            _ => {}
        });
        let whole = whole.map_err(RecordingError::io("read", target))?;
        let message = whole.and(found);
        let (time_ns, message) = message.ok_or_else(|| damaged("the chunk of a frame does not have its points"))?;
        let cloud = PointCloud::decode(message.as_slice()).map_err(|error| damaged(&error.to_string()))?;
        Cloud::new(cloud, time_ns as f64 / 1e9).map(Some).ok_or_else(|| damaged("its points have no positions"))
    }
}

/// The recording, or the unfinished one.
fn open(target: &Path) -> Result<File, RecordingError> {
    // Between the two looks it may get its name.
    let partial = partial_path(target);
    for path in [target, &partial, target] {
        match File::open(path) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => {}
            file => return file.map_err(RecordingError::io("open", path)),
        }
    }
    Err(RecordingError::io("open", target)(io::ErrorKind::NotFound.into()))
}

/// The points of a frame of a recording, in one go.
///
/// # Errors
/// As [`FrameIndex::look`] and [`FrameIndex::points`].
pub fn frame_points(
    index: &mut FrameIndex,
    target: &Path,
    frame: u64,
    (field, most): (Option<&str>, usize),
) -> Result<Option<FramePoints>, RecordingError> {
    // A frame that was found stays where it is.
    if frame >= index.len() {
        index.look(target)?;
    }
    Ok(index.points(target, frame)?.map(|cloud| cloud.take(field, most)))
}
