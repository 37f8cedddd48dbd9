//! The recording of a running job as it grows, byte by byte as it will be.

use std::io;
use std::path::PathBuf;

use axum::body::{Body, Bytes};
use axum::http::header;
use axum::response::{IntoResponse, Response};
use futures_util::stream;
use sha2::{Digest, Sha256};
use tokio::fs::File;
use tokio::io::AsyncReadExt;
use tokio::sync::watch;
use uuid::Uuid;

use super::live::apart;
use super::outputs::RECORDING;
use super::problem::Problem;
use super::state::Api;
use super::watch::{Seen, View};
use gridfall_recording::{Growing, RecordingError};

/// How much is sent at a time (bytes).
const PIECE_BYTES: u64 = 64 << 10;

/// Everything that the recording has and will have. A later attempt goes on with it; the stream breaks
/// off if that becomes another recording.
pub async fn follow(api: &Api, id: Uuid, name: &str) -> Result<Response, Problem> {
    let follower = Follower {
        api: api.clone(),
        id,
        seen: api.watch(id).await?,
        source: None,
        growing: None,
        sent: 0,
        hash: Sha256::new(),
        safe: 0,
        complete: false,
    };
    let bytes = stream::unfold(Some(follower), |follower| async {
        let mut follower = follower?;
        match follower.next().await {
            Ok(Some(piece)) => Some((Ok(piece), Some(follower))),
            Ok(None) => None,
            Err(error) => Some((Err(error), None)),
        }
    });
    let headers = [
        (header::CONTENT_TYPE, "application/octet-stream".to_owned()),
        (header::CONTENT_DISPOSITION, format!("attachment; filename=\"{name}\"")),
        (header::ACCEPT_RANGES, "none".to_owned()),
        (header::CACHE_CONTROL, "no-store".to_owned()),
    ];
    Ok((headers, Body::from_stream(bytes)).into_response())
}

struct Follower {
    api: Api,
    id: Uuid,
    seen: watch::Receiver<Seen>,
    /// The file, and the attempt that writes it.
    source: Option<(File, i64)>,
    /// What is known of the recording that an attempt writes.
    growing: Option<(Growing, i64)>,
    sent: u64,
    /// Of what was sent.
    hash: Sha256,
    /// Bytes of the file that no recovery takes away: up to the last complete frame, or all.
    safe: u64,
    complete: bool,
}

impl Follower {
    async fn next(&mut self) -> io::Result<Option<Bytes>> {
        loop {
            if self.sent < self.safe
                && let Some((file, _)) = &mut self.source
            {
                let mut piece = Vec::new();
                file.take(PIECE_BYTES.min(self.safe - self.sent)).read_to_end(&mut piece).await?;
                if piece.is_empty() {
                    return Err(io::Error::other("the recording became shorter"));
                }
                self.sent += piece.len() as u64;
                self.hash.update(&piece);
                return Ok(Some(piece.into()));
            }
            if self.complete {
                return Ok(None);
            }
            let seen = self.seen.borrow_and_update().clone();
            let Some(view) = seen else { return Err(io::Error::other("the job was deleted")) };
            self.look(&view).await?;
            if self.sent == self.safe && !self.complete && self.seen.changed().await.is_err() {
                return Err(io::Error::other("the job is watched no more"));
            }
        }
    }

    /// Finds out how much of the recording there is.
    async fn look(&mut self, view: &View) -> io::Result<()> {
        let files = self.api.data.job(self.id).attempt(view.job.attempt);
        self.api.data.fetch(&view.job, &[RECORDING]).await.map_err(io::Error::other)?;
        if view.job.status.is_terminal() {
            self.open(files.recording(), view.job.attempt).await?;
            let (file, _) = self.source.as_ref().expect("it was opened");
            self.safe = file.metadata().await?.len();
            self.complete = true;
            return Ok(());
        }
        let safe = self.complete_frames(files.partial_recording(), view.job.attempt).await?;
        // Another attempt has yet to come as far as the one before.
        if safe > self.sent {
            match self.open(files.partial_recording(), view.job.attempt).await {
                Ok(()) => self.safe = safe,
                // It was finished in this moment, and has its final name.
                Err(error) if error.kind() == io::ErrorKind::NotFound => {}
                Err(error) => return Err(error),
            }
        }
        Ok(())
    }

    /// Length of an unfinished recording up to its last complete frame; 0 if there is none.
    async fn complete_frames(&mut self, path: PathBuf, attempt: i64) -> io::Result<u64> {
        let growing = match self.growing.take() {
            Some((growing, known)) if known == attempt => growing,
            _ => match tokio::task::spawn_blocking(move || Growing::open(&path)).await.map_err(io::Error::other)? {
                Ok(growing) => growing,
                Err(RecordingError::Io { source, .. }) if source.kind() == io::ErrorKind::NotFound => return Ok(0),
                Err(error) => return Err(io::Error::other(error)),
            },
        };
        let (growing, looked) = apart(growing, Growing::look).await;
        looked.map_err(io::Error::other)?;
        let safe = growing.safe();
        self.growing = Some((growing, attempt));
        Ok(safe)
    }

    /// Opens the file of an attempt behind what was sent, which must be what it begins with.
    async fn open(&mut self, path: PathBuf, attempt: i64) -> io::Result<()> {
        if self.source.as_ref().is_some_and(|(_, open)| *open == attempt) {
            return Ok(());
        }
        let mut file = File::open(path).await?;
        let (mut hash, mut left) = (Sha256::new(), self.sent);
        while left > 0 {
            let mut piece = Vec::new();
            (&mut file).take(PIECE_BYTES.min(left)).read_to_end(&mut piece).await?;
            if piece.is_empty() {
                break;
            }
            left -= piece.len() as u64;
            hash.update(&piece);
        }
        if left > 0 || hash.finalize() != self.hash.clone().finalize() {
            return Err(io::Error::other("the job was run anew, and became another recording"));
        }
        self.source = Some((file, attempt));
        Ok(())
    }
}
