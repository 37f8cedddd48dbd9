//! A page for people who open the server's address.

use axum::response::Html;

/// A page of links.
#[utoipa::path(get, path = "/", tag = "meta", operation_id = "get_page",
    responses((status = 200, body = String, content_type = "text/html")))]
pub async fn index() -> Html<&'static str> {
    Html(include_str!("index.html"))
}
