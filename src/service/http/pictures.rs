//! Pictures of frames of jobs.

use axum::extract::State;
use axum::http::{HeaderMap, Method, header};
use axum::response::{IntoResponse, Response};
use serde::Deserialize;
use utoipa::IntoParams;

use super::conditional::Version;
use super::dto;
use super::extract::Query;
use super::filters::commas;
use super::frames::{JobFrame, Source};
use super::openapi::PROBLEM;
use super::problem::{Code, Problem, internal};
use super::state::Api;
use gridfall_recording::export::ExportError;
use gridfall_recording::render::{Look, RenderError, Renderer, Size};

/// Changes with what is drawn of the same frame.
const EDITION: u32 = 1;
/// Most pixels: 1280 × 720.
const MOST_PIXELS: usize = 1280 * 720;

/// What a picture shall be like.
#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub struct PictureQuery {
    /// Width and height (pixels), 64 at least, and no more pixels than 1280x720; `960x540` by default.
    #[param(pattern = r"^[0-9]+x[0-9]+$", example = "960x540")]
    pub size: Option<String>,
    /// Where the camera stands, in parts with commas between them: `azimuth` and `elevation` (degrees), `distance` (m)
    /// or `zoom`, `look_at` (x,y,z in m). What is left out is chosen so that all is seen.
    #[param(example = "azimuth=30,elevation=20")]
    pub camera: Option<String>,
    /// Colour by a field of the points (`GET /v1/jobs/{id}/frames` lists them), or by `body`, with a legend. The
    /// recorded colours come without it.
    pub color_by: Option<String>,
    /// Values of the field with the first and the last colour, with a comma between them; those of nearly all points of
    /// this frame by default.
    #[param(example = "0,2.5")]
    pub range: Option<String>,
    /// Only points of bodies and sources of these names.
    #[param(style = Form, explode = false)]
    #[serde(default, deserialize_with = "commas")]
    pub body: Vec<String>,
}

impl PictureQuery {
    fn look(self) -> Result<Look, Problem> {
        let size: Option<Size> = parsed("size", self.size)?;
        let look = Look {
            size: size.unwrap_or_default(),
            aim: parsed("camera", self.camera)?.unwrap_or_default(),
            color_by: self.color_by,
            bounds: parsed("range", self.range)?,
            bodies: self.body,
        };
        if look.size.pixels().iter().product::<usize>() > MOST_PIXELS {
            let detail = "size: pictures over HTTP have at most 1280x720 pixels; gridfall render draws larger ones";
            return Err(Problem::new(Code::InvalidQuery, detail));
        }
        if look.bounds.is_some() && look.color_by.is_none() {
            return Err(Problem::new(Code::InvalidQuery, "range: it is the range of a field; name it in color_by"));
        }
        Ok(look)
    }
}

/// A parameter that has a form of its own.
fn parsed<T: std::str::FromStr<Err = String>>(name: &str, text: Option<String>) -> Result<Option<T>, Problem> {
    let parsed = text.map(|text| text.parse()).transpose();
    parsed.map_err(|reason| Problem::new(Code::InvalidQuery, format!("{name}: {reason}")))
}

/// A picture of a frame (PNG), as soon as it is complete: from any place, in the colours of any field.
///
/// One is drawn at a time.
#[utoipa::path(get, path = "/v1/jobs/{id}/frames/{frame}/picture.png", tag = "outputs",
    operation_id = "get_frame_picture",
    params(
        ("id" = Uuid, Path),
        ("frame" = u64, Path, description = "Number of the frame, from 0"),
        PictureQuery,
        ("If-None-Match" = Option<String>, Header, description = "`ETag` of an earlier answer"),
    ),
    responses(
        (status = 200, content_type = "image/png", body = dto::Bytes, headers(("ETag" = String))),
        (status = 304, description = "The client has it"),
        (status = 400, body = dto::Problem, content_type = PROBLEM,
            description = "`invalid_path`; `invalid_query`: also for a field or a body that is not there"),
        (status = 404, body = dto::Problem, content_type = PROBLEM,
            description = "`job_not_found`, `output_not_found`"),
        (status = 422, body = dto::Problem, content_type = PROBLEM,
            description = "`invalid_scene`: this version no longer takes the job's scene"),
        (status = 503, body = dto::Problem, content_type = PROBLEM, description = "`overloaded`"),
    ))]
pub async fn picture(
    State(api): State<Api>,
    JobFrame(id, frame): JobFrame,
    Query(query): Query<PictureQuery>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let (source, status) = Source::of(&api, id).await?;
    let look = query.look()?;
    let index = source.with_frame(&api, frame, status).await?;
    let version = Version::of_frame(EDITION, source.attempt, frame, &look);
    if let Some(answer) = version.judge(&Method::GET, &headers)? {
        return Ok(answer);
    }
    let turn = api.sceneries.turn(&api).await?;
    let scenery = api.sceneries.of(&api, id).await?;
    let (target, judges) = (source.files.recording(), api.judges.clone());
    let draw = move || -> Result<Vec<u8>, RenderError> {
        let _turn = turn;
        let renderer = Renderer::new(&scenery, &look)?;
        let missing = ExportError::NoFrame { frame, frames: index.len() };
        let cloud = index.points(&target, frame)?.ok_or(missing)?;
        judges.install(|| Ok(renderer.draw(&cloud, None)?.png()))
    };
    let png = tokio::task::spawn_blocking(draw).await.map_err(internal)?.map_err(refused)?;
    let mut answer = ([(header::CONTENT_TYPE, "image/png")], png).into_response();
    version.write(answer.headers_mut());
    Ok(answer)
}

fn refused(error: RenderError) -> Problem {
    let query = |name: &str| Problem::new(Code::InvalidQuery, format!("{name}: {error}"));
    match &error {
        // It says of which part it is.
        RenderError::Camera(_) => Problem::new(Code::InvalidQuery, error.to_string()),
        RenderError::NoField { .. } => query("color_by"),
        RenderError::Export(ExportError::NoBody { .. }) => query("body"),
        // The frame was there.
        _ => internal(error),
    }
}
