//! Links by which outputs are downloaded from the object storage itself.

use std::time::Duration;

use axum::Json;
use axum::extract::State;
use axum::http::header;
use axum::response::{IntoResponse, Response};
use jiff::{SignedDuration, Timestamp};
use serde::{Deserialize, Serialize};
use utoipa::{IntoParams, ToSchema};

use super::dto;
use super::extract::{JobId, Query};
use super::openapi::PROBLEM;
use super::outputs::{find, missing};
use super::problem::{Code, Problem};
use super::state::Api;

/// What a link may be good for at most (s): as long as S3 allows.
const MOST_S: u32 = 7 * 86_400;

#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub struct LinksQuery {
    /// How long the links are good for (s).
    #[serde(default = "hour")]
    #[param(minimum = 1, maximum = 604_800, default = 3600)]
    expires_s: u32,
}

fn hour() -> u32 {
    3600
}

/// An output of a job, and where it is.
#[derive(Debug, Serialize, ToSchema)]
pub struct OutputLink {
    #[schema(example = "recording.mcap")]
    name: String,
    bytes: u64,
    /// Anyone who has this can download the output until then, without a key.
    url: String,
}

/// Links to the outputs of a job.
#[derive(Debug, Serialize, ToSchema)]
pub struct OutputLinks {
    links: Vec<OutputLink>,
    #[schema(value_type = String, format = DateTime)]
    expires_at: Timestamp,
}

/// Links to the outputs of a job that has ended, which are good for a while and need no key: downloads then come from
/// the object storage and not through this server. For servers that have one (`--files`).
#[utoipa::path(get, path = "/v1/jobs/{id}/links", tag = "outputs", operation_id = "get_links",
    params(("id" = Uuid, Path), LinksQuery),
    responses(
        (status = 200, body = OutputLinks),
        (status = 404, body = dto::Problem, content_type = PROBLEM,
            description = "`job_not_found`, `output_not_found`"),
        (status = 409, body = dto::Problem, content_type = PROBLEM,
            description = "`no_object_storage`, `job_not_finished`"),
        (status = 503, body = dto::Problem, content_type = PROBLEM, description = "`storage_away`"),
    ))]
pub async fn links(
    State(api): State<Api>,
    JobId(id): JobId,
    Query(query): Query<LinksQuery>,
) -> Result<Response, Problem> {
    if !(1..=MOST_S).contains(&query.expires_s) {
        let detail = format!("expires_s is {}; ask for 1 to {MOST_S} s", query.expires_s);
        return Err(Problem::new(Code::InvalidQuery, detail));
    }
    let (_, job) = find(&api, id, &[]).await?;
    let Some(objects) = api.data.objects() else {
        let detail = format!(
            "this server keeps its files itself and has no links to others; GET /v1/jobs/{id}/recording.mcap, or start \
             it with --files s3://BUCKET"
        );
        return Err(Problem::new(Code::NoObjectStorage, detail));
    };
    if !job.status.is_terminal() {
        let detail = "the job runs; its outputs get links at its end";
        return Err(Problem::new(Code::JobNotFinished, detail));
    }
    let time = Duration::from_secs(query.expires_s.into());
    let expires_at = Timestamp::now().saturating_add(SignedDuration::try_from(time).unwrap_or(SignedDuration::MAX));
    let mut links = Vec::new();
    for output in objects.outputs(id, job.attempt).await? {
        let url = output.signed(time).await?;
        links.push(OutputLink { name: output.name, bytes: output.bytes, url });
    }
    if links.is_empty() {
        return Err(missing("output", job.status));
    }
    let links = OutputLinks { links, expires_at: expires_at.unwrap_or(Timestamp::MAX) };
    Ok(([(header::CACHE_CONTROL, "no-store")], Json(links)).into_response())
}
