//! Who has changed something, and who was not let: a line each in the log, of the target `audit`. Only where keys are
//! asked for; elsewhere nobody could say who it was.

use axum::extract::{Request, State};
use axum::http::{StatusCode, header};
use axum::middleware::Next;
use axum::response::Response;

use super::auth::changes;
use super::caller::Caller;
use super::state::Api;

/// Marks an answer that says of something that it is not there, because it is another key's.
#[derive(Clone, Copy, Debug)]
pub struct Hidden;

pub async fn audit(State(api): State<Api>, request: Request, next: Next) -> Response {
    let (method, path) = (request.method().clone(), request.uri().path().to_owned());
    let answer = next.run(request).await;
    if !api.has_asked() {
        return answer;
    }
    let key = answer.extensions().get::<Caller>().and_then(Caller::key);
    if let Some(key) = key {
        api.metrics.asked(&key.name);
    }
    let status = answer.status();
    let refused = matches!(status, StatusCode::UNAUTHORIZED | StatusCode::FORBIDDEN | StatusCode::TOO_MANY_REQUESTS)
        || answer.extensions().get::<Hidden>().is_some();
    if changes(&method) || refused {
        let (who, id) = key.map_or(("nobody", ""), |key| (key.name.as_str(), key.id.as_str()));
        // What was made, or else what it was about.
        let location = answer.headers().get(header::LOCATION).and_then(|made| made.to_str().ok());
        let job = location.unwrap_or(&path).strip_prefix("/v1/jobs/");
        let job = job.and_then(|rest| rest.split('/').next()).unwrap_or_default();
        tracing::info!(target: "audit", who, key = id, %method, path, job, status = status.as_u16(), "request");
    }
    answer
}
