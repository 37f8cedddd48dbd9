//! Deliveries of webhooks: claimed under a lease, as jobs are, and sent again until they arrive or are given up.

use std::time::Duration;

use jiff::Timestamp;
use serde::{Deserialize, Serialize};
use sqlx::any::{Any, AnyRow};
use sqlx::{AssertSqlSafe, Executor, FromRow, Row};
use uuid::Uuid;

use super::row::{decode, timestamp, uuid};
use super::webhooks::{EventType, Webhook, WebhookRow};
use super::{JobStore, Result};

/// `pending → delivered | dead`; a retry makes it pending again.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, utoipa::ToSchema)]
#[serde(rename_all = "lowercase")]
pub enum DeliveryStatus {
    Pending,
    Delivered,
    Dead,
}

impl DeliveryStatus {
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Pending => "pending",
            Self::Delivered => "delivered",
            Self::Dead => "dead",
        }
    }
}

/// How the receiver, or the way to it, answered last.
#[derive(Clone, Debug, PartialEq)]
pub struct Reply {
    pub at: Timestamp,
    /// HTTP status; `None` where no answer came.
    pub code: Option<u16>,
    /// The beginning of the answer, or why there is none.
    pub text: String,
}

/// What is told to one webhook.
#[derive(Clone, Debug, PartialEq)]
pub struct Delivery {
    /// Order of making.
    pub seq: i64,
    /// The same in all attempts, for receivers that drop what they have.
    pub id: String,
    pub webhook: Uuid,
    pub event: EventType,
    /// JSON.
    pub payload: String,
    pub created_at: Timestamp,
    pub status: DeliveryStatus,
    /// Counts claims; the fencing token of what an attempt writes.
    pub attempt: i64,
    /// Claims before it was last made pending by hand.
    pub spent: i64,
    /// When it is sent next, if it is pending.
    pub next_at: Timestamp,
    pub reply: Option<Reply>,
}

/// What becomes of a delivery after an attempt.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    Delivered,
    /// To be sent again after so long.
    Again(Duration),
    Dead,
    /// The receiver wants nothing more: neither this nor anything else.
    Gone,
}

impl FromRow<'_, AnyRow> for Delivery {
    fn from_row(row: &AnyRow) -> sqlx::Result<Self> {
        let status: String = row.try_get("status")?;
        let known = [DeliveryStatus::Pending, DeliveryStatus::Delivered, DeliveryStatus::Dead];
        let status = known.into_iter().find(|known| known.as_str() == status);
        let answered_at: Option<i64> = row.try_get("answered_at")?;
        let code: Option<i64> = row.try_get("answer_code")?;
        let text: Option<String> = row.try_get("answer")?;
        let reply = |at| -> sqlx::Result<Reply> {
            let code = code.and_then(|code| u16::try_from(code).ok());
            Ok(Reply { at: timestamp(at)?, code, text: text.clone().unwrap_or_default() })
        };
        Ok(Self {
            seq: row.try_get("seq")?,
            id: row.try_get("id")?,
            webhook: uuid(row.try_get("webhook")?)?,
            event: EventType::known(&row.try_get::<String, _>("event")?)?,
            payload: row.try_get("payload")?,
            created_at: timestamp(row.try_get("created_at")?)?,
            status: status.ok_or_else(|| decode("a status that the table's check does not allow"))?,
            attempt: row.try_get("attempt")?,
            spent: row.try_get("spent")?,
            next_at: timestamp(row.try_get("next_at")?)?,
            reply: answered_at.map(reply).transpose()?,
        })
    }
}

/// Adds a delivery about a job or a sweep. Does nothing if it tells of the end of a sweep a second time.
pub(super) async fn insert(
    to: impl Executor<'_, Database = Any>,
    webhook: Uuid,
    (event, subject): (EventType, Uuid),
    payload: &str,
    now: i64,
) -> sqlx::Result<Option<Delivery>> {
    sqlx::query_as(
        "INSERT INTO webhook_deliveries (id, webhook, event, subject, payload, created_at, status, next_at) \
         VALUES ($1, $2, $3, $4, $5, $6, 'pending', $7) ON CONFLICT DO NOTHING RETURNING *",
    )
    .bind(format!("msg_{}", Uuid::now_v7().simple()))
    .bind(webhook.to_string())
    .bind(event.as_str())
    .bind(subject.to_string())
    .bind(payload)
    .bind(now)
    .bind(now)
    .fetch_optional(to)
    .await
}

impl JobStore {
    /// Adds a delivery that tells a webhook of itself.
    pub async fn test_webhook(&self, webhook: Uuid, payload: &str) -> Result<Delivery> {
        let event = (EventType::WebhookTest, webhook);
        let made = insert(&self.database.writer, webhook, event, payload, self.clock.now()).await?;
        Ok(made.ok_or(sqlx::Error::RowNotFound)?)
    }

    /// Claims the delivery that has been due longest, for as long as `lease`, of webhooks but those in `busy`.
    pub async fn claim_delivery(&self, lease: Duration, busy: &[Uuid]) -> Result<Option<(Delivery, Webhook)>> {
        let now = self.clock.now();
        // Ids, not the text of a client.
        let busy: Vec<String> = busy.iter().map(|id| format!("'{id}'")).collect();
        let but = if busy.is_empty() { String::new() } else { format!("AND webhook NOT IN ({})", busy.join(", ")) };
        let due = format!("status = 'pending' AND next_at <= $1 {but}");
        let waiting = format!("SELECT seq FROM webhook_deliveries WHERE {due} LIMIT 1");
        let waiting = sqlx::query(AssertSqlSafe(waiting)).bind(now);
        if waiting.fetch_optional(&self.database.reader).await?.is_none() {
            return Ok(None);
        }
        let delivery: Option<Delivery> = sqlx::query_as(AssertSqlSafe(format!(
            "UPDATE webhook_deliveries SET attempt = attempt + 1, claimed = 1, next_at = $2 WHERE seq = \
               (SELECT seq FROM webhook_deliveries WHERE {due} ORDER BY next_at, seq LIMIT 1 {}) RETURNING *",
            self.database.skip_locked()
        )))
        .bind(now)
        .bind(now.saturating_add(micros(lease)))
        .fetch_optional(&self.database.writer)
        .await?;
        let Some(delivery) = delivery else { return Ok(None) };
        // Its row may have been removed with its deliveries just now.
        let webhook: Option<WebhookRow> = sqlx::query_as("SELECT * FROM webhooks WHERE id = $1")
            .bind(delivery.webhook.to_string())
            .fetch_optional(&self.database.writer)
            .await?;
        Ok(webhook.map(|webhook| (delivery, webhook.0)))
    }

    /// Gives a claim back, as if there had been none.
    pub async fn unclaim_delivery(&self, delivery: &Delivery) -> Result<()> {
        sqlx::query(
            "UPDATE webhook_deliveries SET attempt = attempt - 1, claimed = 0, next_at = $1 \
             WHERE id = $2 AND attempt = $3 AND status = 'pending'",
        )
        .bind(self.clock.now())
        .bind(&delivery.id)
        .bind(delivery.attempt)
        .execute(&self.database.writer)
        .await?;
        Ok(())
    }

    /// Records how an attempt went. Returns false if the delivery is no longer this attempt's.
    pub async fn conclude_delivery(
        &self,
        delivery: &Delivery,
        verdict: Verdict,
        (code, text): (Option<u16>, &str),
    ) -> Result<bool> {
        let now = self.clock.now();
        let (status, next_at) = match verdict {
            Verdict::Delivered => (DeliveryStatus::Delivered, now),
            Verdict::Again(wait) => (DeliveryStatus::Pending, now.saturating_add(micros(wait))),
            Verdict::Dead | Verdict::Gone => (DeliveryStatus::Dead, now),
        };
        let mut tx = self.database.writer.begin().await?;
        let changed = sqlx::query(
            "UPDATE webhook_deliveries SET status = $1, claimed = 0, next_at = $2, answered_at = $3, answer_code = $4, \
               answer = $5 \
             WHERE id = $6 AND attempt = $7 AND status = 'pending'",
        )
        .bind(status.as_str())
        .bind(next_at)
        .bind(now)
        .bind(code.map(i64::from))
        .bind(text)
        .bind(&delivery.id)
        .bind(delivery.attempt)
        .execute(&mut *tx)
        .await?
        .rows_affected();
        if verdict == Verdict::Gone && changed > 0 {
            let webhook = delivery.webhook.to_string();
            sqlx::query("UPDATE webhooks SET enabled = 0 WHERE id = $1").bind(&webhook).execute(&mut *tx).await?;
            sqlx::query("UPDATE webhook_deliveries SET status = 'dead' WHERE webhook = $1 AND status = 'pending'")
                .bind(&webhook)
                .execute(&mut *tx)
                .await?;
        }
        tx.commit().await?;
        Ok(changed > 0)
    }

    /// Makes a delivery due now; one that was given up or has arrived gets all its attempts anew. `None` if there is
    /// none of that webhook.
    pub async fn retry_delivery(&self, webhook: Uuid, id: &str) -> Result<Option<Delivery>> {
        let retried = sqlx::query_as(
            "UPDATE webhook_deliveries SET status = 'pending', \
               spent = CASE status WHEN 'pending' THEN spent ELSE attempt END, \
               next_at = CASE claimed WHEN 1 THEN next_at ELSE $1 END \
             WHERE id = $2 AND webhook = $3 RETURNING *",
        );
        let retried = retried.bind(self.clock.now()).bind(id).bind(webhook.to_string());
        Ok(retried.fetch_optional(&self.database.writer).await?)
    }

    /// The deliveries of a webhook, newest first; if `before` (a [`Delivery::seq`]) is given, only those made before
    /// it.
    pub async fn deliveries(
        &self,
        webhook: Uuid,
        status: Option<DeliveryStatus>,
        before: Option<i64>,
        limit: i64,
    ) -> Result<Vec<Delivery>> {
        let of_status = status.map_or(String::new(), |status| format!("AND status = '{}'", status.as_str()));
        let found = sqlx::query_as(AssertSqlSafe(format!(
            "SELECT * FROM webhook_deliveries WHERE webhook = $1 AND seq < $2 {of_status} ORDER BY seq DESC LIMIT $3"
        )));
        let found = found.bind(webhook.to_string()).bind(before.unwrap_or(i64::MAX)).bind(limit);
        Ok(found.fetch_all(&self.database.reader).await?)
    }

    /// Number of all deliveries of a status.
    pub async fn count_deliveries(&self, status: DeliveryStatus) -> Result<i64> {
        let count = sqlx::query_scalar("SELECT count(*) FROM webhook_deliveries WHERE status = $1");
        Ok(count.bind(status.as_str()).fetch_one(&self.database.reader).await?)
    }

    /// Forgets deliveries that arrived, or were given up, before a time. Returns how many.
    pub async fn forget_deliveries(&self, status: DeliveryStatus, before: Timestamp) -> Result<u64> {
        let forgotten = sqlx::query("DELETE FROM webhook_deliveries WHERE status = $1 AND created_at < $2");
        let forgotten = forgotten.bind(status.as_str()).bind(before.as_microsecond());
        Ok(forgotten.execute(&self.database.writer).await?.rows_affected())
    }
}

fn micros(time: Duration) -> i64 {
    i64::try_from(time.as_micros()).unwrap_or(i64::MAX)
}
