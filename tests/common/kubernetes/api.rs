//! The API server: Jobs and Pods of one namespace.

use std::net::{SocketAddr, TcpListener};
use std::sync::{Arc, Mutex, OnceLock};
use std::time::Duration;

use axum::Router;
use axum::body::Body;
use axum::extract::{Path, Query, Request, State as Held};
use axum::http::{HeaderMap, StatusCode, header};
use axum::middleware::{Next, from_fn};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use axum::serve::Listener;
use base64::Engine;
use k8s_openapi::api::batch::v1::Job;
use serde_json::{Value, json};
use tokio::net::TcpStream;
use tokio::runtime::Runtime;
use tokio::time::timeout;
use tokio_rustls::TlsAcceptor;
use tokio_rustls::rustls::ServerConfig;
use tokio_rustls::rustls::pki_types::PrivateKeyDer;
use tokio_rustls::server::TlsStream;

use super::{ADMINISTRATOR, NAMESPACE, State, TOKEN};

type Shared = Arc<Mutex<State>>;
type Parameters = std::collections::HashMap<String, String>;

/// How long a client may take to begin.
const PATIENCE: Duration = Duration::from_secs(5);

/// A certificate of its own, by which clients know the API server; kubectl shows no token without one.
pub struct Certificate {
    pub pem: String,
    acceptor: TlsAcceptor,
}

impl Certificate {
    pub fn make() -> Self {
        let made = rcgen::generate_simple_self_signed(["127.0.0.1".to_owned()]).unwrap();
        let key = PrivateKeyDer::try_from(made.signing_key.serialize_der()).unwrap();
        let provider = Arc::new(tokio_rustls::rustls::crypto::ring::default_provider());
        let config = ServerConfig::builder_with_provider(provider).with_safe_default_protocol_versions().unwrap();
        let config = config.with_no_client_auth().with_single_cert(vec![made.cert.der().clone()], key).unwrap();
        Self { pem: made.cert.pem(), acceptor: TlsAcceptor::from(Arc::new(config)) }
    }
}

struct Listening {
    listener: tokio::net::TcpListener,
    acceptor: TlsAcceptor,
}

impl Listener for Listening {
    type Io = TlsStream<TcpStream>;
    type Addr = SocketAddr;

    async fn accept(&mut self) -> (Self::Io, Self::Addr) {
        loop {
            let Ok((stream, address)) = self.listener.accept().await else { continue };
            if let Ok(Ok(stream)) = timeout(PATIENCE, self.acceptor.accept(stream)).await {
                return (stream, address);
            }
        }
    }

    fn local_addr(&self) -> std::io::Result<SocketAddr> {
        self.listener.local_addr()
    }
}

/// Serves until the runtime is dropped.
pub fn serve(listener: TcpListener, certificate: &Certificate, state: Shared) -> Runtime {
    let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(1).enable_all().build().unwrap();
    let jobs = format!("/apis/batch/v1/namespaces/{NAMESPACE}/jobs");
    let pods = format!("/api/v1/namespaces/{NAMESPACE}/pods");
    let router = Router::new()
        .route(&jobs, get(list_jobs).post(create))
        .route(&format!("{jobs}/{{name}}"), get(get_job).delete(delete_job))
        .route(&pods, get(list_pods))
        .route(&format!("{pods}/{{name}}"), get(get_pod).delete(delete_pod))
        .route("/version", get(async || axum::Json(json!({ "major": "1", "minor": "33", "gitVersion": "v1.33.0" }))))
        .route("/api", get(async || axum::Json(json!({ "kind": "APIVersions", "versions": ["v1"] }))))
        .route("/apis", get(groups))
        // An empty document in protobuf, by which kubectl knows of no schema; tests have others.
        .route("/openapi/v2", get(async || ""))
        .route("/api/v1", get(async || resources("v1")))
        .route("/apis/apps/v1", get(async || resources("apps/v1")))
        .route("/apis/batch/v1", get(async || resources("batch/v1")))
        .route("/apis/rbac.authorization.k8s.io/v1", get(async || resources("rbac.authorization.k8s.io/v1")))
        .fallback(keep)
        .with_state(state)
        .layer(from_fn(authenticate));
    listener.set_nonblocking(true).unwrap();
    let acceptor = certificate.acceptor.clone();
    runtime.spawn(async move {
        let listener = tokio::net::TcpListener::from_std(listener).unwrap();
        axum::serve(Listening { listener, acceptor }, router).await.unwrap();
    });
    runtime
}

/// Who asks, and whether they may.
async fn authenticate(request: Request, next: Next) -> Response {
    let given = request.headers().get(header::AUTHORIZATION).and_then(|value| value.to_str().ok());
    let token = given.and_then(|given| given.strip_prefix("Bearer ")).unwrap_or_default();
    let mut way = request.uri().path().split('/').skip_while(|part| *part != NAMESPACE).skip(1);
    let (resource, name) = (way.next().unwrap_or_default().to_owned(), way.next());
    let verb = match (request.method().as_str(), name) {
        ("GET", None) => "list",
        ("GET", Some(_)) => "get",
        ("POST", _) => "create",
        _ => "delete",
    };
    if token == ADMINISTRATOR || token == TOKEN && (resource.is_empty() || may(verb, &resource)) {
        next.run(request).await
    } else if token == TOKEN {
        let account = "system:serviceaccount:gridfall:gridfall";
        let what = format!("{resource} is forbidden: User {account:?} cannot {verb} resource {resource:?}");
        status(403, "Forbidden", &what)
    } else {
        status(401, "Unauthorized", "Unauthorized")
    }
}

/// Whether the Role that is given to users lets the server do this.
fn may(verb: &str, resource: &str) -> bool {
    static ROLE: OnceLock<Value> = OnceLock::new();
    let role = ROLE.get_or_init(|| {
        let file = concat!(env!("CARGO_MANIFEST_DIR"), "/deploy/kubernetes/rights.yaml");
        let documents: Vec<Value> = serde_saphyr::from_multiple(&std::fs::read_to_string(file).unwrap()).unwrap();
        documents.into_iter().find(|document| document["kind"] == "Role").unwrap()
    });
    let has = |list: &Value, what: &str| list.as_array().unwrap().iter().any(|one| one == what);
    role["rules"].as_array().unwrap().iter().any(|rule| has(&rule["verbs"], verb) && has(&rule["resources"], resource))
}

/// What the API server says where it does not do as it is told.
pub fn failure(code: u16, reason: &str, message: &str) -> Value {
    json!({ "kind": "Status", "apiVersion": "v1", "metadata": {}, "status": "Failure",
        "message": message, "reason": reason, "code": code })
}

fn status(code: u16, reason: &str, message: &str) -> Response {
    answer(code, &failure(code, reason, message))
}

fn answer(code: u16, body: &Value) -> Response {
    let json = [(header::CONTENT_TYPE, "application/json")];
    (StatusCode::from_u16(code).unwrap(), json, body.to_string()).into_response()
}

/// Kinds of objects, by their version; all but namespaces are in one.
const KINDS: [(&str, &str, &str); 11] = [
    ("v1", "namespaces", "Namespace"),
    ("v1", "configmaps", "ConfigMap"),
    ("v1", "persistentvolumeclaims", "PersistentVolumeClaim"),
    ("v1", "pods", "Pod"),
    ("v1", "secrets", "Secret"),
    ("v1", "serviceaccounts", "ServiceAccount"),
    ("v1", "services", "Service"),
    ("apps/v1", "deployments", "Deployment"),
    ("batch/v1", "jobs", "Job"),
    ("rbac.authorization.k8s.io/v1", "rolebindings", "RoleBinding"),
    ("rbac.authorization.k8s.io/v1", "roles", "Role"),
];

async fn groups() -> Response {
    let group = |name: &str| {
        let version = json!({ "groupVersion": format!("{name}/v1"), "version": "v1" });
        json!({ "name": name, "versions": [version], "preferredVersion": version })
    };
    let groups = ["apps", "batch", "rbac.authorization.k8s.io"].map(group);
    answer(200, &json!({ "kind": "APIGroupList", "apiVersion": "v1", "groups": groups }))
}

fn resources(version: &str) -> Response {
    let resource = |&(_, name, kind): &(&str, &str, &str)| {
        json!({ "name": name, "singularName": kind.to_lowercase(), "namespaced": kind != "Namespace", "kind": kind,
            "verbs": ["create", "delete", "get", "list"] })
    };
    let of: Vec<Value> = KINDS.iter().filter(|(of, ..)| *of == version).map(resource).collect();
    answer(200, &json!({ "kind": "APIResourceList", "apiVersion": "v1", "groupVersion": version, "resources": of }))
}

/// Objects that nothing happens to.
async fn keep(Held(state): Held<Shared>, request: Request) -> Response {
    let (parts, body) = request.into_parts();
    let body = axum::body::to_bytes(body, 1 << 20).await.unwrap();
    let (path, mut state) = (parts.uri.path().to_owned(), state.lock().unwrap());
    let is_here = path.contains(&format!("/namespaces/{NAMESPACE}")) || path == "/api/v1/namespaces";
    let known = is_here && KINDS.iter().any(|(_, plural, _)| path.split('/').any(|part| part == *plural));
    match (parts.method.as_str(), state.others.get(&path)) {
        ("GET", Some(object)) => answer(200, object),
        ("POST", _) if known => {
            let object: Value = serde_json::from_slice(&body).unwrap();
            let name = object["metadata"]["name"].as_str().unwrap().to_owned();
            for (key, value) in object["data"].as_object().filter(|_| object["kind"] == "Secret").into_iter().flatten()
            {
                let value = base64::engine::general_purpose::STANDARD.decode(value.as_str().unwrap()).unwrap();
                state.secrets.insert((name.clone(), key.clone()), String::from_utf8(value).unwrap());
            }
            state.others.insert(format!("{path}/{name}"), object.clone());
            answer(201, &object)
        }
        _ => status(404, "NotFound", "the server could not find the requested resource"),
    }
}

/// Whether the labels of an object are those that are asked for.
fn selected(object: &Value, selector: Option<&String>) -> bool {
    let wanted = selector.map(String::as_str).unwrap_or_default().split(',').filter_map(|one| one.split_once('='));
    wanted.into_iter().all(|(label, value)| object["metadata"]["labels"][label] == value)
}

/// A page of a list. It goes on after a name.
fn page(kind: &str, version: &str, objects: Vec<Value>, query: &Parameters) -> Response {
    let after = query.get("continue").cloned().unwrap_or_default();
    let name = |object: &Value| object["metadata"]["name"].as_str().unwrap().to_owned();
    let found = objects.into_iter().filter(|object| selected(object, query.get("labelSelector")));
    let mut found: Vec<Value> = found.filter(|object| name(object) > after).collect();
    // Pages of the tests are small.
    let limit = query.get("limit").and_then(|limit| limit.parse().ok()).unwrap_or(usize::MAX).min(3);
    let goes_on = found.len() > limit;
    found.truncate(limit);
    let next = found.last().filter(|_| goes_on).map(name);
    answer(
        200,
        &json!({ "kind": format!("{kind}List"), "apiVersion": version,
        "metadata": { "resourceVersion": "1", "continue": next.unwrap_or_default() }, "items": found }),
    )
}

async fn list_jobs(Held(state): Held<Shared>, Query(query): Query<Parameters>) -> Response {
    let mut state = state.lock().unwrap();
    state.lists.push(format!("jobs {}", query.get("labelSelector").cloned().unwrap_or_default()));
    page("Job", "batch/v1", state.jobs.values().cloned().collect(), &query)
}

async fn list_pods(Held(state): Held<Shared>, Query(query): Query<Parameters>) -> Response {
    let mut state = state.lock().unwrap();
    state.lists.push(format!("pods {}", query.get("labelSelector").cloned().unwrap_or_default()));
    page("Pod", "v1", state.pods.values().cloned().collect(), &query)
}

async fn get_job(Held(state): Held<Shared>, Path(name): Path<String>) -> Response {
    match state.lock().unwrap().jobs.get(&name) {
        Some(job) => answer(200, job),
        None => status(404, "NotFound", &format!("jobs.batch {name:?} not found")),
    }
}

async fn get_pod(Held(state): Held<Shared>, Path(name): Path<String>) -> Response {
    match state.lock().unwrap().pods.get(&name) {
        Some(pod) => answer(200, pod),
        None => status(404, "NotFound", &format!("pods {name:?} not found")),
    }
}

async fn create(Held(state): Held<Shared>, Query(query): Query<Parameters>, body: String) -> Response {
    let mut state = state.lock().unwrap();
    let dry = query.get("dryRun").is_some_and(|dry| dry == "All");
    let ordered = if dry { None } else { state.answers.pop_front() };
    if let Some(Some((code, body))) = &ordered {
        return answer(*code, body);
    }
    let job: Value = serde_json::from_str(&body).unwrap();
    let name = job["metadata"]["name"].as_str().unwrap_or_default().to_owned();
    if let Err(refusal) = valid(&job, query.get("fieldValidation").is_some_and(|how| how == "Strict")) {
        return refusal;
    }
    if state.jobs.contains_key(&name) {
        return status(409, "AlreadyExists", &format!("jobs.batch {name:?} already exists"));
    }
    if dry {
        return answer(201, &job);
    }
    state.submitted.push(job.clone());
    let made = state.make_job(job);
    if ordered.is_some() {
        // The connection breaks with the body.
        let broken = futures_util::stream::iter([Err::<&[u8], _>(std::io::Error::other("the test breaks it"))]);
        return Response::builder().status(201).body(Body::from_stream(broken)).unwrap();
    }
    answer(201, &made)
}

/// What the API server would say of a Job that it does not take.
fn valid(job: &Value, strictly: bool) -> Result<(), Response> {
    let bad =
        |what: String| status(400, "BadRequest", &format!("Job in version \"v1\" cannot be handled as a Job: {what}"));
    let typed: Job = serde_json::from_value(job.clone()).map_err(|error| bad(error.to_string()))?;
    let known = serde_json::to_value(typed).unwrap();
    if strictly && let Some(field) = lost(job, &known, "") {
        return Err(bad(format!("strict decoding error: unknown field {field:?}")));
    }
    let invalid = |field: &str, what: &str| {
        let name = &job["metadata"]["name"];
        Err(status(422, "Invalid", &format!("Job.batch {name} is invalid: {field}: {what}")))
    };
    let name = job["metadata"]["name"].as_str().unwrap_or_default();
    if name.is_empty()
        || name.len() > 63
        || !name.bytes().all(|b| b.is_ascii_lowercase() || b.is_ascii_digit() || b == b'-')
    {
        return invalid("metadata.name", "must be a lowercase RFC 1123 label");
    }
    let pod = &job["spec"]["template"]["spec"];
    if !["Never", "OnFailure"].contains(&pod["restartPolicy"].as_str().unwrap_or_default()) {
        return invalid("spec.template.spec.restartPolicy", "Required value: valid values: \"OnFailure\", \"Never\"");
    }
    let labels = job["metadata"]["labels"].as_object().cloned().unwrap_or_default();
    let fits = |value: &Value| value.as_str().is_some_and(|value| value.len() <= 63);
    if !labels.values().all(fits) {
        return invalid("metadata.labels", "must be no more than 63 characters");
    }
    for container in pod["containers"].as_array().into_iter().flatten() {
        let mounts = container["volumeMounts"].as_array().cloned().unwrap_or_default();
        let volumes = pod["volumes"].as_array().cloned().unwrap_or_default();
        if !mounts.iter().all(|mount| volumes.iter().any(|volume| volume["name"] == mount["name"])) {
            return invalid("spec.template.spec.containers[0].volumeMounts[0].name", "Not found");
        }
    }
    Ok(())
}

/// A field that is not in what was made of a document.
fn lost(given: &Value, known: &Value, at: &str) -> Option<String> {
    match (given, known) {
        (Value::Object(given), Value::Object(known)) => given.iter().find_map(|(name, value)| {
            let at = if at.is_empty() { name.clone() } else { format!("{at}.{name}") };
            match known.get(name) {
                Some(known) => lost(value, known, &at),
                None => Some(at),
            }
        }),
        (Value::Array(given), Value::Array(known)) => {
            let both = given.iter().zip(known).enumerate();
            both.into_iter().find_map(|(i, (given, known))| lost(given, known, &format!("{at}[{i}]")))
        }
        _ => None,
    }
}

async fn delete_job(
    Held(state): Held<Shared>,
    Path(name): Path<String>,
    Query(query): Query<Parameters>,
    _: HeaderMap,
    body: String,
) -> Response {
    let mut state = state.lock().unwrap();
    let options: Value = serde_json::from_str(&body).unwrap_or_default();
    let Some(job) = state.jobs.get(&name).cloned() else {
        return status(404, "NotFound", &format!("jobs.batch {name:?} not found"));
    };
    if let Some(uid) = options.pointer("/preconditions/uid")
        && *uid != job["metadata"]["uid"]
    {
        return status(409, "Conflict", "Precondition failed: UID in precondition");
    }
    let by_query = query.get("propagationPolicy").map(String::as_str);
    let policy = options["propagationPolicy"].as_str().or(by_query).unwrap_or("Background").to_owned();
    state.delete_job(&name, policy == "Foreground");
    answer(200, &json!({ "kind": "Status", "apiVersion": "v1", "metadata": {}, "status": "Success" }))
}

async fn delete_pod(Held(state): Held<Shared>, Path(name): Path<String>) -> Response {
    let mut state = state.lock().unwrap();
    if !state.pods.contains_key(&name) {
        return status(404, "NotFound", &format!("pods {name:?} not found"));
    }
    state.delete_pod(&name);
    answer(200, &state.pods[&name])
}
