//! A frame's points out of a recording, finished or growing, by an index of where the frames are.
//!
//! The index of a finished recording comes from its summary. That of a growing one comes from the heads of its records,
//! each of which is looked at once. Either way a frame is one chunk to read, however far it lies in the file.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::path::Path;

use foxglove::messages::PointCloud;
use mcap::Summary;
use mcap::records::{Record, op};
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};
use mcap::sans_io::summary_reader::{SummaryReadEvent, SummaryReader, SummaryReaderOptions};
use prost::Message;

use super::cloud::{Cloud, FramePoints};
use super::embedded::BODIES;
use super::files::{RecordingError, partial_path};

/// Length of the mark that recordings begin with, and of a record's head: opcode and length.
const MAGIC_BYTES: u64 = 8;
const RECORD_HEAD: u64 = 9;
/// Most bytes that a chunk may have or unfold to. A damaged length may say anything.
const MOST_CHUNK_BYTES: u64 = 1 << 30;
/// Most bytes of an index of messages that are looked at; a frame's have a few entries.
const MOST_INDEX_BYTES: u64 = 1 << 20;
/// Most bytes of metadata that are looked at.
const MOST_METADATA_BYTES: u64 = 1 << 24;

/// Where a chunk is in the file, head included.
#[derive(Clone, Copy, Debug)]
struct Place {
    offset: u64,
    length: u64,
}

/// Ids of the channels that matter here.
#[derive(Clone, Copy, Debug)]
struct Ids {
    particles: u16,
    diagnostics: u16,
}

/// Where the complete frames of a recording are.
#[derive(Clone, Debug, Default)]
pub struct FrameIndex {
    ids: Option<Ids>,
    /// The chunk of each frame's points.
    frames: Vec<Place>,
    /// The last chunk, and that of the points of the frame that is being written.
    chunk: Option<Place>,
    open: Option<Place>,
    /// Where the next record begins; 0 before anything was read.
    end: u64,
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
        let (mut file, finished) = open(target)?;
        let read = RecordingError::io("read", target);
        if finished && self.end == 0 {
            return self.summarise(&mut file, target);
        }
        self.walk(&mut file).map_err(read)
    }

    /// The points of a frame; `None` if it is not there at the last look.
    ///
    /// # Errors
    /// When the file cannot be read, or is damaged there.
    pub fn points(&self, target: &Path, frame: u64) -> Result<Option<Cloud>, RecordingError> {
        let place = usize::try_from(frame).ok().and_then(|frame| self.frames.get(frame));
        let (Some(place), Some(ids)) = (place, self.ids) else { return Ok(None) };
        let damaged = |reason: &str| RecordingError::Damaged { path: target.to_owned(), reason: reason.into() };
        let (mut file, _) = open(target)?;
        let chunk = chunk(&mut file, *place).map_err(RecordingError::io("read", target))?;
        let message = chunk.and_then(|chunk| message(&chunk, ids.particles, frame as u32));
        let (time_ns, message) = message.ok_or_else(|| damaged("the chunk of a frame does not have its points"))?;
        let cloud = PointCloud::decode(message.as_slice()).map_err(|error| damaged(&error.to_string()))?;
        Cloud::new(cloud, time_ns as f64 / 1e9).map(Some).ok_or_else(|| damaged("its points have no positions"))
    }

    /// Finds the frames of a finished recording.
    fn summarise(&mut self, file: &mut File, target: &Path) -> Result<(), RecordingError> {
        let damaged = |reason: String| RecordingError::Damaged { path: target.to_owned(), reason };
        let summary = summary(file).map_err(|error| damaged(error.to_string()))?;
        let Some(summary) = summary else { return Err(damaged("it has no summary".into())) };
        self.end = file.metadata().map_err(RecordingError::io("read", target))?.len();
        self.name(summary.channels.values().map(|channel| (channel.topic.as_str(), channel.id)));
        let Some(ids) = self.ids else { return Ok(()) };
        let mut chunks = summary.chunk_indexes;
        chunks.retain(|chunk| chunk.message_index_offsets.contains_key(&ids.particles));
        chunks.sort_by_key(|chunk| chunk.chunk_start_offset);
        let place =
            |chunk: mcap::records::ChunkIndex| Place { offset: chunk.chunk_start_offset, length: chunk.chunk_length };
        self.frames = chunks.into_iter().map(place).collect();
        let counts = summary.stats.map(|stats| stats.channel_message_counts).unwrap_or_default();
        self.frames.truncate(counts.get(&ids.diagnostics).copied().unwrap_or(0) as usize);
        Ok(())
    }

    fn name<'a>(&mut self, channels: impl Iterator<Item = (&'a str, u16)>) {
        let (mut particles, mut diagnostics) = (None, None);
        for (topic, id) in channels {
            match topic {
                "/particles" => particles = Some(id),
                "/diagnostics" => diagnostics = Some(id),
                _ => {}
            }
        }
        if let (Some(particles), Some(diagnostics)) = (particles, diagnostics) {
            self.ids = Some(Ids { particles, diagnostics });
        }
    }

    /// Looks at the heads of the records that are new, as far as they are complete.
    fn walk(&mut self, file: &mut File) -> io::Result<()> {
        let length = file.metadata()?.len();
        self.end = self.end.max(MAGIC_BYTES);
        while self.end + RECORD_HEAD <= length {
            file.seek(SeekFrom::Start(self.end))?;
            let mut head = [0; RECORD_HEAD as usize];
            file.read_exact(&mut head)?;
            let size = u64::from_le_bytes(head[1..].try_into().expect("eight bytes"));
            let next = (self.end + RECORD_HEAD).checked_add(size).filter(|next| *next <= length);
            let (Some(next), true) = (next, head[0] != op::DATA_END) else { break };
            let place = Place { offset: self.end, length: next - self.end };
            match head[0] {
                op::CHUNK => {
                    if self.ids.is_none() {
                        let channels = chunk(file, place)?.map(|chunk| channels(&chunk)).unwrap_or_default();
                        self.name(channels.iter().map(|(topic, id)| (topic.as_str(), *id)));
                    }
                    self.chunk = Some(place);
                }
                op::MESSAGE_INDEX if size <= MOST_INDEX_BYTES => {
                    let mut body = vec![0; size as usize];
                    file.read_exact(&mut body)?;
                    self.index(&body);
                }
                _ => {}
            }
            self.end = next;
        }
        Ok(())
    }

    /// Each frame has a message of points, and ends with its diagnostics.
    fn index(&mut self, body: &[u8]) {
        let (Ok(Record::MessageIndex(index)), Some(ids)) = (mcap::parse_record(op::MESSAGE_INDEX, body), self.ids)
        else {
            return;
        };
        if index.channel_id == ids.particles && !index.records.is_empty() {
            self.open = self.chunk;
        } else if index.channel_id == ids.diagnostics && !index.records.is_empty() {
            self.frames.extend(self.open.take());
        }
    }
}

/// Names of the bodies and sources of a recording, by their numbers in the field `body`; none where it does not say.
///
/// # Errors
/// When there is no recording, or it cannot be read.
pub fn bodies(target: &Path) -> Result<Vec<String>, RecordingError> {
    let (mut file, _) = open(target)?;
    read_bodies(&mut file).map_err(RecordingError::io("read", target))
}

/// They are before the first chunk.
fn read_bodies(file: &mut File) -> io::Result<Vec<String>> {
    let length = file.metadata()?.len();
    let mut at = MAGIC_BYTES;
    while at + RECORD_HEAD <= length {
        file.seek(SeekFrom::Start(at))?;
        let mut head = [0; RECORD_HEAD as usize];
        file.read_exact(&mut head)?;
        let size = u64::from_le_bytes(head[1..].try_into().expect("eight bytes"));
        let next = (at + RECORD_HEAD).checked_add(size).filter(|next| *next <= length);
        let (Some(next), false) = (next, matches!(head[0], op::CHUNK | op::DATA_END)) else { break };
        if head[0] == op::METADATA && size <= MOST_METADATA_BYTES {
            let mut body = vec![0; size as usize];
            file.read_exact(&mut body)?;
            if let Ok(Record::Metadata(metadata)) = mcap::parse_record(op::METADATA, &body)
                && metadata.name == BODIES
            {
                let name = |n: usize| metadata.metadata.get(&n.to_string()).cloned();
                return Ok((0..metadata.metadata.len()).map_while(name).collect());
            }
        }
        at = next;
    }
    Ok(Vec::new())
}

/// The recording and `true`, or the unfinished one.
fn open(target: &Path) -> Result<(File, bool), RecordingError> {
    // Between the two looks it may get its name.
    let partial = partial_path(target);
    for (path, finished) in [(target, true), (&partial, false), (target, true)] {
        match File::open(path) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => {}
            file => {
                // Whoever names the unfinished one means that.
                let finished = finished && path.extension().is_none_or(|extension| extension != "partial");
                return Ok((file.map_err(RecordingError::io("open", path))?, finished));
            }
        }
    }
    Err(RecordingError::io("open", target)(io::ErrorKind::NotFound.into()))
}

fn summary(file: &mut File) -> mcap::McapResult<Option<Summary>> {
    let options = SummaryReaderOptions::default().with_file_size(file.metadata()?.len());
    let mut reader = SummaryReader::new_with_options(options);
    while let Some(event) = reader.next_event() {
        match event? {
            SummaryReadEvent::ReadRequest(need) => {
                let read = file.read(reader.insert(need))?;
                reader.notify_read(read);
            }
            SummaryReadEvent::SeekRequest(to) => reader.notify_seeked(file.seek(to)?),
        }
    }
    Ok(reader.finish())
}

/// A chunk's record, head included; `None` if there is no chunk at the place, or it is beyond all measure.
fn chunk(file: &mut File, place: Place) -> io::Result<Option<Vec<u8>>> {
    let end = place.offset.checked_add(place.length).filter(|end| *end <= file.metadata().map_or(0, |file| file.len()));
    if end.is_none() || !(RECORD_HEAD..MOST_CHUNK_BYTES).contains(&place.length) {
        return Ok(None);
    }
    let mut bytes = vec![0; place.length as usize];
    file.seek(SeekFrom::Start(place.offset))?;
    file.read_exact(&mut bytes)?;
    Ok((bytes[0] == op::CHUNK).then_some(bytes))
}

/// Hands over the records in a chunk until one of them is what is looked for. Its checksum is looked at before anything
/// in it is believed; `None` if the chunk is damaged.
fn search<T>(chunk: &[u8], mut find: impl FnMut(Record) -> Option<T>) -> Option<T> {
    let options = LinearReaderOptions::default()
        .with_skip_start_magic(true)
        .with_skip_end_magic(true)
        .with_prevalidate_chunk_crcs(true)
        .with_record_length_limit(MOST_CHUNK_BYTES as usize);
    let (mut reader, mut bytes) = (LinearReader::new_with_options(options), chunk);
    while let Some(event) = reader.next_event() {
        match event.ok()? {
            LinearReadEvent::ReadRequest(need) => {
                let read = bytes.read(reader.insert(need)).ok()?;
                reader.notify_read(read);
            }
            LinearReadEvent::Record { opcode, data } => {
                if let Some(found) = find(mcap::parse_record(opcode, data).ok()?) {
                    return Some(found);
                }
            }
        }
    }
    None
}

fn channels(chunk: &[u8]) -> Vec<(String, u16)> {
    let mut channels = Vec::new();
    search(chunk, |record| {
        if let Record::Channel(channel) = record {
            channels.push((channel.topic, channel.id));
        }
        None::<()>
    });
    channels
}

/// Time (ns) and content of the message of a channel with this number.
fn message(chunk: &[u8], channel: u16, sequence: u32) -> Option<(u64, Vec<u8>)> {
    search(chunk, |record| match record {
        Record::Message { header, data } if header.channel_id == channel && header.sequence == sequence => {
            Some((header.log_time, data.into_owned()))
        }
        _ => None,
    })
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
