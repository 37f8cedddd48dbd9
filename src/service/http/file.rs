//! Files as answers, whole or by ranges.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::path::Path;

use axum::body::Body;
use axum::http::{HeaderMap, HeaderValue, Method, StatusCode, header};
use axum::response::{IntoResponse, Response};
use tokio::io::{AsyncReadExt, AsyncSeekExt};
use tokio::task::spawn_blocking;
use tokio_util::io::ReaderStream;

use super::conditional::Version;
use super::problem::{Code, Problem, internal};
use super::range::{Selection, select};
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
        let length = metadata.len();
        let version = Version::of_file(length, metadata.modified()?);
        if let Some(answer) = version.judge(method, request)? {
            return Ok(Some(answer));
        }
        // Ranges apply only to GET.
        let range = request.get(header::RANGE).filter(|_| version.has_range_of(request) && method == Method::GET);
        let (status, part) = match select(range, length) {
            Selection::Whole => (StatusCode::OK, 0..length),
            Selection::Part(part) => (StatusCode::PARTIAL_CONTENT, part),
            Selection::Unsatisfiable => {
                let problem = Problem::new(Code::RangeNotSatisfiable, format!("the file has {length} bytes"));
                return Err(problem.with_header(header::CONTENT_RANGE, ascii(format!("bytes */{length}"))));
            }
        };
        let n = part.end - part.start;
        let body = if method == Method::HEAD {
            Body::empty()
        } else if n <= READ_BYTES as u64 {
            Body::from(read(file, part.start, n).await?)
        } else {
            let mut file = tokio::fs::File::from_std(file);
            file.seek(SeekFrom::Start(part.start)).await?;
            Body::from_stream(ReaderStream::with_capacity(file.take(n), READ_BYTES))
        };
        let mut response = (status, body).into_response();
        let headers = response.headers_mut();
        headers.insert(header::CONTENT_TYPE, HeaderValue::from_static(self.content_type));
        headers.insert(header::CONTENT_LENGTH, n.into());
        headers.insert(header::ACCEPT_RANGES, HeaderValue::from_static("bytes"));
        version.write(headers);
        if status == StatusCode::PARTIAL_CONTENT {
            headers.insert(header::CONTENT_RANGE, ascii(format!("bytes {}-{}/{length}", part.start, part.end - 1)));
        }
        if let Some(name) = self.download {
            headers.insert(header::CONTENT_DISPOSITION, attachment(name));
        }
        Ok(Some(response))
    }
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
