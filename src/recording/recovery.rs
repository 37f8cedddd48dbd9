//! Makes valid recordings of unfinished ones: everything on disk up to the last complete frame,
//! followed by a new index.
//!
//! Only record headers and the first chunk are read to build the index, so a snapshot of a large
//! recording is cheap.

use std::collections::BTreeMap;
use std::fs::{File, OpenOptions};
use std::io::{self, BufReader, Read, Seek, SeekFrom, Write};
use std::path::Path;

use binrw::{BinRead, BinWrite};
use mcap::records::{self, Record, op};
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};

use super::files::{RecordingError, publish};

const MAGIC: &[u8; 8] = b"\x89MCAP0\r\n";
/// Most bytes that a chunk may unfold to. What is recorded of a frame is far less; a damaged length may say anything.
const MOST_CHUNK_BYTES: usize = 1 << 30;
/// Length of a record's head: opcode and length.
const RECORD_HEAD: u64 = 9;

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

/// Contents of the index of a recording.
#[derive(Default)]
struct Contents {
    /// Where the last complete frame ends; 0 until the file's header is complete.
    end: u64,
    schemas: BTreeMap<u16, (records::SchemaHeader, Vec<u8>)>,
    channels: BTreeMap<u16, records::Channel>,
    chunks: Vec<(records::ChunkIndex, BTreeMap<u16, u64>)>,
    attachments: Vec<records::AttachmentIndex>,
    metadata: Vec<records::MetadataIndex>,
    /// Number of chunks before `end`.
    chunks_kept: usize,
}

impl Contents {
    /// Reads records until the end of the file, an incomplete record, or a damaged chunk.
    fn read(&mut self, file: &mut (impl Read + Seek), length: u64, verify: bool) -> io::Result<()> {
        let mut magic = [0; MAGIC.len()];
        if length < magic.len() as u64 {
            return Ok(());
        }
        file.read_exact(&mut magic)?;
        if &magic != MAGIC {
            return Ok(());
        }
        let mut offset = magic.len() as u64;
        while offset + RECORD_HEAD <= length {
            let mut head = [0; RECORD_HEAD as usize];
            file.read_exact(&mut head)?;
            let size = u64::from_le_bytes(head[1..].try_into().expect("eight bytes"));
            let Some(next) = (offset + RECORD_HEAD).checked_add(size).filter(|&next| next <= length) else { break };
            if !self.record(file, head[0], offset, size, verify)? {
                break;
            }
            offset = next;
            file.seek(SeekFrom::Start(offset))?;
        }
        Ok(())
    }

    /// Indexes a complete record. Returns false where the data ends.
    fn record(&mut self, file: &mut impl Read, code: u8, offset: u64, size: u64, verify: bool) -> io::Result<bool> {
        let end = offset + RECORD_HEAD + size;
        let mut body = vec![];
        let partly = code == op::CHUNK && !verify && !self.channels.is_empty();
        // A chunk's header is 40 bytes and the name of the compression.
        file.take(if partly { size.min(64) } else { size }).read_to_end(&mut body)?;
        match code {
            op::HEADER => self.keep(end),
            op::CHUNK => {
                let header = if partly { chunk_header(&body) } else { self.read_chunk(&body) };
                let Some(header) = header else { return Ok(false) };
                self.chunks.push((chunk_index(header, offset, end - offset), BTreeMap::new()));
            }
            op::MESSAGE_INDEX => {
                let (Ok(Record::MessageIndex(index)), Some((chunk, counts))) =
                    (mcap::parse_record(code, &body), self.chunks.last_mut())
                else {
                    return Ok(false);
                };
                chunk.message_index_offsets.insert(index.channel_id, offset);
                chunk.message_index_length += end - offset;
                counts.insert(index.channel_id, index.records.len() as u64);
                // Each frame ends with its diagnostics, in a chunk of their own or in the frame's
                // last one, and their index is the last one after the chunk.
                if Some(index.channel_id) == self.diagnostics_channel() {
                    self.keep(end);
                }
            }
            op::ATTACHMENT | op::METADATA => {
                match mcap::parse_record(code, &body) {
                    Ok(Record::Attachment { header, data, .. }) => self.attachments.push(records::AttachmentIndex {
                        offset,
                        length: end - offset,
                        log_time: header.log_time,
                        create_time: header.create_time,
                        data_size: data.len() as u64,
                        name: header.name,
                        media_type: header.media_type,
                    }),
                    Ok(Record::Metadata(metadata)) => {
                        self.metadata.push(records::MetadataIndex {
                            offset,
                            length: end - offset,
                            name: metadata.name,
                        });
                    }
                    _ => return Ok(false),
                }
                self.keep(end);
            }
            _ => return Ok(false),
        }
        Ok(true)
    }

    fn keep(&mut self, end: u64) {
        self.end = end;
        self.chunks_kept = self.chunks.len();
    }

    /// Reads schemas and channels from a chunk. Returns `None` if its content is damaged: its checksum is looked at
    /// before anything in it is believed.
    fn read_chunk(&mut self, body: &[u8]) -> Option<records::ChunkHeader> {
        let header = chunk_header(body)?;
        let head = [&[op::CHUNK][..], &(body.len() as u64).to_le_bytes()].concat();
        let mut bytes = head.as_slice().chain(body);
        let options = LinearReaderOptions::default()
            .with_skip_start_magic(true)
            .with_skip_end_magic(true)
            .with_prevalidate_chunk_crcs(true)
            .with_record_length_limit(MOST_CHUNK_BYTES);
        let mut reader = LinearReader::new_with_options(options);
        while let Some(event) = reader.next_event() {
            let (opcode, data) = match event.ok()? {
                LinearReadEvent::ReadRequest(need) => {
                    let read = bytes.read(reader.insert(need)).ok()?;
                    reader.notify_read(read);
                    continue;
                }
                LinearReadEvent::Record { opcode, data } => (opcode, data),
            };
            match mcap::parse_record(opcode, data).ok()? {
                Record::Schema { header, data } => {
                    self.schemas.insert(header.id, (header, data.into_owned()));
                }
                Record::Channel(channel) => {
                    self.channels.insert(channel.id, channel);
                }
                _ => {}
            }
        }
        Some(header)
    }

    fn diagnostics_channel(&self) -> Option<u16> {
        self.channels.values().find(|channel| channel.topic == "/diagnostics").map(|channel| channel.id)
    }

    fn statistics(&self) -> records::Statistics {
        let mut channel_message_counts = BTreeMap::new();
        for (_, counts) in &self.chunks {
            counts.iter().for_each(|(&channel, &count)| *channel_message_counts.entry(channel).or_insert(0) += count);
        }
        let with_messages = || self.chunks.iter().filter(|(_, counts)| !counts.is_empty()).map(|(chunk, _)| chunk);
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
        self.chunks.truncate(self.chunks_kept);
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
            tail.group(op::CHUNK_INDEX, &self.chunks, |tail, (index, _)| tail.write(op::CHUNK_INDEX, index)),
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

fn chunk_header(body: &[u8]) -> Option<records::ChunkHeader> {
    records::ChunkHeader::read_le(&mut io::Cursor::new(body)).ok()
}

fn chunk_index(header: records::ChunkHeader, offset: u64, length: u64) -> records::ChunkIndex {
    records::ChunkIndex {
        message_start_time: header.message_start_time,
        message_end_time: header.message_end_time,
        chunk_start_offset: offset,
        chunk_length: length,
        message_index_offsets: BTreeMap::new(),
        message_index_length: 0,
        compression: header.compression,
        compressed_size: header.compressed_size,
        uncompressed_size: header.uncompressed_size,
    }
}
