//! Parts of requests, with rejections as problems.

use std::error::Error;

use axum::body::{Body, Bytes};
use axum::extract::rejection::{BytesRejection, JsonRejection, PathRejection, QueryRejection};
use axum::extract::{FromRequest, FromRequestParts, Request};
use axum::http::request::Parts;
use serde::de::DeserializeOwned;
use tokio::time::timeout;
use uuid::Uuid;

use super::problem::{Code, Problem};
use super::state::Api;

/// A JSON body.
pub struct JsonBody<T>(pub T);

impl<T: DeserializeOwned> FromRequest<Api> for JsonBody<T> {
    type Rejection = Problem;

    async fn from_request(request: Request, api: &Api) -> Result<Self, Problem> {
        let (parts, body) = request.into_parts();
        let within = api.config.body_timeout;
        let request = Request::from_parts(parts.clone(), body);
        let body = timeout(within, Bytes::from_request(request, api))
            .await
            .map_err(|_| {
                let detail = format!("the body did not arrive within {} s", within.as_secs_f64());
                Problem::new(Code::RequestTimeout, detail)
            })?
            .map_err(|rejection| bytes_problem(&rejection, api.config.max_body_bytes))?;
        let request = Request::from_parts(parts, Body::from(body));
        match axum::Json::from_request(request, api).await {
            Ok(axum::Json(value)) => Ok(Self(value)),
            Err(rejection) => Err(json_problem(&rejection, api.config.max_body_bytes)),
        }
    }
}

fn bytes_problem(rejection: &BytesRejection, max_body_bytes: usize) -> Problem {
    if rejection.status() == Code::BodyTooLarge.status() {
        return Problem::new(Code::BodyTooLarge, format!("a body may have at most {max_body_bytes} bytes"));
    }
    Problem::new(Code::InvalidBody, reason(rejection))
}

fn json_problem(rejection: &JsonRejection, max_body_bytes: usize) -> Problem {
    match rejection {
        JsonRejection::JsonSyntaxError(error) => Problem::new(Code::InvalidJson, reason(error)),
        JsonRejection::JsonDataError(error) => Problem::new(Code::InvalidRequest, reason(error)),
        JsonRejection::MissingJsonContentType(_) => {
            Problem::new(Code::UnsupportedMediaType, "send the header Content-Type: application/json")
        }
        JsonRejection::BytesRejection(rejection) => bytes_problem(rejection, max_body_bytes),
        other => Problem::new(Code::InvalidBody, reason(other)),
    }
}

/// The innermost message of an error: the one that is about the client's data.
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
