//! Tests that the store keeps its guarantees, whatever the order of calls.

use super::*;

async fn store() -> (tempfile::TempDir, JobStore) {
    let dir = tempfile::tempdir().unwrap();
    let store = JobStore::open(&dir.path().join("jobs.sqlite")).await.unwrap();
    (dir, store)
}

fn new_job(name: &str) -> NewJob {
    NewJob {
        name: name.into(),
        scene: "{}".into(),
        particles: 10,
        frames: 3,
        end_time_s: 0.5,
        integrator: "explicit".into(),
        integrator_reason: "it is a test".into(),
        notices: Vec::new(),
        idempotency_key: None,
        request_sha256: name.into(),
    }
}

async fn accept(store: &JobStore, name: &str) -> Job {
    match store.submit(&new_job(name), 100).await.unwrap() {
        Submission::Accepted(job) => job,
        other => panic!("{other:?}"),
    }
}

#[tokio::test]
async fn jobs_are_claimed_in_order_of_acceptance() {
    let (_dir, store) = store().await;
    let (a, b) = (accept(&store, "a").await, accept(&store, "b").await);
    assert_eq!((a.queue_position, b.queue_position), (Some(1), Some(2)));
    let claim = store.claim().await.unwrap().unwrap();
    assert_eq!((claim.id, claim.attempt), (a.id, 1));
    assert_eq!(store.get(b.id).await.unwrap().unwrap().queue_position, Some(1));
    assert_eq!(store.claim().await.unwrap().unwrap().id, b.id);
    assert!(store.claim().await.unwrap().is_none());
}

#[tokio::test]
async fn a_job_put_back_is_next_again_and_the_old_attempt_can_write_nothing() {
    let (_dir, store) = store().await;
    let (a, _b) = (accept(&store, "a").await, accept(&store, "b").await);
    let first = store.claim().await.unwrap().unwrap();
    store.put_back(a.id, first.attempt).await.unwrap();
    let second = store.claim().await.unwrap().unwrap();
    assert_eq!((second.id, second.attempt), (a.id, 2));

    let stale = Progress { step: 99, ..Progress::default() };
    assert!(!store.heartbeat(a.id, first.attempt, &stale).await.unwrap());
    assert!(!store.finish(a.id, first.attempt, &Outcome::Succeeded).await.unwrap());
    let job = store.get(a.id).await.unwrap().unwrap();
    assert_eq!((job.status, job.progress.step), (Status::Running, 0));
    assert!(store.finish(a.id, second.attempt, &Outcome::Succeeded).await.unwrap());
    assert!(!store.finish(a.id, second.attempt, &Outcome::Canceled).await.unwrap(), "a job ends once");
}

#[tokio::test]
async fn a_running_job_learns_of_its_cancellation_and_a_queued_one_ends_at_once() {
    let (_dir, store) = store().await;
    let (a, b) = (accept(&store, "a").await, accept(&store, "b").await);
    let claim = store.claim().await.unwrap().unwrap();
    assert!(store.heartbeat(a.id, claim.attempt, &Progress::default()).await.unwrap());
    assert_eq!(store.cancel(a.id).await.unwrap().unwrap().status, Status::Running);
    assert!(!store.heartbeat(a.id, claim.attempt, &Progress::default()).await.unwrap());
    let b = store.cancel(b.id).await.unwrap().unwrap();
    assert_eq!(b.status, Status::Canceled);
    assert!(b.finished_at.is_some());
    let again = store.cancel(b.id).await.unwrap().unwrap();
    assert_eq!(again, b, "canceling twice changes nothing");
    assert!(store.cancel(Uuid::now_v7()).await.unwrap().is_none());
}

#[tokio::test]
async fn a_job_that_took_two_servers_with_it_fails() {
    let (_dir, store) = store().await;
    let job = accept(&store, "a").await;
    store.claim().await.unwrap().unwrap();
    assert_eq!(store.recover().await.unwrap(), [Recovered { id: job.id, status: Status::Queued }]);
    assert_eq!(store.claim().await.unwrap().unwrap().attempt, 2);
    assert_eq!(store.recover().await.unwrap(), [Recovered { id: job.id, status: Status::Failed }]);
    let job = store.get(job.id).await.unwrap().unwrap();
    assert_eq!(job.failure.unwrap().code, "crashed");
    assert!(job.finished_at.is_some());
    assert!(store.claim().await.unwrap().is_none());
}

#[tokio::test]
async fn a_job_canceled_before_its_server_died_ends_canceled() {
    let (_dir, store) = store().await;
    let job = accept(&store, "a").await;
    store.claim().await.unwrap().unwrap();
    store.cancel(job.id).await.unwrap();
    assert_eq!(store.recover().await.unwrap(), [Recovered { id: job.id, status: Status::Canceled }]);
    assert_eq!(store.get(job.id).await.unwrap().unwrap().failure, None);
}

#[tokio::test]
async fn the_queue_is_bounded_and_a_repeated_request_is_accepted_once() {
    let (_dir, store) = store().await;
    let keyed = NewJob { idempotency_key: Some("k".into()), ..new_job("a") };
    let Submission::Accepted(job) = store.submit(&keyed, 1).await.unwrap() else { panic!() };
    assert!(matches!(store.submit(&new_job("b"), 1).await.unwrap(), Submission::QueueFull));
    let Submission::Repeated(same) = store.submit(&keyed, 1).await.unwrap() else { panic!() };
    assert_eq!(same.id, job.id);
    let other = NewJob { request_sha256: "other".into(), ..keyed };
    assert!(matches!(store.submit(&other, 1).await.unwrap(), Submission::KeyReused));
}

#[tokio::test]
async fn lists_are_newest_first_and_page_without_gaps() {
    let (_dir, store) = store().await;
    for name in ["a", "b", "c", "d"] {
        accept(&store, name).await;
    }
    store.claim().await.unwrap().unwrap();
    let names = |jobs: &[Job]| jobs.iter().map(|job| job.name.clone()).collect::<Vec<_>>();
    let page = store.list(None, None, 3).await.unwrap();
    assert_eq!(names(&page), ["d", "c", "b"]);
    assert_eq!(names(&store.list(None, Some(page[2].seq), 3).await.unwrap()), ["a"]);
    assert_eq!(names(&store.list(Some(Status::Running), None, 3).await.unwrap()), ["a"]);
    assert_eq!(store.counts().await.unwrap()[..2], [(Status::Queued, 3), (Status::Running, 1)]);
}

#[tokio::test]
async fn only_ended_jobs_are_deleted() {
    let (_dir, store) = store().await;
    let job = accept(&store, "a").await;
    assert_eq!(store.delete(job.id).await.unwrap(), Deletion::NotFinished(Status::Queued));
    store.cancel(job.id).await.unwrap();
    assert_eq!(store.delete(job.id).await.unwrap(), Deletion::Deleted);
    assert_eq!(store.delete(job.id).await.unwrap(), Deletion::NotFound);
    assert!(store.ids().await.unwrap().is_empty());
}

#[test]
fn a_data_directory_has_one_server() {
    let dir = tempfile::tempdir().unwrap();
    let first = DataDir::open(dir.path()).unwrap();
    assert!(matches!(DataDir::open(dir.path()), Err(StoreError::Locked { .. })));
    drop(first);
    DataDir::open(dir.path()).unwrap();
}

#[test]
fn folders_of_forgotten_jobs_are_swept() {
    let dir = tempfile::tempdir().unwrap();
    let data = DataDir::open(dir.path()).unwrap();
    let (kept, forgotten) = (Uuid::now_v7(), Uuid::now_v7());
    data.job(kept).reset().unwrap();
    data.job(forgotten).reset().unwrap();
    data.sweep(&HashSet::from([kept])).unwrap();
    assert!(data.job(kept).recording().parent().unwrap().exists());
    assert!(!data.job(forgotten).recording().parent().unwrap().exists());
}
