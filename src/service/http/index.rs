//! What is at the server's address: the dashboard for browsers, links for programs.

use axum::Json;
use axum::http::{HeaderMap, header};
use axum::response::{IntoResponse, Response};
use serde::Serialize;
use utoipa::ToSchema;

use super::dashboard;
use super::problem::Problem;
use gridfall_recording::provenance;

/// Where to begin.
#[derive(Debug, Serialize, ToSchema)]
pub struct Index {
    /// `gridfall`.
    pub name: &'static str,
    pub version: &'static str,
    /// Paths of the API's main parts.
    pub links: Links,
}

/// Paths of the API's main parts.
#[derive(Debug, Serialize, ToSchema)]
pub struct Links {
    pub jobs: &'static str,
    pub library: &'static str,
    pub materials: &'static str,
    pub scene_schema: &'static str,
    pub openapi: &'static str,
    pub docs: &'static str,
    pub errors: &'static str,
    pub ready: &'static str,
    pub metrics: &'static str,
}

const INDEX: Index = Index {
    name: "gridfall",
    version: provenance::VERSION,
    links: Links {
        jobs: "/v1/jobs",
        library: "/v1/library",
        materials: "/v1/materials",
        scene_schema: "/v1/schema/scene",
        openapi: "/openapi.json",
        docs: "/docs/",
        errors: "/docs/errors",
        ready: "/readyz",
        metrics: "/metrics",
    },
};

/// The dashboard, for clients that accept HTML; links for all others.
#[utoipa::path(get, path = "/", tag = "meta", operation_id = "get_index",
    responses((status = 200, content((Index = "application/json"), (String = "text/html")))))]
pub async fn index(headers: HeaderMap) -> Result<Response, Problem> {
    let accepted = headers.get_all(header::ACCEPT).iter().filter_map(|value| value.to_str().ok());
    let mut answer = if accepted.flat_map(|list| list.split(',')).any(is_html) {
        dashboard::page(&headers)?
    } else {
        Json(INDEX).into_response()
    };
    answer.headers_mut().insert(header::VARY, header::ACCEPT.into());
    Ok(answer)
}

/// Names HTML, and does not refuse it.
fn is_html(range: &str) -> bool {
    let mut parts = range.split(';').map(str::trim);
    let html = parts.next().is_some_and(|kind| kind.eq_ignore_ascii_case("text/html"));
    html && !parts.any(|parameter| matches!(parameter, "q=0" | "q=0.0" | "q=0.00" | "q=0.000"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn browsers_accept_html_and_programs_do_not() {
        let browser = "text/html,application/xhtml+xml,application/xml;q=0.9,image/avif,*/*;q=0.8";
        assert!(browser.split(',').any(is_html));
        assert!(is_html(" Text/HTML; q=0.5"));
        assert!(!"*/*".split(',').any(is_html) && !"application/json, text/html;q=0".split(',').any(is_html));
    }
}
