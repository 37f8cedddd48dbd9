//! The messages of a recording that is being written, as its frames come to be.

use std::collections::BTreeSet;
use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};

use mcap::records::Record;

use crate::files::RecordingError;
use crate::index::{Contents, unfold_at};

/// A topic, and how its messages are encoded.
#[derive(Clone, Debug)]
pub struct Channel {
    pub id: u16,
    pub topic: String,
    pub encoding: String,
    pub schema_name: String,
    pub schema_encoding: String,
    pub schema: Vec<u8>,
}

/// A message, as it is in the recording.
#[derive(Clone, Debug)]
pub struct Message {
    pub channel: u16,
    /// Simulated time (ns).
    pub log_time: u64,
    pub data: Vec<u8>,
}

/// A recording that may still be written. Of what is written only whole frames are seen, because a
/// recovery may take away the rest.
#[derive(Debug)]
pub struct Growing {
    path: PathBuf,
    file: File,
    contents: Contents,
}

impl Growing {
    /// # Errors
    /// When the file cannot be opened.
    pub fn open(path: &Path) -> Result<Self, RecordingError> {
        let file = File::open(path).map_err(RecordingError::io("open", path))?;
        Ok(Self { path: path.to_owned(), file, contents: Contents::default() })
    }

    /// Finds what was written since the last look.
    ///
    /// # Errors
    /// When the file cannot be read.
    pub fn look(&mut self) -> Result<(), RecordingError> {
        let Self { path, file, contents } = self;
        let mut look = || contents.read(&mut BufReader::new(&*file), file.metadata()?.len(), false);
        look().map_err(RecordingError::io("read", path))
    }

    /// How much of the file no recovery takes away (bytes): up to the last whole frame, or all if the
    /// recording is finished. 0 before the file's header is there.
    pub fn safe(&self) -> u64 {
        self.contents.end
    }

    /// Number of chunks up to the last whole frame, or of all if the recording is finished.
    pub fn chunks(&self) -> usize {
        self.contents.chunks.len()
    }

    /// The topics; none before the first frame.
    pub fn channels(&self) -> Vec<Channel> {
        let Contents { channels, schemas, chunks, .. } = &self.contents;
        let known = channels.values().filter(|_| !chunks.is_empty());
        let channel = |channel: &mcap::records::Channel| {
            let (schema, data) = schemas.get(&channel.schema_id)?;
            Some(Channel {
                id: channel.id,
                topic: channel.topic.clone(),
                encoding: channel.message_encoding.clone(),
                schema_name: schema.name.clone(),
                schema_encoding: schema.encoding.clone(),
                schema: data.clone(),
            })
        };
        known.filter_map(channel).collect()
    }

    /// Whether a chunk has messages of one of these channels.
    pub fn has(&self, chunk: usize, channels: &BTreeSet<u16>) -> bool {
        self.contents.chunks[chunk].counts.keys().any(|channel| channels.contains(channel))
    }

    /// Whether the first `chunks` chunks are those of another recording.
    pub fn begins_as(&self, other: &Self, chunks: usize) -> bool {
        let [ours, theirs] = [self, other].map(|recording| recording.contents.chunks.get(..chunks));
        ours.zip(theirs).is_some_and(|(ours, theirs)| ours.iter().zip(theirs).all(|(a, b)| a.is(b)))
    }

    /// The messages of a chunk, in their order.
    ///
    /// # Errors
    /// When the file cannot be read, or is not what it was.
    pub fn messages(&mut self, chunk: usize) -> Result<Vec<Message>, RecordingError> {
        let mut messages = Vec::new();
        let whole = unfold_at(&mut self.file, &self.contents.chunks[chunk], |record| {
            if let Record::Message { header, data } = record {
                messages.push(Message {
                    channel: header.channel_id,
                    log_time: header.log_time,
                    data: data.into_owned(),
                });
            }
        })
        .map_err(RecordingError::io("read", &self.path))?;
        let damaged = || RecordingError::Damaged { path: self.path.clone(), reason: "a chunk is damaged".into() };
        whole.map(|()| messages).ok_or_else(damaged)
    }
}
