//! What happens to jobs becomes deliveries, in the transaction in which it happens, and each is sent by one server at a
//! time until it arrives or is given up.

use std::sync::Arc;
use std::sync::atomic::{AtomicI64, Ordering};
use std::time::Duration;

use gridfall_service::store::{
    Delivery, DeliveryStatus, EventType, Filter, Job, JobStore, NewSweep, NewWebhook, Outcome, Subject, Submission,
    Verdict, Webhook,
};
use uuid::Uuid;

use super::{accept, new_job, on_both};

on_both!(
    every_change_of_a_job_is_told_with_the_job_as_it_was,
    webhooks_are_told_what_they_want_and_nothing_from_before,
    a_sweep_is_told_of_once,
    servers_that_race_make_and_claim_every_delivery_once,
    a_claim_without_an_end_is_taken_over_and_its_late_end_changes_nothing,
    what_was_given_up_can_be_sent_again,
    a_receiver_that_wants_no_more_gets_no_more,
    a_change_that_is_undone_is_told_nowhere,
);

const LEASE: Duration = Duration::from_secs(40);

async fn add(store: &JobStore, events: &[EventType]) -> Webhook {
    let new = NewWebhook { url: "https://example.com/".into(), secret: "whsec_".into(), events: events.to_vec() };
    store.add_webhook(&new, 100).await.unwrap().unwrap()
}

/// Names the event, and what it is about.
fn named(event: EventType, _: jiff::Timestamp, subject: &Subject) -> String {
    match subject {
        Subject::Job(job) => format!("{} {} {}", event.as_str(), job.name, job.attempt),
        Subject::Sweep(sweep) => format!("{} {}", event.as_str(), sweep.name),
    }
}

async fn spread(store: &JobStore) {
    while store.spread_events(named).await.unwrap() > 0 {}
}

/// What a webhook is told, the oldest first.
async fn told(store: &JobStore, webhook: &Webhook) -> Vec<String> {
    spread(store).await;
    let deliveries = store.deliveries(webhook.id, None, None, 1000).await.unwrap();
    deliveries.into_iter().rev().map(|delivery| delivery.payload).collect()
}

async fn run(store: &JobStore, outcome: Outcome) {
    let claim = store.claim("me").await.unwrap().unwrap();
    assert!(store.finish(claim.id, claim.attempt, &outcome).await.unwrap());
}

async fn every_change_of_a_job_is_told_with_the_job_as_it_was(store: JobStore) {
    let webhook = add(&store, &[]).await;
    let job = accept(&store, "a").await;
    let as_they_were = std::sync::Mutex::new(Vec::<Job>::new());
    let keep = |event: EventType, at: jiff::Timestamp, subject: &Subject| {
        if let Subject::Job(job) = subject {
            assert!(event != EventType::JobQueued || job.attempt > 0 || at == job.created_at);
            as_they_were.lock().unwrap().push((**job).clone());
        }
        event.as_str().to_owned()
    };
    let queued = store.get(job.id).await.unwrap().unwrap();
    let claim = store.claim("me").await.unwrap().unwrap();
    let running = store.get(job.id).await.unwrap().unwrap();
    // Nothing was made of the events before: they keep the job as it was.
    store.put_back(claim.id, claim.attempt).await.unwrap();
    let again = store.get(job.id).await.unwrap().unwrap();
    run(&store, Outcome::Succeeded).await;
    let ended = store.get(job.id).await.unwrap().unwrap();
    assert_eq!(store.spread_events(keep).await.unwrap(), 5);
    let seen = as_they_were.into_inner().unwrap();
    assert_eq!(seen[0], Job { queue_position: None, ..queued });
    assert_eq!(seen[1], running);
    assert_eq!(seen[2], Job { queue_position: None, ..again });
    assert_eq!((seen[3].attempt, &seen[4]), (2, &ended));
    assert_eq!(
        told(&store, &webhook).await,
        ["job.queued", "job.started", "job.queued", "job.started", "job.succeeded"]
    );
    // What is no change is told nobody, and what is deleted is still told.
    let other = accept(&store, "b").await;
    store.cancel(other.id).await.unwrap();
    store.cancel(other.id).await.unwrap();
    store.delete(other.id).await.unwrap();
    assert_eq!(told(&store, &webhook).await[5..], ["job.queued b 0", "job.canceled b 0"]);
}

async fn webhooks_are_told_what_they_want_and_nothing_from_before(store: JobStore) {
    accept(&store, "before").await;
    assert_eq!(store.spread_events(named).await.unwrap(), 0, "nobody was there to be told");
    let ends = add(&store, &[EventType::JobSucceeded, EventType::JobCanceled]).await;
    run(&store, Outcome::Succeeded).await;
    let late = add(&store, &[]).await;
    let job = accept(&store, "after").await;
    store.cancel(job.id).await.unwrap();
    assert_eq!(told(&store, &ends).await, ["job.succeeded before 1", "job.canceled after 0"]);
    assert_eq!(told(&store, &late).await, ["job.queued after 0", "job.canceled after 0"]);
    assert!(store.remove_webhook(late.id).await.unwrap() && !store.remove_webhook(late.id).await.unwrap());
    assert_eq!(store.webhooks().await.unwrap(), [ends]);
}

async fn a_sweep_is_told_of_once(store: JobStore) {
    let webhook = add(&store, &[EventType::SweepFinished]).await;
    let new =
        NewSweep { name: "swept".into(), jobs: vec![new_job("a"), new_job("b"), new_job("c")], ..NewSweep::default() };
    let Submission::Accepted(sweep) = store.submit_sweep(&new, 100).await.unwrap() else { panic!() };
    run(&store, Outcome::Succeeded).await;
    assert_eq!(told(&store, &webhook).await, [""; 0]);
    run(&store, Outcome::Succeeded).await;
    let last = store.claim("me").await.unwrap().unwrap();
    store.cancel_all(&Filter { sweep: Some(sweep), ..Filter::default() }).await.unwrap();
    assert_eq!(told(&store, &webhook).await, [""; 0], "a job still runs");
    store.finish(last.id, last.attempt, &Outcome::Canceled).await.unwrap();
    assert_eq!(told(&store, &webhook).await, ["sweep.finished swept"]);
    // Two servers may both see the last job end.
    let Submission::Accepted(_) = store.submit_sweep(&new, 100).await.unwrap() else { panic!() };
    while let Some(claim) = store.claim("me").await.unwrap() {
        store.finish(claim.id, claim.attempt, &Outcome::Succeeded).await.unwrap();
    }
    let (one, other) = tokio::join!(store.spread_events(named), store.spread_events(named));
    assert!(one.unwrap() + other.unwrap() > 0);
    assert_eq!(told(&store, &webhook).await, ["sweep.finished swept"; 2]);
}

async fn servers_that_race_make_and_claim_every_delivery_once(store: JobStore) {
    const JOBS: usize = 150;
    let webhook = add(&store, &[EventType::JobQueued]).await;
    for n in 0..JOBS {
        accept_many(&store, n).await;
    }
    let servers: Vec<_> = (0..6)
        .map(|_| {
            let store = store.clone();
            tokio::spawn(async move {
                spread(&store).await;
                let mut claimed = Vec::new();
                while let Some((delivery, _)) = store.claim_delivery(LEASE, &[]).await.unwrap() {
                    claimed.push(delivery.id);
                }
                claimed
            })
        })
        .collect();
    let mut claimed = Vec::new();
    for server in servers {
        claimed.extend(server.await.unwrap());
    }
    // Events that one server had taken became deliveries after another had looked.
    while let Some((delivery, _)) = store.claim_delivery(LEASE, &[]).await.unwrap() {
        claimed.push(delivery.id);
    }
    claimed.sort();
    claimed.dedup();
    assert_eq!(claimed.len(), JOBS);
    assert_eq!(told(&store, &webhook).await.len(), JOBS);
    assert!(store.claim_delivery(LEASE, &[]).await.unwrap().is_none());
}

async fn accept_many(store: &JobStore, n: usize) {
    assert!(matches!(store.submit(&new_job(&n.to_string()), 1000).await.unwrap(), Submission::Accepted(_)));
}

async fn claimed(store: &JobStore) -> Option<Delivery> {
    store.claim_delivery(LEASE, &[]).await.unwrap().map(|(delivery, _)| delivery)
}

async fn conclude(store: &JobStore, delivery: &Delivery, verdict: Verdict) -> bool {
    store.conclude_delivery(delivery, verdict, (Some(500), "no")).await.unwrap()
}

fn with_time(store: JobStore) -> (Arc<AtomicI64>, JobStore) {
    let time = Arc::new(AtomicI64::new(1_000_000_000_000_000));
    let read = time.clone();
    (time, store.with_clock(move || read.load(Ordering::SeqCst)))
}

fn pass(time: &AtomicI64, seconds: u64) {
    time.fetch_add((seconds * 1_000_000) as i64, Ordering::SeqCst);
}

async fn a_claim_without_an_end_is_taken_over_and_its_late_end_changes_nothing(store: JobStore) {
    let (time, store) = with_time(store);
    let webhook = add(&store, &[]).await;
    store.test_webhook(webhook.id, "{}").await.unwrap();
    let first = claimed(&store).await.unwrap();
    assert_eq!((first.attempt, claimed(&store).await), (1, None));
    assert!(store.claim_delivery(LEASE, &[webhook.id]).await.unwrap().is_none());
    pass(&time, 41);
    assert!(store.claim_delivery(LEASE, &[webhook.id]).await.unwrap().is_none(), "the webhook is busy");
    let second = claimed(&store).await.unwrap();
    assert_eq!((&second.id, second.attempt), (&first.id, 2));
    assert!(!conclude(&store, &first, Verdict::Dead).await);
    assert!(conclude(&store, &second, Verdict::Again(Duration::from_secs(10))).await);
    pass(&time, 9);
    assert!(claimed(&store).await.is_none());
    pass(&time, 2);
    let third = claimed(&store).await.unwrap();
    store.unclaim_delivery(&third).await.unwrap();
    let third = claimed(&store).await.unwrap();
    assert_eq!(third.attempt, 3);
    assert!(conclude(&store, &third, Verdict::Delivered).await);
    pass(&time, 1000);
    assert!(claimed(&store).await.is_none());
    let kept = &store.deliveries(webhook.id, None, None, 10).await.unwrap()[0];
    assert_eq!((kept.status, kept.reply.as_ref().unwrap().code), (DeliveryStatus::Delivered, Some(500)));
}

async fn what_was_given_up_can_be_sent_again(store: JobStore) {
    let webhook = add(&store, &[]).await;
    let made = store.test_webhook(webhook.id, "{}").await.unwrap();
    let sent = claimed(&store).await.unwrap();
    // While it is being sent, a retry does not send it twice.
    store.retry_delivery(webhook.id, &made.id).await.unwrap().unwrap();
    assert!(claimed(&store).await.is_none());
    assert!(conclude(&store, &sent, Verdict::Dead).await);
    assert_eq!(store.count_deliveries(DeliveryStatus::Dead).await.unwrap(), 1);
    let dead = store.deliveries(webhook.id, Some(DeliveryStatus::Dead), None, 10).await.unwrap();
    assert_eq!(dead[0].id, made.id);
    assert!(store.deliveries(webhook.id, Some(DeliveryStatus::Pending), None, 10).await.unwrap().is_empty());
    let again = store.retry_delivery(webhook.id, &made.id).await.unwrap().unwrap();
    assert_eq!((again.status, again.attempt, again.spent), (DeliveryStatus::Pending, 1, 1));
    assert!(store.retry_delivery(Uuid::now_v7(), &made.id).await.unwrap().is_none());
    let sent = claimed(&store).await.unwrap();
    assert!(conclude(&store, &sent, Verdict::Again(Duration::from_secs(1000))).await);
    store.retry_delivery(webhook.id, &made.id).await.unwrap().unwrap();
    let sent = claimed(&store).await.expect("a retry does not wait");
    assert_eq!(sent.spent, 1);
    assert!(conclude(&store, &sent, Verdict::Delivered).await);
    let now = jiff::Timestamp::now() + jiff::SignedDuration::from_secs(1);
    assert_eq!(store.forget_deliveries(DeliveryStatus::Dead, now).await.unwrap(), 0);
    assert_eq!(store.forget_deliveries(DeliveryStatus::Delivered, now).await.unwrap(), 1);
}

async fn a_receiver_that_wants_no_more_gets_no_more(store: JobStore) {
    let (gone, there) = (add(&store, &[]).await, add(&store, &[]).await);
    accept(&store, "a").await;
    spread(&store).await;
    let sent = loop {
        let sent = claimed(&store).await.unwrap();
        if sent.webhook == gone.id {
            break sent;
        }
    };
    accept(&store, "b").await;
    spread(&store).await;
    assert!(conclude(&store, &sent, Verdict::Gone).await);
    assert!(!store.webhook(gone.id).await.unwrap().unwrap().enabled);
    assert_eq!(store.deliveries(gone.id, Some(DeliveryStatus::Dead), None, 10).await.unwrap().len(), 2);
    accept(&store, "c").await;
    assert_eq!(told(&store, &gone).await.len(), 2);
    assert_eq!(told(&store, &there).await.len(), 3);
}

/// A sweep without room is refused after its first jobs were added.
async fn a_change_that_is_undone_is_told_nowhere(store: JobStore) {
    let webhook = add(&store, &[]).await;
    let new = NewSweep { name: "s".into(), jobs: vec![new_job("a"), new_job("b")], ..NewSweep::default() };
    assert!(matches!(store.submit_sweep(&new, 1).await.unwrap(), Submission::QueueFull));
    assert_eq!(told(&store, &webhook).await, [""; 0]);
}
