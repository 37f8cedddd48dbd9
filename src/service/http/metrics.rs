//! Metrics for Prometheus. No label has a job's id: the number of jobs is unbounded, and the number
//! of series must not be.

use std::collections::HashMap;
use std::sync::atomic::{AtomicU64, Ordering};

use axum::extract::State;
use axum::http::{HeaderMap, Method, StatusCode, header};
use axum::response::IntoResponse;
use prometheus_client::encoding::{EncodeLabelSet, text};
use prometheus_client::metrics::counter::Counter;
use prometheus_client::metrics::family::Family;
use prometheus_client::metrics::gauge::Gauge;
use prometheus_client::metrics::histogram::Histogram;
use prometheus_client::metrics::info::Info;
use prometheus_client::registry::{Registry, Unit};

use super::problem::{Problem, internal};
use super::state::Api;
use super::webhooks::deliver::Attempts;
use crate::jobs::{Counters, StatusLabel};
use crate::store::{DeliveryStatus, Status, Usage};

#[derive(Debug)]
pub struct Metrics {
    registry: Registry,
    requests: Family<RequestLabels, Counter>,
    request_seconds: Family<RouteLabels, Histogram, fn() -> Histogram>,
    jobs: Family<StatusLabel, Gauge>,
    /// Attempts to deliver messages to webhooks, by result.
    pub deliveries: Attempts,
    dead_letters: Gauge,
    key_requests: Family<KeyLabel, Counter>,
    key_jobs: Family<KeyStatusLabel, Gauge>,
    key_bytes: Family<KeyLabel, Gauge>,
    key_device_seconds: Family<KeyLabel, Counter<f64, AtomicU64>>,
}

/// The name of a key. There are as many as an operator has made.
#[derive(Clone, Debug, PartialEq, Eq, Hash, EncodeLabelSet)]
struct KeyLabel {
    key: String,
}

#[derive(Clone, Debug, PartialEq, Eq, Hash, EncodeLabelSet)]
struct KeyStatusLabel {
    key: String,
    status: Status,
}

#[derive(Clone, Debug, PartialEq, Eq, Hash, EncodeLabelSet)]
struct RequestLabels {
    method: &'static str,
    route: String,
    status: u16,
}

#[derive(Clone, Debug, PartialEq, Eq, Hash, EncodeLabelSet)]
struct RouteLabels {
    method: &'static str,
    route: String,
}

impl Metrics {
    pub fn new(counters: &Counters) -> Self {
        let mut registry = Registry::with_prefix("gridfall");
        let metrics = Self {
            requests: Family::default(),
            request_seconds: Family::new_with_constructor(|| {
                Histogram::new([0.001, 0.003, 0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0])
            }),
            jobs: Family::default(),
            key_requests: Family::default(),
            key_jobs: Family::default(),
            key_bytes: Family::default(),
            key_device_seconds: Family::default(),
            deliveries: Attempts::default(),
            dead_letters: Gauge::default(),
            registry: Registry::default(),
        };
        registry.register("build", "Version of the server", Info::new(vec![("version", env!("CARGO_PKG_VERSION"))]));
        registry.register("jobs", "Jobs kept, by status", metrics.jobs.clone());
        counters.register(&mut registry);
        let deliveries = "Messages sent to webhooks: delivered, failed, dead (given up) or gone (nothing more wanted)";
        registry.register("webhook_deliveries", deliveries, metrics.deliveries.0.clone());
        let dead = "Messages to webhooks that were given up and are kept";
        registry.register("webhook_dead_letters", dead, metrics.dead_letters.clone());
        registry.register("http_requests", "Requests answered", metrics.requests.clone());
        registry.register_with_unit(
            "http_request_duration",
            "Time to the head of the answer",
            Unit::Seconds,
            metrics.request_seconds.clone(),
        );
        registry.register("key_requests", "Requests of a key that were answered", metrics.key_requests.clone());
        registry.register("key_jobs", "Jobs of a key that wait or run", metrics.key_jobs.clone());
        let kept = "Outputs and uploads of a key that are kept";
        registry.register_with_unit("key_kept", kept, Unit::Bytes, metrics.key_bytes.clone());
        let device = "Time on devices of a key's jobs, whenever the server was started";
        registry.register_with_unit("key_device", device, Unit::Seconds, metrics.key_device_seconds.clone());
        Self { registry, ..metrics }
    }

    /// Counts a request of a key.
    pub fn asked(&self, key: &str) {
        self.key_requests.get_or_create(&KeyLabel { key: key.to_owned() }).inc();
    }

    fn used(&self, usage: &Usage) {
        let label = KeyLabel { key: usage.key.name.clone() };
        for (status, jobs) in [(Status::Queued, usage.queued), (Status::Running, usage.running)] {
            self.key_jobs.get_or_create(&KeyStatusLabel { key: label.key.clone(), status }).set(jobs);
        }
        self.key_bytes.get_or_create(&label).set(usage.bytes);
        let seconds = usage.total_device_s.to_bits();
        // The database counts; a counter here can only be made to show it.
        self.key_device_seconds.get_or_create(&label).inner().store(seconds, Ordering::Relaxed);
    }

    pub fn observe(&self, method: &Method, route: String, status: StatusCode, seconds: f64) {
        let method = method_label(method);
        let labels = RequestLabels { method, route: route.clone(), status: status.as_u16() };
        self.requests.get_or_create(&labels).inc();
        self.request_seconds.get_or_create(&RouteLabels { method, route }).observe(seconds);
    }
}

/// Clients may invent methods; the number of series must stay small.
fn method_label(method: &Method) -> &'static str {
    match *method {
        Method::GET => "GET",
        Method::HEAD => "HEAD",
        Method::POST => "POST",
        Method::PUT => "PUT",
        Method::DELETE => "DELETE",
        Method::OPTIONS => "OPTIONS",
        _ => "other",
    }
}

const OPENMETRICS: &str = "application/openmetrics-text; version=1.0.0; charset=utf-8";
const PLAIN: &str = "text/plain; version=0.0.4; charset=utf-8";

/// Counters and gauges in the Prometheus text format 0.0.4, or in OpenMetrics for clients that
/// accept it.
#[utoipa::path(get, path = "/metrics", tag = "health", operation_id = "get_metrics", responses(
    (status = 200, content(
        (String = "text/plain"),
        (String = "application/openmetrics-text"),
    )),
))]
pub async fn metrics(State(api): State<Api>, headers: HeaderMap) -> Result<impl IntoResponse, Problem> {
    for (status, n) in api.store.counts().await? {
        api.metrics.jobs.get_or_create(&StatusLabel { status }).set(n);
    }
    api.store.usage(None).await?.iter().for_each(|usage| api.metrics.used(usage));
    let dead = api.store.count_deliveries(DeliveryStatus::Dead).await?;
    api.metrics.dead_letters.set(dead);
    let mut body = String::new();
    text::encode(&mut body, &api.metrics.registry).map_err(internal)?;
    let accepted = headers.get_all(header::ACCEPT).iter().filter_map(|value| value.to_str().ok());
    let openmetrics = accepted.into_iter().any(|kinds| kinds.contains("application/openmetrics-text"));
    let (kind, body) = if openmetrics { (OPENMETRICS, body) } else { (PLAIN, plain(&body)) };
    Ok(([(header::CONTENT_TYPE, kind), (header::VARY, "accept")], body))
}

/// OpenMetrics in the older format: there a family has the name of its samples, suffix included,
/// and `info`, units and the end are unknown.
fn plain(openmetrics: &str) -> String {
    let comment = |line: &'_ str| -> Option<(String, String, String)> {
        let mut words = line.strip_prefix("# ")?.splitn(3, ' ').map(str::to_owned);
        Some((words.next()?, words.next()?, words.next()?))
    };
    let types: HashMap<String, String> =
        openmetrics.lines().filter_map(comment).filter(|(word, ..)| word == "TYPE").map(|(_, n, t)| (n, t)).collect();
    let mut text = String::with_capacity(openmetrics.len());
    for line in openmetrics.lines() {
        if line.starts_with("# UNIT ") || line == "# EOF" {
            continue;
        }
        match comment(line) {
            Some((word, name, rest)) => {
                let kind = types.get(&name).map_or("untyped", String::as_str);
                let (suffix, kind) = match kind {
                    "counter" => ("_total", "counter"),
                    "info" => ("_info", "gauge"),
                    other => ("", other),
                };
                let rest = if word == "TYPE" { kind } else { &rest };
                text.push_str(&format!("# {word} {name}{suffix} {rest}"));
            }
            None => text.push_str(line),
        }
        text.push('\n');
    }
    text
}
