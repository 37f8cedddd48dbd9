//! Files as answers, whole or by ranges.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::ops::Range;
use std::path::Path;

use axum::body::{Body, Bytes};
use axum::http::{HeaderMap, HeaderValue, Method, StatusCode, header};
use axum::response::{IntoResponse, Response};
use futures_util::stream::{self, Stream};
use tokio::io::{AsyncReadExt, AsyncSeekExt};
use tokio::task::spawn_blocking;
use tokio_util::io::ReaderStream;

use super::conditional::Version;
use super::problem::{Code, Problem, internal};
use super::range::{Selection, select};
use crate::store::Remote;
use gridfall_recording::RecordingError;

/// How much of a file is read at a time (bytes).
pub(super) const READ_BYTES: usize = 64 << 10;

/// A file as the response to a `GET` or `HEAD`.
pub(super) struct FileAnswer<'a> {
    pub path: &'a Path,
    pub content_type: &'static str,
    /// File name that browsers save it under.
    pub download: Option<&'a str>,
}

impl FileAnswer<'_> {
    /// `None` if there is no such file.
    pub async fn send(&self, method: &Method, request: &HeaderMap) -> Result<Option<Response>, Problem> {
        let path = self.path.to_owned();
        // Each hand to another thread costs more than opening a file or reading a small part of it.
        let opened = spawn_blocking(move || {
            let file = File::open(path)?;
            file.metadata().map(|metadata| (file, metadata))
        });
        let Some((file, metadata)) = found(opened.await.map_err(internal)?)? else { return Ok(None) };
        let parts = match self.select(
            Version::of_file(metadata.len(), metadata.modified()?),
            metadata.len(),
            method,
            request,
        )? {
            Selected::Answer(answer) => return Ok(Some(answer)),
            Selected::Part(parts) => parts,
        };
        let n = parts.bytes();
        let body = if method == Method::HEAD {
            Body::empty()
        } else if n <= READ_BYTES as u64 {
            Body::from(read(file, parts.range.start, n).await?)
        } else {
            let mut file = tokio::fs::File::from_std(file);
            file.seek(SeekFrom::Start(parts.range.start)).await?;
            Body::from_stream(ReaderStream::with_capacity(file.take(n), READ_BYTES))
        };
        Ok(Some(self.answer(parts, body)))
    }

    /// The same of what is in the object storage.
    pub fn send_from(&self, remote: Remote, method: &Method, request: &HeaderMap) -> Result<Response, Problem> {
        let version = Version::of_file(remote.bytes, remote.modified);
        let parts = match self.select(version, remote.bytes, method, request)? {
            Selected::Answer(answer) => return Ok(answer),
            Selected::Part(parts) => parts,
        };
        let body =
            if method == Method::HEAD { Body::empty() } else { Body::from_stream(pieces(remote, parts.range.clone())) };
        Ok(self.answer(parts, body))
    }

    /// What a request gets of a file of this version and length.
    fn select(&self, version: Version, length: u64, method: &Method, request: &HeaderMap) -> Result<Selected, Problem> {
        if let Some(answer) = version.judge(method, request)? {
            return Ok(Selected::Answer(answer));
        }
        // Ranges apply only to GET.
        let range = request.get(header::RANGE).filter(|_| version.has_range_of(request) && method == Method::GET);
        let (status, range) = match select(range, length) {
            Selection::Whole => (StatusCode::OK, 0..length),
            Selection::Part(part) => (StatusCode::PARTIAL_CONTENT, part),
            Selection::Unsatisfiable => {
                let problem = Problem::new(Code::RangeNotSatisfiable, format!("the file has {length} bytes"));
                return Err(problem.with_header(header::CONTENT_RANGE, ascii(format!("bytes */{length}"))));
            }
        };
        Ok(Selected::Part(Part { version, length, status, range }))
    }

    fn answer(&self, part: Part, body: Body) -> Response {
        let mut response = (part.status, body).into_response();
        let headers = response.headers_mut();
        headers.insert(header::CONTENT_TYPE, HeaderValue::from_static(self.content_type));
        headers.insert(header::CONTENT_LENGTH, part.bytes().into());
        headers.insert(header::ACCEPT_RANGES, HeaderValue::from_static("bytes"));
        part.version.write(headers);
        if part.status == StatusCode::PARTIAL_CONTENT {
            let Range { start, end } = part.range;
            headers.insert(header::CONTENT_RANGE, ascii(format!("bytes {start}-{}/{}", end - 1, part.length)));
        }
        if let Some(name) = self.download {
            headers.insert(header::CONTENT_DISPOSITION, attachment(name));
        }
        response
    }
}

/// What a request is answered with.
enum Selected {
    /// A whole answer without any of the file.
    Answer(Response),
    Part(Part),
}

struct Part {
    version: Version,
    length: u64,
    status: StatusCode,
    range: Range<u64>,
}

impl Part {
    fn bytes(&self) -> u64 {
        self.range.end - self.range.start
    }
}

/// Bytes of what is in the object storage, as they are asked for.
fn pieces(remote: Remote, range: Range<u64>) -> impl Stream<Item = io::Result<Bytes>> {
    stream::try_unfold((remote, range), |(remote, mut range)| async move {
        if range.is_empty() {
            return Ok(None);
        }
        let piece = remote.read(range.clone()).await.map_err(io::Error::other)?;
        if piece.is_empty() {
            return Err(io::ErrorKind::UnexpectedEof.into());
        }
        range.start += piece.len() as u64;
        Ok(Some((piece, (remote, range))))
    })
}

/// A small part of a file.
async fn read(mut file: File, start: u64, n: u64) -> Result<Vec<u8>, Problem> {
    let part = spawn_blocking(move || {
        let mut bytes = vec![0; n as usize];
        file.seek(SeekFrom::Start(start))?;
        file.read_exact(&mut bytes).map(|()| bytes)
    });
    Ok(part.await.map_err(internal)??)
}

/// Writes a file for one answer beside a recording: on the disk, so that slow clients cost no memory; without a name,
/// so that nothing is left of it. `write` gets the file and its folder.
pub(super) fn unnamed<E: From<RecordingError>>(
    recording: &Path,
    write: impl FnOnce(&File, &Path) -> Result<(), E>,
) -> Result<File, E> {
    let folder = recording.parent().expect("recordings are in folders");
    let mut file = tempfile::tempfile_in(folder).map_err(RecordingError::io("create a file in", folder))?;
    write(&file, folder)?;
    file.rewind().map_err(RecordingError::io("read a file in", folder))?;
    Ok(file)
}

/// A file that was made for this answer, which browsers save under a name.
pub(super) fn made(file: File, kind: &'static str, name: &str, version: &Version) -> Result<Response, Problem> {
    let length = file.metadata()?.len();
    let body = Body::from_stream(ReaderStream::with_capacity(tokio::fs::File::from_std(file), READ_BYTES));
    let mut answer = ([(header::CONTENT_TYPE, kind)], body).into_response();
    let headers = answer.headers_mut();
    headers.insert(header::CONTENT_DISPOSITION, attachment(name));
    headers.insert(header::CONTENT_LENGTH, length.into());
    version.write(headers);
    Ok(answer)
}

fn attachment(name: &str) -> HeaderValue {
    ascii(format!("attachment; filename=\"{name}\""))
}

fn ascii(text: String) -> HeaderValue {
    HeaderValue::try_from(text).expect("digits, letters and quotes are fit for a header")
}

/// `None` for a file that is not there.
pub(super) fn found<T>(result: io::Result<T>) -> io::Result<Option<T>> {
    match result {
        Ok(value) => Ok(Some(value)),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(error),
    }
}
