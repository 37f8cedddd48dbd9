//! Surfaces of frames of jobs.

use axum::extract::State;
use axum::http::{HeaderMap, Method};
use axum::response::Response;
use serde::Deserialize;
use utoipa::{IntoParams, ToSchema};

use super::conditional::Version;
use super::dto;
use super::extract::Query;
use super::file::{made, unnamed};
use super::filters::commas;
use super::frames::{JobFrame, Source};
use super::openapi::PROBLEM;
use super::problem::{Code, Problem, internal};
use super::state::Api;
use gridfall_recording::export::ExportError;
use gridfall_recording::reconstruction::{Format, SurfaceError, Surfaces};

/// Changes with what is written of the same frame.
const EDITION: u32 = 1;
/// Most points that a surface is made of: of a million it takes about a gigabyte.
const MOST_POINTS: usize = 1_000_000;

/// What to make a surface of.
#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub struct SurfaceQuery {
    /// Form of the file.
    #[param(inline)]
    pub format: SurfaceFormat,
    /// Only surfaces of bodies and sources of these names.
    #[param(style = Form, explode = false)]
    #[serde(default, deserialize_with = "commas")]
    pub body: Vec<String>,
    /// Most points to make the surfaces of, the same share of all parts; a million by default and at most.
    #[param(minimum = 1, maximum = 1_000_000)]
    pub max_points: Option<u32>,
}

/// Form of a mesh.
#[derive(Clone, Copy, Debug, Deserialize, ToSchema)]
#[serde(rename_all = "lowercase")]
pub enum SurfaceFormat {
    Obj,
    Ply,
    Glb,
}

impl From<SurfaceFormat> for Format {
    fn from(format: SurfaceFormat) -> Self {
        match format {
            SurfaceFormat::Obj => Self::Obj,
            SurfaceFormat::Ply => Self::Ply,
            SurfaceFormat::Glb => Self::Glb,
        }
    }
}

/// The surfaces of the bodies in a frame of a 3D scene as triangle meshes, as soon as it is complete: OBJ, PLY or glTF.
///
/// Each body has a closed surface of its own, with normals, and velocities where they are recorded (PLY, glTF). One
/// frame is worked on at a time.
#[utoipa::path(get, path = "/v1/jobs/{id}/frames/{frame}/surface", tag = "outputs", operation_id = "get_frame_surface",
    params(
        ("id" = Uuid, Path),
        ("frame" = u64, Path, description = "Number of the frame, from 0"),
        SurfaceQuery,
        ("If-None-Match" = Option<String>, Header, description = "`ETag` of an earlier answer"),
    ),
    responses(
        (status = 200, headers(("ETag" = String), ("Content-Disposition" = String)),
            content((dto::Bytes = "application/octet-stream"), (dto::Bytes = "model/gltf-binary"),
                (String = "model/obj"))),
        (status = 304, description = "The client has it"),
        (status = 400, body = dto::Problem, content_type = PROBLEM,
            description = "`invalid_path`; `invalid_query`: also for a body that is not there"),
        (status = 404, body = dto::Problem, content_type = PROBLEM,
            description = "`job_not_found`; `output_not_found`: 2D scenes have no surface"),
        (status = 422, body = dto::Problem, content_type = PROBLEM,
            description = "`invalid_scene`: this version no longer takes the job's scene"),
        (status = 503, body = dto::Problem, content_type = PROBLEM, description = "`overloaded`"),
    ))]
pub async fn surface(
    State(api): State<Api>,
    JobFrame(id, frame): JobFrame,
    Query(query): Query<SurfaceQuery>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let SurfaceQuery { format, body, max_points } = query;
    let most = max_points.map_or(MOST_POINTS, |most| most as usize);
    if !(1..=MOST_POINTS).contains(&most) {
        let detail = format!("max_points is {most}; ask for 1 to {MOST_POINTS}, or leave it out");
        return Err(Problem::new(Code::InvalidQuery, detail));
    }
    let format = Format::from(format);
    let (source, status) = Source::of(&api, id).await?;
    let index = source.with_frame(&api, frame, status).await?;
    let version = Version::of_frame(EDITION, source.attempt, frame, &(format, &body, most));
    if let Some(answer) = version.judge(&Method::GET, &headers)? {
        return Ok(answer);
    }
    let turn = api.sceneries.turn(&api).await?;
    let scenery = api.sceneries.of(&api, id).await?;
    let (target, judges) = (source.files.recording(), api.judges.clone());
    let write = move || {
        let _turn = turn;
        let surfaces = Surfaces::new(&scenery, &body, most)?;
        unnamed(&target, |file, folder| {
            judges.install(|| surfaces.write((&index, &target), frame, format, file, folder)).map(drop)
        })
    };
    let written = tokio::task::spawn_blocking(write).await.map_err(internal)?.map_err(refused)?;
    let kind = match format {
        Format::Obj => "model/obj",
        Format::Ply => "application/octet-stream",
        Format::Glb => "model/gltf-binary",
    };
    made(written, kind, &format!("gridfall-{id}.{frame:04}.{}", format.name()), &version)
}

fn refused(error: SurfaceError) -> Problem {
    match &error {
        SurfaceError::Plane => Problem::new(Code::OutputNotFound, error.to_string()),
        SurfaceError::Export(ExportError::NoBody { .. }) => Problem::new(Code::InvalidQuery, format!("body: {error}")),
        // The frame was there.
        _ => internal(error),
    }
}
