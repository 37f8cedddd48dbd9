//! Writes recordings.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufWriter, Read};
use std::path::{Path, PathBuf};

use foxglove::Encode;
use foxglove::messages::log::Level;
use foxglove::messages::{CompressedImage, Log, Timestamp};
use mcap::records::{MessageHeader, Record, op};
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};
use mcap::write::NoSeek;
use mcap::{Attachment, McapError, WriteOptions};
use sha2::{Digest, Sha256};

use super::channels::{Channels, Kind};
use super::colliders::WORLD;
use super::files::{RecordingError, partial_path, publish, sync};
use super::picture::Camera;
use super::points::Points;
use super::{colliders, diagnostics};
use crate::appearance::Appearance;
use crate::embedded::{BODIES, SCENE};
use crate::excerpt::{select, union};
use crate::provenance;
use gridfall_core::sim::diagnostics::{Row, SolverRow};
use gridfall_core::sim::excerpt::Excerpt;
use gridfall_core::sim::setup::Setup;
use gridfall_engine::Backend;

/// Where no message ends a chunk (see [`Writer::put`]), this size does (bytes).
const CHUNK_BYTES: u64 = 1 << 20;
/// zstd's output is the same for every number of threads except zero, so this may differ between
/// machines.
const COMPRESSION_THREADS: u32 = 2;

/// What a recording says about its run, before the first frame.
pub struct Header<'a> {
    pub setup: &'a Setup,
    pub appearance: &'a Appearance,
    /// The scene document, attached unchanged.
    pub scene_json: &'a str,
    pub backend: &'a Backend,
}

/// Severity of a line of the log.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Severity {
    Info,
    Warning,
    Error,
}

/// A recording being written.
pub struct Writer {
    mcap: mcap::Writer<NoSeek<BufWriter<File>>>,
    target: PathBuf,
    partial: PathBuf,
    channels: Channels,
    /// What the chunk that is open has, if one is.
    open: Option<Kind>,
    /// Indices of the particles that are recorded, ascending.
    wanted: Vec<u32>,
    points: Points,
    camera: Camera,
    /// Time of the last message written (ns).
    now: u64,
    /// Messages so far, by channel.
    sequences: BTreeMap<u16, u32>,
    /// Colliders in the last scene that was sent.
    present: Option<Vec<bool>>,
    /// Lines of the log that go with the next frame.
    lines: Vec<(Level, String)>,
}

impl Writer {
    /// Starts the recording that will become `target`, in `target`'s [`partial_path`]. Replaces
    /// what is there.
    ///
    /// # Errors
    /// When the file cannot be created or written.
    pub fn create(target: &Path, header: &Header) -> Result<Self, RecordingError> {
        let partial = partial_path(target);
        let file = File::create(&partial).map_err(RecordingError::io("create", &partial))?;
        let setup = header.setup;
        let recorded = select(setup.total_particles(), setup.preview_points, setup.seed);
        let recorded_points = recorded.len();
        let (wanted, [in_points, in_film]) = union(&recorded, &Camera::film_selection(setup));
        let points = Points::new(setup, header.appearance, in_points, recorded);
        let camera = Camera::film(setup, header.appearance, in_film);
        let start = || -> Result<_, McapError> {
            // Without seeking the file only grows, so that its prefixes can be read while it is
            // written.
            let options = WriteOptions::new()
                .library(format!("gridfall {}", provenance::VERSION))
                .chunk_size(Some(CHUNK_BYTES))
                .disable_seeking(true)
                .compression_threads(COMPRESSION_THREADS);
            let mut mcap = options.create(NoSeek::new(BufWriter::new(file)))?;
            mcap.attach(&Attachment {
                log_time: 0,
                create_time: 0,
                name: SCENE.into(),
                media_type: "application/json".into(),
                data: Cow::Borrowed(header.scene_json.as_bytes()),
            })?;
            for (name, metadata) in provenance_records(header, recorded_points) {
                mcap.write_metadata(&mcap::write::Metadata { name: name.into(), metadata })?;
            }
            let channels = Channels::add(&mut mcap, setup)?;
            Ok((mcap, channels))
        };
        match start() {
            Ok((mcap, channels)) => Ok(Self {
                mcap,
                target: target.to_owned(),
                partial,
                channels,
                // The topics and their schemas.
                open: Some(Kind::Other),
                wanted,
                points,
                camera,
                now: 0,
                sequences: BTreeMap::new(),
                present: None,
                lines: vec![],
            }),
            Err(source) => Err(RecordingError::Mcap { path: partial, source }),
        }
    }

    /// Starts a recording as [`Self::create`] does, with the frames up to `frame`, at `time_s`, of one that the same
    /// header began. They are in the first `length` bytes of the file `earlier`; they are written as they were written
    /// there, so that the bytes are the same.
    ///
    /// # Errors
    /// When a file cannot be read or written, or `earlier` does not have these frames.
    pub fn resume(
        target: &Path,
        header: &Header,
        earlier: &Path,
        length: u64,
        (frame, time_s): (u64, f64),
    ) -> Result<Self, RecordingError> {
        let mut writer = Self::create(target, header)?;
        let frames = writer.replay(earlier, length)?;
        if frames != frame + 1 {
            let reason = format!("it has {frames} frames in {length} bytes, of {} that it should have", frame + 1);
            return Err(RecordingError::Damaged { path: earlier.to_owned(), reason });
        }
        writer.now = stamp(time_s).0;
        writer.present = Some(colliders::present(header.setup, time_s));
        if writer.length()? != length {
            let reason = "its frames are not what this build writes".to_owned();
            return Err(RecordingError::Damaged { path: earlier.to_owned(), reason });
        }
        Ok(writer)
    }

    /// Writes the messages of another recording. Returns the number of frames.
    fn replay(&mut self, earlier: &Path, length: u64) -> Result<u64, RecordingError> {
        let damaged =
            |error: McapError| RecordingError::Damaged { path: earlier.to_owned(), reason: error.to_string() };
        let mut file = File::open(earlier).map_err(RecordingError::io("open", earlier))?.take(length);
        // Checked before a chunk is unfolded: a damaged length may say anything.
        let options = LinearReaderOptions::default()
            .with_skip_end_magic(true)
            .with_prevalidate_chunk_crcs(true)
            .with_record_length_limit(1 << 30);
        let mut reader = LinearReader::new_with_options(options);
        let mut frames = 0;
        while let Some(event) = reader.next_event() {
            match event.map_err(damaged)? {
                LinearReadEvent::ReadRequest(need) => {
                    let read = file.read(reader.insert(need)).map_err(RecordingError::io("read", earlier))?;
                    reader.notify_read(read);
                }
                LinearReadEvent::Record { opcode: op::MESSAGE, data } => {
                    let Record::Message { header, data } = mcap::parse_record(op::MESSAGE, data).map_err(damaged)?
                    else {
                        continue;
                    };
                    self.put(&header, &data)?;
                    frames += u64::from(header.channel_id == self.channels.diagnostics);
                }
                LinearReadEvent::Record { .. } => {}
            }
        }
        Ok(frames)
    }

    /// Length of the file so far (bytes), after [`Self::frame`].
    ///
    /// # Errors
    /// When the file cannot be looked at.
    pub fn length(&self) -> Result<u64, RecordingError> {
        let metadata = std::fs::metadata(&self.partial).map_err(RecordingError::io("look at", &self.partial))?;
        Ok(metadata.len())
    }

    /// Waits until the frames so far are on the disk. Returns the length of the file (bytes).
    ///
    /// # Errors
    /// When the file cannot be synced.
    pub fn sync(&self) -> Result<u64, RecordingError> {
        sync(&self.partial)
    }

    /// The selection whose excerpts [`Self::frame`] takes, ascending.
    pub fn wanted(&self) -> &[u32] {
        &self.wanted
    }

    /// Adds a frame and the implicit steps that led to it. When this returns, the operating system
    /// has the frame, and it survives the death of this process.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn frame(
        &mut self,
        setup: &Setup,
        particles: &Excerpt,
        row: &Row,
        steps: &[SolverRow],
    ) -> Result<(), RecordingError> {
        let (nanos, timestamp) = stamp(row.time_s);
        for step in steps {
            // The times of steps are sums, which may round past the frame's.
            self.now = stamp(step.time_s).0.clamp(self.now, nanos);
            self.bytes(self.channels.solver, &diagnostics::encode_solver(step))?;
        }
        self.now = nanos;
        let points = self.points.message(setup, particles, timestamp);
        self.message(self.channels.particles, &points)?;
        let picture = self.camera.render(setup, particles, row.time_s);
        let image = CompressedImage {
            timestamp: Some(timestamp),
            frame_id: WORLD.into(),
            data: picture.png().into(),
            format: "png".into(),
        };
        self.message(self.channels.camera, &image)?;
        let present = Some(colliders::present(setup, row.time_s));
        if present != self.present {
            let shown = present.as_deref().unwrap_or_default();
            self.message(self.channels.colliders, &colliders::scene(setup, shown, timestamp))?;
            for (n, (collider, &shown)) in setup.colliders.iter().zip(shown).enumerate() {
                if self.present.as_ref().is_none_or(|before| before[n] != shown) {
                    let points = colliders::points(setup, collider, shown, timestamp);
                    self.message(self.channels.shapes[n], &points)?;
                }
            }
            self.present = present;
        }
        self.message(self.channels.tf, &colliders::transforms(setup, row.time_s, timestamp))?;
        self.write_log()?;
        // The last message of a frame. Recovery takes a frame as complete when it finds this
        // message.
        self.bytes(self.channels.diagnostics, &diagnostics::encode(row))
    }

    /// Adds a line to `/log`. It goes with the next frame, or with the end of the recording.
    pub fn log(&mut self, severity: Severity, message: String) {
        let level = match severity {
            Severity::Info => Level::Info,
            Severity::Warning => Level::Warning,
            Severity::Error => Level::Error,
        };
        self.lines.push((level, message));
    }

    fn write_log(&mut self) -> Result<(), RecordingError> {
        for (level, message) in std::mem::take(&mut self.lines) {
            let timestamp = Some(nanoseconds(self.now));
            let log = Log { timestamp, level: level.into(), message, name: "gridfall".into(), ..Default::default() };
            self.message(self.channels.log, &log)?;
        }
        Ok(())
    }

    /// Completes the recording as `result` says, and gives it its final name.
    ///
    /// # Errors
    /// When the file cannot be written, synced or renamed.
    pub fn finish(mut self, result: BTreeMap<String, String>) -> Result<(), RecordingError> {
        self.write_log()?;
        let metadata = mcap::write::Metadata { name: "result".into(), metadata: result };
        self.mcap.write_metadata(&metadata).map_err(|source| self.error(source))?;
        self.mcap.finish().map_err(|source| self.error(source))?;
        publish(&self.partial, &self.target)
    }

    fn message<M: Encode>(&mut self, channel: u16, message: &M) -> Result<(), RecordingError> {
        let mut bytes = Vec::with_capacity(message.encoded_len().unwrap_or(0));
        message.encode(&mut bytes).expect("a vector grows");
        self.bytes(channel, &bytes)
    }

    fn bytes(&mut self, channel_id: u16, data: &[u8]) -> Result<(), RecordingError> {
        let sequence = self.sequences.get(&channel_id).copied().unwrap_or(0);
        let header = MessageHeader { channel_id, sequence, log_time: self.now, publish_time: self.now };
        self.put(&header, data)
    }

    /// Writes a message. Chunks have messages of one [`Kind`] and of one frame, whose end is on the disk
    /// when this returns. They are a function of their messages and of nothing else, so that a run that
    /// goes on leaves the bytes of one that was never interrupted.
    fn put(&mut self, header: &MessageHeader, data: &[u8]) -> Result<(), RecordingError> {
        let kind = self.channels.kind(header.channel_id);
        let last = header.channel_id == self.channels.diagnostics;
        let other = self.open.is_some_and(|open| open != kind);
        let mut write = || -> Result<(), McapError> {
            if other {
                self.mcap.flush()?;
            }
            self.mcap.write_to_known_channel(header, data)?;
            if last { self.mcap.flush() } else { Ok(()) }
        };
        write().map_err(|source| self.error(source))?;
        self.open = Some(kind).filter(|_| !last);
        self.sequences.insert(header.channel_id, header.sequence + 1);
        Ok(())
    }

    fn error(&self, source: McapError) -> RecordingError {
        RecordingError::Mcap { path: self.partial.clone(), source }
    }
}

/// The metadata records `build`, `run`, `hardware` and `bodies`.
fn provenance_records(header: &Header, points: usize) -> [(&'static str, BTreeMap<String, String>); 4] {
    let Header { setup, scene_json, backend, .. } = header;
    let record = |pairs: &[(&str, String)]| pairs.iter().map(|(key, value)| (key.to_string(), value.clone())).collect();
    let hash: String = Sha256::digest(scene_json.as_bytes()).iter().map(|byte| format!("{byte:02x}")).collect();
    let build = record(&[
        ("version", provenance::VERSION.into()),
        ("commit", provenance::COMMIT.into()),
        ("target", provenance::TARGET.into()),
    ]);
    let run = record(&[
        ("name", setup.name.clone()),
        ("dimension", setup.dimension.to_string()),
        ("kernel", format!("{:?}", setup.kernel).to_lowercase()),
        ("transfer", format!("{:?}", setup.transfer).to_lowercase()),
        ("integrator", setup.integrator.name().into()),
        ("integrator_reason", setup.integrator_reason.clone()),
        ("dx_m", setup.dx.to_string()),
        ("frames", (u64::from(setup.frames) + 1).to_string()),
        ("frame_s", setup.frame_s.to_string()),
        ("particles", setup.total_particles().to_string()),
        ("points", points.to_string()),
        ("decimation", (points as f64 / setup.total_particles().max(1) as f64).to_string()),
    ]);
    let hardware = record(&[
        ("backend", backend.kind.clone()),
        ("adapter", backend.device.clone()),
        ("driver", backend.driver.clone()),
        ("software", backend.software.to_string()),
        ("reason", backend.reason.clone()),
        ("precision", format!("{:?}", setup.precision_on(&backend.kind)).to_lowercase()),
        ("seed", setup.seed.to_string()),
        ("scene_sha256", hash),
    ]);
    // By their numbers in the field `body`.
    let bodies = setup.bodies.iter().enumerate().map(|(n, body)| (n.to_string(), body.name.clone())).collect();
    [("build", build), ("run", run), ("hardware", hardware), (BODIES, bodies)]
}

/// Simulated time as nanoseconds and as a message's timestamp.
fn stamp(time_s: f64) -> (u64, Timestamp) {
    let nanos = (time_s * 1e9).round() as u64;
    (nanos, nanoseconds(nanos))
}

fn nanoseconds(nanos: u64) -> Timestamp {
    Timestamp::new((nanos / 1_000_000_000) as u32, (nanos % 1_000_000_000) as u32)
}
