//! The whole API on one page. A handler's attribute holds its path, so that the routes and the
//! document cannot differ.

use axum::extract::DefaultBodyLimit;
use axum::http::{HeaderName, Method, header};
use axum::{Router, middleware};
use tower_http::catch_panic::CatchPanicLayer;
use tower_http::cors::{Any, CorsLayer};
use utoipa::OpenApi;
use utoipa::openapi::OpenApi as Document;
use utoipa_axum::router::{OpenApiRouter, UtoipaMethodRouter};
use utoipa_axum::routes;

use super::openapi::{self, Description};
use super::state::Api;
use super::{assets, health, index, jobs, layers, metrics, outputs, scenes};

/// All routes of the API, and their OpenAPI document.
pub(super) fn routes() -> (Router<Api>, Document) {
    let api = OpenApiRouter::with_openapi(Description::openapi())
        // /v1/jobs
        .routes(routes!(jobs::submit, jobs::list))
        // /v1/jobs/{id}
        .routes(routes!(jobs::get, jobs::delete))
        // /v1/jobs/{id}/cancel
        .routes(routes!(jobs::cancel))
        // /v1/jobs/{id}/diagnostics
        .routes(routes!(outputs::diagnostics))
        // /v1/jobs/{id}/recording.mcap, /v1/jobs/{id}/thumbnail.png
        .routes(for_viewers(routes!(outputs::recording)))
        .routes(for_viewers(routes!(outputs::thumbnail)))
        // /v1/scenes:validate
        .routes(routes!(scenes::validate))
        // /v1/assets, /v1/assets/{id}
        .routes(routes!(assets::put, assets::list))
        .routes(routes!(assets::get))
        // /v1/schema/scene
        .routes(routes!(scenes::schema))
        // /livez, /readyz, /metrics
        .routes(routes!(health::livez))
        .routes(routes!(health::readyz))
        .routes(routes!(metrics::metrics))
        // /, /openapi.json
        .routes(routes!(index::index))
        .routes(routes!(openapi::openapi));
    let (router, mut document) = api.split_for_parts();
    openapi::complete(&mut document);
    (router, document)
}

/// The API, ready to serve.
pub fn router(api: Api) -> Router {
    routes()
        .0
        .fallback(layers::route_not_found)
        .method_not_allowed_fallback(layers::method_not_allowed)
        .layer(CatchPanicLayer::custom(layers::panicked))
        .layer(middleware::from_fn_with_state(api.clone(), layers::bound_time))
        .layer(middleware::from_fn_with_state(api.clone(), layers::observe))
        .layer(DefaultBodyLimit::max(api.config.max_body_bytes))
        .with_state(api)
}

/// Lets pages from any origin read what viewers show, by ranges. The rest of the API is closed to
/// scripts of other origins.
fn for_viewers((schemas, paths, route): UtoipaMethodRouter<Api>) -> UtoipaMethodRouter<Api> {
    // The fallback must be inside the layer, because browsers' preflight requests would reach it.
    (schemas, paths, route.fallback(layers::method_not_allowed).layer(viewers_cors()))
}

fn viewers_cors() -> CorsLayer {
    CorsLayer::new()
        .allow_origin(Any)
        .allow_methods([Method::GET, Method::HEAD])
        .allow_headers([header::RANGE, header::IF_RANGE, header::IF_NONE_MATCH, header::CACHE_CONTROL])
        .expose_headers(EXPOSED)
        // Browsers ask before a public page may read from a private address, such as the user's own
        // machine.
        .allow_private_network(true)
}

const EXPOSED: [HeaderName; 5] =
    [header::ACCEPT_RANGES, header::CONTENT_LENGTH, header::CONTENT_RANGE, header::ETAG, header::CONTENT_DISPOSITION];
