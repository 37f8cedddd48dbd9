//! Keys: what is whose, how much of it there may be, and whose turn it is.

use std::sync::Arc;
use std::sync::atomic::{AtomicI64, Ordering};

use gridfall_service::store::{
    Filter, Job, JobStore, Key, NewJob, NewKey, NewSweep, Outcome, Owner, Progress, Quotas, Scope, Secret, Standing,
    Status, Submission, Upload,
};
use jiff::{Timestamp, ToSpan};
use uuid::Uuid;

use super::{new_job, on_both};

on_both!(
    a_key_is_found_by_its_secret_alone_and_ends,
    what_is_one_keys_is_in_no_list_of_another,
    an_idempotency_key_is_its_owners,
    quotas_bound_what_waits_and_what_runs,
    time_on_devices_is_counted_and_bounded_whatever_is_deleted,
    room_is_counted_until_it_is_given_back,
    few_jobs_are_not_behind_many,
    a_cluster_is_offered_jobs_by_turns,
    whoever_comes_back_takes_nobodys_turns,
    many_lines_are_looked_through_soon,
);

async fn made(store: &JobStore, name: &str, quotas: Quotas) -> (Key, Secret) {
    let new = NewKey { name: name.into(), scope: Scope::Submit, expires_at: None, quotas };
    store.create_key(&new).await.unwrap().unwrap()
}

fn of(key: &Key, name: &str) -> NewJob {
    let owner = Owner { key: key.id.clone(), max_queued: key.quotas.queued };
    NewJob { owner, ..new_job(name) }
}

async fn submit(store: &JobStore, new: &NewJob) -> Job {
    match store.submit(new, 100_000).await.unwrap() {
        Submission::Accepted(job) => job,
        other => panic!("{other:?}"),
    }
}

async fn many(store: &JobStore, key: &Key, jobs: usize) {
    let mut submissions = tokio::task::JoinSet::new();
    for n in 0..jobs {
        let (store, new) = (store.clone(), of(key, &format!("{} {n}", key.name)));
        submissions.spawn(async move { submit(&store, &new).await });
    }
    submissions.join_all().await;
}

/// A store whose clock the test sets (s).
fn clocked(store: JobStore) -> (JobStore, Arc<AtomicI64>) {
    let clock = Arc::new(AtomicI64::new(1_000_000));
    let shown = clock.clone();
    (store.with_clock(move || shown.load(Ordering::Relaxed) * 1_000_000), clock)
}

/// Claims a job, runs it for so many seconds, and returns the key it is of.
async fn run_one(store: &JobStore, clock: &AtomicI64, seconds: impl Fn(&str) -> i64) -> Option<String> {
    let claim = store.claim("me").await.unwrap()?;
    let owner = store.owner_of_job(claim.id).await.unwrap().unwrap();
    for _ in 0..seconds(&owner) {
        clock.fetch_add(1, Ordering::Relaxed);
        assert!(store.heartbeat(claim.id, claim.attempt, &Progress::default()).await.unwrap());
    }
    assert!(store.finish(claim.id, claim.attempt, &Outcome::Succeeded).await.unwrap());
    Some(owner)
}

async fn a_key_is_found_by_its_secret_alone_and_ends(store: JobStore) {
    assert!(!store.has_keys().await.unwrap());
    let now = Timestamp::now();
    let quotas = Quotas { particles: Some(7), ..Quotas::default() };
    let new = NewKey { name: "a".into(), scope: Scope::Read, expires_at: Some(now + 1.hour()), quotas };
    let (key, secret) = store.create_key(&new).await.unwrap().unwrap();
    assert!(store.has_keys().await.unwrap());
    assert!(store.create_key(&new).await.unwrap().is_none(), "the name is taken");
    assert_eq!(store.key_of(&secret).await.unwrap(), Some(key.clone()));
    assert_eq!((key.quotas.particles, key.scope, key.standing(now)), (Some(7), Scope::Read, Standing::Good));
    assert_eq!(key.standing(now + 2.hours()), Standing::Expired);

    let (renewed, other) = store.renew_key("a", None).await.unwrap().unwrap();
    assert_eq!((&renewed.id, renewed.expires_at), (&key.id, None));
    assert_eq!(store.key_of(&secret).await.unwrap(), None, "the old secret is void");
    let revoked = store.revoke_key("a").await.unwrap().unwrap();
    assert_eq!(revoked.standing(now), Standing::Revoked);
    assert_eq!(store.key_of(&other).await.unwrap(), Some(revoked));
    assert!(store.has_keys().await.unwrap(), "a server that asks for keys does not stop to when they end");
    assert!(store.revoke_key("b").await.unwrap().is_none());
    store.key_used(&key.id).await.unwrap();
    assert!(store.keys().await.unwrap()[0].last_used_at.is_some());
}

async fn what_is_one_keys_is_in_no_list_of_another(store: JobStore) {
    let ((a, _), (b, _)) = (made(&store, "a", Quotas::default()).await, made(&store, "b", Quotas::default()).await);
    let tagged = |key: &Key, n: i64| NewJob { tags: vec!["t".into()], priority: n % 2, ..of(key, &format!("job {n}")) };
    let mut of_b = Vec::new();
    for n in 0..6 {
        submit(&store, &tagged(&a, n)).await;
        of_b.push(submit(&store, &tagged(&b, n)).await);
    }
    assert_eq!(of_b.iter().map(|job| job.queue_position.unwrap()).collect::<Vec<_>>(), [1, 1, 3, 2, 5, 3]);
    let sweep =
        NewSweep { owner: of(&a, "").owner, name: "s".into(), jobs: vec![of(&a, "s 1")], ..NewSweep::default() };
    let Submission::Accepted(sweep) = store.submit_sweep(&sweep, 100).await.unwrap() else { panic!() };
    submit(&store, &new_job("nobody's")).await;

    let whole = Filter { key: Some(b.id.clone()), ..Filter::default() };
    let filters = [
        whole.clone(),
        Filter { tags: vec!["t".into()], ..whole.clone() },
        Filter { statuses: vec![Status::Queued], ..whole.clone() },
        Filter { tags: vec!["t".into()], statuses: vec![Status::Queued], name: Some("job*".into()), ..whole.clone() },
    ];
    for filter in &filters {
        let listed = store.list(filter, None, 100).await.unwrap();
        assert!(listed.iter().all(|job| job.key.as_deref() == Some(&b.id)));
        assert_eq!(
            listed.iter().map(|job| job.id).collect::<Vec<_>>(),
            of_b.iter().rev().map(|job| job.id).collect::<Vec<_>>()
        );
        let places: Vec<i64> = listed.iter().rev().map(|job| job.queue_position.unwrap()).collect();
        assert_eq!(places, [4, 1, 5, 2, 6, 3]);
        assert!(filter.key.is_some());
    }
    let stranger = Filter { sweep: Some(sweep), ..whole.clone() };
    assert!(store.list(&stranger, None, 9).await.unwrap().is_empty());
    assert_eq!(store.sweeps(Some(&b.id), None, 9).await.unwrap(), []);
    assert_eq!(store.sweeps(Some(&a.id), None, 9).await.unwrap()[0].id, sweep);
    assert_eq!(store.owner_of_sweep(sweep).await.unwrap(), Some(a.id.clone()));
    assert_eq!(store.owner_of_job(Uuid::now_v7()).await.unwrap(), None);

    assert_eq!(store.cancel_all(&Filter { tags: vec!["t".into()], ..whole.clone() }).await.unwrap(), 6);
    assert_eq!(store.delete_all(&whole, 100).await.unwrap().len(), 6);
    assert_eq!(store.list(&Filter::default(), None, 100).await.unwrap().len(), 8, "no other's are touched");
    assert!(whole.is_empty() && !stranger.is_empty());
    assert_eq!(store.list(&whole, None, 100).await.unwrap(), []);
}

async fn an_idempotency_key_is_its_owners(store: JobStore) {
    let ((a, _), (b, _)) = (made(&store, "a", Quotas::default()).await, made(&store, "b", Quotas::default()).await);
    let mut ids = Vec::new();
    for new in [of(&a, "same"), of(&b, "same"), new_job("same")] {
        let keyed = NewJob { idempotency_key: Some("k".into()), ..new };
        let Submission::Accepted(job) = store.submit(&keyed, 9).await.unwrap() else { panic!() };
        let Submission::Repeated(same) = store.submit(&keyed, 9).await.unwrap() else { panic!() };
        assert_eq!(job.id, same.id);
        ids.push(job.id);
    }
    ids.dedup();
    assert_eq!(ids.len(), 3);
    // What one has computed is no answer for another.
    let claim = store.claim("me").await.unwrap().unwrap();
    store.finish(claim.id, claim.attempt, &Outcome::Succeeded).await.unwrap();
    for key in [a.id.as_str(), b.id.as_str(), ""] {
        let found = store.finished("", "me", key).await.unwrap();
        assert!(found.is_none_or(|job| job.key.unwrap_or_default() == key));
    }
}

async fn quotas_bound_what_waits_and_what_runs(store: JobStore) {
    let bounded = Quotas { queued: Some(3), running: Some(1), ..Quotas::default() };
    let ((a, _), (b, _)) = (made(&store, "a", bounded).await, made(&store, "b", Quotas::default()).await);
    for n in 0..3 {
        submit(&store, &of(&a, &format!("{n}"))).await;
    }
    assert!(matches!(store.submit(&of(&a, "4"), 100).await.unwrap(), Submission::OwnerFull(3)));
    submit(&store, &of(&b, "b")).await;
    let two = NewSweep { owner: of(&a, "").owner, jobs: vec![of(&a, "x"), of(&a, "y")], ..NewSweep::default() };
    store.claim("me").await.unwrap().unwrap();
    assert!(matches!(store.submit_sweep(&two, 100).await.unwrap(), Submission::OwnerFull(3)), "all or none");
    submit(&store, &of(&a, "there is room for one")).await;
    assert_eq!(store.owner_of_job(store.claim("me").await.unwrap().unwrap().id).await.unwrap(), Some(b.id));
    assert!(store.claim("me").await.unwrap().is_none(), "one of a's runs, and more may not");
    store.set_quotas("a", Quotas::default()).await.unwrap().unwrap();
    assert!(store.claim("me").await.unwrap().is_some());
}

async fn time_on_devices_is_counted_and_bounded_whatever_is_deleted(store: JobStore) {
    let (store, clock) = clocked(store);
    let (a, _) = made(&store, "a", Quotas { device_s: Some(50), ..Quotas::default() }).await;
    many(&store, &a, 9).await;
    for _ in 0..2 {
        run_one(&store, &clock, |_| 20).await.unwrap();
    }
    // An attempt that dies, and one that is put back, count as well; what nobody beats for does not.
    let claim = store.claim("me").await.unwrap().unwrap();
    clock.fetch_add(10, Ordering::Relaxed);
    store.heartbeat(claim.id, claim.attempt, &Progress::default()).await.unwrap();
    clock.fetch_add(1000, Ordering::Relaxed);
    assert!(store.claim("me").await.unwrap().is_none(), "the quota is used up");
    let usage = || async { store.usage(Some(&a.id)).await.unwrap().pop().unwrap() };
    assert_eq!((usage().await.device_s, usage().await.queued, usage().await.jobs), (50.0, 7, 9));
    let ended = Filter { statuses: vec![Status::Succeeded], key: Some(a.id.clone()), ..Filter::default() };
    assert_eq!(store.delete_all(&ended, 9).await.unwrap().len(), 2);
    assert_eq!((usage().await.device_s, usage().await.total_device_s), (50.0, 50.0));
    clock.fetch_add(31 * 86_400, Ordering::Relaxed);
    assert_eq!((usage().await.device_s, usage().await.total_device_s), (0.0, 50.0));
    assert!(store.claim("me").await.unwrap().is_some());
}

async fn room_is_counted_until_it_is_given_back(store: JobStore) {
    let (store, clock) = clocked(store);
    let ((a, _), (b, _)) = (made(&store, "a", Quotas::default()).await, made(&store, "b", Quotas::default()).await);
    many(&store, &a, 2).await;
    run_one(&store, &clock, |_| 1).await.unwrap();
    assert!(store.to_measure("me", 9).await.unwrap().is_empty(), "its worker may still be tidying up");
    clock.fetch_add(5, Ordering::Relaxed);
    assert!(store.to_measure("another server", 9).await.unwrap().is_empty());
    let [job] = store.to_measure("me", 9).await.unwrap()[..] else { panic!() };
    store.measured(job, 1000).await.unwrap();
    assert!(store.to_measure("me", 9).await.unwrap().is_empty());
    assert!(store.hold(&a.id, Upload::Asset, "sha256:1", 10).await.unwrap());
    assert!(!store.hold(&a.id, Upload::Asset, "sha256:1", 10).await.unwrap(), "the same file is one");
    assert!(store.hold(&b.id, Upload::Asset, "sha256:1", 10).await.unwrap(), "it is new to b");
    assert!(!store.holds(&b.id, Upload::Scene, "sha256:1").await.unwrap());
    assert_eq!(store.held(&b.id, Upload::Asset).await.unwrap(), ["sha256:1"]);
    let bytes = || async { store.usage(None).await.unwrap().iter().map(|usage| usage.bytes).collect::<Vec<_>>() };
    assert_eq!(bytes().await, [1010, 10]);
    store.delete(job).await.unwrap();
    assert_eq!(bytes().await, [10, 10]);
}

async fn few_jobs_are_not_behind_many(store: JobStore) {
    let (store, clock) = clocked(store);
    let ((a, _), (b, _)) = (made(&store, "a", Quotas::default()).await, made(&store, "b", Quotas::default()).await);
    many(&store, &a, 100).await;
    for _ in 0..10 {
        run_one(&store, &clock, |_| 2).await.unwrap();
    }
    many(&store, &b, 5).await;
    let mut order = Vec::new();
    for _ in 0..12 {
        order.push(run_one(&store, &clock, |_| 2).await.unwrap());
    }
    let places: Vec<usize> = (0..12).filter(|&n| order[n] == b.id).collect();
    assert_eq!(places.len(), 5, "{order:?}");
    assert!(places[4] <= 9 && places[0] <= 1, "every second one is b's: {places:?}");

    // With several workers, each has its share of them at once.
    many(&store, &b, 5).await;
    let mut running = Vec::new();
    for _ in 0..6 {
        let claim = store.claim("me").await.unwrap().unwrap();
        running.push(store.owner_of_job(claim.id).await.unwrap().unwrap());
    }
    assert_eq!(running.iter().filter(|&key| *key == a.id).count(), 3);
}

async fn a_cluster_is_offered_jobs_by_turns(store: JobStore) {
    let bounded = Quotas { running: Some(2), ..Quotas::default() };
    let ((a, _), (b, _)) = (made(&store, "a", Quotas::default()).await, made(&store, "b", bounded).await);
    many(&store, &a, 20).await;
    many(&store, &b, 20).await;
    let shares = || async {
        let mut shares = Vec::new();
        for candidate in store.candidates(6).await.unwrap() {
            shares.push(store.owner_of_job(candidate.id).await.unwrap().unwrap() == b.id);
        }
        shares
    };
    assert_eq!(shares().await, [false, true, false, true, false, false], "two of b's may run");
    // One that was offered is as one that runs.
    for candidate in store.candidates(2).await.unwrap() {
        assert!(store.offered(candidate.id, candidate.attempt, &candidate.id.to_string()).await.unwrap());
    }
    assert_eq!(shares().await.iter().filter(|&&of_b| of_b).count(), 1);
    assert_eq!(shares().await.len(), 6);
}

async fn whoever_comes_back_takes_nobodys_turns(store: JobStore) {
    let (store, clock) = clocked(store);
    let ((a, _), (b, _)) = (made(&store, "a", Quotas::default()).await, made(&store, "b", Quotas::default()).await);
    many(&store, &a, 50).await;
    for _ in 0..20 {
        run_one(&store, &clock, |_| 30).await.unwrap();
    }
    // b begins where a is, although it has had nothing; and a is not made to wait for what it had alone.
    many(&store, &b, 60).await;
    let mut had = [0, 0];
    for _ in 0..44 {
        let seconds = |key: &str| if key == a.id { 30 } else { 10 };
        let key = run_one(&store, &clock, seconds).await.unwrap();
        had[usize::from(key == b.id)] += seconds(&key);
    }
    assert!((had[0] - had[1]).abs() <= 30, "equal time on the device, but for one job: {had:?}");
    let (c, _) = made(&store, "c", Quotas::default()).await;
    while run_one(&store, &clock, |_| 5).await.is_some() {}
    many(&store, &c, 4).await;
    many(&store, &a, 4).await;
    let mut order = Vec::new();
    for _ in 0..4 {
        order.push(run_one(&store, &clock, |_| 5).await.unwrap());
    }
    assert_eq!(order.iter().filter(|&key| *key == a.id).count(), 2, "{order:?}");
}

/// Not a matter of seconds: what a claim costs does not follow from how many jobs wait.
async fn many_lines_are_looked_through_soon(store: JobStore) {
    let mut keys = Vec::new();
    for n in 0..50 {
        keys.push(made(&store, &format!("k{n}"), Quotas::default()).await.0);
    }
    for key in &keys {
        many(&store, key, 20).await;
    }
    let mut seen = std::collections::BTreeSet::new();
    for _ in 0..50 {
        let claim = store.claim("me").await.unwrap().unwrap();
        seen.insert(store.owner_of_job(claim.id).await.unwrap().unwrap());
    }
    assert_eq!(seen.len(), 50, "each key has one before any has two");
}
