//! Webhooks: add, list, try, remove; what was delivered, and what was given up.

pub mod address;
pub mod deliver;
pub mod payload;
mod secret;
pub mod send;

use axum::Json;
use axum::extract::rejection::PathRejection;
use axum::extract::{Path, State};
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};
use jiff::Timestamp;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use utoipa::{IntoParams, ToSchema};
use uuid::Uuid;

use super::dto;
use super::extract::{JobId, JsonBody, Query};
use super::openapi::PROBLEM;
use super::pages::Page;
use super::problem::{Code, Problem, internal};
use super::state::Api;
use crate::store::{self, DeliveryStatus, EventType, NewWebhook};
use secret::Secret;
use send::Sender;

/// Most webhooks of a server.
const MOST: i64 = 100;
const LONGEST_URL: usize = 2000;

/// A request to be told of what happens to jobs.
#[derive(Debug, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct AddWebhook {
    /// Where messages are posted to.
    #[schema(max_length = 2000, example = "https://hooks.example/gridfall")]
    pub url: String,
    /// Types of events to be told of; all without any.
    #[serde(default)]
    pub events: Vec<EventType>,
    /// What messages are signed with: `whsec_` and 24 to 64 bytes in base64. One is made without it.
    #[serde(default)]
    pub secret: Option<String>,
}

/// Who is told of what happens to jobs.
#[derive(Clone, Debug, Serialize, ToSchema)]
pub struct Webhook {
    pub id: Uuid,
    pub url: String,
    /// Types of events that it is told of; all without any.
    pub events: Vec<EventType>,
    pub created_at: Timestamp,
    /// False once its receiver answered 410: it is told nothing more.
    pub enabled: bool,
}

impl From<store::Webhook> for Webhook {
    fn from(webhook: store::Webhook) -> Self {
        let store::Webhook { id, url, events, created_at, enabled, .. } = webhook;
        Self { id, url, events, created_at, enabled }
    }
}

/// A webhook that was added, with what its messages are signed with. That is not shown again.
#[derive(Debug, Serialize, ToSchema)]
pub struct AddedWebhook {
    pub id: Uuid,
    pub url: String,
    pub events: Vec<EventType>,
    pub created_at: Timestamp,
    pub enabled: bool,
    /// For libraries of Standard Webhooks.
    pub secret: String,
}

/// All webhooks, oldest first.
#[derive(Debug, Serialize, ToSchema)]
pub struct WebhookList {
    pub webhooks: Vec<Webhook>,
}

/// How a receiver answered, or why it did not.
#[derive(Debug, Serialize, ToSchema)]
pub struct DeliveryAnswer {
    pub at: Timestamp,
    /// HTTP status; null where no answer came.
    #[schema(required)]
    pub status: Option<u16>,
    /// The beginning of the answer, or why there is none.
    pub text: String,
}

/// A message to a webhook.
#[derive(Debug, Serialize, ToSchema)]
pub struct Delivery {
    /// The header `webhook-id`, the same each time that it is sent.
    pub id: String,
    pub event: EventType,
    /// `pending → delivered | dead`.
    pub status: DeliveryStatus,
    pub created_at: Timestamp,
    /// How often it was sent.
    pub attempts: i64,
    /// When it is sent again, at the earliest; null unless pending.
    #[schema(required)]
    pub next_at: Option<Timestamp>,
    /// The last answer; null before the first.
    #[schema(required)]
    pub answer: Option<DeliveryAnswer>,
    /// What is sent.
    #[schema(value_type = Object)]
    pub payload: Value,
}

impl From<store::Delivery> for Delivery {
    fn from(delivery: store::Delivery) -> Self {
        let store::Delivery { id, event, payload, created_at, status, attempt, next_at, reply, .. } = delivery;
        let answer = reply.map(|store::Reply { at, code, text }| DeliveryAnswer { at, status: code, text });
        Self {
            id,
            event,
            status,
            created_at,
            attempts: attempt,
            next_at: (status == DeliveryStatus::Pending).then_some(next_at),
            answer,
            payload: serde_json::from_str(&payload).unwrap_or_default(),
        }
    }
}

/// A page of deliveries, newest first.
#[derive(Debug, Serialize, ToSchema)]
pub struct DeliveryList {
    pub deliveries: Vec<Delivery>,
    /// Asks for the next page; null on the last one.
    #[schema(required)]
    pub next_cursor: Option<String>,
}

/// Which deliveries to list.
#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub struct ListDeliveries {
    /// Only those of this status: `dead` has what was given up.
    pub status: Option<DeliveryStatus>,
    /// Deliveries a page; 50 by default.
    #[param(minimum = 1, maximum = 200)]
    pub limit: Option<i64>,
    /// `next_cursor` of the page before.
    pub cursor: Option<String>,
}

/// Adds a webhook. It is told of what happens from now on, with signatures of Standard Webhooks.
#[utoipa::path(post, path = "/v1/webhooks", tag = "webhooks", operation_id = "add_webhook", request_body = AddWebhook,
    responses(
        (status = 201, body = AddedWebhook, headers(("Location" = String, description = "Path of the webhook"))),
        (status = 422, body = dto::Problem, content_type = PROBLEM,
            description = "`webhook_refused`, `invalid_request`"),
    ))]
pub async fn add(State(api): State<Api>, JsonBody(request, _room): JsonBody<AddWebhook>) -> Result<Response, Problem> {
    let AddWebhook { url, events, secret } = request;
    let refused = |why: String| Problem::new(Code::WebhookRefused, format!("/url: {why}"));
    if url.len() > LONGEST_URL {
        return Err(refused(format!("it has {} characters; {LONGEST_URL} is the most", url.len())));
    }
    let parsed = Sender::judge(&url).map_err(refused)?;
    api.sender.resolve(&parsed).await.map_err(refused)?;
    let secret = match secret {
        Some(secret) => secret,
        None => Secret::make().map_err(internal)?,
    };
    if let Err(why) = Secret::read(&secret) {
        return Err(Problem::new(Code::InvalidRequest, format!("/secret: {why}")));
    }
    let new = NewWebhook { url: parsed.into(), secret, events };
    let Some(added) = api.store.add_webhook(&new, MOST).await? else {
        let detail = format!("there are {MOST} webhooks already; delete one that is no longer needed");
        return Err(Problem::new(Code::InvalidRequest, detail));
    };
    let location = format!("/v1/webhooks/{}", added.id);
    let store::Webhook { id, url, secret, events, created_at, enabled } = added;
    let answer = AddedWebhook { id, url, events, created_at, enabled, secret };
    Ok((StatusCode::CREATED, [(header::LOCATION, location)], Json(answer)).into_response())
}

/// Lists all webhooks, oldest first.
#[utoipa::path(get, path = "/v1/webhooks", tag = "webhooks", operation_id = "list_webhooks",
    responses((status = 200, body = WebhookList)))]
pub async fn list(State(api): State<Api>) -> Result<Json<WebhookList>, Problem> {
    let webhooks = api.store.webhooks().await?;
    Ok(Json(WebhookList { webhooks: webhooks.into_iter().map(Into::into).collect() }))
}

/// A webhook.
#[utoipa::path(get, path = "/v1/webhooks/{id}", tag = "webhooks", operation_id = "get_webhook",
    params(("id" = Uuid, Path)), responses((status = 200, body = Webhook)))]
pub async fn get(State(api): State<Api>, JobId(id): JobId) -> Result<Json<Webhook>, Problem> {
    Ok(Json(found(&api, id).await?.into()))
}

/// Removes a webhook and its deliveries. It is told nothing more.
#[utoipa::path(delete, path = "/v1/webhooks/{id}", tag = "webhooks", operation_id = "delete_webhook",
    params(("id" = Uuid, Path)), responses((status = 204, description = "It is gone")))]
pub async fn delete(State(api): State<Api>, JobId(id): JobId) -> Result<StatusCode, Problem> {
    if api.store.remove_webhook(id).await? { Ok(StatusCode::NO_CONTENT) } else { Err(missing(id)) }
}

/// Sends a webhook a message of the type `webhook.test`, and again until it arrives, as any message.
#[utoipa::path(post, path = "/v1/webhooks/{id}/test", tag = "webhooks", operation_id = "test_webhook",
    params(("id" = Uuid, Path)),
    responses(
        (status = 202, body = Delivery, description = "It is sent in a moment"),
        (status = 409, body = dto::Problem, content_type = PROBLEM, description = "`webhook_disabled`"),
    ))]
pub async fn test(State(api): State<Api>, JobId(id): JobId) -> Result<(StatusCode, Json<Delivery>), Problem> {
    let webhook = enabled(&api, id).await?;
    let delivery = api.store.test_webhook(id, &payload::of_test(webhook.into())).await?;
    Ok((StatusCode::ACCEPTED, Json(delivery.into())))
}

/// Lists messages to a webhook, newest first: what was delivered (for a week), what is to be sent, and what was given
/// up (for a month).
#[utoipa::path(get, path = "/v1/webhooks/{id}/deliveries", tag = "webhooks", operation_id = "list_deliveries",
    params(("id" = Uuid, Path), ListDeliveries), responses((status = 200, body = DeliveryList)))]
pub async fn deliveries(
    State(api): State<Api>,
    JobId(id): JobId,
    Query(query): Query<ListDeliveries>,
) -> Result<Json<DeliveryList>, Problem> {
    found(&api, id).await?;
    let page = Page::of(query.limit, query.cursor.as_ref())?;
    let found = api.store.deliveries(id, query.status, page.after, page.wanted()).await?;
    let (found, next_cursor) = page.cut(found, |delivery| delivery.seq);
    Ok(Json(DeliveryList { deliveries: found.into_iter().map(Into::into).collect(), next_cursor }))
}

/// Sends a message again now, whether it was given up, has arrived or waits for its next time.
#[utoipa::path(post, path = "/v1/webhooks/{id}/deliveries/{delivery}/retry", tag = "webhooks",
    operation_id = "retry_delivery",
    params(("id" = Uuid, Path), ("delivery" = String, Path, description = "Id of the message", example = "msg_1")),
    responses(
        (status = 202, body = Delivery, description = "It is sent in a moment"),
        (status = 404, body = dto::Problem, content_type = PROBLEM,
            description = "`webhook_not_found`, `delivery_not_found`"),
        (status = 409, body = dto::Problem, content_type = PROBLEM, description = "`webhook_disabled`"),
    ))]
pub async fn retry(
    State(api): State<Api>,
    path: Result<Path<(Uuid, String)>, PathRejection>,
) -> Result<(StatusCode, Json<Delivery>), Problem> {
    let Path((id, delivery)) = path.map_err(|rejection| Problem::new(Code::InvalidPath, rejection.body_text()))?;
    enabled(&api, id).await?;
    let retried = api.store.retry_delivery(id, &delivery).await?;
    let missing = || {
        let detail = format!("the webhook has no delivery {delivery:?}; GET /v1/webhooks/{id}/deliveries lists all");
        Problem::new(Code::DeliveryNotFound, detail)
    };
    Ok((StatusCode::ACCEPTED, Json(retried.ok_or_else(missing)?.into())))
}

async fn found(api: &Api, id: Uuid) -> Result<store::Webhook, Problem> {
    api.store.webhook(id).await?.ok_or_else(|| missing(id))
}

async fn enabled(api: &Api, id: Uuid) -> Result<store::Webhook, Problem> {
    let webhook = found(api, id).await?;
    if !webhook.enabled {
        let detail = "its receiver answered 410, and wants nothing more; delete it, and add it anew";
        return Err(Problem::new(Code::WebhookDisabled, detail));
    }
    Ok(webhook)
}

fn missing(id: Uuid) -> Problem {
    Problem::new(Code::WebhookNotFound, format!("there is no webhook {id}; GET /v1/webhooks lists all"))
}
