//! What keys have had, and the quotas that bound it.

use axum::Json;
use axum::extract::State;
use jiff::Timestamp;
use serde::Serialize;
use utoipa::ToSchema;

use super::caller::Caller;
use super::problem::{Code, Problem};
use super::session::KeyInfo;
use super::state::Api;
use crate::store::{self, Key, USAGE_DAYS};

/// What keys have had.
#[derive(Debug, Serialize, ToSchema)]
pub struct UsageReport {
    /// Days that `jobs` and `device_s` are of, the present one included.
    pub days: i64,
    /// The key that asks; all of them, if that one's scope is `admin`. None where nobody is asked for a key.
    pub keys: Vec<Usage>,
}

/// What a key has had.
#[derive(Debug, Serialize, ToSchema)]
pub struct Usage {
    pub key: KeyInfo,
    /// When it was last used, to about a minute.
    #[schema(required)]
    pub last_used_at: Option<Timestamp>,
    /// Jobs that wait.
    pub queued: i64,
    /// Jobs that run.
    pub running: i64,
    /// Jobs accepted within so many `days`.
    pub jobs: i64,
    /// Time on devices within so many `days` (s).
    pub device_s: f64,
    /// Bytes of outputs of ended jobs and of uploads that are kept.
    pub bytes: i64,
}

impl From<store::Usage> for Usage {
    fn from(usage: store::Usage) -> Self {
        let store::Usage { key, queued, running, jobs, device_s, bytes, .. } = usage;
        Self { last_used_at: key.last_used_at, key: KeyInfo::from(&key), queued, running, jobs, device_s, bytes }
    }
}

/// What the key that asks has used of its quotas; of all keys, if its scope is `admin`.
#[utoipa::path(get, path = "/v1/usage", tag = "keys", operation_id = "get_usage",
    responses((status = 200, body = UsageReport)))]
pub async fn get(State(api): State<Api>, caller: Caller) -> Result<Json<UsageReport>, Problem> {
    let keys = match &caller {
        Caller::Anybody => Vec::new(),
        Caller::Key(_) => api.store.usage(caller.confined_to()).await?,
    };
    Ok(Json(UsageReport { days: USAGE_DAYS, keys: keys.into_iter().map(Usage::from).collect() }))
}

/// Refuses scenes of more particles than a caller may have.
pub fn require_particles(caller: &Caller, particles: u64) -> Result<(), Problem> {
    match caller.key().and_then(|key| Some((key, key.quotas.particles?))) {
        Some((key, most)) if particles > most as u64 => Err(exceeded(
            key,
            &format!("the scene has {particles} particles, and a scene of this key may have {most}"),
            "coarsen it (domain.dx, particles_per_cell)",
        )),
        _ => Ok(()),
    }
}

/// Refuses what would take more room or time on devices than a caller may still have; `more` is the bytes of an
/// upload.
pub async fn require_rest(api: &Api, caller: &Caller, more: u64) -> Result<(), Problem> {
    let Some(key) = caller.key() else { return Ok(()) };
    if key.quotas.bytes.is_none() && key.quotas.device_s.is_none() {
        return Ok(());
    }
    let Some(usage) = api.store.usage(Some(&key.id)).await?.pop() else { return Ok(()) };
    let used = usage.bytes as u64 + more;
    // What a job will leave is not known: it may begin while there is room.
    if let Some(most) = key.quotas.bytes.filter(|&most| used >= most as u64 + u64::from(more > 0)) {
        let what = if more > 0 { format!(", {more} of them those of this upload") } else { String::new() };
        return Err(exceeded(
            key,
            &format!("{used} bytes are kept for this key{what}, and {most} may be"),
            "delete jobs that are no longer needed",
        ));
    }
    // Uploads take no time.
    if let Some(most) = key.quotas.device_s.filter(|&most| more == 0 && usage.device_s >= most as f64) {
        return Err(exceeded(
            key,
            &format!("{:.0} s on devices were used in {USAGE_DAYS} days, and {most} s may be", usage.device_s),
            "wait until those days have passed",
        ));
    }
    Ok(())
}

fn exceeded(key: &Key, fact: &str, remedy: &str) -> Problem {
    let detail = format!("{fact}; {remedy}, or ask for a larger quota of the key {}", key.name);
    Problem::new(Code::QuotaExceeded, detail)
}
