//! State that the handlers share.

use std::sync::Arc;
use std::time::Duration;

use tokio::sync::Semaphore;

use super::metrics::Metrics;
use crate::jobs;
use crate::store::{DataDir, JobStore};
use gridfall_scene::Limits;

/// Limits on what clients may ask of the server.
#[derive(Clone, Debug)]
pub struct Config {
    /// Largest request body (bytes).
    pub max_body_bytes: usize,
    /// Largest upload (bytes).
    pub max_asset_bytes: usize,
    /// How long a request body may take to arrive.
    pub body_timeout: Duration,
    /// How long a request may take to be answered, not counting the body of the answer.
    pub handler_timeout: Duration,
    /// Maximum number of waiting jobs.
    pub max_queued: i64,
    /// Number of scenes checked at a time; each may need as much memory as its particles do.
    pub max_validations: usize,
    /// How long a scene may wait to be checked.
    pub validation_wait: Duration,
    pub limits: Limits,
}

impl Default for Config {
    fn default() -> Self {
        Self {
            max_body_bytes: 8 << 20,
            max_asset_bytes: 64 << 20,
            body_timeout: Duration::from_secs(30),
            handler_timeout: Duration::from_secs(120),
            max_queued: 1000,
            max_validations: 2,
            validation_wait: Duration::from_secs(10),
            limits: Limits::default(),
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
    pub(super) metrics: Arc<Metrics>,
}

impl Api {
    pub fn new(store: JobStore, data: Arc<DataDir>, worker: Arc<jobs::Shared>, config: Config) -> Self {
        Self {
            metrics: Arc::new(Metrics::new(&worker.counters)),
            validations: Arc::new(Semaphore::new(config.max_validations)),
            config: Arc::new(config),
            store,
            data,
            worker,
        }
    }
}
