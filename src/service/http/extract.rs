//! Extractors of parts of requests, with rejections as problems.

use std::error::Error;
use std::future::poll_fn;
use std::pin::Pin;

use axum::body::{Body, HttpBody};
use axum::extract::rejection::{JsonRejection, PathRejection, QueryRejection};
use axum::extract::{FromRequest, FromRequestParts, Request};
use axum::http::request::Parts;
use serde::de::DeserializeOwned;
use tokio::time::timeout;
use uuid::Uuid;

use super::problem::{Code, Problem};
use super::state::Api;

/// Bytes beyond the limit that are read and discarded before a body is refused. A client that is
/// still sending when the connection closes may never see the reason.
const DISCARDED_BYTES: usize = 64 << 20;

/// A JSON body.
pub struct JsonBody<T>(pub T);

impl<T: DeserializeOwned> FromRequest<Api> for JsonBody<T> {
    type Rejection = Problem;

    async fn from_request(request: Request, api: &Api) -> Result<Self, Problem> {
        let (parts, body) = request.into_parts();
        let bytes = read_in_time(body, api.config.max_body_bytes, api).await?;
        match axum::Json::from_request(Request::from_parts(parts, bytes.into()), api).await {
            Ok(axum::Json(value)) => Ok(Self(value)),
            Err(rejection) => Err(json_problem(&rejection)),
        }
    }
}

/// The bytes of an upload.
pub struct AssetBody(pub Vec<u8>);

impl FromRequest<Api> for AssetBody {
    type Rejection = Problem;

    async fn from_request(request: Request, api: &Api) -> Result<Self, Problem> {
        read_in_time(request.into_body(), api.config.max_asset_bytes, api).await.map(Self)
    }
}

async fn read_in_time(body: Body, max: usize, api: &Api) -> Result<Vec<u8>, Problem> {
    let within = api.config.body_timeout;
    timeout(within, read(body, max)).await.unwrap_or_else(|_| {
        let detail = format!("the body did not arrive within {} s", within.as_secs_f64());
        Err(Problem::new(Code::RequestTimeout, detail))
    })
}

/// Reads a body of at most `max` bytes.
async fn read(mut body: Body, max: usize) -> Result<Vec<u8>, Problem> {
    let (mut bytes, mut received) = (Vec::new(), 0usize);
    while let Some(frame) = poll_fn(|context| Pin::new(&mut body).poll_frame(context)).await {
        let frame = frame.map_err(|error| Problem::new(Code::InvalidBody, reason(&error)))?;
        let Ok(data) = frame.into_data() else { continue };
        received = received.saturating_add(data.len());
        if received <= max {
            bytes.extend_from_slice(&data);
        } else if received - max > DISCARDED_BYTES {
            break;
        }
    }
    if received > max {
        return Err(Problem::new(Code::BodyTooLarge, format!("a body may have at most {max} bytes")));
    }
    Ok(bytes)
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

/// The `{id}` of a job in the path.
pub struct JobId(pub Uuid);

impl FromRequestParts<Api> for JobId {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, api: &Api) -> Result<Self, Problem> {
        match axum::extract::Path::<Uuid>::from_request_parts(parts, api).await {
            Ok(axum::extract::Path(id)) => Ok(Self(id)),
            Err(PathRejection::FailedToDeserializePathParams(error)) => {
                Err(Problem::new(Code::InvalidPath, format!("a job id is a UUID: {}", error.body_text())))
            }
            Err(other) => Err(Problem::new(Code::InvalidPath, other.to_string())),
        }
    }
}

/// The `{id}` of an asset in the path.
pub struct AssetId(pub String);

impl FromRequestParts<Api> for AssetId {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, api: &Api) -> Result<Self, Problem> {
        let form = |detail: String| Problem::new(Code::InvalidPath, detail);
        let path = axum::extract::Path::<String>::from_request_parts(parts, api).await;
        let axum::extract::Path(id) = path.map_err(|rejection| form(rejection.to_string()))?;
        let hex = id.strip_prefix("sha256:").unwrap_or_default();
        if hex.len() == 64 && hex.bytes().all(|byte| byte.is_ascii_hexdigit()) {
            Ok(Self(id))
        } else {
            Err(form("an asset id is `sha256:` and 64 hexadecimal digits".into()))
        }
    }
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
