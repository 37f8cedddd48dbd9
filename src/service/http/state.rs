//! State that the handlers share.

use std::sync::Arc;
use std::time::Duration;

use axum::http::HeaderValue;
use tokio::sync::Semaphore;

use super::caller::Authority;
use super::frames::Indexes;
use super::metrics::Metrics;
use super::sceneries::Sceneries;
use super::watch::Watches;
use super::webhooks::address::Range;
use super::webhooks::deliver::{Deliverer, Patience};
use super::webhooks::send::Sender;
use crate::jobs;
use crate::store::{DataDir, JobStore};
use gridfall_scene::Limits;

/// Bodies are counted in units of so many bytes.
pub(super) const BODY_UNIT: usize = 1 << 10;

/// Limits on what clients may ask of the server.
#[derive(Clone, Debug)]
pub struct Config {
    /// Largest request body (bytes).
    pub max_body_bytes: usize,
    /// Largest upload (bytes).
    pub max_asset_bytes: usize,
    /// Memory for the bodies of all requests that are being read or judged, parsed JSON included
    /// (bytes).
    pub max_bodies_bytes: usize,
    /// How long the head of a request may take to arrive, counted from when the connection is
    /// ready for it. So a connection without requests is closed after this time, too.
    pub header_timeout: Duration,
    /// How long a request body may take to arrive.
    pub body_timeout: Duration,
    /// How long a client may take in nothing of an answer.
    pub write_timeout: Duration,
    /// Open connections; health, metrics and cancel have a few of their own.
    pub max_connections: usize,
    /// Requests that are answered at a time; health, metrics and cancel are not counted.
    pub max_in_flight: usize,
    /// How long a request may take to be answered, not counting the body of the answer.
    pub handler_timeout: Duration,
    /// How long a client may wait for a job to change (`Prefer: wait`).
    pub max_wait: Duration,
    /// Maximum number of waiting jobs.
    pub max_queued: i64,
    /// Number of scenes checked at a time; each may need as much memory as its particles do.
    pub max_validations: usize,
    /// How long a scene may wait to be checked.
    pub validation_wait: Duration,
    /// Free disk space below which no job is accepted (bytes).
    pub min_free_bytes: u64,
    /// Ask for keys even before there is one.
    pub require_keys: bool,
    /// Origins whose pages may use the whole API, such as `https://app.example`.
    pub cors_origins: Vec<HeaderValue>,
    /// Names of the server, besides its addresses and `localhost`, in requests that change state.
    pub allowed_hosts: Vec<String>,
    /// Work of judging one scene ([`Limits::max_work`]); the default is about a quarter of a second
    /// of two cores.
    pub max_work: u64,
    pub limits: Limits,
    /// Addresses of webhooks that may be called, although they are not on the internet.
    pub webhook_addresses: Vec<Range>,
    pub webhook_patience: Patience,
}

impl Default for Config {
    fn default() -> Self {
        Self {
            max_body_bytes: 8 << 20,
            max_asset_bytes: 64 << 20,
            max_bodies_bytes: 512 << 20,
            header_timeout: Duration::from_secs(15),
            body_timeout: Duration::from_secs(30),
            write_timeout: Duration::from_secs(60),
            max_connections: 1024,
            max_in_flight: 512,
            handler_timeout: Duration::from_secs(120),
            max_wait: Duration::from_secs(60),
            max_queued: 1000,
            max_validations: 2,
            validation_wait: Duration::from_secs(10),
            min_free_bytes: 256 << 20,
            require_keys: false,
            cors_origins: Vec::new(),
            allowed_hosts: Vec::new(),
            max_work: 40_000_000,
            limits: Limits::default(),
            webhook_addresses: Vec::new(),
            webhook_patience: Patience::default(),
        }
    }
}

/// The state behind the API; cheap to clone.
#[derive(Clone, Debug)]
pub struct Api {
    pub(super) store: JobStore,
    pub(super) data: Arc<DataDir>,
    pub(super) worker: Arc<jobs::Shared>,
    pub(super) config: Arc<Config>,
    pub(super) validations: Arc<Semaphore>,
    /// The threads that judge scenes: not those that simulate, behind whose work they would have to wait.
    pub(super) judges: Arc<rayon::ThreadPool>,
    pub(super) in_flight: Arc<Semaphore>,
    /// Room for bodies, in [`BODY_UNIT`]s.
    pub(super) bodies: Arc<Semaphore>,
    pub(super) metrics: Arc<Metrics>,
    pub(super) watches: Arc<Watches>,
    pub(super) frames: Arc<Indexes>,
    pub(super) sceneries: Arc<Sceneries>,
    pub(super) authority: Arc<Authority>,
    pub(super) sender: Arc<Sender>,
}

impl Api {
    /// What sends messages to webhooks.
    pub(super) fn deliverer(&self) -> Deliverer {
        Deliverer {
            store: self.store.clone(),
            sender: self.sender.clone(),
            patience: self.config.webhook_patience,
            attempts: self.metrics.deliveries.clone(),
        }
    }

    pub fn new(store: JobStore, data: Arc<DataDir>, worker: Arc<jobs::Shared>, config: Config) -> Self {
        Self {
            sender: Arc::new(Sender::new(config.webhook_addresses.clone())),
            metrics: Arc::new(Metrics::new(&worker.counters)),
            watches: Arc::default(),
            frames: Arc::default(),
            sceneries: Arc::default(),
            authority: Arc::default(),
            validations: Arc::new(Semaphore::new(config.max_validations)),
            judges: Arc::new(judges()),
            in_flight: Arc::new(Semaphore::new(config.max_in_flight)),
            bodies: Arc::new(Semaphore::new(config.max_bodies_bytes / BODY_UNIT)),
            config: Arc::new(config),
            store,
            data,
            worker,
        }
    }
}

fn judges() -> rayon::ThreadPool {
    let threads = rayon::ThreadPoolBuilder::new().thread_name(|n| format!("judge {n}"));
    // A panic is reported where it happens, and its request is answered; the server goes on.
    threads.panic_handler(|_| ()).build().expect("the system has room for a few more threads")
}
