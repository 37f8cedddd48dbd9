//! Changes of all jobs that a filter finds.

use axum::Json;
use axum::extract::State;
use serde::Serialize;
use utoipa::ToSchema;

use super::caller::Caller;
use super::dto;
use super::extract::JsonBody;
use super::filters::JobFilter;
use super::openapi::PROBLEM;
use super::problem::Problem;
use super::state::Api;

/// Jobs that are deleted in one transaction.
const BATCH: i64 = 200;

/// Number of jobs changed.
#[derive(Debug, Serialize, ToSchema)]
pub struct Changed {
    pub jobs: u64,
}

/// Cancels all jobs that a filter finds. Answers with the number of those that had not ended.
#[utoipa::path(post, path = "/v1/jobs:cancel", tag = "jobs", request_body = JobFilter, responses(
    (status = 200, body = Changed),
    (status = 422, body = dto::Problem, content_type = PROBLEM, description = "`invalid_request`"),
))]
pub async fn cancel_jobs(
    State(api): State<Api>,
    caller: Caller,
    JsonBody(filter, _): JsonBody<JobFilter>,
) -> Result<Json<Changed>, Problem> {
    Ok(Json(Changed { jobs: api.store.cancel_all(&filter.given(&caller)?).await? }))
}

/// Deletes all jobs that a filter finds and that have ended, and their files. Answers with their number.
#[utoipa::path(post, path = "/v1/jobs:delete", tag = "jobs", request_body = JobFilter, responses(
    (status = 200, body = Changed),
    (status = 422, body = dto::Problem, content_type = PROBLEM, description = "`invalid_request`"),
))]
pub async fn delete_jobs(
    State(api): State<Api>,
    caller: Caller,
    JsonBody(filter, _): JsonBody<JobFilter>,
) -> Result<Json<Changed>, Problem> {
    let filter = filter.given(&caller)?;
    let mut jobs = 0;
    loop {
        let deleted = api.store.delete_all(&filter, BATCH).await?;
        if deleted.is_empty() {
            return Ok(Json(Changed { jobs }));
        }
        jobs += deleted.len() as u64;
        for id in deleted {
            api.data.remove(id).await?;
        }
    }
}
