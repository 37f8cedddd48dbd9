//! The API's OpenAPI 3.1 document, generated from the handlers.

mod finish;
mod rows;

use std::collections::BTreeMap;
use std::sync::LazyLock;

use axum::Json;
use serde_json::Value;
use utoipa::OpenApi;
use utoipa::openapi::path::{Operation, ParameterIn};
use utoipa::openapi::response::{Response, ResponseBuilder};
use utoipa::openapi::{ContentBuilder, OpenApi as Document, Ref, RefOr};

use super::auth::needed;
use super::webhooks::payload::{JobEvent, SweepEvent, TestEvent};
use super::{dto, router};
use crate::store::Scope;

/// Media type of errors.
pub const PROBLEM: &str = "application/problem+json";

/// What the document says about the API as a whole.
#[derive(OpenApi)]
#[openapi(
    info(
        title = "Gridfall",
        description = "Submit material point method (MPM) scenes as jobs, watch them, \
            and download their recordings.\n\n\
            Every error is an RFC 9457 problem with a stable `code`; \
            clients should go by it and ignore members and codes they do not know.\n\n\
            A server without keys asks nobody for one, and listens to its own machine only, unless it was told \
            otherwise. One with keys asks for them everywhere but where `security` is empty; the scope that an \
            operation needs stands in its `security`. What belongs to another key is answered as what is not there.",
        license(name = "MIT OR Apache-2.0", identifier = "MIT OR Apache-2.0"),
    ),
    components(schemas(dto::Problem, JobEvent, SweepEvent, TestEvent)),
    tags(
        (name = "jobs", description = "Scenes to be run, running and run"),
        (name = "sweeps", description = "Scenes to be run with many values"),
        (name = "outputs", description = "What jobs produce"),
        (name = "scenes", description = "What can be run"),
        (name = "webhooks", description = "Who is told of what happens to jobs"),
        (name = "assets", description = "Files that scenes name"),
        (name = "keys", description = "Who asks, and what it has used"),
        (name = "health", description = "For operators"),
        (name = "meta", description = "The API itself"),
    ),
)]
pub(super) struct Description;

/// The complete document.
pub fn document() -> &'static Value {
    static DOCUMENT: LazyLock<Value> = LazyLock::new(|| {
        let described = router::routes().1;
        finish::finish(serde_json::to_value(described).expect("the document is plain data"))
    });
    &DOCUMENT
}

/// The document as stored in `api/openapi.json`.
pub fn document_json() -> String {
    serde_json::to_string_pretty(document()).expect("the document is plain data") + "\n"
}

/// This document.
#[utoipa::path(get, path = "/openapi.json", tag = "meta", operation_id = "get_openapi",
    responses((status = 200, body = Object)))]
pub async fn openapi() -> Json<&'static Value> {
    Json(document())
}

/// Adds to each operation the problems that follow from its form, and descriptions where handlers
/// gave none.
pub(super) fn complete(document: &mut Document) {
    for (path, item) in &mut document.paths.paths {
        let operations =
            [(&mut item.get, "get"), (&mut item.post, "post"), (&mut item.put, "put"), (&mut item.delete, "delete")];
        for (operation, method) in operations.into_iter().filter_map(|(slot, method)| slot.as_mut().zip(Some(method))) {
            for (status, codes) in common_problems(path, operation, method) {
                operation.responses.responses.entry(status.to_owned()).or_insert_with(|| problem(&codes));
            }
            for response in operation.responses.responses.values_mut() {
                if let RefOr::T(response) = response
                    && response.description.is_empty()
                {
                    response.description = "Done".to_owned();
                }
            }
        }
    }
}

/// Codes by status that any operation of this form may answer with.
fn common_problems(path: &str, operation: &Operation, method: &str) -> BTreeMap<&'static str, Vec<&'static str>> {
    let takes = |kind: ParameterIn| {
        let mut parameters = operation.parameters.iter().flatten();
        parameters.any(|parameter| matches!(parameter, RefOr::T(parameter) if parameter.parameter_in == kind))
    };
    let mut problems = BTreeMap::from([("500", vec!["internal"]), ("503", vec!["overloaded"])]);
    let assets = path.starts_with("/v1/assets");
    let mut add = |status, codes: &[&'static str]| problems.entry(status).or_insert_with(Vec::new).extend(codes);
    if takes(ParameterIn::Path) {
        add("400", &["invalid_path"]);
        add(
            "404",
            match path {
                _ if assets => &["asset_not_found"],
                _ if ["/v1/scenes", "/v1/library"].iter().any(|of| path.starts_with(of)) => &["scene_not_found"],
                _ if path.starts_with("/v1/webhooks") => &["webhook_not_found"],
                _ if path.starts_with("/v1/materials") => &["material_not_found"],
                _ => &["job_not_found"],
            },
        );
    }
    if takes(ParameterIn::Query) {
        add("400", &["invalid_query"]);
    }
    let scope = needed(method, path);
    if scope.is_some() {
        add("401", &["key_required", "key_refused"]);
    }
    if scope > Some(Scope::Read) {
        add("403", &["insufficient_scope"]);
    }
    if method != "get" {
        add("403", &["foreign_origin", "unknown_host"]);
    }
    if matches!(
        operation.operation_id.as_deref(),
        Some(
            "submit_job"
                | "rerun_job"
                | "submit_sweep"
                | "validate_sweep"
                | "validate_scene"
                | "keep_scene"
                | "keep_scene_of_recording"
                | "upload_asset"
        )
    ) {
        add("403", &["quota_exceeded"]);
    }
    if operation.request_body.is_some() {
        add("415", &["unsupported_encoding"]);
        add("408", &["request_timeout"]);
        add("413", &["body_too_large"]);
    }
    if operation.request_body.is_some() && assets {
        add("400", &["invalid_body"]);
    } else if operation.request_body.is_some() {
        add("400", &["invalid_json", "invalid_body"]);
        add("415", &["unsupported_media_type"]);
        add("422", &["invalid_scene"]);
    }
    problems
}

fn problem(codes: &[&str]) -> RefOr<Response> {
    let codes: Vec<String> = codes.iter().map(|code| format!("`{code}`")).collect();
    let schema = RefOr::Ref(Ref::from_schema_name("Problem"));
    let content = ContentBuilder::new().schema(Some(schema)).build();
    RefOr::T(ResponseBuilder::new().description(codes.join(", ")).content(PROBLEM, content).build())
}
