//! The queue: in order, bounded, and every request accepted once.

use gridfall_service::store::{Deletion, Filter, Job, JobStore, NewJob, Outcome, Progress, Status, Submission};
use uuid::Uuid;

use super::{accept, new_job, on_both};

on_both!(
    jobs_are_claimed_in_order_of_acceptance,
    a_job_put_back_is_next_again_and_the_old_attempt_can_write_nothing,
    a_running_job_learns_of_its_cancellation_and_a_queued_one_ends_at_once,
    the_queue_is_bounded_and_a_repeated_request_is_accepted_once,
    lists_are_newest_first_and_page_without_gaps,
    only_ended_jobs_are_deleted,
);

async fn jobs_are_claimed_in_order_of_acceptance(store: JobStore) {
    let (a, b) = (accept(&store, "a").await, accept(&store, "b").await);
    assert_eq!((a.queue_position, b.queue_position), (Some(1), Some(2)));
    let claim = store.claim("me").await.unwrap().unwrap();
    assert_eq!((claim.id, claim.attempt), (a.id, 1));
    assert_eq!(store.get(b.id).await.unwrap().unwrap().queue_position, Some(1));
    assert_eq!(store.claim("me").await.unwrap().unwrap().id, b.id);
    assert!(store.claim("me").await.unwrap().is_none());
}

async fn a_job_put_back_is_next_again_and_the_old_attempt_can_write_nothing(store: JobStore) {
    let (a, _b) = (accept(&store, "a").await, accept(&store, "b").await);
    let first = store.claim("me").await.unwrap().unwrap();
    store.put_back(a.id, first.attempt).await.unwrap();
    let second = store.claim("me").await.unwrap().unwrap();
    assert_eq!((second.id, second.attempt), (a.id, 2));

    let stale = Progress { step: 99, ..Progress::default() };
    assert!(!store.heartbeat(a.id, first.attempt, &stale).await.unwrap());
    assert!(!store.finish(a.id, first.attempt, &Outcome::Succeeded).await.unwrap());
    let job = store.get(a.id).await.unwrap().unwrap();
    assert_eq!((job.status, job.progress.step), (Status::Running, 0));
    assert!(store.finish(a.id, second.attempt, &Outcome::Succeeded).await.unwrap());
    assert!(!store.finish(a.id, second.attempt, &Outcome::Canceled).await.unwrap(), "a job ends once");
}

async fn a_running_job_learns_of_its_cancellation_and_a_queued_one_ends_at_once(store: JobStore) {
    let (a, b) = (accept(&store, "a").await, accept(&store, "b").await);
    let claim = store.claim("me").await.unwrap().unwrap();
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

async fn the_queue_is_bounded_and_a_repeated_request_is_accepted_once(store: JobStore) {
    let keyed = NewJob { idempotency_key: Some("k".into()), ..new_job("a") };
    let Submission::Accepted(job) = store.submit(&keyed, 1).await.unwrap() else { panic!() };
    assert!(matches!(store.submit(&new_job("b"), 1).await.unwrap(), Submission::QueueFull));
    let Submission::Repeated(same) = store.submit(&keyed, 1).await.unwrap() else { panic!() };
    assert_eq!(same.id, job.id);
    let other = NewJob { request_sha256: "other".into(), ..keyed };
    assert!(matches!(store.submit(&other, 1).await.unwrap(), Submission::KeyReused));
}

async fn lists_are_newest_first_and_page_without_gaps(store: JobStore) {
    for name in ["a", "b", "c", "d"] {
        accept(&store, name).await;
    }
    store.claim("me").await.unwrap().unwrap();
    let names = |jobs: &[Job]| jobs.iter().map(|job| job.name.clone()).collect::<Vec<_>>();
    let running = Filter { statuses: vec![Status::Running], ..Filter::default() };
    let page = store.list(&Filter::default(), None, 3).await.unwrap();
    assert_eq!(names(&page), ["d", "c", "b"]);
    assert_eq!(names(&store.list(&Filter::default(), Some(page[2].seq), 3).await.unwrap()), ["a"]);
    assert_eq!(names(&store.list(&running, None, 3).await.unwrap()), ["a"]);
    assert_eq!(store.counts().await.unwrap()[..2], [(Status::Queued, 3), (Status::Running, 1)]);
}

async fn only_ended_jobs_are_deleted(store: JobStore) {
    let job = accept(&store, "a").await;
    assert_eq!(store.delete(job.id).await.unwrap(), Deletion::NotFinished(Status::Queued));
    store.cancel(job.id).await.unwrap();
    assert_eq!(store.delete(job.id).await.unwrap(), Deletion::Deleted);
    assert_eq!(store.delete(job.id).await.unwrap(), Deletion::NotFound);
    assert!(store.ids().await.unwrap().is_empty());
}
