//! The whole API on one page. A handler's attribute holds its path, so that the routes and the
//! document cannot differ.

use axum::extract::DefaultBodyLimit;
use axum::{Router, middleware};
use tower_http::catch_panic::CatchPanicLayer;
use utoipa::OpenApi;
use utoipa::openapi::OpenApi as Document;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use super::openapi::{self, Description};
use super::state::Api;
use super::{
    assets, audit, auth, colliders, cors, dashboard, devices, docs, encoding, events, exports, frames, groups, guard,
    headers, health, index, jobs, laboratory, layers, library, links, live, load, materials, metrics, outputs,
    pictures, scenes, session, surfaces, sweeps, usage, webhooks,
};

/// All routes of the API, and their OpenAPI document.
pub(super) fn routes() -> (Router<Api>, Document) {
    let api = OpenApiRouter::with_openapi(Description::openapi())
        // /v1/jobs
        .routes(routes!(jobs::submit, jobs::list))
        // /v1/jobs/{id}
        .routes(routes!(jobs::get, jobs::delete))
        // /v1/jobs/{id}/scene
        .routes(routes!(jobs::scene))
        // /v1/jobs/{id}/events, /v1/jobs/{id}/log
        .routes(routes!(events::events))
        .routes(routes!(events::log))
        // /v1/jobs/{id}/cancel, /v1/jobs/{id}/rerun
        .routes(routes!(jobs::cancel))
        .routes(routes!(jobs::rerun))
        // /v1/jobs:cancel, /v1/jobs:delete
        .routes(routes!(groups::cancel_jobs))
        .routes(routes!(groups::delete_jobs))
        // /v1/sweeps, /v1/sweeps:validate, /v1/sweeps/{id}
        .routes(routes!(sweeps::submit_sweep, sweeps::list_sweeps))
        .routes(routes!(sweeps::validate_sweep))
        .routes(routes!(sweeps::get_sweep))
        // /v1/sweeps/{id}/results, /v1/sweeps/{id}/cancel
        .routes(routes!(sweeps::results))
        .routes(routes!(sweeps::cancel_sweep))
        // /v1/jobs/{id}/diagnostics, /v1/jobs/{id}/diagnostics.csv
        .routes(routes!(outputs::diagnostics))
        .routes(routes!(outputs::diagnostics_csv))
        // /v1/jobs/{id}/solver, /v1/jobs/{id}/solver.csv
        .routes(routes!(outputs::solver))
        .routes(routes!(outputs::solver_csv))
        // /v1/jobs/{id}/recording.mcap, recording-so-far.mcap, thumbnail.png, state.npz
        .routes(routes!(outputs::recording))
        .routes(routes!(outputs::recording_so_far))
        .routes(routes!(outputs::thumbnail))
        .routes(routes!(outputs::state))
        // /v1/jobs/{id}/frames, /v1/jobs/{id}/frames/{frame}/points
        .routes(routes!(frames::list))
        .routes(routes!(frames::points))
        // /v1/jobs/{id}/frames/{frame}/colliders
        .routes(routes!(colliders::colliders))
        // /v1/jobs/{id}/frames/{frame}/export, /v1/jobs/{id}/frames/{frame}/surface
        .routes(routes!(exports::export))
        .routes(routes!(surfaces::surface))
        // /v1/jobs/{id}/frames/{frame}/picture.png
        .routes(routes!(pictures::picture))
        // /v1/jobs/{id}/links
        .routes(routes!(links::links))
        // /v1/jobs/{id}/live
        .routes(routes!(live::live))
        // /v1/scenes:validate
        .routes(routes!(scenes::validate))
        // /v1/scenes, /v1/scenes/{id}
        .routes(routes!(scenes::keep, scenes::keep_of_recording, scenes::list))
        .routes(routes!(scenes::get))
        // /v1/library, /v1/library/{name}
        .routes(routes!(library::list))
        .routes(routes!(library::get))
        // /v1/materials, /v1/materials/{name}, /v1/materials/test
        .routes(routes!(materials::list))
        .routes(routes!(materials::get))
        .routes(routes!(laboratory::test))
        // /v1/assets, /v1/assets/{id}
        .routes(routes!(assets::put, assets::list))
        .routes(routes!(assets::get))
        // /v1/webhooks, /v1/webhooks/{id}, /v1/webhooks/{id}/test
        .routes(routes!(webhooks::add, webhooks::list))
        .routes(routes!(webhooks::get, webhooks::delete))
        .routes(routes!(webhooks::test))
        // /v1/webhooks/{id}/deliveries, /v1/webhooks/{id}/deliveries/{delivery}/retry
        .routes(routes!(webhooks::deliveries))
        .routes(routes!(webhooks::retry))
        // /v1/devices
        .routes(routes!(devices::list))
        // /v1/session, /v1/usage
        .routes(routes!(session::get, session::put, session::delete))
        .routes(routes!(usage::get))
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

/// The API, ready to serve. The layers from the inside out.
pub fn router(api: Api) -> Router {
    routes()
        .0
        // /docs, /docs/errors
        .merge(docs::routes())
        // /dashboard/{file}
        .merge(dashboard::routes())
        .fallback(layers::route_not_found)
        .method_not_allowed_fallback(layers::method_not_allowed)
        .layer(CatchPanicLayer::custom(layers::panicked))
        .layer(middleware::from_fn(encoding::decode))
        .layer(middleware::from_fn_with_state(api.clone(), auth::authorize))
        .layer(middleware::from_fn_with_state(api.clone(), layers::bound_time))
        .layer(middleware::from_fn_with_state(api.clone(), guard::guard))
        .layer(middleware::from_fn_with_state(api.clone(), load::shed))
        .layer(middleware::from_fn(encoding::encode))
        .layer(middleware::from_fn_with_state(api.clone(), cors::cors))
        .layer(middleware::from_fn_with_state(api.clone(), audit::audit))
        .layer(middleware::from_fn(headers::secure))
        .layer(middleware::from_fn_with_state(api.clone(), layers::observe))
        .layer(DefaultBodyLimit::max(api.config.max_body_bytes))
        .with_state(api)
}
