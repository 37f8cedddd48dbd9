//! The guide at `/docs/guide`: the pages of `docs/`, in the order of `docs/SUMMARY.md`. The same files are an mdBook.

mod book;
mod render;
mod search;

use axum::Router;
use axum::extract::Path;
use axum::http::{HeaderMap, HeaderValue, Method, Uri, header};
use axum::response::{IntoResponse, Redirect, Response};
use axum::routing::get;

use super::super::layers::route_not_found;
use super::super::problem::Problem;
use super::super::state::Api;
use book::{Book, Bound};

/// Styles, pictures and the search from this server, and nothing else.
const POLICY: &str = "default-src 'none'; style-src 'self'; img-src 'self'; script-src 'self'; connect-src 'self'; \
                      base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

/// The routes of the guide's pages and pictures.
pub fn routes() -> Router<Api> {
    Router::new()
        .route("/docs/guide", get(|| async { Redirect::permanent("/docs/guide/") }))
        .route("/docs/guide/", get(first))
        .route("/docs/guide/{*page}", get(page))
}

async fn first(uri: Uri, headers: HeaderMap) -> Result<Response, Problem> {
    page(Path(String::new()), uri, headers).await
}

async fn page(Path(name): Path<String>, uri: Uri, headers: HeaderMap) -> Result<Response, Problem> {
    let book = Book::get();
    match name.as_str() {
        "style.css" => return send("text/css; charset=utf-8", &book.style, &headers),
        "search.js" => return send("text/javascript; charset=utf-8", &book.search, &headers),
        "search.json" => return send("application/json", &book.index, &headers),
        _ => {}
    }
    if let Some(page) = book.page(&name) {
        return send("text/html; charset=utf-8", page, &headers);
    }
    let kind = if name.ends_with(".svg") { "image/svg+xml" } else { "image/png" };
    match book.picture(&name) {
        Some(picture) => send(kind, picture, &headers),
        None => Err(route_not_found(uri).await),
    }
}

fn send<T: AsRef<[u8]>>(
    kind: &'static str,
    Bound { content, version }: &'static Bound<T>,
    headers: &HeaderMap,
) -> Result<Response, Problem> {
    let mut answer = match version.judge(&Method::GET, headers)? {
        Some(answer) => answer,
        None => ([(header::CONTENT_TYPE, kind)], content.as_ref()).into_response(),
    };
    version.write(answer.headers_mut());
    let policy = HeaderValue::from_static(POLICY);
    answer.headers_mut().insert(header::CONTENT_SECURITY_POLICY, policy);
    Ok(answer)
}
