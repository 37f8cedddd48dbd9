//! What the document gets after it was derived: schemas that are not those of Rust types, and forms
//! that generators of clients take as they are meant.

use serde_json::{Map, Value, json};

use super::super::auth::needed;
use super::super::caller::COOKIE;
use super::super::problem::Code;
use super::rows;
use crate::store::{EventType, Scope};
use gridfall_scene as scene;

/// The document, ready for clients.
pub fn finish(mut document: Value) -> Value {
    document["components"]["securitySchemes"] = json!({
        "key": {
            "type": "http",
            "scheme": "bearer",
            "description": "A key (`gf_…`), as `gridfall keys create` shows it once.",
        },
        "cookie": {
            "type": "apiKey",
            "in": "cookie",
            "name": COOKIE,
            "description": "The same, as browsers have it that have signed in (`PUT /v1/session`).",
        },
    });
    document["security"] = asked(None);
    document["servers"] = json!([{
        "url": "http://{address}",
        "description": "A server, by default on this machine",
        "variables": { "address": { "default": "127.0.0.1:8080", "description": "Host and port" } },
    }]);
    let components = document["components"]["schemas"].as_object_mut().expect("the document has schemas");
    components.remove("Bytes");
    let example: Value = serde_json::from_str(include_str!("../../../../api/examples/submit-job.json")).expect("JSON");
    components["SubmitJob"]["examples"] = json!([example]);
    components.insert("Code".into(), code());
    components.insert("FrameRow".into(), rows::frame());
    components.insert("StepRow".into(), rows::step());
    for (name, component) in scene::contract::components() {
        let replaced = components.insert(name.clone(), component);
        assert!(replaced.is_none() || ["Material", "Scene"].contains(&name.as_str()), "two schemas are called {name}");
    }
    for (_, request) in components.iter_mut().filter(|(name, _)| REQUESTS.contains(&name.as_str())) {
        members(&mut request["properties"]).for_each(left_out);
    }
    for (path, item) in document["paths"].as_object_mut().into_iter().flatten() {
        for (method, operation) in item.as_object_mut().into_iter().flatten() {
            operation["security"] = match needed(method, path) {
                None => json!([]),
                scope => asked(scope),
            };
            let parameters = operation.get_mut("parameters").and_then(Value::as_array_mut);
            parameters.into_iter().flatten().for_each(|parameter| not_null(&mut parameter["schema"]));
        }
    }
    link(&mut document);
    document["webhooks"] = messages();
    mend(&mut document);
    document
}

/// What an operation asks of its callers: a key of a scope, unless the server asks nobody.
fn asked(scope: Option<Scope>) -> Value {
    let scopes: Vec<&str> = scope.iter().map(|scope| scope.as_str()).collect();
    json!([{}, { "key": scopes }, { "cookie": scopes }])
}

fn members(value: &mut Value) -> impl Iterator<Item = &mut Value> {
    value.as_object_mut().into_iter().flat_map(Map::values_mut)
}

/// What clients send.
const REQUESTS: &[&str] =
    &["SubmitJob", "RerunJob", "SubmitSweep", "JobFilter", "KeepScene", "SignIn", "TestMaterial", "AddWebhook"];

/// What answers lead to: where in them the id is that other operations take.
const LINKS: &[(&str, &str, &str, &str, &[&str])] = &[
    ("/v1/jobs", "post", "202", "$response.body#/id", OF_NEW_JOB),
    ("/v1/jobs", "get", "200", "$response.body#/jobs/0/id", OF_JOB),
    ("/v1/jobs/{id}/cancel", "post", "202", "$response.body#/id", OF_NEW_JOB),
    ("/v1/sweeps", "post", "202", "$response.body#/id", OF_SWEEP),
    ("/v1/sweeps", "get", "200", "$response.body#/sweeps/0/id", OF_SWEEP),
    ("/v1/webhooks", "post", "201", "$response.body#/id", OF_WEBHOOK),
    ("/v1/scenes", "post", "201", "$response.body#/id", &["get_scene"]),
    ("/v1/materials", "get", "200", "$response.body#/materials/0/name", &["get_material"]),
    ("/v1/assets", "put", "200", "$response.body#/id", &["get_asset"]),
    ("/v1/assets", "put", "201", "$response.body#/id", &["get_asset"]),
    ("/v1/assets", "get", "200", "$response.body#/assets/0/id", &["get_asset"]),
];

const OF_WEBHOOK: &[&str] = &["get_webhook", "delete_webhook", "test_webhook", "list_deliveries"];

const OF_SWEEP: &[&str] = &["get_sweep", "get_sweep_results", "cancel_sweep"];

/// What a job has from the start. Its outputs come later, or never.
const OF_NEW_JOB: &[&str] = &["get_job", "cancel_job", "delete_job", "get_job_scene"];

const OF_JOB: &[&str] = &[
    "get_job",
    "cancel_job",
    "delete_job",
    "get_recording",
    "get_thumbnail",
    "get_state",
    "get_diagnostics",
    "get_diagnostics_csv",
    "get_solver",
    "get_solver_csv",
    "get_job_scene",
    "list_frames",
];

fn link(document: &mut Value) {
    for (path, method, status, id, operations) in LINKS {
        let parameter = if id.ends_with("/name") { "name" } else { "id" };
        let to = |name: &&str| ((*name).to_owned(), json!({ "operationId": name, "parameters": { parameter: id } }));
        document["paths"][path][method]["responses"][status]["links"] = operations.iter().map(to).collect();
    }
}

/// What the server sends to webhooks, by the type of the event.
fn messages() -> Value {
    let header = |name: &str, description: &str| {
        let schema = json!({ "type": "string" });
        json!({ "name": name, "in": "header", "required": true, "description": description, "schema": schema })
    };
    let message = |event: EventType| {
        let (body, summary) = match event {
            EventType::JobQueued => ("JobEvent", "A job waits, for the first time or again"),
            EventType::JobStarted => ("JobEvent", "An attempt of a job has begun"),
            EventType::JobSucceeded => ("JobEvent", "A job has run to its end"),
            EventType::JobFailed => ("JobEvent", "A job has failed; `data.failure` says why"),
            EventType::JobCanceled => ("JobEvent", "A job was canceled"),
            EventType::SweepFinished => ("SweepEvent", "All jobs of a sweep have ended"),
            EventType::WebhookTest => ("TestEvent", "Somebody asked for a test"),
        };
        let schema = json!({ "$ref": format!("#/components/schemas/{body}") });
        let operation = json!({
            "tags": ["webhooks"],
            "operationId": format!("on_{}", event.as_str().replace('.', "_")),
            "summary": summary,
            // Makers of clients leave out what has this mark, and otherwise make calls of it that clients never send.
            "x-internal": true,
            "parameters": [
                header("webhook-id", "The same each time that a message is sent"),
                header("webhook-timestamp", "When it is sent (s since 1970)"),
                header("webhook-signature", "`v1,` and HMAC-SHA256 of id, timestamp and body (Standard Webhooks)"),
            ],
            "requestBody": { "required": true, "content": { "application/json": { "schema": schema } } },
            "responses": {
                "2XX": { "description": "It has arrived; anything but this and 410 makes the server send it again" },
                "410": { "description": "Nothing more is wanted: the webhook is disabled" },
            },
        });
        (event.as_str().to_owned(), json!({ "post": operation }))
    };
    EventType::ALL.into_iter().map(message).collect()
}

/// A text, not a choice: clients would break when a code is added.
fn code() -> Value {
    let known: Vec<String> = Code::ALL.iter().map(|code| format!("`{}`", code.as_str())).collect();
    json!({
        "type": "string",
        "description": format!(
            "What went wrong, for programs. Codes are stable; new ones may come. Known are {}.", known.join(", ")
        ),
        "examples": [Code::JobNotFound.as_str()],
    })
}

/// What is left out of a query or the headers is not null.
fn not_null(schema: &mut Value) {
    if let Some([kind, null]) = schema["type"].as_array().map(Vec::as_slice)
        && null == "null"
    {
        schema["type"] = kind.clone();
    }
}

/// What is left out of a request has no default, and clients have no need of a null scene.
fn left_out(schema: &mut Value) {
    if let Some(members) = schema.as_object_mut() {
        members.retain(|name, value| name != "default" || !value.is_null());
    }
    if let Some([value, null]) = schema["oneOf"].as_array().map(Vec::as_slice)
        && null["type"] == "null"
    {
        *schema = value.clone();
    }
}

/// Writes out bytes of files, says nothing of the form of streams, and that objects without members may have any.
fn mend(node: &mut Value) {
    if node["$ref"] == "#/components/schemas/Bytes" {
        *node = json!({ "type": "string", "format": "binary" });
    }
    // A stream is not one value.
    if let Some(stream) = node.get_mut("text/event-stream") {
        *stream = json!({});
    }
    if node["type"] == "object" && ["properties", "additionalProperties"].iter().all(|name| node[*name].is_null()) {
        node["additionalProperties"] = true.into();
    }
    match node {
        Value::Object(members) => members.values_mut().for_each(mend),
        Value::Array(items) => items.iter_mut().for_each(mend),
        _ => {}
    }
}
