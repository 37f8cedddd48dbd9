//! Extractors of parts of requests, with rejections as problems.

use std::error::Error;
use std::future::poll_fn;
use std::pin::Pin;

use axum::body::{Body, HttpBody};
use axum::extract::rejection::{JsonRejection, PathRejection, QueryRejection};
use axum::extract::{FromRequest, FromRequestParts, Request};
use axum::http::request::Parts;
use serde::de::DeserializeOwned;
use tokio::sync::OwnedSemaphorePermit;
use tokio::time::timeout;
use uuid::Uuid;

use super::problem::{Code, Problem, internal};
use super::state::{Api, BODY_UNIT};

/// Bytes beyond the limit that are read and discarded before a body is refused. A client that is
/// still sending when the connection closes may never see the reason.
const DISCARDED_BYTES: usize = 64 << 20;

/// Longer JSON is parsed on a thread that may take its time (bytes).
const LONG_JSON: usize = 64 << 10;

/// Room for a body, given back when this is dropped.
#[derive(Default)]
pub struct Room(Option<OwnedSemaphorePermit>);

/// A JSON body, and the room that it takes until it is judged.
pub struct JsonBody<T>(pub T, pub Room);

impl<T: DeserializeOwned + Send + 'static> FromRequest<Api> for JsonBody<T> {
    type Rejection = Problem;

    async fn from_request(request: Request, api: &Api) -> Result<Self, Problem> {
        let (parts, body) = request.into_parts();
        let (bytes, room) = read_in_time(body, api.config.max_body_bytes, api).await?;
        let mut room = room;
        room.widen(bytes.len() + parsed_bytes(&bytes), api)?;
        // Asks for the media type, and leaves long bodies to another thread.
        let long = bytes.len() > LONG_JSON;
        let head = Request::from_parts(parts, Body::from(if long { b"null".to_vec() } else { bytes.clone() }));
        let parsed = match axum::Json::<T>::from_request(head, api).await {
            Err(rejection @ JsonRejection::MissingJsonContentType(_)) => return Err(json_problem(&rejection)),
            _ if long => {
                let parse = move || axum::Json::<T>::from_bytes(&bytes);
                tokio::task::spawn_blocking(parse).await.map_err(internal)?
            }
            parsed => parsed,
        };
        parsed.map(|axum::Json(value)| Self(value, room)).map_err(|rejection| json_problem(&rejection))
    }
}

/// The bytes of an upload, and the room that they take.
pub struct AssetBody(pub Vec<u8>, pub Room);

impl FromRequest<Api> for AssetBody {
    type Rejection = Problem;

    async fn from_request(request: Request, api: &Api) -> Result<Self, Problem> {
        let (bytes, room) = read_in_time(request.into_body(), api.config.max_asset_bytes, api).await?;
        Ok(Self(bytes, room))
    }
}

async fn read_in_time(body: Body, max: usize, api: &Api) -> Result<(Vec<u8>, Room), Problem> {
    let within = api.config.body_timeout;
    timeout(within, read(body, max, api)).await.unwrap_or_else(|_| {
        let detail = format!("the body did not arrive within {} s", within.as_secs_f64());
        Err(Problem::new(Code::RequestTimeout, detail))
    })
}

/// Reads a body of at most `max` bytes.
async fn read(mut body: Body, max: usize, api: &Api) -> Result<(Vec<u8>, Room), Problem> {
    let (mut bytes, mut received) = (Vec::new(), 0usize);
    let mut room = Room(None);
    while let Some(frame) = poll_fn(|context| Pin::new(&mut body).poll_frame(context)).await {
        let frame = frame.map_err(|error| Problem::new(Code::InvalidBody, reason(&error)))?;
        let Ok(data) = frame.into_data() else { continue };
        received = received.saturating_add(data.len());
        if received <= max {
            room.widen(received, api)?;
            bytes.extend_from_slice(&data);
        } else if received - max > DISCARDED_BYTES {
            break;
        }
    }
    if received > max {
        return Err(Problem::new(Code::BodyTooLarge, format!("a body may have at most {max} bytes")));
    }
    Ok((bytes, room))
}

impl Room {
    /// Takes what is missing for so many bytes.
    fn widen(&mut self, bytes: usize, api: &Api) -> Result<(), Problem> {
        let missing = bytes.div_ceil(BODY_UNIT) - self.0.as_ref().map_or(0, OwnedSemaphorePermit::num_permits);
        if missing == 0 {
            return Ok(());
        }
        let more = api.bodies.clone().try_acquire_many_owned(missing as u32).map_err(|_| {
            let detail = "the bodies of other requests take all the memory that there is for them";
            Problem::new(Code::Overloaded, detail).retry_after(5)
        })?;
        match &mut self.0 {
            Some(permit) => permit.merge(more),
            none => *none = Some(more),
        }
        Ok(())
    }
}

/// What the values of a JSON text take once they are parsed, at most (bytes): nodes of maps, lists,
/// values.
fn parsed_bytes(json: &[u8]) -> usize {
    let (mut bytes, mut in_string, mut escaped) = (0, false, false);
    for &byte in json {
        match byte {
            _ if escaped => escaped = false,
            b'\\' if in_string => escaped = true,
            b'"' => in_string = !in_string,
            _ if in_string => {}
            b'{' => bytes += 640,
            b'[' => bytes += 128,
            b',' => bytes += 32,
            _ => {}
        }
    }
    bytes
}

fn json_problem(rejection: &JsonRejection) -> Problem {
    match rejection {
        JsonRejection::JsonSyntaxError(error) => Problem::new(Code::InvalidJson, reason(error)),
        JsonRejection::JsonDataError(error) => Problem::new(Code::InvalidRequest, reason(error)),
        JsonRejection::MissingJsonContentType(_) => {
            Problem::new(Code::UnsupportedMediaType, "send the header Content-Type: application/json")
        }
        other => Problem::new(Code::InvalidBody, reason(other)),
    }
}

/// The innermost message of an error, which is about the client's data.
fn reason(error: &(dyn Error + 'static)) -> String {
    let mut innermost = error;
    while let Some(source) = innermost.source() {
        innermost = source;
    }
    innermost.to_string()
}

/// The `{id}` of a job, a sweep or a webhook in the path.
pub struct JobId(pub Uuid);

impl FromRequestParts<Api> for JobId {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, api: &Api) -> Result<Self, Problem> {
        match axum::extract::Path::<Uuid>::from_request_parts(parts, api).await {
            Ok(axum::extract::Path(id)) => Ok(Self(id)),
            Err(PathRejection::FailedToDeserializePathParams(error)) => Err(Problem::new(
                Code::InvalidPath,
                format!("the ids of jobs, sweeps and webhooks are UUIDs: {}", error.body_text()),
            )),
            Err(other) => Err(Problem::new(Code::InvalidPath, other.to_string())),
        }
    }
}

/// The `{id}` of an asset or a kept scene in the path.
pub struct AssetId(pub String);

impl FromRequestParts<Api> for AssetId {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, api: &Api) -> Result<Self, Problem> {
        let form = |detail: String| Problem::new(Code::InvalidPath, detail);
        let path = axum::extract::Path::<String>::from_request_parts(parts, api).await;
        let axum::extract::Path(id) = path.map_err(|rejection| form(rejection.to_string()))?;
        if is_hash(&id) { Ok(Self(id)) } else { Err(form("an id is `sha256:` and 64 hexadecimal digits".into())) }
    }
}

/// Whether this is the id of an asset or a kept scene.
pub fn is_hash(id: &str) -> bool {
    let hex = id.strip_prefix("sha256:").unwrap_or_default();
    hex.len() == 64 && hex.bytes().all(|byte| byte.is_ascii_hexdigit())
}

/// The query string.
pub struct Query<T>(pub T);

impl<T: DeserializeOwned> FromRequestParts<Api> for Query<T> {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, api: &Api) -> Result<Self, Problem> {
        match axum::extract::Query::from_request_parts(parts, api).await {
            Ok(axum::extract::Query(value)) => Ok(Self(value)),
            Err(QueryRejection::FailedToDeserializeQueryString(error)) => {
                Err(Problem::new(Code::InvalidQuery, reason(&error)))
            }
            Err(other) => Err(Problem::new(Code::InvalidQuery, other.to_string())),
        }
    }
}
