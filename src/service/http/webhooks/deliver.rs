//! Makes deliveries of what happens and sends them, until they arrive or are given up.
//!
//! Each server of a database does so. A delivery is claimed by one of them, under a lease: if that server dies, another
//! one, or itself when it is back, sends it again. So a message arrives at least once, under the same id each time.

use std::collections::HashMap;
use std::sync::Arc;
use std::time::Duration;

use axum::http::{HeaderMap, HeaderValue, header};
use jiff::{SignedDuration, Timestamp};
use prometheus_client::encoding::EncodeLabelSet;
use prometheus_client::metrics::counter::Counter;
use prometheus_client::metrics::family::Family;
use tokio::task::JoinSet;
use tokio::time::{Instant, sleep};
use url::Url;
use uuid::Uuid;

use super::payload;
use super::secret::Secret;
use super::send::{Answer, Sender};
use crate::store::{Delivery, DeliveryStatus, JobStore, StoreError, Verdict, Webhook};

/// Deliveries that are sent at a time, in all and to one host.
const MOST: usize = 16;
const MOST_TO_HOST: usize = 4;
/// How long a claim is good for: longer than sending takes.
const LEASE: Duration = Duration::from_secs(40);
/// How often to look for what has happened and is due.
const LOOKS: Duration = Duration::from_millis(500);
/// How long to wait after an error of the database.
const TROUBLE: Duration = Duration::from_secs(2);
/// By how much each wait is longer than the one before, and the longest.
const GROWTH: f64 = 3.0;
const LONGEST_S: f64 = 8.0 * 3600.0;
/// How much of a wait is up to chance, so that what failed together is not sent again together.
const JITTER: f64 = 0.2;
/// How long deliveries are kept, and how often to look for older ones.
const KEPT: [(DeliveryStatus, SignedDuration); 2] = [
    (DeliveryStatus::Delivered, SignedDuration::from_hours(7 * 24)),
    (DeliveryStatus::Dead, SignedDuration::from_hours(30 * 24)),
];
const TIDYING: Duration = Duration::from_secs(600);

/// How often, and how soon, a message is sent again.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Patience {
    /// Times that a message is sent before it is given up.
    pub attempts: u32,
    /// Wait after the first time (s).
    pub first_wait_s: f64,
}

impl Default for Patience {
    /// About a day.
    fn default() -> Self {
        Self { attempts: 11, first_wait_s: 5.0 }
    }
}

impl Patience {
    /// How long to wait after so many attempts; `chance` is between 0 and 1.
    fn wait(&self, attempts: i64, chance: f64) -> Duration {
        let grown = self.first_wait_s * GROWTH.powi(i32::try_from(attempts - 1).unwrap_or(i32::MAX));
        Duration::from_secs_f64(grown.min(LONGEST_S) * (1.0 + JITTER * (2.0 * chance - 1.0)))
    }
}

/// What became of attempts, for operators.
#[derive(Clone, Debug, Default)]
pub struct Attempts(pub Family<ResultLabel, Counter>);

#[derive(Clone, Debug, PartialEq, Eq, Hash, EncodeLabelSet)]
pub struct ResultLabel {
    result: &'static str,
}

impl Attempts {
    fn count(&self, verdict: Verdict) {
        let result = match verdict {
            Verdict::Delivered => "delivered",
            Verdict::Again(_) => "failed",
            Verdict::Dead => "dead",
            Verdict::Gone => "gone",
        };
        self.0.get_or_create(&ResultLabel { result }).inc();
    }
}

/// What the task of a server works with.
#[derive(Clone)]
pub struct Deliverer {
    pub store: JobStore,
    pub sender: Arc<Sender>,
    pub patience: Patience,
    pub attempts: Attempts,
}

impl Deliverer {
    /// Delivers for ever.
    pub async fn run(self) {
        let (mut sent, mut busy) = (JoinSet::new(), Busy::default());
        let mut tidy = Instant::now();
        loop {
            let looked = async {
                if tidy.elapsed() > TIDYING {
                    tidy = Instant::now();
                    for (status, kept) in KEPT {
                        self.store.forget_deliveries(status, Timestamp::now() - kept).await?;
                    }
                }
                while self.store.spread_events(payload::of).await? > 0 {}
                self.claim(&mut sent, &mut busy).await
            };
            let mut pause = LOOKS;
            if let Err(error) = looked.await {
                tracing::warn!(%error, "cannot look for deliveries of webhooks");
                pause = TROUBLE;
            }
            tokio::select! {
                () = sleep(pause) => {}
                Some(done) = sent.join_next() => busy.done(done.ok()),
            }
            while let Some(done) = sent.try_join_next() {
                busy.done(done.ok());
            }
        }
    }

    /// Begins to send what is due, as much as may be sent now.
    async fn claim(&self, sent: &mut JoinSet<(Uuid, String)>, busy: &mut Busy) -> Result<(), StoreError> {
        let mut full = busy.full();
        while sent.len() < MOST
            && let Some((delivery, webhook)) = self.store.claim_delivery(LEASE, &full).await?
        {
            let url = Sender::judge(&webhook.url);
            let host = url.as_ref().map_or(String::new(), |url| url.host_str().unwrap_or_default().to_owned());
            if !busy.begin(webhook.id, &host) {
                // Another webhook at a host that has enough to do.
                self.store.unclaim_delivery(&delivery).await?;
                full.push(webhook.id);
                continue;
            }
            full = [busy.full(), full].concat();
            let deliverer = self.clone();
            sent.spawn(async move {
                deliverer.deliver(&delivery, &webhook, url).await;
                (webhook.id, host)
            });
        }
        Ok(())
    }

    async fn deliver(&self, delivery: &Delivery, webhook: &Webhook, url: Result<Url, String>) {
        let answer = self.send(delivery, webhook, url).await;
        let verdict = self.verdict(delivery, &answer);
        let said = match &answer {
            Ok(Answer { status, text, .. }) => (Some(*status), text.as_str()),
            Err(why) => (None, why.as_str()),
        };
        self.attempts.count(verdict);
        if matches!(verdict, Verdict::Dead | Verdict::Gone) {
            // What a stranger's server says is for whoever asks for it, and not for the log.
            let why = answer.as_ref().err();
            tracing::warn!(webhook = %webhook.id, delivery = delivery.id, code = said.0, why, "given up");
        }
        // If it cannot be noted, the lease ends, and the message is sent again.
        if let Err(error) = self.store.conclude_delivery(delivery, verdict, said).await {
            tracing::warn!(%error, delivery = delivery.id, "cannot note how a delivery went");
        }
    }

    async fn send(&self, delivery: &Delivery, webhook: &Webhook, url: Result<Url, String>) -> Result<Answer, String> {
        let (url, secret) = (url?, Secret::read(&webhook.secret)?);
        let time_s = Timestamp::now().as_second();
        let mut headers = HeaderMap::new();
        for (name, value) in [
            ("webhook-id", delivery.id.clone()),
            ("webhook-timestamp", time_s.to_string()),
            ("webhook-signature", secret.sign(&delivery.id, time_s, &delivery.payload)),
        ] {
            headers.insert(name, HeaderValue::try_from(value).map_err(|error| error.to_string())?);
        }
        headers.insert(header::CONTENT_TYPE, HeaderValue::from_static("application/json"));
        let agent = concat!("gridfall/", env!("CARGO_PKG_VERSION"));
        headers.insert(header::USER_AGENT, HeaderValue::from_static(agent));
        self.sender.post(&url, headers, delivery.payload.clone()).await
    }

    fn verdict(&self, delivery: &Delivery, answer: &Result<Answer, String>) -> Verdict {
        let attempts = delivery.attempt - delivery.spent;
        let asked = match answer {
            Ok(Answer { status: 200..300, .. }) => return Verdict::Delivered,
            Ok(Answer { status: 410, .. }) => return Verdict::Gone,
            Ok(Answer { headers, .. }) => {
                headers.get(header::RETRY_AFTER).and_then(|value| value.to_str().ok()?.parse::<u32>().ok())
            }
            Err(_) => None,
        };
        if attempts >= i64::from(self.patience.attempts) {
            return Verdict::Dead;
        }
        let asked = f64::from(asked.unwrap_or(0)).min(LONGEST_S);
        // Ids are made of chance, too.
        let chance = f64::from(Uuid::now_v7().as_bytes()[15]) / 255.0;
        Verdict::Again(self.patience.wait(attempts, chance).max(Duration::from_secs_f64(asked)))
    }
}

/// What is being sent, by host, and of which webhooks.
#[derive(Debug, Default)]
struct Busy(HashMap<String, Vec<Uuid>>);

impl Busy {
    /// Notes that something is sent to a host. False if it has enough to do.
    fn begin(&mut self, webhook: Uuid, host: &str) -> bool {
        let now = self.0.entry(host.to_owned()).or_default();
        let free = now.len() < MOST_TO_HOST;
        if free {
            now.push(webhook);
        }
        free
    }

    fn done(&mut self, done: Option<(Uuid, String)>) {
        let Some((webhook, host)) = done else { return };
        if let Some(now) = self.0.get_mut(&host) {
            let at = now.iter().position(|id| *id == webhook);
            at.map(|at| now.swap_remove(at));
            if now.is_empty() {
                self.0.remove(&host);
            }
        }
    }

    /// Webhooks at hosts that have enough to do.
    fn full(&self) -> Vec<Uuid> {
        let full = self.0.values().filter(|now| now.len() >= MOST_TO_HOST);
        full.flatten().copied().collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_are_sent_again_for_about_a_day() {
        let patience = Patience::default();
        let waits: Vec<f64> = (1..i64::from(patience.attempts)).map(|n| patience.wait(n, 0.5).as_secs_f64()).collect();
        assert_eq!(&waits[..4], [5.0, 15.0, 45.0, 135.0]);
        let all: f64 = waits.iter().sum();
        assert!((18.0..30.0).contains(&(all / 3600.0)), "{all}");
        assert_eq!(patience.wait(1, 0.0).as_secs_f64(), 4.0);
        assert_eq!(patience.wait(1, 1.0).as_secs_f64(), 6.0);
    }

    #[test]
    fn a_host_has_only_so_much_to_do() {
        let (mut busy, [a, b]) = (Busy::default(), [Uuid::from_u128(1), Uuid::from_u128(2)]);
        for _ in 0..MOST_TO_HOST - 1 {
            assert!(busy.begin(a, "one"));
        }
        assert!(busy.begin(b, "one") && !busy.begin(b, "one") && busy.begin(b, "other"));
        assert!(busy.full().contains(&a) && busy.full().contains(&b));
        busy.done(Some((a, "one".into())));
        assert!(busy.full().is_empty() && busy.begin(a, "one"));
    }
}
