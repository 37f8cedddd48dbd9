//! The topics of a recording, their schemas, and which messages share chunks.

use std::collections::BTreeMap;
use std::io::{Seek, Write};

use foxglove::Encode;
use foxglove::messages::{self, CompressedImage, Log};
use mcap::McapError;

use super::{colliders, diagnostics};
use gridfall_core::sim::setup::Setup;

/// Channel ids.
pub struct Channels {
    pub particles: u16,
    pub colliders: u16,
    /// Points of each collider.
    pub shapes: Vec<u16>,
    pub tf: u16,
    pub log: u16,
    pub camera: u16,
    pub solver: u16,
    pub diagnostics: u16,
}

/// What is in one chunk. Viewers fetch whole chunks, so clouds, pictures and shapes have chunks of
/// their own: what plots the rest reads none of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    Cloud,
    Picture,
    Shape,
    Other,
}

impl Channels {
    /// Adds the channels, and their schemas.
    pub fn add<W: Write + Seek>(mcap: &mut mcap::Writer<W>, setup: &Setup) -> Result<Self, McapError> {
        let mut add = |topic: &str, name: &str, schema: &[u8]| {
            let schema = mcap.add_schema(name, "protobuf", schema)?;
            mcap.add_channel(schema, topic, "protobuf", &BTreeMap::new())
        };
        fn schema<M: Encode>() -> foxglove::Schema {
            M::get_schema().expect("Foxglove's messages have schemas")
        }
        let mut add_foxglove = |topic: &str, schema: foxglove::Schema| add(topic, &schema.name, &schema.data);
        Ok(Self {
            particles: add_foxglove("/particles", schema::<messages::PointCloud>())?,
            colliders: add_foxglove("/colliders", schema::<messages::SceneUpdate>())?,
            shapes: setup
                .colliders
                .iter()
                .map(|collider| add_foxglove(&colliders::points_topic(collider), schema::<messages::PointCloud>()))
                .collect::<Result<_, _>>()?,
            tf: add_foxglove("/tf", schema::<messages::FrameTransforms>())?,
            log: add_foxglove("/log", schema::<Log>())?,
            camera: add_foxglove("/camera", schema::<CompressedImage>())?,
            solver: add("/solver", diagnostics::SOLVER_SCHEMA_NAME, &diagnostics::schema())?,
            // The largest id, so that its index is the last one after a chunk; see `recovery`.
            diagnostics: add("/diagnostics", diagnostics::SCHEMA_NAME, &diagnostics::schema())?,
        })
    }

    /// What a channel's messages are.
    pub fn kind(&self, channel: u16) -> Kind {
        match channel {
            channel if channel == self.particles => Kind::Cloud,
            channel if channel == self.camera => Kind::Picture,
            channel if channel == self.colliders || self.shapes.contains(&channel) => Kind::Shape,
            _ => Kind::Other,
        }
    }
}
