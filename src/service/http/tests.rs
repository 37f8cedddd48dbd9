//! Tests that each limit on clients takes effect, on the real router and on real connections.

use std::sync::Arc;
use std::time::Duration;

use axum::Router;
use axum::body::{Body, to_bytes};
use axum::http::{Request, header};
use serde_json::{Value, json};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::{TcpListener, TcpStream};
use tokio_rustls::TlsConnector;
use tokio_rustls::rustls::crypto::ring;
use tokio_rustls::rustls::{ClientConfig, RootCertStore};
use tokio_util::io::ReaderStream;
use tower::ServiceExt;

use super::tls::Tls;
use super::{Api, Certificate, Config, connections, router};
use crate::jobs;
use crate::store::{DataDir, JobStore};

/// The API over a fresh store; no worker takes jobs.
async fn api(config: Config) -> (tempfile::TempDir, Api) {
    let dir = tempfile::tempdir().unwrap();
    let data = Arc::new(DataDir::open(dir.path()).unwrap());
    let store = JobStore::open(&data.database()).await.unwrap();
    (dir, Api::new(store, data, Arc::new(jobs::Shared::new(1, Duration::ZERO)), config))
}

/// Status, `Retry-After` and body.
async fn post(app: &Router, path: &str, body: Body) -> (u16, Option<String>, Value) {
    let request = Request::post(path).header(header::CONTENT_TYPE, "application/json").body(body).unwrap();
    let response = app.clone().oneshot(request).await.unwrap();
    let retry_after = response.headers().get(header::RETRY_AFTER).map(|value| value.to_str().unwrap().to_owned());
    let status = response.status().as_u16();
    let bytes = to_bytes(response.into_body(), 1 << 20).await.unwrap();
    (status, retry_after, serde_json::from_slice(&bytes).unwrap())
}

/// The body of a submission.
fn request() -> Body {
    let scene: Value = serde_json::from_str(include_str!("../../../scenes/quickstart.json")).unwrap();
    json!({ "scene": scene }).to_string().into()
}

#[tokio::test]
async fn the_queue_has_an_end() {
    let (_dir, api) = api(Config { max_queued: 2, ..Config::default() }).await;
    let app = router(api);
    let submit = || post(&app, "/v1/jobs", request());
    assert_eq!((submit().await.0, submit().await.0), (202, 202));
    let (status, retry_after, body) = submit().await;
    assert_eq!((status, &body["code"]), (429, &json!("queue_full")));
    assert!(retry_after.is_some());
}

#[tokio::test]
async fn a_body_that_does_not_come_is_not_waited_for() {
    let (_dir, api) = api(Config { body_timeout: Duration::from_millis(50), ..Config::default() }).await;
    let (never, _held) = tokio::io::duplex(64);
    let (status, _, body) = post(&router(api), "/v1/jobs", Body::from_stream(ReaderStream::new(never))).await;
    assert_eq!((status, &body["code"]), (408, &json!("request_timeout")));
}

#[tokio::test]
async fn a_body_without_end_is_cut_off() {
    let (_dir, api) = api(Config { max_body_bytes: 100, ..Config::default() }).await;
    let endless = Body::from_stream(ReaderStream::new(tokio::io::repeat(b' ')));
    let (status, _, body) = post(&router(api), "/v1/jobs", endless).await;
    assert_eq!((status, &body["code"]), (413, &json!("body_too_large")));
}

#[tokio::test]
async fn scenes_are_judged_a_bounded_number_at_a_time() {
    let config = Config { max_validations: 1, validation_wait: Duration::from_millis(50), ..Config::default() };
    let (_dir, api) = api(config).await;
    let held = api.validations.clone().acquire_owned().await.unwrap();
    let app = router(api);
    let (status, retry_after, body) = post(&app, "/v1/scenes:validate", request()).await;
    assert_eq!((status, &body["code"]), (503, &json!("overloaded")));
    assert!(retry_after.is_some());
    drop(held);
    assert_eq!(post(&app, "/v1/scenes:validate", request()).await.0, 200);
}

#[tokio::test]
async fn a_request_that_takes_too_long_is_given_up() {
    let config = Config {
        max_validations: 1,
        handler_timeout: Duration::from_millis(50),
        validation_wait: Duration::from_secs(3600),
        ..Config::default()
    };
    let (_dir, api) = api(config).await;
    let _held = api.validations.clone().acquire_owned().await.unwrap();
    let (status, retry_after, body) = post(&router(api), "/v1/scenes:validate", request()).await;
    assert_eq!((status, &body["code"]), (503, &json!("overloaded")));
    assert!(retry_after.is_some());
}

#[tokio::test]
async fn readiness_says_what_is_missing() {
    let (_dir, api) = api(Config::default()).await;
    let store = api.store.clone();
    let app = router(api);
    let ready = || get_json(app.clone(), "/readyz");
    let failing = |body: &Value| -> Vec<String> {
        let checks = body["checks"].as_array().unwrap();
        let failing = checks.iter().filter(|check| check["ok"] == false);
        failing.map(|check| check["name"].as_str().unwrap().to_owned()).collect()
    };
    let (status, body) = ready().await;
    assert_eq!((status, &body["code"], failing(&body)), (503, &json!("not_ready"), vec!["device".to_owned()]));
    store.close().await;
    let (status, body) = ready().await;
    assert_eq!((status, failing(&body)), (503, vec!["store".to_owned(), "device".to_owned()]));
    let (status, body) = get_json(app.clone(), "/livez").await;
    assert_eq!((status, &body["status"]), (200, &json!("live")), "liveness touches nothing");
    let (status, body) = get_json(app, "/v1/jobs").await;
    assert_eq!((status, &body["code"]), (503, &json!("database_away")));
}

async fn get_json(app: Router, path: &str) -> (u16, Value) {
    let response = app.oneshot(Request::get(path).body(Body::empty()).unwrap()).await.unwrap();
    let status = response.status().as_u16();
    let bytes = to_bytes(response.into_body(), 1 << 20).await.unwrap();
    (status, serde_json::from_slice(&bytes).unwrap())
}

#[tokio::test]
async fn a_full_disk_is_said_before_jobs_meet_it() {
    let (_dir, api) = api(Config { min_free_bytes: u64::MAX, ..Config::default() }).await;
    let app = router(api);
    let (status, retry_after, body) = post(&app, "/v1/jobs", request()).await;
    assert_eq!((status, &body["code"]), (507, &json!("disk_low")));
    assert!(retry_after.is_some() && body["detail"].as_str().unwrap().contains("--min-free-bytes"), "{body:#}");
    let (status, body) = get_json(app, "/readyz").await;
    assert_eq!(status, 503);
    assert!(body["detail"].as_str().unwrap().contains("disk: "), "{body:#}");
}

#[tokio::test]
async fn load_is_shed_and_what_helps_out_of_it_passes() {
    let (_dir, api) = api(Config { max_in_flight: 1, ..Config::default() }).await;
    let held = api.in_flight.clone().acquire_owned().await.unwrap();
    let app = router(api);
    let (status, retry_after, body) = post(&app, "/v1/jobs", request()).await;
    assert_eq!((status, &body["code"]), (503, &json!("overloaded")));
    assert!(retry_after.is_some());
    assert_eq!(get_json(app.clone(), "/livez").await.0, 200);
    assert_eq!(get_json(app.clone(), "/readyz").await.1["code"], "not_ready");
    let cancel = "/v1/jobs/01890000-0000-7000-8000-000000000000/cancel";
    assert_eq!(post(&app, cancel, Body::empty()).await.2["code"], "job_not_found");
    drop(held);
    assert_eq!(get_json(app, "/v1/jobs").await.0, 200);
}

#[tokio::test]
async fn bodies_share_bounded_memory() {
    let (_dir, api) = api(Config { max_bodies_bytes: 64 << 10, ..Config::default() }).await;
    let app = router(api.clone());
    let long = || Body::from(format!("\"{}\"", "x".repeat(65 << 10)));
    let (status, retry_after, body) = post(&app, "/v1/jobs", long()).await;
    assert_eq!((status, &body["code"]), (503, &json!("overloaded")));
    assert!(retry_after.is_some());
    assert_eq!(post(&app, "/v1/jobs", request()).await.0, 202);
    assert_eq!(api.bodies.available_permits(), 64, "a body gives its room back");
}

#[tokio::test]
async fn a_small_body_that_grows_when_decoded_is_cut_off() {
    let (_dir, api) = api(Config { max_body_bytes: 1 << 20, ..Config::default() }).await;
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::best());
    std::io::Write::write_all(&mut encoder, &vec![b' '; 16 << 20]).unwrap();
    let small = encoder.finish().unwrap();
    assert!(small.len() < 1 << 16);
    let request = Request::post("/v1/jobs")
        .header(header::CONTENT_TYPE, "application/json")
        .header(header::CONTENT_ENCODING, "gzip")
        .body(Body::from(small))
        .unwrap();
    assert_eq!(router(api).oneshot(request).await.unwrap().status(), 413);
}

/// The API with these limits on a real socket.
async fn on_a_socket(config: Config) -> (tempfile::TempDir, std::net::SocketAddr) {
    on_a_socket_by(config, None).await
}

async fn on_a_socket_by(config: Config, tls: Option<Arc<Tls>>) -> (tempfile::TempDir, std::net::SocketAddr) {
    let (dir, api) = api(config).await;
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let address = listener.local_addr().unwrap();
    let config = api.config.clone();
    tokio::spawn(async move { connections::serve(listener, tls, router(api), &config, std::future::pending()).await });
    (dir, address)
}

/// What comes back for these bytes until the server closes the connection.
async fn talk(address: std::net::SocketAddr, sent: &str) -> String {
    let mut stream = TcpStream::connect(address).await.unwrap();
    stream.write_all(sent.as_bytes()).await.unwrap();
    let mut answer = String::new();
    // A reset ends the conversation as well.
    let _ = stream.read_to_string(&mut answer).await;
    answer
}

#[tokio::test]
async fn half_a_request_and_an_idle_connection_are_not_kept() {
    let config = Config { header_timeout: Duration::from_millis(50), ..Config::default() };
    let (_dir, address) = on_a_socket(config).await;
    assert_eq!(talk(address, "GET /livez HTTP/1.1\r\nHost: x").await, "");
    assert_eq!(talk(address, "").await, "");
    let answer = talk(address, "GET /livez HTTP/1.1\r\nHost: x\r\n\r\n").await;
    assert!(answer.starts_with("HTTP/1.1 200 "), "{answer}");
}

#[tokio::test]
async fn connections_have_a_bound_and_health_has_its_own() {
    let (_dir, address) = on_a_socket(Config { max_connections: 1, ..Config::default() }).await;
    let mut first = TcpStream::connect(address).await.unwrap();
    first.write_all(b"GET /livez HTTP/1.1\r\nHost: x\r\n\r\n").await.unwrap();
    assert!(first.read(&mut [0; 64]).await.unwrap() > 0);
    let get = |path: &str| format!("GET {path} HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n");
    let refused = talk(address, &get("/v1/jobs")).await;
    assert!(refused.starts_with("HTTP/1.1 503 ") && refused.contains("retry-after: "), "{refused}");
    assert!(talk(address, &get("/livez")).await.starts_with("HTTP/1.1 200 "));
}

/// The API with these limits behind TLS, and what clients connect by.
async fn behind_tls(config: Config) -> (tempfile::TempDir, std::net::SocketAddr, TlsConnector) {
    let folder = tempfile::tempdir().unwrap();
    let files = Certificate { chain: folder.path().join("chain.pem"), key: folder.path().join("key.pem") };
    let made = rcgen::generate_simple_self_signed(["localhost".to_owned()]).unwrap();
    std::fs::write(&files.chain, made.cert.pem()).unwrap();
    std::fs::write(&files.key, made.signing_key.serialize_pem()).unwrap();
    let (dir, address) = on_a_socket_by(config, Some(Arc::new(Tls::open(files).unwrap()))).await;
    let mut roots = RootCertStore::empty();
    roots.add(made.cert.der().clone()).unwrap();
    let client = ClientConfig::builder_with_provider(Arc::new(ring::default_provider()))
        .with_safe_default_protocol_versions()
        .unwrap()
        .with_root_certificates(roots)
        .with_no_client_auth();
    (dir, address, Arc::new(client).into())
}

async fn talk_by_tls(address: std::net::SocketAddr, connector: &TlsConnector, sent: &str) -> String {
    let stream = TcpStream::connect(address).await.unwrap();
    let mut stream = connector.connect("localhost".try_into().unwrap(), stream).await.unwrap();
    stream.write_all(sent.as_bytes()).await.unwrap();
    let mut answer = String::new();
    let _ = stream.read_to_string(&mut answer).await;
    answer
}

#[tokio::test]
async fn limits_of_connections_hold_under_tls() {
    let config = Config { header_timeout: Duration::from_millis(200), max_connections: 1, ..Config::default() };
    let (_dir, address, connector) = behind_tls(config).await;
    assert_eq!(talk(address, "").await, "", "who does not shake hands is not kept");
    assert_eq!(talk_by_tls(address, &connector, "GET /livez HTTP/1.1\r\nHost: x").await, "");
    let get = |path: &str| format!("GET {path} HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n");
    let answer = talk_by_tls(address, &connector, &get("/livez")).await;
    assert!(answer.starts_with("HTTP/1.1 200 ") && answer.contains("strict-transport-security"), "{answer}");
    // A place is taken from the first byte on.
    let _silent = TcpStream::connect(address).await.unwrap();
    tokio::time::sleep(Duration::from_millis(50)).await;
    let refused = talk_by_tls(address, &connector, &get("/v1/jobs")).await;
    assert!(refused.starts_with("HTTP/1.1 503 "), "{refused}");
}

#[tokio::test]
async fn every_answer_has_the_headers_that_keep_browsers_safe() {
    let (_dir, api) = api(Config::default()).await;
    let app = router(api);
    for path in ["/", "/v1/jobs", "/nowhere", "/docs/", "/docs/errors", "/docs/guide/", "/dashboard/main.js", "/livez"]
    {
        let answer = app.clone().oneshot(Request::get(path).body(Body::empty()).unwrap()).await.unwrap();
        let policy = answer.headers()[header::CONTENT_SECURITY_POLICY].to_str().unwrap();
        assert!(policy.contains("default-src 'none'") && policy.contains("frame-ancestors 'none'"), "{path}: {policy}");
        assert_eq!(answer.headers()[header::X_CONTENT_TYPE_OPTIONS], "nosniff", "{path}");
        assert_eq!(answer.headers()[header::REFERRER_POLICY], "no-referrer", "{path}");
        assert!(!answer.headers().contains_key(header::STRICT_TRANSPORT_SECURITY), "{path}: there is no TLS");
    }
}
