//! Leases and fences: a job whose worker is gone goes on elsewhere, and nobody does what another has
//! taken over.

use std::collections::BTreeSet;
use std::sync::Arc;
use std::sync::atomic::{AtomicI64, Ordering};

use gridfall_service::store::{Failure, JobStore, LEASE, MAX_DEATHS, Outcome, Progress, Recovered, Status, Submission};

use super::{accept, new_job, on_both};

on_both!(
    workers_that_race_claim_every_job_once,
    a_late_write_of_an_earlier_attempt_changes_nothing,
    a_job_without_heartbeats_goes_to_another_worker,
    a_heartbeat_holds_a_job,
    a_clock_that_goes_back_neither_loses_nor_doubles_a_job,
    a_job_that_dies_again_and_again_without_progress_is_given_up,
    a_checkpoint_further_on_forgives_deaths,
    a_lost_device_is_a_death,
    a_server_recovers_its_own_jobs_and_no_others,
    a_job_canceled_before_its_server_died_ends_canceled,
    progress_is_kept_where_an_attempt_goes_on_from_a_checkpoint,
);

/// A clock that tests set, in seconds.
#[derive(Clone)]
struct Time(Arc<AtomicI64>);

impl Time {
    fn of(store: JobStore) -> (Self, JobStore) {
        let time = Self(Arc::new(AtomicI64::new(1_000_000_000_000_000)));
        let read = time.0.clone();
        (time, store.with_clock(move || read.load(Ordering::SeqCst)))
    }

    fn pass(&self, seconds: f64) {
        self.0.fetch_add((seconds * 1e6) as i64, Ordering::SeqCst);
    }

    fn pass_a_lease(&self) {
        self.pass(LEASE.as_secs_f64() + 1.0);
    }
}

fn no_log(_: uuid::Uuid) -> String {
    String::new()
}

async fn workers_that_race_claim_every_job_once(store: JobStore) {
    const JOBS: usize = 60;
    for i in 0..JOBS {
        assert!(matches!(store.submit(&new_job(&i.to_string()), 1000).await.unwrap(), Submission::Accepted(_)));
    }
    let workers: Vec<_> = (0..12)
        .map(|worker| {
            let store = store.clone();
            tokio::spawn(async move {
                let mut claimed = Vec::new();
                while let Some(claim) = store.claim(&format!("worker {worker}")).await.unwrap() {
                    assert_eq!(claim.attempt, 1);
                    claimed.push(claim.id);
                }
                claimed
            })
        })
        .collect();
    let mut claimed = Vec::new();
    for worker in workers {
        claimed.extend(worker.await.unwrap());
    }
    assert_eq!(claimed.len(), JOBS);
    assert_eq!(claimed.into_iter().collect::<BTreeSet<_>>().len(), JOBS);
}

async fn a_late_write_of_an_earlier_attempt_changes_nothing(store: JobStore) {
    let (time, store) = Time::of(store);
    let id = accept(&store, "a").await.id;
    let first = store.claim("slow").await.unwrap().unwrap();
    time.pass_a_lease();
    let second = store.claim("quick").await.unwrap().unwrap();
    assert_eq!((second.id, second.attempt, second.deaths), (id, 2, 1));

    let before = store.get(id).await.unwrap();
    let late = Progress { step: 99, ..Progress::default() };
    let backend = gridfall_engine::Backend {
        kind: "cpu".into(),
        device: "late".into(),
        driver: String::new(),
        software: false,
        reason: "it is a test".into(),
    };
    assert!(!store.heartbeat(id, first.attempt, &late).await.unwrap());
    assert!(!store.checkpointed(id, first.attempt, 7).await.unwrap());
    assert!(!store.finish(id, first.attempt, &Outcome::Succeeded).await.unwrap());
    assert_eq!(store.put_back(id, first.attempt).await.unwrap(), None);
    assert_eq!(store.lose(id, first.attempt, &Failure::new("device_lost", "late")).await.unwrap(), None);
    store.set_backend(id, first.attempt, &backend).await.unwrap();
    assert_eq!(store.get(id).await.unwrap(), before);
    assert!(store.finish(id, second.attempt, &Outcome::Succeeded).await.unwrap());
}

async fn a_job_without_heartbeats_goes_to_another_worker(store: JobStore) {
    let (time, store) = Time::of(store);
    let (a, b) = (accept(&store, "a").await.id, accept(&store, "b").await.id);
    store.claim("dead").await.unwrap().unwrap();
    time.pass(LEASE.as_secs_f64() - 1.0);
    assert_eq!(store.claim("alive").await.unwrap().unwrap().id, b);
    assert!(store.claim("alive").await.unwrap().is_none());
    time.pass(2.0);
    let claim = store.claim("alive").await.unwrap().unwrap();
    assert_eq!((claim.id, claim.attempt, claim.deaths), (a, 2, 1));
}

async fn a_heartbeat_holds_a_job(store: JobStore) {
    let (time, store) = Time::of(store);
    let id = accept(&store, "a").await.id;
    let claim = store.claim("one").await.unwrap().unwrap();
    for _ in 0..4 {
        time.pass(LEASE.as_secs_f64() * 0.9);
        assert!(store.heartbeat(id, claim.attempt, &Progress::default()).await.unwrap());
        assert!(store.claim("two").await.unwrap().is_none());
    }
    // A worker that comes back before another has taken the job keeps it.
    time.pass_a_lease();
    assert!(store.heartbeat(id, claim.attempt, &Progress::default()).await.unwrap());
    assert!(store.claim("two").await.unwrap().is_none());
}

async fn a_clock_that_goes_back_neither_loses_nor_doubles_a_job(store: JobStore) {
    let (time, store) = Time::of(store);
    let (dead, alive) = (accept(&store, "a").await.id, accept(&store, "b").await.id);
    store.claim("dead").await.unwrap().unwrap();
    let claim = store.claim("alive").await.unwrap().unwrap();
    time.pass(-3600.0);
    // The next heartbeat puts the lease right.
    assert!(store.heartbeat(alive, claim.attempt, &Progress::default()).await.unwrap());
    // The one that nobody renews does not last for an hour.
    let again = store.claim("alive").await.unwrap().unwrap();
    assert_eq!((again.id, again.attempt), (dead, 2));
    assert!(store.claim("alive").await.unwrap().is_none());
    assert!(store.finish(alive, claim.attempt, &Outcome::Succeeded).await.unwrap());
    assert!(store.finish(dead, again.attempt, &Outcome::Succeeded).await.unwrap());
}

async fn a_job_that_dies_again_and_again_without_progress_is_given_up(store: JobStore) {
    let (time, store) = Time::of(store);
    let (a, b) = (accept(&store, "a").await.id, accept(&store, "b").await.id);
    for deaths in 0..MAX_DEATHS {
        let claim = store.claim("me").await.unwrap().unwrap();
        assert_eq!((claim.id, claim.attempt, claim.deaths), (a, deaths + 1, deaths));
        let progress = Progress { frames_written: 12, ..Progress::default() };
        assert!(store.heartbeat(a, claim.attempt, &progress).await.unwrap());
        assert!(store.checkpointed(a, claim.attempt, 10).await.unwrap(), "the same frame each time");
        if deaths == 0 {
            assert_eq!(store.get(a).await.unwrap().unwrap().deaths, 0);
        }
        time.pass_a_lease();
    }
    // The claim gives it up and goes on to the next job.
    assert_eq!(store.claim("me").await.unwrap().unwrap().id, b);
    let job = store.get(a).await.unwrap().unwrap();
    assert_eq!((job.status, job.deaths), (Status::Failed, MAX_DEATHS));
    assert!(job.finished_at.is_some());
    let failure = job.failure.unwrap();
    assert_eq!(failure.code, "crashed");
    for part in ["5 times", "12 frames", "checkpoint at frame 10", "make the scene smaller"] {
        assert!(failure.message.contains(part), "{part:?} is not in {failure:?}");
    }
}

async fn a_checkpoint_further_on_forgives_deaths(store: JobStore) {
    let (time, store) = Time::of(store);
    let id = accept(&store, "a").await.id;
    for frame in 0..3 * MAX_DEATHS as u64 {
        let claim = store.claim("me").await.unwrap().unwrap();
        assert_eq!(claim.deaths, i64::from(frame > 0));
        assert!(store.checkpointed(id, claim.attempt, frame).await.unwrap());
        time.pass_a_lease();
    }
    let claim = store.claim("me").await.unwrap().unwrap();
    assert!(store.checkpointed(id, claim.attempt, 3).await.unwrap(), "an older frame than the newest");
    let job = store.get(id).await.unwrap().unwrap();
    assert_eq!((job.status, job.deaths, job.checkpoint_frame), (Status::Running, 1, Some(14)));
}

async fn a_lost_device_is_a_death(store: JobStore) {
    let id = accept(&store, "a").await.id;
    let failure = Failure::new("device_lost", "it fell off the bus");
    for deaths in 1..=MAX_DEATHS {
        let claim = store.claim("me").await.unwrap().unwrap();
        let status = if deaths < MAX_DEATHS { Status::Queued } else { Status::Failed };
        assert_eq!(store.lose(id, claim.attempt, &failure).await.unwrap(), Some(status));
    }
    let job = store.get(id).await.unwrap().unwrap();
    assert_eq!((job.failure, job.deaths), (Some(failure), MAX_DEATHS));
    assert!(store.claim("me").await.unwrap().is_none());
}

async fn a_server_recovers_its_own_jobs_and_no_others(store: JobStore) {
    let (mine, other) = (accept(&store, "a").await.id, accept(&store, "b").await.id);
    for deaths in 1..=MAX_DEATHS {
        assert_eq!(store.claim("me").await.unwrap().unwrap().id, mine);
        if deaths == 1 {
            assert_eq!(store.claim("other").await.unwrap().unwrap().id, other);
        }
        let status = if deaths < MAX_DEATHS { Status::Queued } else { Status::Failed };
        let tail = |id: uuid::Uuid| format!("the last line of {id}");
        assert_eq!(store.recover("me", tail).await.unwrap(), [Recovered { id: mine, status }]);
    }
    assert_eq!(store.recover("me", no_log).await.unwrap(), []);
    let failure = store.get(mine).await.unwrap().unwrap().failure.unwrap();
    assert_eq!(failure.code, "crashed");
    assert!(failure.message.ends_with(&format!("the last line of {mine}")), "{failure:?}");
    assert_eq!(store.get(other).await.unwrap().unwrap().status, Status::Running);
}

async fn a_job_canceled_before_its_server_died_ends_canceled(store: JobStore) {
    let id = accept(&store, "a").await.id;
    store.claim("me").await.unwrap().unwrap();
    store.cancel(id).await.unwrap();
    assert_eq!(store.recover("me", no_log).await.unwrap(), [Recovered { id, status: Status::Canceled }]);
    let job = store.get(id).await.unwrap().unwrap();
    assert_eq!(job.failure, None);
    assert!(job.finished_at.is_some());
}

async fn progress_is_kept_where_an_attempt_goes_on_from_a_checkpoint(store: JobStore) {
    let (a, b) = (accept(&store, "a").await.id, accept(&store, "b").await.id);
    let progress = Progress { sim_time_s: 0.25, step: 40, frames_written: 12, run_s: 3.0 };
    for id in [a, b] {
        let claim = store.claim("me").await.unwrap().unwrap();
        assert_eq!(claim.id, id);
        store.heartbeat(id, claim.attempt, &progress).await.unwrap();
    }
    store.checkpointed(a, 1, 10).await.unwrap();
    for id in [a, b] {
        assert_eq!(store.put_back(id, 1).await.unwrap(), Some(Status::Queued));
        assert_eq!(store.get(id).await.unwrap().unwrap().started_at, None);
        store.claim("me").await.unwrap().unwrap();
    }
    let (a, b) = (store.get(a).await.unwrap().unwrap(), store.get(b).await.unwrap().unwrap());
    assert_eq!((a.progress, a.checkpoint_frame), (progress, Some(10)));
    assert_eq!((b.progress, b.checkpoint_frame), (Progress::default(), None));
    assert_eq!((a.deaths, b.deaths), (0, 0), "their server stopped them in order");
}
