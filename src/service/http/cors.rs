//! Which pages of other origins may read answers (CORS).

use axum::extract::{Request, State};
use axum::http::{HeaderName, Method, header};
use axum::middleware::Next;
use axum::response::Response;
use tower::{Layer, ServiceExt};
use tower_http::cors::{AllowHeaders, Any, CorsLayer};

use super::state::Api;

/// Pages of the configured origins may use the whole API. Pages of any origin may read what viewers
/// show, by ranges.
pub async fn cors(State(api): State<Api>, request: Request, next: Next) -> Response {
    let Some(origin) = request.headers().get(header::ORIGIN) else { return next.run(request).await };
    let layer = if api.config.cors_origins.contains(origin) {
        CorsLayer::new()
            .allow_origin(origin.clone())
            .allow_methods([Method::GET, Method::HEAD, Method::POST, Method::PUT, Method::DELETE])
            .allow_headers(AllowHeaders::mirror_request())
            .expose_headers(EXPOSED)
            .allow_private_network(true)
    } else if is_for_viewers(request.method(), request.headers(), request.uri().path()) {
        CorsLayer::new()
            .allow_origin(Any)
            .allow_methods([Method::GET, Method::HEAD])
            .allow_headers([
                header::AUTHORIZATION,
                header::RANGE,
                header::IF_RANGE,
                header::IF_NONE_MATCH,
                header::CACHE_CONTROL,
            ])
            .expose_headers(EXPOSED)
            // Browsers ask before a public page may read from a private address, such as the user's
            // own machine.
            .allow_private_network(true)
    } else {
        return next.run(request).await;
    };
    layer.layer(next).oneshot(request).await.unwrap_or_else(|never| match never {})
}

/// A read, or the question whether one is allowed, of an output that viewers show.
fn is_for_viewers(method: &Method, headers: &axum::http::HeaderMap, path: &str) -> bool {
    let reads = match *method {
        Method::GET | Method::HEAD => true,
        Method::OPTIONS => headers.contains_key(header::ACCESS_CONTROL_REQUEST_METHOD),
        _ => false,
    };
    let output = path.strip_prefix("/v1/jobs/").and_then(|rest| rest.split_once('/')).map(|(_, output)| output);
    reads && output.is_some_and(|output| ["recording.mcap", "recording-so-far.mcap", "thumbnail.png"].contains(&output))
}

const EXPOSED: [HeaderName; 12] = [
    header::ACCEPT_RANGES,
    header::CONTENT_DISPOSITION,
    header::CONTENT_ENCODING,
    header::CONTENT_LENGTH,
    header::CONTENT_RANGE,
    header::ETAG,
    header::LAST_MODIFIED,
    header::LINK,
    header::LOCATION,
    header::RETRY_AFTER,
    HeaderName::from_static("preference-applied"),
    HeaderName::from_static("x-request-id"),
];
