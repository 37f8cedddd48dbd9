//! Recordings: MCAP files with Foxglove's protobuf messages, their recovery after a crash, and
//! pictures of frames.
//!
//! A recording is written as `NAME.mcap.partial`, append-only, one frame after the other. Each
//! frame ends with its `/diagnostics` message and a closed chunk; its cloud, its picture and shapes
//! have chunks of their own. What is on disk up to the last closed frame can be made a valid,
//! indexed file by appending an index ([`snapshot`], [`recover`]), and read message by message
//! ([`Growing`]). A finished recording is renamed to `NAME.mcap`.

mod appearance;
mod arrays;
mod channels;
pub mod checkpoint;
mod cloud;
mod colliders;
mod diagnostics;
pub mod embedded;
mod excerpt;
pub mod export;
mod files;
mod frames;
mod growing;
mod index;
mod palette;
mod picture;
mod points;
pub mod provenance;
pub mod reconstruction;
mod recovery;
pub mod render;
pub mod run;
mod scenery;
mod solids;
mod state;
mod surface;
mod writer;

pub use appearance::Appearance;
pub use cloud::{Cloud, FramePoints, unit};
pub use files::{RecordingError, partial_path, write_file};
pub use frames::{FrameIndex, frame_points};
pub use growing::{Channel, Growing, Message};
pub use picture::thumbnail;
pub use recovery::{Snapshot, recover, snapshot};
pub use scenery::Scenery;
pub use solids::{FrameSolids, Solid};
pub use writer::{Header, Severity, Writer};
