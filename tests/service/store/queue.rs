//! The queue: in order, bounded, and every request accepted once.

use std::collections::BTreeMap;

use gridfall_service::store::{Deletion, Filter, Job, JobStore, NewJob, Outcome, Progress, Status, Submission};
use uuid::Uuid;

use super::{accept, new_job, on_both};

on_both!(
    jobs_are_claimed_in_order_of_acceptance,
    a_job_put_back_is_next_again_and_the_old_attempt_can_write_nothing,
    a_running_job_learns_of_its_cancellation_and_a_queued_one_ends_at_once,
    the_queue_is_bounded_and_a_repeated_request_is_accepted_once,
    submissions_at_the_same_time_are_judged_as_if_one_came_after_the_other,
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

/// Those that come together share a transaction.
async fn submissions_at_the_same_time_are_judged_as_if_one_came_after_the_other(store: JobStore) {
    const MOST: i64 = 150;
    let first = accept(&store, "first").await;
    let mut submissions = tokio::task::JoinSet::new();
    for index in 0..200_i64 {
        let new = NewJob {
            priority: index % 3,
            tags: if index % 2 == 0 { vec!["even".into(), format!("t{index}")] } else { vec![] },
            idempotency_key: (index < 40).then(|| format!("k{}", index % 10)),
            request_sha256: if index == 25 { "another request".into() } else { "the request".into() },
            ..new_job(&format!("job {index}"))
        };
        // Those with a key are never refused, however late they come.
        let most = if index < 40 { 10 * MOST } else { MOST };
        let store = store.clone();
        submissions.spawn(async move { (index, store.submit(&new, most).await.unwrap()) });
    }
    let answers = submissions.join_all().await;

    let mut accepted: Vec<&Job> = Vec::new();
    let mut by_key: BTreeMap<i64, Vec<Uuid>> = BTreeMap::new();
    let (mut reused, mut refused) = (0, 0);
    for (index, answer) in &answers {
        match answer {
            Submission::Accepted(job) => {
                assert_eq!(job.name, format!("job {index}"));
                accepted.push(job);
                by_key.entry(if *index < 40 { index % 10 } else { *index }).or_default().push(job.id);
            }
            Submission::Repeated(job) => {
                assert!(*index < 40 && job.queue_position.is_some(), "{index} repeats {}", job.name);
                by_key.entry(index % 10).or_default().push(job.id);
            }
            Submission::KeyReused => {
                assert!(*index < 40 && index % 10 == 5, "{index}");
                reused += 1;
            }
            Submission::QueueFull => refused += 1,
            Submission::OwnerFull(_) => panic!("nobody has a quota"),
        }
    }
    let count = accepted.len() as i64;
    assert!((MOST - 1..MOST + 10).contains(&count), "{count}");
    assert_eq!(refused, 200 - 30 - count);
    // Job 25 differs from the three others of its key. Whichever of them came first was accepted.
    assert!(reused == 1 || reused == 3, "{reused}");
    assert!(by_key.values().all(|ids| ids.windows(2).all(|pair| pair[0] == pair[1])));

    accepted.sort_by_key(|job| job.seq);
    for (number, job) in accepted.iter().enumerate() {
        let before = accepted[..number].iter().filter(|other| other.priority >= job.priority).count() as i64;
        assert_eq!(job.queue_position, Some(before + 1 + i64::from(job.priority <= first.priority)), "{}", job.name);
    }
    let even = Filter { tags: vec!["even".into()], ..Filter::default() };
    let even = store.list(&even, None, 200).await.unwrap().len();
    assert_eq!(even, accepted.iter().filter(|job| !job.tags.is_empty()).count());
    for job in accepted {
        let stored = store.get(job.id).await.unwrap().unwrap();
        assert_eq!(Job { queue_position: None, ..job.clone() }, Job { queue_position: None, ..stored });
    }
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
