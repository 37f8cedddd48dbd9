//! The points of a job's frames, as viewers draw them.

use std::sync::{Arc, Mutex, MutexGuard};

use axum::Json;
use axum::extract::rejection::PathRejection;
use axum::extract::{FromRequestParts, State};
use axum::http::request::Parts;
use axum::http::{HeaderMap, Method, header};
use axum::response::{IntoResponse, Response};
use serde::{Deserialize, Serialize};
use tokio::sync::Semaphore;
use utoipa::{IntoParams, ToSchema};
use uuid::Uuid;

use super::conditional::Version;
use super::dto;
use super::extract::{JobId, Query};
use super::openapi::PROBLEM;
use super::outputs::{RECORDING, find, missing};
use super::problem::{Code, Problem, internal};
use super::state::Api;
use crate::store::{AttemptFiles, Status};
use gridfall_recording::{self as recording, FrameIndex, FramePoints, RecordingError};

/// Recordings whose frames are known, those that were read last.
const KNOWN: usize = 64;
/// Frames that are read at a time; each is in memory as a whole.
const READERS: usize = 4;
/// What an answer begins with, and the length of its head (bytes).
const MAGIC: &[u8; 4] = b"GFPT";
const FORMAT: u32 = 1;
const HEAD_BYTES: usize = 64;

type Index = Arc<Mutex<FrameIndex>>;

/// Where the frames of recordings are, by job and attempt.
#[derive(Debug)]
pub struct Indexes {
    known: Mutex<Vec<((Uuid, i64), Index)>>,
    pub(super) readers: Semaphore,
}

impl Default for Indexes {
    fn default() -> Self {
        Self { known: Mutex::default(), readers: Semaphore::new(READERS) }
    }
}

impl Indexes {
    fn of(&self, job: Uuid, attempt: i64) -> Index {
        let mut known = lock(&self.known);
        let at = known.iter().position(|(key, _)| *key == (job, attempt));
        let entry = at.map_or_else(|| ((job, attempt), Index::default()), |at| known.remove(at));
        let index = entry.1.clone();
        known.insert(0, entry);
        known.truncate(KNOWN);
        index
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().expect("no code panics while it holds this lock")
}

/// What there is to draw of a job.
#[derive(Debug, Serialize, ToSchema)]
pub struct FrameList {
    /// Number of complete frames; they are numbered from 0.
    pub frames: u64,
    /// Points of the newest frame.
    pub points: u64,
    /// Fields that points can be coloured by.
    pub fields: Vec<FrameField>,
}

/// A field of points.
#[derive(Debug, Serialize, ToSchema)]
pub struct FrameField {
    pub name: String,
    /// `m/s`, `Pa`, or `1` for ratios; empty if it is not known.
    pub unit: &'static str,
}

/// What to send of a frame.
#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub struct PointsQuery {
    /// The field whose values come with the points; the recorded colours come without it.
    pub field: Option<String>,
    /// Most points to send; all by default.
    #[param(minimum = 1, maximum = 2_147_483_647)]
    pub max_points: Option<u32>,
}

/// The number of complete frames of a job so far, and the fields of their points.
#[utoipa::path(get, path = "/v1/jobs/{id}/frames", tag = "outputs", operation_id = "list_frames",
    params(("id" = Uuid, Path)),
    responses(
        (status = 200, body = FrameList),
        (status = 404, body = dto::Problem, content_type = PROBLEM,
            description = "`job_not_found`, `output_not_found`"),
    ))]
pub async fn list(State(api): State<Api>, JobId(id): JobId) -> Result<Json<FrameList>, Problem> {
    let (source, status) = Source::of(&api, id).await?;
    let list = source.read(&api, |index, target| {
        index.look(target)?;
        let Some(newest) = index.len().checked_sub(1) else { return Ok(None) };
        let Some(cloud) = index.points(target, newest)? else { return Ok(None) };
        let field = |name: &str| FrameField { name: name.to_owned(), unit: recording::unit(name) };
        let fields = cloud.fields().into_iter().map(field).collect();
        Ok(Some(FrameList { frames: index.len(), points: cloud.len() as u64, fields }))
    });
    Ok(Json(list.await?.ok_or_else(|| missing("frame", status))?))
}

/// The points of a frame, as soon as it is complete.
///
/// All numbers are little-endian. A head of 64 bytes comes first: `GFPT`; as u32 the version 1, the number of the
/// frame, how many points follow, how many the recorded frame has, and flags (1: values follow, 2: colours follow); as
/// f64 the time (s) and the x, y, z (m) that positions are relative to; as f32 the smallest and the largest value of
/// all recorded points (NaN without any).
///
/// Then come x, y, z of each point (f32, m), and after them the value (f32) or the colour (u8: red, green, blue, alpha)
/// of each point.
#[utoipa::path(get, path = "/v1/jobs/{id}/frames/{frame}/points", tag = "outputs", operation_id = "get_frame_points",
    params(
        ("id" = Uuid, Path),
        ("frame" = u64, Path, description = "Number of the frame, from 0"),
        PointsQuery,
        ("If-None-Match" = Option<String>, Header, description = "`ETag` of an earlier answer"),
    ),
    responses(
        (status = 200, content_type = "application/octet-stream", body = dto::Bytes, headers(("ETag" = String))),
        (status = 304, description = "The client has it"),
        (status = 400, body = dto::Problem, content_type = PROBLEM,
            description = "`invalid_path`; `invalid_query`: also for a field that the points do not have"),
        (status = 404, body = dto::Problem, content_type = PROBLEM,
            description = "`job_not_found`, `output_not_found`"),
    ))]
pub async fn points(
    State(api): State<Api>,
    JobFrame(id, frame): JobFrame,
    Query(query): Query<PointsQuery>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let PointsQuery { field, max_points } = query;
    if let Some(most) = max_points.filter(|most| !(1..=i32::MAX as u32).contains(most)) {
        let detail = format!("max_points is {most}; ask for 1 to {}, or leave it out for all", i32::MAX);
        return Err(Problem::new(Code::InvalidQuery, detail));
    }
    let most = max_points.unwrap_or(u32::MAX);
    let (source, status) = Source::of(&api, id).await?;
    let version = Version::of_frame(FORMAT, source.attempt, frame, &(&field, most));
    let wanted = field.clone();
    let found = source.read(&api, move |index, target| {
        recording::frame_points(index, target, frame, (wanted.as_deref(), most as usize))
    });
    let Some(points) = found.await? else {
        let problem = missing(&format!("frame {frame}"), status);
        return Err(if status.is_terminal() { problem } else { problem.retry_after(1) });
    };
    if let Some(field) = field
        && points.values.is_empty()
        && !points.positions.is_empty()
    {
        let detail = format!("the points have no field {field}; GET /v1/jobs/{id}/frames lists those that they have");
        return Err(Problem::new(Code::InvalidQuery, detail));
    }
    if let Some(answer) = version.judge(&Method::GET, &headers)? {
        return Ok(answer);
    }
    let mut answer = ([(header::CONTENT_TYPE, "application/octet-stream")], packed(frame, &points)).into_response();
    version.write(answer.headers_mut());
    Ok(answer)
}

/// A frame's points in the form that the document describes.
fn packed(frame: u64, points: &FramePoints) -> Vec<u8> {
    let FramePoints { time_s, recorded, origin, positions, values, range, colors } = points;
    let flags = u32::from(!values.is_empty()) | u32::from(!colors.is_empty()) << 1;
    let mut bytes = Vec::with_capacity(HEAD_BYTES + 16 * positions.len());
    bytes.extend(MAGIC);
    let counts = [FORMAT, frame as u32, positions.len() as u32, *recorded as u32, flags];
    counts.iter().for_each(|count| bytes.extend(count.to_le_bytes()));
    [*time_s, origin[0], origin[1], origin[2]].iter().for_each(|number| bytes.extend(number.to_le_bytes()));
    range.unwrap_or([f32::NAN; 2]).iter().for_each(|bound| bytes.extend(bound.to_le_bytes()));
    debug_assert_eq!(bytes.len(), HEAD_BYTES);
    positions.iter().flatten().for_each(|x| bytes.extend(x.to_le_bytes()));
    values.iter().for_each(|value| bytes.extend(value.to_le_bytes()));
    colors.iter().for_each(|color| bytes.extend(color));
    bytes
}

/// The recording of a job's attempt.
pub(super) struct Source {
    pub files: AttemptFiles,
    pub attempt: i64,
    index: Index,
}

impl Source {
    pub async fn of(api: &Api, id: Uuid) -> Result<(Self, Status), Problem> {
        let (files, job) = find(api, id, &[RECORDING]).await?;
        let index = api.frames.of(id, job.attempt);
        Ok((Self { files, attempt: job.attempt, index }, job.status))
    }

    /// Where the frames are, among them this one.
    pub async fn with_frame(&self, api: &Api, frame: u64, status: Status) -> Result<FrameIndex, Problem> {
        let found = self.read(api, move |index, target| {
            // A frame that was found stays where it is.
            if frame >= index.len() {
                index.look(target)?;
            }
            Ok((frame < index.len()).then(|| index.clone()))
        });
        found.await?.ok_or_else(|| {
            let problem = missing(&format!("frame {frame}"), status);
            if status.is_terminal() { problem } else { problem.retry_after(1) }
        })
    }

    /// Reads on a thread that may wait; `None` where there is no recording yet, or what is asked for is not in it.
    pub async fn read<T: Send + 'static>(
        &self,
        api: &Api,
        with: impl FnOnce(&mut FrameIndex, &std::path::Path) -> Result<Option<T>, RecordingError> + Send + 'static,
    ) -> Result<Option<T>, Problem> {
        let _reader = api.frames.readers.acquire().await.map_err(internal)?;
        let (index, target) = (self.index.clone(), self.files.recording());
        let read = tokio::task::spawn_blocking(move || with(&mut lock(&index), &target));
        match read.await.map_err(internal)? {
            Err(RecordingError::Io { source, .. }) if source.kind() == std::io::ErrorKind::NotFound => Ok(None),
            read => read.map_err(internal),
        }
    }
}

/// The `{id}` and `{frame}` in the path.
pub struct JobFrame(pub Uuid, pub u64);

impl FromRequestParts<Api> for JobFrame {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, api: &Api) -> Result<Self, Problem> {
        match axum::extract::Path::<(Uuid, u64)>::from_request_parts(parts, api).await {
            Ok(axum::extract::Path((id, frame))) => Ok(Self(id, frame)),
            Err(PathRejection::FailedToDeserializePathParams(error)) => {
                let detail =
                    format!("the ids of jobs are UUIDs, and frames have numbers from 0: {}", error.body_text());
                Err(Problem::new(Code::InvalidPath, detail))
            }
            Err(other) => Err(Problem::new(Code::InvalidPath, other.to_string())),
        }
    }
}
