//! The guide at `/docs/guide`: the pages of `docs/`, in the order of `docs/SUMMARY.md`. The same files are an mdBook.

mod book;
mod render;
mod search;

use axum::Router;
use axum::extract::Path;
use axum::http::{HeaderMap, HeaderValue, Method, Uri, header};
use axum::response::{IntoResponse, Redirect, Response};
use axum::routing::get;

use super::super::conditional::Version;
use super::super::layers::route_not_found;
use super::super::problem::Problem;
use super::super::state::Api;
use super::super::submission::sha256_hex;
use book::Book;

/// Styles, pictures and the search from this server, and nothing else.
const POLICY: &str = "default-src 'none'; style-src 'self'; img-src 'self'; script-src 'self'; connect-src 'self'; \
                      base-uri 'none'; form-action 'none'; frame-ancestors 'none'";
const STYLE: &str = include_str!("style.css");
const SEARCH: &str = include_str!("search.js");

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
        "style.css" => return send("text/css; charset=utf-8", STYLE.as_bytes(), &headers),
        "search.js" => return send("text/javascript; charset=utf-8", SEARCH.as_bytes(), &headers),
        "search.json" => return send("application/json", book.index().as_bytes(), &headers),
        _ => {}
    }
    if let Some(page) = book.page(&name) {
        return send("text/html; charset=utf-8", page.as_bytes(), &headers);
    }
    let kind = if name.ends_with(".svg") { "image/svg+xml" } else { "image/png" };
    match book.picture(&name) {
        Some(picture) => send(kind, picture, &headers),
        None => Err(route_not_found(uri).await),
    }
}

fn send(kind: &'static str, content: &'static [u8], headers: &HeaderMap) -> Result<Response, Problem> {
    let version = Version::of_tag(format!("\"{}\"", &sha256_hex(content)[..32]));
    let mut answer = match version.judge(&Method::GET, headers)? {
        Some(answer) => answer,
        None => ([(header::CONTENT_TYPE, kind)], content).into_response(),
    };
    version.write(answer.headers_mut());
    let policy = HeaderValue::from_static(POLICY);
    answer.headers_mut().insert(header::CONTENT_SECURITY_POLICY, policy);
    Ok(answer)
}
