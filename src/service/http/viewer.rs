//! What is said between this server and viewers: Foxglove's WebSocket protocol,
//! <https://github.com/foxglove/ws-protocol/blob/main/docs/spec.md>. Of it what a server needs that has
//! topics to show and takes nothing.

use axum::extract::ws::Message;
use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use serde::Deserialize;
use serde_json::json;
use uuid::Uuid;

use gridfall_recording as recording;

/// Names of the protocol: Foxglove's and Lichtblick's. What is used here is the same in both.
pub const SUBPROTOCOLS: [&str; 2] = ["foxglove.sdk.v1", "foxglove.websocket.v1"];

/// Opcodes of binary messages.
const MESSAGE_DATA: u8 = 1;
const TIME: u8 = 2;

/// What clients ask for.
#[derive(Debug, Deserialize)]
#[serde(tag = "op", rename_all = "camelCase")]
pub enum Request {
    Subscribe {
        subscriptions: Vec<Subscription>,
    },
    #[serde(rename_all = "camelCase")]
    Unsubscribe {
        subscription_ids: Vec<u32>,
    },
    #[serde(other)]
    Other,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct Subscription {
    /// The client's choice.
    pub id: u32,
    pub channel_id: u16,
}

/// Severity of a [`status`].
#[derive(Clone, Copy, Debug)]
pub enum Level {
    Info = 0,
    Warning = 1,
    Error = 2,
}

fn text(value: serde_json::Value) -> Message {
    Message::Text(value.to_string().into())
}

/// The first message: whose frames these are, and that it tells their time.
pub fn server_info(job: Uuid) -> Message {
    text(json!({
        "op": "serverInfo",
        "name": format!("gridfall {}", recording::provenance::VERSION),
        "capabilities": ["time"],
        "supportedEncodings": [],
        "metadata": { "job": job },
        "sessionId": job,
    }))
}

/// The topics that there are.
pub fn advertise(channels: &[recording::Channel]) -> Message {
    let channel = |channel: &recording::Channel| {
        json!({
            "id": channel.id,
            "topic": channel.topic,
            "encoding": channel.encoding,
            "schemaName": channel.schema_name,
            "schemaEncoding": channel.schema_encoding,
            "schema": BASE64_STANDARD.encode(&channel.schema),
        })
    };
    text(json!({ "op": "advertise", "channels": channels.iter().map(channel).collect::<Vec<_>>() }))
}

/// A line for the user.
pub fn status(level: Level, message: &str) -> Message {
    text(json!({ "op": "status", "level": level as u8, "message": message }))
}

/// Simulated time (ns).
pub fn time(nanos: u64) -> Message {
    Message::Binary([&[TIME][..], &nanos.to_le_bytes()].concat().into())
}

/// A message of a topic, for a subscription.
pub fn data(subscription: u32, message: &recording::Message) -> Message {
    let head = [&[MESSAGE_DATA][..], &subscription.to_le_bytes(), &message.log_time.to_le_bytes()].concat();
    Message::Binary([head.as_slice(), &message.data].concat().into())
}
