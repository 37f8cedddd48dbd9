//! Every error of the API as RFC 9457 `application/problem+json`.

use axum::Json;
use axum::http::{HeaderName, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde::Serialize;
use utoipa::ToSchema;

use super::dto;
use crate::store::{JobStore, ObjectsError, StoreError};
use gridfall_scene::Fault;

/// Declares the codes once: name, status and title.
macro_rules! codes {
    ($($(#[doc = $doc:literal])* $name:ident $status:ident $title:literal,)+) => {
        /// What went wrong, for programs. Codes are stable; new ones may come.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, ToSchema)]
        #[serde(rename_all = "snake_case")]
        pub enum Code {
            $($(#[doc = $doc])* $name,)+
        }

        impl Code {
            pub const ALL: &[Self] = &[$(Self::$name),+];

            pub fn status(self) -> StatusCode {
                match self { $(Self::$name => StatusCode::$status,)+ }
            }

            pub fn title(self) -> &'static str {
                match self { $(Self::$name => $title,)+ }
            }
        }
    };
}

codes! {
    InvalidJson BAD_REQUEST "The body is not JSON",
    InvalidBody BAD_REQUEST "The body could not be read",
    InvalidPath BAD_REQUEST "The path has a part of the wrong form",
    InvalidQuery BAD_REQUEST "A query parameter is unknown or out of range",
    InvalidHeader BAD_REQUEST "A header is out of form",
    KeyRequired UNAUTHORIZED "The server asks for a key",
    KeyRefused UNAUTHORIZED "The key is not good",
    InsufficientScope FORBIDDEN "The key does not allow this",
    QuotaExceeded FORBIDDEN "A quota of the key is used up",
    ForeignOrigin FORBIDDEN "A page of another origin may not change anything here",
    UnknownHost FORBIDDEN "The server does not know itself by this name",
    RouteNotFound NOT_FOUND "There is nothing at this path",
    JobNotFound NOT_FOUND "There is no such job",
    AssetNotFound NOT_FOUND "There is no such asset",
    SceneNotFound NOT_FOUND "There is no such scene",
    MaterialNotFound NOT_FOUND "There is no such preset of materials",
    SweepNotFound NOT_FOUND "There is no such sweep",
    WebhookNotFound NOT_FOUND "There is no such webhook",
    DeliveryNotFound NOT_FOUND "The webhook has no such delivery",
    OutputNotFound NOT_FOUND "The job has no such output yet",
    MethodNotAllowed METHOD_NOT_ALLOWED "The path has no such method",
    RequestTimeout REQUEST_TIMEOUT "The request did not arrive in time",
    JobNotFinished CONFLICT "The job has not ended",
    JobEnded CONFLICT "The job has ended",
    WebhookDisabled CONFLICT "The webhook is told nothing more",
    NoObjectStorage CONFLICT "The server keeps its files itself",
    PreconditionFailed PRECONDITION_FAILED "It is another version",
    BodyTooLarge PAYLOAD_TOO_LARGE "The body is too large",
    UnsupportedMediaType UNSUPPORTED_MEDIA_TYPE "The body is not declared as JSON",
    UnsupportedEncoding UNSUPPORTED_MEDIA_TYPE "The body has an encoding that the server does not decode",
    RangeNotSatisfiable RANGE_NOT_SATISFIABLE "The range lies outside the file",
    WebsocketExpected UPGRADE_REQUIRED "The path is for WebSockets",
    InvalidRequest UNPROCESSABLE_ENTITY "The body has not the form of a request",
    InvalidAsset UNPROCESSABLE_ENTITY "The upload is nothing that scenes can use",
    InvalidScene UNPROCESSABLE_ENTITY "The scene has faults",
    InvalidMaterial UNPROCESSABLE_ENTITY "The material or its test has faults",
    InvalidRecording UNPROCESSABLE_ENTITY "The upload is no recording with a scene",
    WebhookRefused UNPROCESSABLE_ENTITY "The webhook may not be called there",
    IdempotencyKeyReused UNPROCESSABLE_ENTITY "The idempotency key belongs to another request",
    CostExceeded UNPROCESSABLE_ENTITY "The run would cost more than allowed",
    QueueFull TOO_MANY_REQUESTS "The queue is full",
    Internal INTERNAL_SERVER_ERROR "The server failed",
    Overloaded SERVICE_UNAVAILABLE "The server is too busy",
    NotReady SERVICE_UNAVAILABLE "The server is not ready",
    DatabaseAway SERVICE_UNAVAILABLE "The job database cannot be reached",
    StorageAway SERVICE_UNAVAILABLE "The object storage cannot be reached",
    DiskLow INSUFFICIENT_STORAGE "The disk is nearly full",
}

/// An error that will be sent to the client.
#[derive(Debug)]
pub struct Problem {
    code: Code,
    detail: String,
    faults: Vec<Fault>,
    checks: Vec<dto::Check>,
    header: Option<(HeaderName, HeaderValue)>,
}

impl Problem {
    pub fn new(code: Code, detail: impl Into<String>) -> Self {
        Self { code, detail: detail.into(), faults: Vec::new(), checks: Vec::new(), header: None }
    }

    /// All faults of a scene that a request had in its member `scene`.
    pub fn invalid_scene(faults: Vec<Fault>) -> Self {
        let n = faults.len();
        let faults =
            faults.into_iter().map(|fault| Fault { pointer: format!("/scene{}", fault.pointer), ..fault }).collect();
        let detail = format!("the scene has {n} {}", if n == 1 { "fault" } else { "faults" });
        Self { faults, ..Self::new(Code::InvalidScene, detail) }
    }

    /// All faults of a material and of its test.
    pub fn invalid_material(faults: Vec<Fault>) -> Self {
        let detail = match faults.as_slice() {
            [fault] => format!("{}: {}; {}", fault.pointer, fault.reason, fault.remedy),
            _ => format!("the material has {} faults", faults.len()),
        };
        Self { faults, ..Self::new(Code::InvalidMaterial, detail) }
    }

    pub fn not_ready(checks: Vec<dto::Check>) -> Self {
        let reasons: Vec<String> =
            checks.iter().filter(|check| !check.ok).map(|check| format!("{}: {}", check.name, check.detail)).collect();
        Self { checks, ..Self::new(Code::NotReady, reasons.join("; ")) }
    }

    pub fn job_not_found(id: uuid::Uuid) -> Self {
        Self::new(Code::JobNotFound, format!("there is no job {id}; it may have been deleted"))
    }

    pub fn sweep_not_found(id: uuid::Uuid) -> Self {
        Self::new(Code::SweepNotFound, format!("there is no sweep {id}"))
    }

    pub fn asset_not_found(id: &str) -> Self {
        Self::new(Code::AssetNotFound, format!("there is no asset {id}; GET /v1/assets lists all"))
    }

    pub fn scene_not_found(id: &str) -> Self {
        Self::new(Code::SceneNotFound, format!("there is no scene {id}; GET /v1/scenes lists all"))
    }

    /// Says which part of a request with many parts has the problem.
    pub fn of(mut self, part: &str) -> Self {
        self.detail = format!("{part}: {}", self.detail);
        self
    }

    pub fn retry_after(self, seconds: u32) -> Self {
        self.with_header(header::RETRY_AFTER, seconds.into())
    }

    pub fn with_header(self, name: HeaderName, value: HeaderValue) -> Self {
        Self { header: Some((name, value)), ..self }
    }
}

impl IntoResponse for Problem {
    fn into_response(self) -> Response {
        let status = self.code.status();
        let body = dto::Problem {
            kind: format!("/docs/errors#{}", self.code.as_str()),
            title: self.code.title(),
            status: status.as_u16(),
            code: self.code,
            detail: self.detail,
            faults: self.faults.into_iter().map(Into::into).collect(),
            checks: self.checks,
        };
        let mut response = (status, Json(body)).into_response();
        response.headers_mut().insert(header::CONTENT_TYPE, HeaderValue::from_static("application/problem+json"));
        response.headers_mut().extend(self.header);
        response
    }
}

impl Code {
    /// The code as it appears in JSON.
    pub fn as_str(self) -> String {
        match serde_json::to_value(self) {
            Ok(serde_json::Value::String(name)) => name,
            _ => unreachable!("a unit variant serialises as its name"),
        }
    }
}

/// Failures that are not the client's: logged in full, reported briefly.
impl From<StoreError> for Problem {
    fn from(error: StoreError) -> Self {
        if JobStore::is_away(&error) {
            tracing::error!(%error, "the job database cannot be reached");
            let detail = "the job database cannot be reached; nothing is lost: ask again";
            return Self::new(Code::DatabaseAway, detail).retry_after(5);
        }
        match error {
            StoreError::Objects(error) => error.into(),
            error => internal(error),
        }
    }
}

impl From<ObjectsError> for Problem {
    fn from(error: ObjectsError) -> Self {
        match error {
            ObjectsError::Failed(_) => {
                tracing::error!(%error, "the object storage cannot be used");
                let detail = "the object storage, where the outputs of jobs are, does not answer, or refuses; \
                              nothing is lost: ask again, and look at the server's log";
                Self::new(Code::StorageAway, detail).retry_after(5)
            }
            error => internal(error),
        }
    }
}

impl From<std::io::Error> for Problem {
    fn from(error: std::io::Error) -> Self {
        internal(error)
    }
}

pub fn internal(error: impl std::fmt::Display) -> Problem {
    tracing::error!(%error, "a request failed");
    Problem::new(Code::Internal, "the server's log has the details")
}
