//! Pages for people, all in the binary: the API's reference at `/docs`, what each error code means at
//! `/docs/errors`, and the guide at `/docs/guide`.

mod advice;
mod guide;
mod page;

use axum::Router;
use axum::response::Html;
use axum::routing::get;
use utoipa_swagger_ui::{Config, SwaggerUi};

use super::state::Api;
pub use page::markdown;

/// The routes of the pages. They are no part of the API, so the document has none of them.
pub fn routes() -> Router<Api> {
    let viewer = SwaggerUi::new("/docs").config(Config::new(["/openapi.json"]).try_it_out_enabled(false));
    Router::from(viewer).route("/docs/errors", get(errors)).merge(guide::routes())
}

/// What to do about a job that failed with this code.
pub fn remedy(code: &str) -> Option<&'static str> {
    advice::FAILURES.iter().find(|(known, _)| *known == code).map(|(_, advice)| *advice)
}

async fn errors() -> Html<String> {
    Html(page::html())
}
