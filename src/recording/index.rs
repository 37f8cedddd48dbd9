//! What is in the data of a recording, found without unpacking it: only record headers and the first chunk are read.

use std::collections::BTreeMap;
use std::io::{self, Read, Seek, SeekFrom};

use binrw::BinRead;
use mcap::records::{self, Record, op};
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};

pub const MAGIC: &[u8; 8] = b"\x89MCAP0\r\n";
/// Most bytes that a chunk may unfold to. What is recorded of a frame is far less; a damaged length may say anything.
const MOST_CHUNK_BYTES: usize = 1 << 30;
/// Length of a record's head: opcode and length.
const RECORD_HEAD: u64 = 9;

/// A chunk whose record is complete.
#[derive(Clone, Debug)]
pub struct Chunk {
    pub index: records::ChunkIndex,
    /// Number of messages by channel.
    pub counts: BTreeMap<u16, u64>,
    /// Of what it unfolds to.
    crc: u32,
}

impl Chunk {
    /// Whether it is the same chunk at the same place, of this file or of another.
    pub fn is(&self, other: &Self) -> bool {
        let place = |chunk: &Self| (chunk.index.chunk_start_offset, chunk.index.chunk_length, chunk.crc);
        place(self) == place(other)
    }
}

/// Contents of the index of a recording.
#[derive(Clone, Debug, Default)]
pub struct Contents {
    /// Where the last complete frame ends; 0 until the file's header is complete.
    pub end: u64,
    pub schemas: BTreeMap<u16, (records::SchemaHeader, Vec<u8>)>,
    pub channels: BTreeMap<u16, records::Channel>,
    pub chunks: Vec<Chunk>,
    pub attachments: Vec<records::AttachmentIndex>,
    pub metadata: Vec<records::MetadataIndex>,
    /// Number of chunks before `end`.
    chunks_kept: usize,
}

impl Contents {
    /// Reads records until the end of the file, an incomplete record, or a damaged chunk. Goes on behind the last
    /// complete frame that it has found before.
    pub fn read(&mut self, file: &mut (impl Read + Seek), length: u64, verify: bool) -> io::Result<()> {
        let mut offset = self.end;
        if offset == 0 {
            let mut magic = [0; MAGIC.len()];
            if length < magic.len() as u64 {
                return Ok(());
            }
            file.seek(SeekFrom::Start(0))?;
            file.read_exact(&mut magic)?;
            if &magic != MAGIC {
                return Ok(());
            }
            offset = magic.len() as u64;
        }
        self.chunks.truncate(self.chunks_kept);
        file.seek(SeekFrom::Start(offset))?;
        while offset + RECORD_HEAD <= length {
            let mut head = [0; RECORD_HEAD as usize];
            file.read_exact(&mut head)?;
            let size = u64::from_le_bytes(head[1..].try_into().expect("eight bytes"));
            let Some(next) = (offset + RECORD_HEAD).checked_add(size).filter(|&next| next <= length) else { break };
            if !self.record(file, head[0], offset, size, verify)? {
                break;
            }
            offset = next;
            // What is buffered stays so: records are many and short.
            let position = file.stream_position()?;
            file.seek_relative(offset as i64 - position as i64)?;
        }
        self.chunks.truncate(self.chunks_kept);
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
                self.chunks.push(chunk(header, offset, end - offset));
            }
            op::MESSAGE_INDEX => {
                let (Ok(Record::MessageIndex(index)), Some(chunk)) =
                    (mcap::parse_record(code, &body), self.chunks.last_mut())
                else {
                    return Ok(false);
                };
                chunk.index.message_index_offsets.insert(index.channel_id, offset);
                chunk.index.message_index_length += end - offset;
                chunk.counts.insert(index.channel_id, index.records.len() as u64);
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
        unfold(head.as_slice().chain(body), |record| match record {
            Record::Schema { header, data } => {
                self.schemas.insert(header.id, (header, data.into_owned()));
            }
            Record::Channel(channel) => {
                self.channels.insert(channel.id, channel);
            }
            _ => {}
        })?;
        Some(header)
    }

    pub fn diagnostics_channel(&self) -> Option<u16> {
        self.channel("/diagnostics")
    }

    /// The metadata of this name, if there is such; of a file that was read.
    pub fn metadata(&self, file: &mut (impl Read + Seek), name: &str) -> io::Result<BTreeMap<String, String>> {
        let Some(place) = self.metadata.iter().find(|place| place.name == name) else { return Ok(BTreeMap::new()) };
        let mut body = Vec::new();
        file.seek(SeekFrom::Start(place.offset + RECORD_HEAD))?;
        file.take(place.length - RECORD_HEAD).read_to_end(&mut body)?;
        match mcap::parse_record(op::METADATA, &body) {
            Ok(Record::Metadata(metadata)) => Ok(metadata.metadata),
            _ => Ok(BTreeMap::new()),
        }
    }

    /// The channel of a topic, once it is known.
    pub fn channel(&self, topic: &str) -> Option<u16> {
        self.channels.values().find(|channel| channel.topic == topic).map(|channel| channel.id)
    }
}

/// Reads the records in a chunk of a file. `None` if it is damaged.
pub fn unfold_at(file: &mut (impl Read + Seek), chunk: &Chunk, take: impl FnMut(Record)) -> io::Result<Option<()>> {
    let mut bytes = Vec::new();
    file.seek(SeekFrom::Start(chunk.index.chunk_start_offset))?;
    file.take(chunk.index.chunk_length).read_to_end(&mut bytes)?;
    Ok(unfold(bytes.as_slice(), take))
}

/// Reads the records in a chunk. `None` if it is damaged: its checksum is looked at before anything in it is believed.
fn unfold(mut chunk: impl Read, mut take: impl FnMut(Record)) -> Option<()> {
    let options = LinearReaderOptions::default()
        .with_skip_start_magic(true)
        .with_skip_end_magic(true)
        .with_prevalidate_chunk_crcs(true)
        .with_record_length_limit(MOST_CHUNK_BYTES);
    let mut reader = LinearReader::new_with_options(options);
    while let Some(event) = reader.next_event() {
        match event.ok()? {
            LinearReadEvent::ReadRequest(need) => {
                let read = chunk.read(reader.insert(need)).ok()?;
                reader.notify_read(read);
            }
            LinearReadEvent::Record { opcode, data } => take(mcap::parse_record(opcode, data).ok()?),
        }
    }
    Some(())
}

fn chunk_header(body: &[u8]) -> Option<records::ChunkHeader> {
    records::ChunkHeader::read_le(&mut io::Cursor::new(body)).ok()
}

fn chunk(header: records::ChunkHeader, offset: u64, length: u64) -> Chunk {
    let index = records::ChunkIndex {
        message_start_time: header.message_start_time,
        message_end_time: header.message_end_time,
        chunk_start_offset: offset,
        chunk_length: length,
        message_index_offsets: BTreeMap::new(),
        message_index_length: 0,
        compression: header.compression,
        compressed_size: header.compressed_size,
        uncompressed_size: header.uncompressed_size,
    };
    Chunk { index, counts: BTreeMap::new(), crc: header.uncompressed_crc }
}
