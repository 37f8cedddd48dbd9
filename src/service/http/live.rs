//! A job's frames as they come, for viewers that speak Foxglove's WebSocket protocol.
//!
//! They are read from the recording, each time for each client. So the messages are those of the
//! recording, a topic that is subscribed late begins with the first frame all the same, and a client
//! that is slow costs no memory: it gets its frames later. One that takes in nothing runs into the time
//! limit of its connection.

use std::collections::{BTreeMap, BTreeSet};
use std::io;
use std::time::Duration;

use axum::Extension;
use axum::extract::State;
use axum::extract::ws::rejection::WebSocketUpgradeRejection;
use axum::extract::ws::{CloseFrame, Message, WebSocket, WebSocketUpgrade, close_code};
use axum::http::{HeaderMap, HeaderValue, Uri, header};
use axum::response::Response;
use futures_util::FutureExt;
use tokio::sync::watch;
use tokio::time::{Instant, sleep, sleep_until};
use uuid::Uuid;

use super::connections::Occupied;
use super::dto;
use super::extract::JobId;
use super::guard::judge;
use super::openapi::PROBLEM;
use super::outputs::RECORDING;
use super::problem::{Code, Problem};
use super::state::Api;
use super::viewer::{self, Level, Request};
use super::watch::Seen;
use gridfall_recording::{Growing, RecordingError};

/// Longest message of a client (bytes).
const MOST_HEARD: usize = 64 << 10;
/// Most subscriptions of a client; there are far fewer topics.
const MOST_SUBSCRIPTIONS: usize = 256;
/// How long a client may take to subscribe to all that it shows, so that topics begin together.
const SETTLE: Duration = Duration::from_millis(100);
/// How long nothing is sent before the connection is tried.
const PING: Duration = Duration::from_secs(20);
/// How long a client may take to subscribe, and to subscribe to more, once the job has ended.
const FIRST_WORD: Duration = Duration::from_secs(10);
const LAST_WORD: Duration = Duration::from_secs(1);

/// The frames of a job that waits or runs, for viewers: over Foxglove's WebSocket protocol, as
/// `foxglove.websocket.v1` or `foxglove.sdk.v1`. Each topic comes from its first message on, the same
/// bytes as in the recording. The connection is closed after the last message of the job.
#[utoipa::path(get, path = "/v1/jobs/{id}/live", tag = "outputs", operation_id = "view_live",
    params(("id" = Uuid, Path)),
    responses(
        (status = 101, description = "The WebSocket is open"),
        (status = 403, body = dto::Problem, content_type = PROBLEM, description = "`foreign_origin`, `unknown_host`"),
        (status = 409, body = dto::Problem, content_type = PROBLEM,
            description = "`job_ended`: `recording.mcap` has all frames"),
        (status = 426, body = dto::Problem, content_type = PROBLEM, description = "`websocket_expected`"),
    ))]
pub async fn live(
    State(api): State<Api>,
    JobId(id): JobId,
    uri: Uri,
    headers: HeaderMap,
    Extension(mut occupied): Extension<Occupied>,
    upgrade: Result<WebSocketUpgrade, WebSocketUpgradeRejection>,
) -> Result<Response, Problem> {
    let expected = |detail: String| {
        Problem::new(Code::WebsocketExpected, detail)
            .with_header(header::UPGRADE, HeaderValue::from_static("websocket"))
    };
    let upgrade = upgrade.map_err(|rejection| expected(rejection.body_text()))?;
    // Browsers let any page open a WebSocket, and read it.
    judge(&api.config, &uri, &headers, "watch a job")?;
    let upgrade = upgrade.protocols(viewer::SUBPROTOCOLS).max_message_size(MOST_HEARD).max_frame_size(MOST_HEARD);
    if upgrade.selected_protocol().is_none() {
        let detail = format!("ask for the subprotocol {} (Sec-WebSocket-Protocol)", viewer::SUBPROTOCOLS.join(" or "));
        return Err(expected(detail));
    }
    let seen = api.watch(id).await?;
    if seen.borrow().as_ref().is_some_and(|view| view.job.status.is_terminal()) {
        let detail = format!("the job {id} has ended; open its recording, GET /v1/jobs/{id}/recording.mcap, instead");
        return Err(Problem::new(Code::JobEnded, detail));
    }
    let (cursors, settled) = (BTreeMap::new(), Instant::now());
    let show = Show { api, id, seen, source: None, cursors, settled, clock: None, complete: false };
    Ok(upgrade.on_upgrade(move |mut socket| async move {
        if let Err(error) = show.run(&mut socket, &mut occupied).await {
            tracing::debug!(%error, job = %id, "a live view broke off");
        }
    }))
}

/// Where a subscription is.
struct Cursor {
    channel: u16,
    /// The chunk of the recording that it has yet to get.
    next: usize,
}

/// Why a view ends before its job does.
enum End {
    /// The client is told.
    Said(&'static str),
    Failed(RecordingError),
}

impl From<RecordingError> for End {
    fn from(error: RecordingError) -> Self {
        Self::Failed(error)
    }
}

/// What one client sees.
struct Show {
    api: Api,
    id: Uuid,
    seen: watch::Receiver<Seen>,
    /// The recording, and the attempt that writes it.
    source: Option<(Growing, i64)>,
    /// By the clients' ids of subscriptions.
    cursors: BTreeMap<u32, Cursor>,
    /// When to go on after the last subscription.
    settled: Instant,
    /// The simulated time that was told last (ns).
    clock: Option<u64>,
    /// No more frames will come.
    complete: bool,
}

impl Show {
    async fn run(mut self, socket: &mut WebSocket, occupied: &mut Occupied) -> Result<(), axum::Error> {
        socket.send(viewer::server_info(self.id)).await?;
        self.seen.mark_changed();
        loop {
            // What was said in the meantime, before more is sent.
            while let Some(said) = socket.recv().now_or_never() {
                let Some(said) = said else { return Ok(()) };
                self.hear(said?, socket).await?;
            }
            let settling = Instant::now() < self.settled;
            if !settling {
                match self.send(socket).await? {
                    Ok(true) => continue,
                    Ok(false) => {}
                    Err(end) => return self.end(end, socket).await,
                }
            }
            let patience = match (self.complete, self.cursors.is_empty()) {
                (false, _) => PING,
                (true, true) => FIRST_WORD,
                (true, false) => LAST_WORD,
            };
            tokio::select! {
                said = socket.recv() => {
                    let Some(said) = said else { return Ok(()) };
                    self.hear(said?, socket).await?;
                }
                changed = self.seen.changed(), if !self.complete => {
                    let looked = if changed.is_err() { Err(End::Said("the job is watched no more")) } else {
                        self.look(socket).await?
                    };
                    if let Err(end) = looked {
                        return self.end(end, socket).await;
                    }
                }
                () = sleep_until(self.settled), if settling => {}
                _ = occupied.closing.changed() => return self.end(End::Said("the server stops"), socket).await,
                () = sleep(patience) => {
                    if self.complete {
                        return self.end(End::Said("the job has ended"), socket).await;
                    }
                    socket.send(Message::Ping(Default::default())).await?;
                }
            }
        }
    }

    /// Takes in what the client said.
    async fn hear(&mut self, said: Message, socket: &mut WebSocket) -> Result<(), axum::Error> {
        let Message::Text(text) = said else { return Ok(()) };
        let answer = match serde_json::from_str(&text) {
            Ok(Request::Subscribe { subscriptions }) => {
                for asked in subscriptions {
                    self.settled = Instant::now() + SETTLE;
                    self.cursors.insert(asked.id, Cursor { channel: asked.channel_id, next: 0 });
                }
                if self.cursors.len() <= MOST_SUBSCRIPTIONS {
                    return Ok(());
                }
                self.cursors.clear();
                format!("more than {MOST_SUBSCRIPTIONS} subscriptions; all were ended")
            }
            Ok(Request::Unsubscribe { subscription_ids }) => {
                self.cursors.retain(|id, _| !subscription_ids.contains(id));
                return Ok(());
            }
            Ok(Request::Other) => "this server only shows frames, and does nothing else of the protocol".to_owned(),
            Err(error) => format!("not a message of the protocol: {error}"),
        };
        socket.send(viewer::status(Level::Warning, &answer)).await
    }

    /// Sends the next chunk to those subscriptions that have come the least far. Returns false if all have all.
    async fn send(&mut self, socket: &mut WebSocket) -> Result<Result<bool, End>, axum::Error> {
        let Some((mut recording, attempt)) = self.source.take() else { return Ok(Ok(false)) };
        let chunks = recording.chunks();
        let Some(next) = self.cursors.values().map(|cursor| cursor.next).min().filter(|&next| next < chunks) else {
            self.source = Some((recording, attempt));
            return Ok(Ok(false));
        };
        let mut due: Vec<(u32, &mut Cursor)> =
            self.cursors.iter_mut().map(|(id, cursor)| (*id, cursor)).filter(|(_, c)| c.next == next).collect();
        let channels: BTreeSet<u16> = due.iter().map(|(_, cursor)| cursor.channel).collect();
        due.iter_mut().for_each(|(_, cursor)| cursor.next += 1);
        let mut messages = Vec::new();
        if recording.has(next, &channels) {
            let read;
            (recording, read) = apart(recording, move |recording| recording.messages(next)).await;
            match read {
                Ok(read) => messages = read,
                Err(error) => return Ok(Err(error.into())),
            }
        }
        self.source = Some((recording, attempt));
        for message in messages {
            for (id, _) in due.iter().filter(|(_, cursor)| cursor.channel == message.channel) {
                // Subscriptions that catch up do not turn the clock back.
                if self.clock.is_none_or(|clock| clock < message.log_time) {
                    self.clock = Some(message.log_time);
                    socket.send(viewer::time(message.log_time)).await?;
                }
                socket.send(viewer::data(*id, &message)).await?;
            }
        }
        Ok(Ok(true))
    }

    /// Finds out what there is of the recording, and tells the client of its topics.
    async fn look(&mut self, socket: &mut WebSocket) -> Result<Result<(), End>, axum::Error> {
        let known = self.source.as_ref().is_some_and(|(recording, _)| !recording.channels().is_empty());
        if let Err(end) = self.read().await {
            return Ok(Err(end));
        }
        if let Some((recording, _)) = self.source.as_ref().filter(|_| !known) {
            let channels = recording.channels();
            if !channels.is_empty() {
                socket.send(viewer::advertise(&channels)).await?;
            }
        }
        Ok(Ok(()))
    }

    async fn read(&mut self) -> Result<(), End> {
        let seen = self.seen.borrow_and_update().clone();
        let Some(view) = seen else { return Err(End::Said("the job was deleted")) };
        self.complete = view.job.status.is_terminal();
        let attempt = view.job.attempt;
        let fetched = self.api.data.fetch(&view.job, &[RECORDING]).await;
        fetched.map_err(|_| End::Said("the object storage, where the recording is, does not answer"))?;
        let source = match self.source.take() {
            Some((recording, open)) if open == attempt => recording,
            earlier => {
                let files = self.api.data.job(self.id).attempt(attempt);
                let path = if self.complete { files.recording() } else { files.partial_recording() };
                self.source = earlier;
                match tokio::task::spawn_blocking(move || Growing::open(&path)).await.expect("opening does not panic") {
                    Ok(recording) => recording,
                    // There is none yet, or none at all; or it was finished in this moment, and has its final name.
                    Err(RecordingError::Io { source, .. }) if source.kind() == io::ErrorKind::NotFound => return Ok(()),
                    Err(error) => return Err(error.into()),
                }
            }
        };
        let (recording, looked) = apart(source, Growing::look).await;
        looked?;
        if let Some((earlier, _)) = &self.source {
            let sent = self.cursors.values().map(|cursor| cursor.next).max().unwrap_or(0);
            // Another attempt has yet to come as far as the one before.
            if recording.chunks() < sent && !self.complete {
                return Ok(());
            }
            if !recording.begins_as(earlier, sent) {
                return Err(End::Said("the job was run anew, and became another recording"));
            }
        }
        self.source = Some((recording, attempt));
        Ok(())
    }

    async fn end(&self, end: End, socket: &mut WebSocket) -> Result<(), axum::Error> {
        let (reason, level) = match end {
            End::Said(reason) => (reason, if self.complete { Level::Info } else { Level::Warning }),
            End::Failed(error) => {
                tracing::error!(job = %self.id, %error, "cannot show a recording");
                ("the recording cannot be read", Level::Error)
            }
        };
        socket.send(viewer::status(level, reason)).await?;
        let code = match level {
            Level::Error => close_code::ERROR,
            Level::Warning => close_code::AWAY,
            Level::Info => close_code::NORMAL,
        };
        socket.send(Message::Close(Some(CloseFrame { code, reason: reason.into() }))).await
    }
}

/// Does with a recording what may take its time.
pub(super) async fn apart<T: Send + 'static>(
    mut recording: Growing,
    work: impl FnOnce(&mut Growing) -> T + Send + 'static,
) -> (Growing, T) {
    let work = move || {
        let result = work(&mut recording);
        (recording, result)
    };
    tokio::task::spawn_blocking(work).await.expect("reading a recording does not panic")
}
