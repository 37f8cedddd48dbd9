//! Shedding load: more requests at a time than the server can serve well are refused at once, so
//! that those it has are answered. What one needs to get out of trouble always passes.

use axum::extract::{Request, State};
use axum::http::Method;
use axum::middleware::Next;
use axum::response::Response;

use super::problem::{Code, Problem};
use super::state::Api;

/// Marks requests on a connection beyond the usual number.
#[derive(Clone, Copy, Debug)]
pub struct Crowded;

/// Answers at most so many requests at a time. The bodies of answers do not count, nor do clients
/// that wait for a job to change, because they cost next to nothing.
pub async fn shed(State(api): State<Api>, request: Request, next: Next) -> Result<Response, Problem> {
    if always_passes(request.method(), request.uri().path()) {
        return Ok(next.run(request).await);
    }
    if request.extensions().get::<Crowded>().is_some() {
        let detail = format!("{} connections are open already; try again later", api.config.max_connections);
        return Err(Problem::new(Code::Overloaded, detail).retry_after(5));
    }
    let waits = request.method() == Method::GET && request.headers().contains_key("prefer");
    if waits {
        return Ok(next.run(request).await);
    }
    let Ok(_permit) = api.in_flight.try_acquire() else {
        let detail = format!("{} requests are being answered already; try again later", api.config.max_in_flight);
        return Err(Problem::new(Code::Overloaded, detail).retry_after(1));
    };
    Ok(next.run(request).await)
}

/// Health, metrics, and cancel.
fn always_passes(method: &Method, path: &str) -> bool {
    matches!(path, "/livez" | "/readyz" | "/metrics") || (method == Method::POST && path.ends_with("/cancel"))
}
