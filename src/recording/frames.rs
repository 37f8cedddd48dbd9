//! A frame's points out of a recording, finished or growing. A frame is one chunk to read, however far it lies in the
//! file, and what was looked at once is not looked at again.

use std::fs::File;
use std::io::{self, BufReader, Read};
use std::path::Path;
use std::sync::Arc;

use foxglove::messages::{FrameTransforms, PointCloud, SceneUpdate};
use mcap::records::{MessageHeader, Record};
use prost::Message;

use super::cloud::{Cloud, FramePoints};
use super::embedded::BODIES;
use super::files::{RecordingError, partial_path};
use super::index::{Contents, MAGIC, unfold_at};
use super::solids::{FrameSolids, solids};

/// Where the complete frames of a recording are. A copy shares what it has with the original until one of them looks
/// again.
#[derive(Clone, Debug, Default)]
pub struct FrameIndex {
    contents: Arc<Contents>,
    /// The chunk of each frame's points.
    frames: Arc<Vec<usize>>,
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
        let contents = Arc::make_mut(&mut self.contents);
        let mut look = || contents.read(&mut BufReader::new(&file), file.metadata()?.len(), false);
        look().map_err(RecordingError::io("read", target))?;
        let Some(particles) = self.contents.channel("/particles") else { return Ok(()) };
        let chunks = self.contents.chunks.iter().enumerate();
        let frames = chunks.filter(|(_, chunk)| chunk.counts.contains_key(&particles)).map(|(n, _)| n);
        self.frames = Arc::new(frames.collect());
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
        let of_frame = |header: &MessageHeader| header.channel_id == particles && header.sequence == frame as u32;
        let (header, message) = self
            .message(target, *chunk, of_frame)?
            .ok_or_else(|| damaged(target, "the chunk of a frame does not have its points"))?;
        let cloud = PointCloud::decode(message.as_slice()).map_err(|error| damaged(target, &error.to_string()))?;
        let time_s = header.log_time as f64 / 1e9;
        Cloud::new(cloud, time_s).map(Some).ok_or_else(|| damaged(target, "its points have no positions"))
    }

    /// The colliders of a frame, and the domain; `None` if the frame is not there at the last look, or the recording
    /// has none, as those of old releases.
    ///
    /// # Errors
    /// When the file cannot be read, or is damaged there.
    pub fn solids(&self, target: &Path, frame: u64) -> Result<Option<FrameSolids>, RecordingError> {
        let chunk = usize::try_from(frame).ok().and_then(|frame| Some((*self.frames.get(frame)?, frame + 1)));
        let Some((first, next)) = chunk else { return Ok(None) };
        let chunks = &self.contents.chunks[..self.frames.get(next).copied().unwrap_or(self.contents.chunks.len())];
        // The last message of a topic that is sent with this frame, or was before it.
        let latest = |topic: &str, from: usize| -> Result<_, RecordingError> {
            let Some(channel) = self.contents.channel(topic) else { return Ok(None) };
            let at = chunks.iter().rposition(|chunk| chunk.counts.contains_key(&channel)).filter(|at| *at >= from);
            let Some(at) = at else { return Ok(None) };
            self.message(target, at, |header| header.channel_id == channel)
        };
        let (Some((moved, frames)), Some((shown, shapes))) = (latest("/tf", first)?, latest("/colliders", 0)?) else {
            return Ok(None);
        };
        let wrong = |error: prost::DecodeError| damaged(target, &error.to_string());
        let frames = FrameTransforms::decode(frames.as_slice()).map_err(wrong)?;
        let shapes = SceneUpdate::decode(shapes.as_slice()).map_err(wrong)?;
        Ok(solids(&shapes, shown.sequence, &frames, moved.log_time as f64 / 1e9))
    }

    /// The last message of a chunk that is wanted.
    fn message(
        &self,
        target: &Path,
        chunk: usize,
        wanted: impl Fn(&MessageHeader) -> bool,
    ) -> Result<Option<(MessageHeader, Vec<u8>)>, RecordingError> {
        let mut found = None;
        let whole = unfold_at(&mut open(target)?, &self.contents.chunks[chunk], |record| match record {
            Record::Message { header, data } if wanted(&header) => found = Some((header, data.into_owned())),
            _ => {}
        });
        Ok(whole.map_err(RecordingError::io("read", target))?.and(found))
    }
}

fn damaged(target: &Path, reason: &str) -> RecordingError {
    RecordingError::Damaged { path: target.to_owned(), reason: reason.into() }
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
