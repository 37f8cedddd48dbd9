//! Makes valid recordings of unfinished ones: everything on disk up to the last complete frame,
//! followed by a new index.

use std::collections::BTreeMap;
use std::fs::{File, OpenOptions};
use std::io::{self, BufReader, Seek, SeekFrom, Write};
use std::path::Path;

use binrw::BinWrite;
use mcap::records::{self, op};

use super::files::{RecordingError, publish};
use super::index::{Contents, MAGIC};

/// A valid recording: the first `prefix` bytes of the unfinished file, then `tail`.
#[derive(Clone, Debug)]
pub struct Snapshot {
    pub prefix: u64,
    pub tail: Vec<u8>,
    /// Number of frames.
    pub frames: u64,
}

impl Snapshot {
    /// Length of the recording (bytes).
    pub fn length(&self) -> u64 {
        self.prefix + self.tail.len() as u64
    }
}

/// The recording so far, from a file that may still be growing.
///
/// # Errors
/// When the file cannot be read, or does not begin as a recording.
pub fn snapshot(partial: &Path) -> Result<Snapshot, RecordingError> {
    scan(partial, false)
}

/// Completes in place the recording that a dead process left in `partial`, and gives it its final
/// name `target`. The first chunk with a wrong checksum and everything after it are cut off.
/// Returns the number of frames.
///
/// # Errors
/// When the file cannot be read or written, or does not begin as a recording.
pub fn recover(partial: &Path, target: &Path) -> Result<u64, RecordingError> {
    let snapshot = scan(partial, true)?;
    let write = || {
        let mut file = OpenOptions::new().write(true).open(partial)?;
        file.set_len(snapshot.prefix)?;
        file.seek(SeekFrom::End(0))?;
        file.write_all(&snapshot.tail)
    };
    write().map_err(RecordingError::io("complete", partial))?;
    publish(partial, target)?;
    Ok(snapshot.frames)
}

fn scan(partial: &Path, verify: bool) -> Result<Snapshot, RecordingError> {
    let file = File::open(partial).map_err(RecordingError::io("open", partial))?;
    let length = file.metadata().map_err(RecordingError::io("read", partial))?.len();
    let mut contents = Contents::default();
    contents.read(&mut BufReader::new(file), length, verify).map_err(RecordingError::io("read", partial))?;
    if contents.end == 0 {
        let reason = "it ends before its header does".into();
        return Err(RecordingError::Damaged { path: partial.to_owned(), reason });
    }
    Ok(contents.into_snapshot())
}

impl Contents {
    fn statistics(&self) -> records::Statistics {
        let mut channel_message_counts = BTreeMap::new();
        for chunk in &self.chunks {
            chunk
                .counts
                .iter()
                .for_each(|(&channel, &count)| *channel_message_counts.entry(channel).or_insert(0) += count);
        }
        let with_messages = || self.chunks.iter().filter(|chunk| !chunk.counts.is_empty()).map(|chunk| &chunk.index);
        records::Statistics {
            message_count: channel_message_counts.values().sum(),
            schema_count: self.schemas.len() as u16,
            channel_count: self.channels.len() as u32,
            attachment_count: self.attachments.len() as u32,
            metadata_count: self.metadata.len() as u32,
            chunk_count: self.chunks.len() as u32,
            message_start_time: with_messages().map(|chunk| chunk.message_start_time).min().unwrap_or(0),
            message_end_time: with_messages().map(|chunk| chunk.message_end_time).max().unwrap_or(0),
            channel_message_counts,
        }
    }

    fn into_snapshot(mut self) -> Snapshot {
        if self.chunks.is_empty() {
            self.schemas.clear();
            self.channels.clear();
        }
        let statistics = self.statistics();
        let diagnostics = self.diagnostics_channel();
        let frames = diagnostics.and_then(|id| statistics.channel_message_counts.get(&id).copied()).unwrap_or(0);

        let mut tail = Tail { bytes: Vec::new(), start: self.end };
        // A checksum of 0 means that there is none; the chunks have their own.
        tail.write(op::DATA_END, &records::DataEnd { data_section_crc: 0 });
        let summary_start = tail.position();
        let groups = [
            tail.group(op::SCHEMA, self.schemas.values(), |tail, (header, data)| {
                let data_length = (data.len() as u32).to_le_bytes();
                tail.record(op::SCHEMA, &[&encoded(header), &data_length, data]);
            }),
            tail.group(op::CHANNEL, self.channels.values(), |tail, channel| tail.write(op::CHANNEL, channel)),
            tail.group(op::STATISTICS, [&statistics], |tail, statistics| tail.write(op::STATISTICS, statistics)),
            tail.group(op::CHUNK_INDEX, &self.chunks, |tail, chunk| tail.write(op::CHUNK_INDEX, &chunk.index)),
            tail.group(op::ATTACHMENT_INDEX, &self.attachments, |tail, index| tail.write(op::ATTACHMENT_INDEX, index)),
            tail.group(op::METADATA_INDEX, &self.metadata, |tail, index| tail.write(op::METADATA_INDEX, index)),
        ];
        let summary_offset_start = tail.position();
        groups.iter().flatten().for_each(|group| tail.write(op::SUMMARY_OFFSET, group));
        tail.write(op::FOOTER, &records::Footer { summary_start, summary_offset_start, summary_crc: 0 });
        tail.bytes.extend_from_slice(MAGIC);
        Snapshot { prefix: self.end, tail: tail.bytes, frames }
    }
}

/// The records after the data.
struct Tail {
    bytes: Vec<u8>,
    /// Their offset in the file.
    start: u64,
}

impl Tail {
    fn position(&self) -> u64 {
        self.start + self.bytes.len() as u64
    }

    fn record(&mut self, code: u8, parts: &[&[u8]]) {
        self.bytes.push(code);
        self.bytes.extend((parts.iter().map(|part| part.len() as u64).sum::<u64>()).to_le_bytes());
        parts.iter().for_each(|part| self.bytes.extend_from_slice(part));
    }

    fn write<R: for<'a> BinWrite<Args<'a> = ()>>(&mut self, code: u8, record: &R) {
        self.record(code, &[&encoded(record)]);
    }

    /// Writes records of one kind. Returns their location, if there are any.
    fn group<T>(
        &mut self,
        code: u8,
        items: impl IntoIterator<Item = T>,
        write: impl Fn(&mut Self, T),
    ) -> Option<records::SummaryOffset> {
        let group_start = self.position();
        items.into_iter().for_each(|item| write(self, item));
        let group_length = self.position() - group_start;
        (group_length > 0).then_some(records::SummaryOffset { group_opcode: code, group_start, group_length })
    }
}

fn encoded<R: for<'a> BinWrite<Args<'a> = ()>>(record: &R) -> Vec<u8> {
    let mut bytes = io::Cursor::new(Vec::new());
    record.write_le(&mut bytes).expect("a vector grows");
    bytes.into_inner()
}
