//! Conditional requests (RFC 9110 §13).

use std::fmt::Debug;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use axum::http::{HeaderMap, HeaderValue, Method, StatusCode, header};
use axum::response::{IntoResponse, Response};
use sha2::{Digest, Sha256};

use super::problem::{Code, Problem};

/// Which version of a resource an answer has.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Version {
    /// A strong entity tag, quotes included.
    tag: String,
    /// When it changed last, to the second, if that is known.
    modified: Option<SystemTime>,
}

impl Version {
    pub fn of_tag(tag: String) -> Self {
        Self { tag, modified: None }
    }

    /// Of a file that is never changed, only replaced.
    pub fn of_file(length: u64, modified: SystemTime) -> Self {
        let since = modified.duration_since(UNIX_EPOCH).unwrap_or_default();
        let tag = format!("\"{length:x}-{:x}\"", since.as_nanos());
        Self { tag, modified: Some(UNIX_EPOCH + Duration::from_secs(since.as_secs())) }
    }

    /// Of what is made of an attempt's frame, which is written once: it is known by how it is made. `edition` changes
    /// with what is made of the same frame.
    pub fn of_frame(edition: u32, attempt: i64, frame: u64, how: &impl Debug) -> Self {
        let hash = Sha256::digest(format!("{edition} {how:?}"));
        let hash: String = hash[..12].iter().map(|byte| format!("{byte:02x}")).collect();
        Self::of_tag(format!("\"{attempt}-{frame}-{hash}\""))
    }

    pub fn tag(&self) -> &str {
        &self.tag
    }

    /// Fails where the client's preconditions do not hold. Returns the whole answer, 304, where the
    /// client has this version already.
    pub fn judge(&self, method: &Method, request: &HeaderMap) -> Result<Option<Response>, Problem> {
        self.require(request)?;
        let reads = method == Method::GET || method == Method::HEAD;
        let has_it = match request.get(header::IF_NONE_MATCH) {
            Some(tags) => self.weakly_in(tags),
            None => self.modified.zip(date(request, header::IF_MODIFIED_SINCE)).is_some_and(|(at, since)| at <= since),
        };
        Ok((reads && has_it).then(|| {
            let mut response = StatusCode::NOT_MODIFIED.into_response();
            self.write(response.headers_mut());
            response
        }))
    }

    /// Fails where `If-Match` or `If-Unmodified-Since` asks for another version.
    pub fn require(&self, request: &HeaderMap) -> Result<(), Problem> {
        let holds = match request.get(header::IF_MATCH) {
            Some(tags) => list(tags).any(|tag| tag == "*" || tag == self.tag),
            None => {
                let since = date(request, header::IF_UNMODIFIED_SINCE);
                self.modified.zip(since).is_none_or(|(at, since)| at <= since)
            }
        };
        if holds {
            return Ok(());
        }
        let detail = format!("this is another version, with the ETag {}; read it again, then decide", self.tag);
        Err(Problem::new(Code::PreconditionFailed, detail))
    }

    /// True if a `Range` of the request is of this version: a range of another one would not fit
    /// what the client has.
    pub fn has_range_of(&self, request: &HeaderMap) -> bool {
        let Some(given) = request.get(header::IF_RANGE) else { return true };
        given.as_bytes() == self.tag.as_bytes()
            || (self.modified.is_some() && date(request, header::IF_RANGE) == self.modified)
    }

    /// Adds `ETag`, `Last-Modified` and `Cache-Control`.
    pub fn write(&self, answer: &mut HeaderMap) {
        let ascii = |text: &str| HeaderValue::from_str(text).expect("tags and dates are fit for a header");
        answer.insert(header::ETAG, ascii(&self.tag));
        answer.insert(header::CACHE_CONTROL, HeaderValue::from_static("no-cache"));
        if let Some(modified) = self.modified {
            answer.insert(header::LAST_MODIFIED, ascii(&httpdate::fmt_http_date(modified)));
        }
    }

    fn weakly_in(&self, tags: &HeaderValue) -> bool {
        list(tags).any(|tag| tag == "*" || tag.trim_start_matches("W/") == self.tag)
    }
}

fn list(tags: &HeaderValue) -> impl Iterator<Item = &str> {
    tags.to_str().unwrap_or_default().split(',').map(str::trim)
}

/// A malformed date is as good as none.
fn date(request: &HeaderMap, name: header::HeaderName) -> Option<SystemTime> {
    httpdate::parse_http_date(request.get(name)?.to_str().ok()?).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    const EARLIER: &str = "Sun, 06 Nov 1994 08:49:36 GMT";
    const THEN: &str = "Sun, 06 Nov 1994 08:49:37 GMT";
    const LATER: &str = "Sun, 06 Nov 1994 08:49:38 GMT";

    /// Status of a `GET` of a file of that time with these headers: 200, 304 or 412.
    fn status(headers: &[(header::HeaderName, &str)]) -> u16 {
        let version = file();
        match version.judge(&Method::GET, &request(headers, &version)) {
            Ok(None) => 200,
            Ok(Some(response)) => response.status().as_u16(),
            Err(problem) => problem.into_response().status().as_u16(),
        }
    }

    fn file() -> Version {
        Version::of_file(10, httpdate::parse_http_date(THEN).unwrap() + Duration::from_millis(400))
    }

    /// `TAG` stands for the version's tag.
    fn request(headers: &[(header::HeaderName, &str)], version: &Version) -> HeaderMap {
        let value = |text: &str| HeaderValue::from_str(&text.replace("TAG", &version.tag)).unwrap();
        headers.iter().map(|(name, text)| (name.clone(), value(text))).collect()
    }

    #[test]
    fn preconditions() {
        use header::{IF_MATCH, IF_MODIFIED_SINCE, IF_NONE_MATCH, IF_UNMODIFIED_SINCE};
        let cases: &[(&[(header::HeaderName, &str)], u16)] = &[
            (&[], 200),
            (&[(IF_NONE_MATCH, "TAG")], 304),
            (&[(IF_NONE_MATCH, "\"b\", W/TAG")], 304),
            (&[(IF_NONE_MATCH, "*")], 304),
            (&[(IF_NONE_MATCH, "\"b\"")], 200),
            (&[(IF_MODIFIED_SINCE, THEN)], 304),
            (&[(IF_MODIFIED_SINCE, EARLIER)], 200),
            (&[(IF_MODIFIED_SINCE, "yesterday")], 200),
            (&[(IF_NONE_MATCH, "\"b\""), (IF_MODIFIED_SINCE, LATER)], 200),
            (&[(IF_MATCH, "TAG")], 200),
            (&[(IF_MATCH, "*")], 200),
            (&[(IF_MATCH, "W/TAG")], 412),
            (&[(IF_MATCH, "\"b\"")], 412),
            (&[(IF_UNMODIFIED_SINCE, THEN)], 200),
            (&[(IF_UNMODIFIED_SINCE, EARLIER)], 412),
            (&[(IF_MATCH, "TAG"), (IF_UNMODIFIED_SINCE, EARLIER)], 200),
            (&[(IF_MATCH, "\"b\""), (IF_NONE_MATCH, "TAG")], 412),
        ];
        for (headers, expected) in cases {
            assert_eq!(status(headers), *expected, "{headers:?}");
        }
    }

    #[test]
    fn ranges_of_another_version_do_not_apply() {
        let version = file();
        for (given, applies) in [("TAG", true), ("W/TAG", false), ("\"b\"", false), (THEN, true), (LATER, false)] {
            let request = request(&[(header::IF_RANGE, given)], &version);
            assert_eq!(version.has_range_of(&request), applies, "{given}");
        }
    }
}
