//! Compressed requests and answers.

use axum::body::Body;
use axum::extract::Request;
use axum::http::{Extensions, HeaderMap, HeaderValue, StatusCode, Version, header};
use axum::middleware::Next;
use axum::response::Response;
use tower::{Layer, ServiceExt};
use tower_http::compression::CompressionLayer;
use tower_http::decompression::RequestDecompression;

use super::problem::{Code, Problem};

/// Shorter answers fit into a packet, and gain nothing.
const MIN_BYTES: u64 = 1400;

/// Decodes the body of a request. Whoever reads it counts the decoded bytes, and stops at the limit.
pub async fn decode(request: Request, next: Next) -> Result<Response, Problem> {
    let encodings: Vec<&HeaderValue> = request.headers().get_all(header::CONTENT_ENCODING).iter().collect();
    let is = |value: &HeaderValue, known: &[&str]| {
        known.iter().any(|known| value.as_bytes().eq_ignore_ascii_case(known.as_bytes()))
    };
    match encodings[..] {
        [] => return Ok(next.run(request).await),
        [one] if is(one, &["identity"]) => return Ok(next.run(request).await),
        [one] if is(one, &["gzip", "zstd"]) => {}
        _ => {
            let detail = "the body's Content-Encoding is not one of those that this server decodes; \
                          send it as it is, or as gzip or zstd";
            let accepted = HeaderValue::from_static("gzip, zstd, identity");
            return Err(Problem::new(Code::UnsupportedEncoding, detail).with_header(header::ACCEPT_ENCODING, accepted));
        }
    }
    let next = next.map_request(|request: axum::http::Request<_>| request.map(Body::new));
    let answer = RequestDecompression::new(next).oneshot(request).await;
    Ok(answer.unwrap_or_else(|never| match never {}).map(Body::new))
}

/// Compresses answers of text for clients that accept it. Recordings and pictures are compressed
/// already, and ranges are of the bytes as they are.
pub async fn encode(request: Request, next: Next) -> Response {
    let layer = CompressionLayer::new().gzip(true).zstd(true).compress_when(gains);
    let mut response = match layer.layer(next).oneshot(request).await {
        Ok(response) => response.map(Body::new),
        Err(never) => match never {},
    };
    // These bytes are not those that the tag names.
    let headers = response.headers_mut();
    if headers.contains_key(header::CONTENT_ENCODING)
        && let Some(tag) = headers.get(header::ETAG).filter(|tag| !tag.as_bytes().starts_with(b"W/"))
        && let Ok(weak) = HeaderValue::from_bytes(&[b"W/", tag.as_bytes()].concat())
    {
        headers.insert(header::ETAG, weak);
    }
    response
}

fn gains(status: StatusCode, _: Version, headers: &HeaderMap, _: &Extensions) -> bool {
    let text = |name| headers.get(name).and_then(|value| value.to_str().ok()).unwrap_or_default();
    let kind = text(header::CONTENT_TYPE);
    let is_text = kind.starts_with("text/") || kind.contains("json") || kind.starts_with("application/openmetrics");
    let short = text(header::CONTENT_LENGTH).parse::<u64>().is_ok_and(|length| length < MIN_BYTES);
    // Events must not wait in a compressor.
    is_text && !short && !kind.starts_with("text/event-stream") && status != StatusCode::PARTIAL_CONTENT
}
