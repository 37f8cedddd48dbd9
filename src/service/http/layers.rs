//! Middleware that applies to every route.

use std::any::Any;
use std::time::Instant;

use axum::extract::{MatchedPath, Request, State};
use axum::http::{HeaderValue, Method, Uri};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use tokio::time::timeout;
use tracing::Instrument;
use uuid::Uuid;

use super::problem::{Code, Problem};
use super::state::Api;

/// Which request an answer and lines of the log belong to. Clients may choose it.
const REQUEST_ID: &str = "x-request-id";

fn is_sound(id: &HeaderValue) -> bool {
    (1..=128).contains(&id.len()) && id.as_bytes().iter().all(u8::is_ascii_graphic)
}

/// Names, counts and times requests, by route.
pub async fn observe(State(api): State<Api>, request: Request, next: Next) -> Response {
    let started = Instant::now();
    let id = request.headers().get(REQUEST_ID).filter(|id| is_sound(id)).cloned();
    let id = id.unwrap_or_else(|| HeaderValue::try_from(Uuid::now_v7().to_string()).expect("a UUID is ASCII"));
    let method = request.method().clone();
    let path = request.uri().path().to_owned();
    let route = request.extensions().get::<MatchedPath>().map_or("unmatched", MatchedPath::as_str).to_owned();
    let span = tracing::info_span!("request", request_id = id.to_str().unwrap_or_default());
    let mut response = next.run(request).instrument(span.clone()).await;
    let _span = span.enter();
    response.headers_mut().insert(REQUEST_ID, id);
    let (status, seconds) = (response.status(), started.elapsed().as_secs_f64());
    tracing::debug!(%method, path, status = status.as_u16(), seconds, "answered");
    api.metrics.observe(&method, route, status, seconds);
    response
}

/// Times out requests that take too long to answer. The body of an answer may take as long as it
/// needs.
pub async fn bound_time(State(api): State<Api>, request: Request, next: Next) -> Response {
    let within = api.config.handler_timeout;
    timeout(within, next.run(request)).await.unwrap_or_else(|_| {
        let detail = format!("the request could not be answered within {} s", within.as_secs_f64());
        Problem::new(Code::Overloaded, detail).retry_after(10).into_response()
    })
}

pub async fn route_not_found(uri: Uri) -> Problem {
    Problem::new(Code::RouteNotFound, format!("there is nothing at {}; /openapi.json lists all paths", uri.path()))
}

pub async fn method_not_allowed(method: Method, uri: Uri) -> Problem {
    Problem::new(Code::MethodNotAllowed, format!("{} has no {method}; the header Allow lists what it has", uri.path()))
}

pub fn panicked(panic: Box<dyn Any + Send>) -> Response {
    super::problem::internal(crate::jobs::panic_message(panic.as_ref())).into_response()
}

#[cfg(test)]
mod tests {
    use axum::Router;
    use axum::body::{Body, to_bytes};
    use axum::http::header;
    use axum::routing::get;
    use tower::ServiceExt;
    use tower_http::catch_panic::CatchPanicLayer;

    use super::*;

    #[tokio::test]
    async fn a_panic_is_a_problem_that_tells_nothing_of_the_inside() {
        async fn boom() {
            panic!("secret")
        }
        let app = Router::new().route("/", get(boom)).layer(CatchPanicLayer::custom(panicked));
        let response = app.oneshot(Request::new(Body::empty())).await.unwrap();
        assert_eq!(response.status(), 500);
        assert_eq!(response.headers()[header::CONTENT_TYPE], "application/problem+json");
        let body: serde_json::Value =
            serde_json::from_slice(&to_bytes(response.into_body(), 1 << 16).await.unwrap()).unwrap();
        assert_eq!(body["code"], "internal");
        assert!(!body.to_string().contains("secret"));
    }
}
