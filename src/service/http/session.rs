//! Who is signed in. Browsers ask for files and pictures by plain links, which can have no header: so a browser keeps
//! its key in a cookie that no script can read and that goes to no other site.

use axum::extract::State;
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use axum::{Extension, Json};
use jiff::Timestamp;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::auth::{identified, judged};
use super::caller::{COOKIE, Caller, shown};
use super::connections::Encrypted;
use super::dto;
use super::extract::JsonBody;
use super::openapi::PROBLEM;
use super::problem::{Code, Problem, internal};
use super::state::Api;
use crate::store::{Key, Quotas, Scope};

/// Who asks.
#[derive(Debug, Serialize, ToSchema)]
pub struct Session {
    /// Whether this server asks for keys.
    pub keys_required: bool,
    /// The key that the request has shown; null without a good one.
    #[schema(required)]
    pub key: Option<KeyInfo>,
}

/// A key, but for its secret.
#[derive(Debug, Serialize, ToSchema)]
pub struct KeyInfo {
    pub id: String,
    pub name: String,
    pub scope: Scope,
    #[schema(required)]
    pub expires_at: Option<Timestamp>,
    /// Most of everything that it may have; null is as much as it likes.
    pub quotas: Quotas,
}

impl From<&Key> for KeyInfo {
    fn from(key: &Key) -> Self {
        let Key { id, name, scope, expires_at, quotas, .. } = key.clone();
        Self { id, name, scope, expires_at, quotas }
    }
}

/// A request to sign in.
#[derive(Debug, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct SignIn {
    /// The key, whole.
    #[schema(min_length = 1)]
    key: String,
}

/// Who asks, and whether it must show a key.
#[utoipa::path(get, path = "/v1/session", tag = "keys", operation_id = "get_session",
    responses((status = 200, body = Session)))]
pub async fn get(State(api): State<Api>, headers: HeaderMap) -> Result<Response, Problem> {
    let keys_required = api.asks_for_keys().await?;
    let caller = match shown(&headers) {
        Some(_) if keys_required => identified(&api, &headers).await.ok(),
        _ => None,
    };
    let key = caller.as_ref().and_then(Caller::key).map(|key| KeyInfo::from(&**key));
    Ok(([(header::CACHE_CONTROL, "no-store")], Json(Session { keys_required, key })).into_response())
}

/// Signs a browser in: its key goes into a cookie (`gridfall_key`), which it keeps until it is closed. No script can
/// read it, and no other site makes the browser send it. Programs send `Authorization: Bearer KEY` instead.
#[utoipa::path(put, path = "/v1/session", tag = "keys", operation_id = "sign_in", request_body = SignIn,
    responses(
        (status = 200, body = Session, headers(("Set-Cookie" = String))),
        (status = 401, body = dto::Problem, content_type = PROBLEM, description = "`key_refused`"),
        (status = 422, body = dto::Problem, content_type = PROBLEM,
            description = "`invalid_request`: also where nobody is asked for a key"),
    ))]
pub async fn put(
    State(api): State<Api>,
    encrypted: Option<Extension<Encrypted>>,
    JsonBody(SignIn { key: secret }, _): JsonBody<SignIn>,
) -> Result<Response, Problem> {
    if !api.asks_for_keys().await? {
        let detail = "/key: this server asks nobody for a key; use it without one";
        return Err(Problem::new(Code::InvalidRequest, detail));
    }
    let key = judged(&api, secret.trim()).await?;
    let session = Session { keys_required: true, key: Some(KeyInfo::from(&*key)) };
    let mut answer = Json(session).into_response();
    answer.extensions_mut().insert(Caller::Key(key));
    set(answer.headers_mut(), secret.trim(), encrypted.is_some(), "")?;
    Ok(answer)
}

/// Signs a browser out: the cookie goes.
#[utoipa::path(delete, path = "/v1/session", tag = "keys", operation_id = "sign_out",
    responses((status = 204, description = "The browser has no key any more", headers(("Set-Cookie" = String)))))]
pub async fn delete(encrypted: Option<Extension<Encrypted>>) -> Result<Response, Problem> {
    let mut answer = StatusCode::NO_CONTENT.into_response();
    set(answer.headers_mut(), "", encrypted.is_some(), "; Max-Age=0")?;
    Ok(answer)
}

fn set(headers: &mut HeaderMap, value: &str, encrypted: bool, more: &str) -> Result<(), Problem> {
    let secure = if encrypted { "; Secure" } else { "" };
    let cookie = format!("{COOKIE}={value}; Path=/; HttpOnly; SameSite=Strict{secure}{more}");
    headers.insert(header::SET_COOKIE, HeaderValue::try_from(cookie).map_err(internal)?);
    headers.insert(header::CACHE_CONTROL, HeaderValue::from_static("no-store"));
    Ok(())
}
