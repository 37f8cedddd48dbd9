//! Headers that keep browsers from doing with an answer what it is not for.

use axum::extract::Request;
use axum::http::{HeaderName, HeaderValue, header};
use axum::middleware::Next;
use axum::response::Response;

use super::connections::Encrypted;

/// Data is no page: nothing of it runs, loads or stands in another page.
const DATA: &str = "default-src 'none'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";
/// The reference of the API and the list of errors have styles in their text; the former draws with pictures in its.
const DOCS: &str = "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data:; \
                    connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";
const HSTS: &str = "max-age=31536000";

/// Adds them to every answer. Pages with a policy of their own keep it.
pub async fn secure(request: Request, next: Next) -> Response {
    let encrypted = request.extensions().get::<Encrypted>().is_some();
    let policy = if request.uri().path().starts_with("/docs") { DOCS } else { DATA };
    let mut answer = next.run(request).await;
    let mut set = |name: HeaderName, value: &'static str| {
        answer.headers_mut().entry(name).or_insert(HeaderValue::from_static(value));
    };
    set(header::CONTENT_SECURITY_POLICY, policy);
    set(header::X_CONTENT_TYPE_OPTIONS, "nosniff");
    set(header::X_FRAME_OPTIONS, "DENY");
    set(header::REFERRER_POLICY, "no-referrer");
    if encrypted {
        set(header::STRICT_TRANSPORT_SECURITY, HSTS);
    }
    answer
}
