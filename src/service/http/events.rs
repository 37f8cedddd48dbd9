//! What happens to a job, as server-sent events.

use std::collections::VecDeque;
use std::convert::Infallible;
use std::io::SeekFrom;
use std::path::PathBuf;
use std::sync::Arc;

use axum::extract::State;
use axum::http::{HeaderMap, header};
use axum::response::sse::{Event, KeepAlive, Sse};
use axum::response::{IntoResponse, Response};
use futures_util::stream;
use tokio::fs::File;
use tokio::io::{AsyncReadExt, AsyncSeekExt};
use tokio::sync::watch;

use super::extract::JobId;
use super::problem::Problem;
use super::state::Api;
use super::watch::{Seen, View};
use crate::store::Status;

/// Bytes of the log that are read at a time.
const LOG_BYTES: u64 = 64 << 10;

/// What happens to a job: `status` and `progress` have the job as it stands, `log` a line of its log.
/// The stream ends with the status in which the job ends, or with `deleted`. A client that comes
/// back with the last `id` goes on from there.
#[utoipa::path(get, path = "/v1/jobs/{id}/events", tag = "jobs", operation_id = "watch_job",
    params(
        ("id" = uuid::Uuid, Path),
        ("Last-Event-ID" = Option<String>, Header, description = "`id` of the last event that the client has"),
    ),
    responses((status = 200, content_type = "text/event-stream", body = String)))]
pub async fn events(State(api): State<Api>, JobId(id): JobId, headers: HeaderMap) -> Result<Response, Problem> {
    let last = headers.get("last-event-id").and_then(|id| id.to_str().ok()).and_then(|id| id.split_once('.'));
    let (tag, offset) = last.unwrap_or_default();
    let watch = Watch {
        seen: api.watch(id).await?,
        begun: false,
        over: false,
        log: api.data.job(id).log(),
        offset: offset.parse().unwrap_or(0),
        tag: tag.to_owned(),
        state: None,
        ready: VecDeque::new(),
    };
    let events = stream::unfold(watch, |mut watch| async move {
        let event = watch.next().await?;
        Some((Ok::<_, Infallible>(event), watch))
    });
    // Proxies would otherwise collect events.
    let unbuffered = [("x-accel-buffering", "no"), (header::CACHE_CONTROL.as_str(), "no-store")];
    Ok((unbuffered, Sse::new(events).keep_alive(KeepAlive::default())).into_response())
}

/// One client's place in what happens.
struct Watch {
    seen: watch::Receiver<Seen>,
    begun: bool,
    over: bool,
    log: PathBuf,
    /// Bytes of the log that were sent.
    offset: u64,
    /// Of the job as it was sent last.
    tag: String,
    state: Option<(Status, i64)>,
    ready: VecDeque<Event>,
}

impl Watch {
    async fn next(&mut self) -> Option<Event> {
        loop {
            if let Some(event) = self.ready.pop_front() {
                return Some(event);
            }
            // The channel is closed only after the end was seen.
            if self.over || (self.begun && self.seen.changed().await.is_err()) {
                return None;
            }
            self.begun = true;
            let seen = self.seen.borrow_and_update().clone();
            match seen {
                Some(view) => self.gather(view).await,
                None => {
                    self.over = true;
                    self.ready.push_back(Event::default().event("deleted").data("{}"));
                }
            }
        }
    }

    async fn gather(&mut self, view: Arc<View>) {
        while self.offset < view.log_bytes {
            let lines = self.read_log().await;
            if lines.is_empty() {
                break;
            }
            for line in lines.split_inclusive('\n') {
                self.offset += line.len() as u64;
                let event = Event::default().event("log").data(line.trim_end());
                self.ready.push_back(event.id(format!("{}.{}", self.tag, self.offset)));
            }
        }
        let tag = view.tag.trim_matches('"');
        self.over = view.job.status.is_terminal();
        if self.tag != tag {
            let state = Some((view.job.status, view.job.attempt));
            let kind = if state == self.state { "progress" } else { "status" };
            (self.tag, self.state) = (tag.to_owned(), state);
            let event = Event::default().event(kind).data(String::from_utf8_lossy(&view.body));
            self.ready.push_back(event.id(format!("{}.{}", self.tag, self.offset)));
        }
    }

    /// Whole lines after those that were sent; a log that cannot be read has none.
    async fn read_log(&self) -> String {
        let read = async {
            let mut file = File::open(&self.log).await?;
            file.seek(SeekFrom::Start(self.offset)).await?;
            let mut bytes = Vec::new();
            file.take(LOG_BYTES).read_to_end(&mut bytes).await?;
            std::io::Result::Ok(bytes)
        };
        let mut bytes = read.await.unwrap_or_default();
        bytes.truncate(bytes.iter().rposition(|byte| *byte == b'\n').map_or(0, |end| end + 1));
        String::from_utf8_lossy(&bytes).into_owned()
    }
}

/// What the worker and the run have said about a job, a line each.
#[utoipa::path(get, path = "/v1/jobs/{id}/log", tag = "jobs", operation_id = "get_job_log",
    params(("id" = uuid::Uuid, Path)),
    responses((status = 200, content_type = "text/plain", body = String)))]
pub async fn log(State(api): State<Api>, JobId(id): JobId) -> Result<Response, Problem> {
    let job = api.store.get(id).await?.ok_or_else(|| Problem::job_not_found(id))?;
    api.data.fetch(&job, &[]).await?;
    let text = match tokio::fs::read(api.data.job(id).log()).await {
        Ok(text) => text,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Vec::new(),
        Err(error) => return Err(error.into()),
    };
    let headers = [(header::CONTENT_TYPE, "text/plain; charset=utf-8"), (header::CACHE_CONTROL, "no-store")];
    Ok((headers, text).into_response())
}
