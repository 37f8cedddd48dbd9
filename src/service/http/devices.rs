//! What jobs run on here.

use axum::Json;
use axum::extract::State;

use super::dto::{Backend, DeviceList};
use super::state::Api;
use crate::jobs::DeviceState;

/// The devices that the worker has opened, the preferred one first, and their state.
#[utoipa::path(get, path = "/v1/devices", tag = "health", operation_id = "list_devices",
    responses((status = 200, body = DeviceList)))]
pub async fn list(State(api): State<Api>) -> Json<DeviceList> {
    let (state, reason) = match api.worker.device() {
        DeviceState::Ready(what) => ("ready", what),
        DeviceState::Opening => ("opening", "the devices are being opened".into()),
        DeviceState::Unusable(reason) => ("unusable", reason),
        DeviceState::Stopped => ("stopped", "the worker has ended; restart the server".into()),
    };
    let usable = matches!(state, "ready");
    let devices = if usable { api.worker.devices().into_iter().map(Backend::from).collect() } else { Vec::new() };
    Json(DeviceList { state, reason, devices })
}
