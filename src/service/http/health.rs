//! Health checks: is the server alive, and can it accept and run jobs?

use axum::Json;
use axum::extract::State;

use super::dto::{Check, Live, Ready};
use super::problem::{Code, Problem};
use super::state::Api;
use crate::jobs::DeviceState;

/// Is the process alive? Touches nothing.
#[utoipa::path(get, path = "/livez", tag = "health", operation_id = "get_liveness",
    responses((status = 200, body = Live)))]
pub async fn livez() -> Json<Live> {
    Json(Live { status: "live", version: env!("CARGO_PKG_VERSION") })
}

/// Is there room for one more recording?
fn disk(api: &Api) -> Check {
    let least = api.config.min_free_bytes;
    let (ok, detail) = match api.data.free_bytes() {
        Ok(free) if free >= least => (true, format!("{} MiB are free", free >> 20)),
        Ok(free) => {
            let (free, least) = (free >> 20, least >> 20);
            (false, format!("{free} MiB are free, and jobs need {least} MiB (--min-free-bytes); delete jobs or files"))
        }
        Err(error) => (false, format!("the data directory's file system does not answer: {error}")),
    };
    Check { name: "disk", ok, detail }
}

/// Refuses what takes space where there is little.
pub fn require_space(api: &Api) -> Result<(), Problem> {
    let disk = disk(api);
    if disk.ok { Ok(()) } else { Err(Problem::new(Code::DiskLow, disk.detail).retry_after(60)) }
}

/// Can the server take and run jobs, and if not, why?
#[utoipa::path(get, path = "/readyz", tag = "health", operation_id = "get_readiness", responses(
    (status = 200, body = Ready),
    (status = 503, body = super::dto::Problem, content_type = "application/problem+json",
        description = "`not_ready`, with all `checks`"),
))]
pub async fn readyz(State(api): State<Api>) -> Result<Json<Ready>, Problem> {
    let store = match api.store.ping().await {
        Ok(()) => Check { name: "store", ok: true, detail: "the job database answers".into() },
        Err(error) => Check { name: "store", ok: false, detail: error.to_string() },
    };
    let device = api.worker.device();
    let stopped = device == DeviceState::Stopped;
    let worker = Check {
        name: "worker",
        ok: !stopped,
        detail: if stopped { "the worker has ended; restart the server" } else { "the worker runs" }.into(),
    };
    let device = match device {
        DeviceState::Ready(what) => Check { name: "device", ok: true, detail: what },
        DeviceState::Opening => Check { name: "device", ok: false, detail: "the devices are being opened".into() },
        DeviceState::Unusable(reason) => Check { name: "device", ok: false, detail: reason },
        DeviceState::Stopped => Check { name: "device", ok: false, detail: "the devices are closed".into() },
    };
    let checks = vec![store, worker, device, disk(&api)];
    if checks.iter().all(|check| check.ok) {
        Ok(Json(Ready { status: "ready", checks }))
    } else {
        Err(Problem::not_ready(checks))
    }
}
