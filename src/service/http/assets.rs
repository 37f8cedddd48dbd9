//! Assets: meshes and particles that scenes name, kept by the SHA-256 of their bytes.

use std::collections::HashSet;

use axum::Json;
use axum::extract::State;
use axum::http::{HeaderMap, Method, StatusCode, header};
use axum::response::{IntoResponse, Response};

use super::caller::Caller;
use super::dto::{self, Asset, AssetList};
use super::extract::{AssetBody, AssetId};
use super::file::FileAnswer;
use super::health::require_space;
use super::holdings::hold;
use super::openapi::PROBLEM;
use super::problem::{Code, Problem, internal};
use super::scenes::by_judges;
use super::state::Api;
use super::usage::require_rest;
use crate::store::Upload;
use gridfall_scene::assets::examine;

/// Uploads a mesh (STL, OBJ, PLY or glTF in one file) or particles (PLY or npz). Its id is that of
/// its bytes: the same file twice is one asset. Scenes name it as
/// `{"mesh": {"asset": "sha256:…"}}` or a body's `"points": {"asset": "sha256:…"}`.
#[utoipa::path(put, path = "/v1/assets", tag = "assets", operation_id = "upload_asset",
    request_body(content = dto::Bytes, content_type = "application/octet-stream"),
    responses(
        (status = 200, body = Asset, description = "It was there already"),
        (status = 201, body = Asset, description = "Kept",
            headers(("Location" = String, description = "Path of the asset"))),
        (status = 422, body = dto::Problem, content_type = PROBLEM, description = "`invalid_asset`"),
        (status = 507, body = dto::Problem, content_type = PROBLEM, description = "`disk_low`"),
    ))]
pub async fn put(
    State(api): State<Api>,
    caller: Caller,
    AssetBody(bytes, room): AssetBody,
) -> Result<Response, Problem> {
    require_space(&api)?;
    require_rest(&api, &caller, bytes.len() as u64).await?;
    let files = api.data.assets();
    let kept = by_judges(&api, room, move || {
        let kind = examine(&bytes).map_err(|reason| Problem::new(Code::InvalidAsset, reason))?;
        files.put(&bytes, kind).map_err(Problem::from)
    });
    let (asset, new) = kept.await??;
    let new = hold(&api, &caller, (Upload::Asset, &asset.id, asset.bytes), new).await?;
    let status = if new { StatusCode::CREATED } else { StatusCode::OK };
    let location = format!("/v1/assets/{}", asset.id);
    Ok((status, [(header::LOCATION, location)], Json(Asset::from(asset))).into_response())
}

/// Lists all assets, by id.
#[utoipa::path(get, path = "/v1/assets", tag = "assets", operation_id = "list_assets",
    responses((status = 200, body = AssetList)))]
pub async fn list(State(api): State<Api>, caller: Caller) -> Result<Json<AssetList>, Problem> {
    let files = api.data.assets();
    let mut assets = tokio::task::spawn_blocking(move || files.list()).await.map_err(internal)??;
    if let Some(key) = caller.confined_to() {
        let own: HashSet<String> = api.store.held(key, Upload::Asset).await?.into_iter().collect();
        assets.retain(|asset| own.contains(&asset.id));
    }
    Ok(Json(AssetList { assets: assets.into_iter().map(Into::into).collect() }))
}

/// The bytes of an asset.
#[utoipa::path(get, path = "/v1/assets/{id}", tag = "assets", operation_id = "get_asset",
    params(("id" = String, Path, description = "`sha256:` and 64 hexadecimal digits",
        pattern = "^sha256:[0-9A-Fa-f]{64}$",
        example = "sha256:2c26b46b68ffc68ff99b453c1d30413413422d706483bfa0f98a5e886266e7ae")),
    responses(
        (status = 200, content_type = "application/octet-stream", body = dto::Bytes,
            headers(("ETag" = String), ("Accept-Ranges" = String))),
        (status = 206, content_type = "application/octet-stream", body = dto::Bytes,
            headers(("ETag" = String), ("Content-Range" = String))),
        (status = 304, description = "The client has it"),
        (status = 416, body = dto::Problem, content_type = PROBLEM, description = "`range_not_satisfiable`"),
    ))]
pub async fn get(
    State(api): State<Api>,
    AssetId(id): AssetId,
    method: Method,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let files = api.data.assets();
    let wanted = id.clone();
    let found = tokio::task::spawn_blocking(move || files.find(&wanted)).await.map_err(internal)??;
    let missing = || Problem::asset_not_found(&id);
    let (asset, path) = found.ok_or_else(missing)?;
    let name = format!("{}.{}", &asset.id["sha256:".len()..][..16], asset.kind);
    let file = FileAnswer { path: &path, content_type: "application/octet-stream", download: Some(&name) };
    file.send(&method, &headers).await?.ok_or_else(missing)
}
