//! The colliders of a job's frames, as viewers draw them.

use axum::Json;
use axum::extract::State;
use axum::http::{HeaderMap, Method};
use axum::response::{IntoResponse, Response};
use serde::{Deserialize, Serialize};
use utoipa::{IntoParams, ToSchema};

use super::conditional::Version;
use super::dto;
use super::extract::Query;
use super::frames::{JobFrame, Source};
use super::openapi::PROBLEM;
use super::outputs::missing;
use super::problem::Problem;
use super::state::Api;
use gridfall_recording as recording;

/// Changes with what is sent of the same frame.
const EDITION: u32 = 1;

/// What to send of colliders.
#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub struct CollidersQuery {
    /// Send the shapes too. They are the same in all frames of one `edition`.
    #[serde(default)]
    pub meshes: bool,
}

/// The colliders of a frame.
#[derive(Debug, Serialize, ToSchema)]
pub struct FrameColliders {
    pub frame: u64,
    /// Simulated time (s).
    pub time_s: f64,
    /// Number of the set of shapes. It changes when a collider appears or goes.
    pub edition: u32,
    /// Whether any of them ever moves.
    pub moves: bool,
    pub domain: DomainBox,
    /// All colliders that there are in the frame.
    pub colliders: Vec<FrameCollider>,
}

/// The domain as it is simulated, of whole cells.
#[derive(Debug, Serialize, ToSchema)]
pub struct DomainBox {
    /// Lower corner (m).
    pub min: [f64; 3],
    /// Upper corner (m). 2D domains are a cell thick, about z = 0.
    pub max: [f64; 3],
}

/// A collider in a frame.
#[derive(Debug, Serialize, ToSchema)]
pub struct FrameCollider {
    pub name: String,
    /// It is hollow or holds something: what is inside should be seen.
    pub translucent: bool,
    /// Where the origin of its own frame is (m).
    pub position: [f64; 3],
    /// The turn of its own frame: x, y, z, w of a unit quaternion.
    pub orientation: [f64; 4],
    /// Its shape in its own frame, within the domain; with `meshes=true`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mesh: Option<ColliderMesh>,
}

/// A closed surface of triangles.
#[derive(Debug, Serialize, ToSchema)]
pub struct ColliderMesh {
    /// x, y, z of one corner after the other (m).
    pub vertices: Vec<f64>,
    /// Numbers of three corners, counter-clockwise seen from outside, of one triangle after the other.
    pub triangles: Vec<u32>,
}

/// The colliders of a frame and where they are, as soon as it is complete.
///
/// A viewer asks for the shapes once, and again when `edition` changes. Where nothing `moves`, frames of one edition
/// have the same colliders in the same places.
#[utoipa::path(get, path = "/v1/jobs/{id}/frames/{frame}/colliders", tag = "outputs",
    operation_id = "get_frame_colliders",
    params(
        ("id" = Uuid, Path),
        ("frame" = u64, Path, description = "Number of the frame, from 0"),
        CollidersQuery,
        ("If-None-Match" = Option<String>, Header, description = "`ETag` of an earlier answer"),
    ),
    responses(
        (status = 200, body = FrameColliders, headers(("ETag" = String))),
        (status = 304, description = "The client has it"),
        (status = 400, body = dto::Problem, content_type = PROBLEM, description = "`invalid_path`, `invalid_query`"),
        (status = 404, body = dto::Problem, content_type = PROBLEM,
            description = "`job_not_found`, `output_not_found`: also for recordings of old releases without shapes"),
    ))]
pub async fn colliders(
    State(api): State<Api>,
    JobFrame(id, frame): JobFrame,
    Query(CollidersQuery { meshes }): Query<CollidersQuery>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let (source, status) = Source::of(&api, id).await?;
    source.with_frame(&api, frame, status).await?;
    let version = Version::of_frame(EDITION, source.attempt, frame, &("colliders", meshes));
    if let Some(answer) = version.judge(&Method::GET, &headers)? {
        return Ok(answer);
    }
    let found = source.read(&api, move |index, target| index.solids(target, frame)).await?;
    let found = found.ok_or_else(|| missing(&format!("list of colliders of frame {frame}"), status))?;
    let mut answer = Json(answer_of(frame, found, meshes)).into_response();
    version.write(answer.headers_mut());
    Ok(answer)
}

fn answer_of(frame: u64, found: recording::FrameSolids, meshes: bool) -> FrameColliders {
    let recording::FrameSolids { time_s, edition, domain: [min, max], solids } = found;
    let moves = solids.iter().any(|solid| solid.moves);
    let collider = |solid: recording::Solid| {
        let recording::Solid { name, translucent, position, orientation, vertices, triangles, .. } = solid;
        let mesh = meshes.then(|| ColliderMesh {
            vertices: vertices.into_iter().flatten().collect(),
            triangles: triangles.into_iter().flatten().collect(),
        });
        FrameCollider { name, translucent, position, orientation, mesh }
    };
    let colliders = solids.into_iter().map(collider).collect();
    FrameColliders { frame, time_s, edition, moves, domain: DomainBox { min, max }, colliders }
}
