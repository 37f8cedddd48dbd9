//! Metrics for Prometheus. No label has a job's id: the number of jobs is unbounded, and the number
//! of series must not be.

use axum::extract::State;
use axum::http::{Method, StatusCode, header};
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
use crate::jobs::{Counters, StatusLabel};

#[derive(Debug)]
pub struct Metrics {
    registry: Registry,
    requests: Family<RequestLabels, Counter>,
    request_seconds: Family<RouteLabels, Histogram, fn() -> Histogram>,
    jobs: Family<StatusLabel, Gauge>,
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
            registry: Registry::default(),
        };
        registry.register("build", "Version of the server", Info::new(vec![("version", env!("CARGO_PKG_VERSION"))]));
        registry.register("jobs", "Jobs kept, by status", metrics.jobs.clone());
        registry.register("jobs_ended", "Jobs that the worker brought to an end, by status", counters.finished.clone());
        registry.register("frames", "Frames recorded", counters.frames.clone());
        registry.register("steps", "Sub-steps done", counters.steps.clone());
        registry.register("particle_steps", "Particles times sub-steps done", counters.particle_steps.clone());
        registry.register("http_requests", "Requests answered", metrics.requests.clone());
        registry.register_with_unit(
            "http_request_duration",
            "Time to the head of the answer",
            Unit::Seconds,
            metrics.request_seconds.clone(),
        );
        Self { registry, ..metrics }
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

const TEXT: &str = "application/openmetrics-text; version=1.0.0; charset=utf-8";

/// Counters and gauges in the OpenMetrics text format, as Prometheus reads it.
#[utoipa::path(get, path = "/metrics", tag = "health", responses(
    (status = 200, body = String, content_type = "application/openmetrics-text"),
))]
pub async fn metrics(State(api): State<Api>) -> Result<impl IntoResponse, Problem> {
    for (status, n) in api.store.counts().await? {
        api.metrics.jobs.get_or_create(&StatusLabel { status }).set(n);
    }
    let mut body = String::new();
    text::encode(&mut body, &api.metrics.registry).map_err(internal)?;
    Ok(([(header::CONTENT_TYPE, TEXT)], body))
}
