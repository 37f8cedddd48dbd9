//! Offers to a cluster's scheduler: one process gets a job, and the end of a process means what it should.

use std::sync::Arc;
use std::sync::atomic::{AtomicI64, Ordering};

use gridfall_service::store::{
    Failure, JobStore, LEASE, Leftover, MAX_DEATHS, Offer, OfferEnd, Outcome, Status, Taken,
};
use uuid::Uuid;

use super::{accept, new_job, on_both};

on_both!(
    a_job_is_offered_once_and_taken_by_one_process,
    the_next_attempt_waits_for_the_end_of_the_one_before,
    an_offer_that_was_not_noted_can_be_taken_all_the_same,
    a_process_that_is_faster_than_the_note_keeps_its_job,
    a_job_that_another_server_runs_is_left_alone,
    what_deleted_jobs_leave_is_remembered,
    the_end_of_a_process_means_what_it_should,
    deaths_are_counted_once,
    times_that_were_up_are_counted_until_there_is_a_checkpoint,
    an_end_that_comes_late_changes_nothing,
);

async fn only_offer(store: &JobStore) -> Offer {
    let offers = store.offers().await.unwrap();
    assert_eq!(offers.len(), 1, "{offers:?}");
    offers.into_iter().next().unwrap()
}

async fn status(store: &JobStore, id: Uuid) -> Status {
    store.get(id).await.unwrap().unwrap().status
}

async fn take(store: &JobStore, id: Uuid, attempt: i64, process: &str) -> bool {
    let taken = store.take(id, attempt, process).await.unwrap();
    matches!(taken, Taken::Claimed(claim) if claim.attempt == attempt)
}

/// A job whose attempt of this number a process has taken.
async fn taken(store: &JobStore, attempt: i64, process: &str, id: Option<Uuid>) -> (Uuid, Offer) {
    let id = match id {
        Some(id) => id,
        None => accept(store, process).await.id,
    };
    assert!(store.offered(id, attempt, process).await.unwrap());
    assert!(take(store, id, attempt, process).await);
    let offer = store.offers().await.unwrap().into_iter().find(|offer| offer.id == id).unwrap();
    (id, offer)
}

async fn a_job_is_offered_once_and_taken_by_one_process(store: JobStore) {
    let (first, second) = (accept(&store, "first").await.id, accept(&store, "second").await.id);
    let mut urgent = new_job("urgent");
    urgent.priority = 5;
    store.submit(&urgent, 100).await.unwrap();
    let candidates = store.candidates(10).await.unwrap();
    let names: Vec<&str> = candidates.iter().map(|candidate| candidate.name.as_str()).collect();
    assert_eq!(names, ["urgent", "first", "second"]);
    assert_eq!(store.candidates(1).await.unwrap()[0].attempt, 1);

    assert!(store.offered(first, 1, "7").await.unwrap());
    assert!(!store.offered(first, 1, "8").await.unwrap(), "it was offered already");
    assert!(!store.offered(second, 2, "8").await.unwrap(), "that is not its next attempt");
    let offer = only_offer(&store).await;
    assert_eq!((offer.id, offer.cluster_job.as_str(), offer.claimed), (first, "7", false));
    assert_eq!(store.candidates(10).await.unwrap().len(), 2);

    assert!(take(&store, first, 1, "7").await);
    for attempt in [1, 3] {
        let again = store.take(first, attempt, "8").await.unwrap();
        assert!(matches!(again, Taken::Never(_)), "{again:?}");
    }
    assert!(only_offer(&store).await.claimed);
    assert!(matches!(store.take(Uuid::now_v7(), 1, "9").await.unwrap(), Taken::Never(_)));
}

async fn the_next_attempt_waits_for_the_end_of_the_one_before(store: JobStore) {
    let time = Arc::new(AtomicI64::new(1_000_000_000_000_000));
    let clock = time.clone();
    let store = store.with_clock(move || clock.load(Ordering::SeqCst));
    let (id, _) = taken(&store, 1, "7", None).await;
    let early = store.take(id, 2, "8").await.unwrap();
    assert!(matches!(early, Taken::NotYet), "{early:?}");
    assert!(!only_offer(&store).await.expired);
    time.fetch_add(LEASE.as_micros() as i64 + 1, Ordering::SeqCst);
    assert!(!take(&store, id, 2, "8").await, "its machine's clock may be wrong");
    store.expire(|_| String::new()).await.unwrap();
    assert!(take(&store, id, 2, "8").await, "its lease is over");
    assert!(!store.heartbeat(id, 1, &Default::default()).await.unwrap());
    assert!(!store.finish(id, 1, &Outcome::Succeeded).await.unwrap());
    assert_eq!(only_offer(&store).await.cluster_job, "8");
}

async fn an_offer_that_was_not_noted_can_be_taken_all_the_same(store: JobStore) {
    let id = accept(&store, "a").await.id;
    // The server died before it noted 7, and offered the attempt again as 8.
    assert!(store.offered(id, 1, "8").await.unwrap());
    assert!(take(&store, id, 1, "7").await);
    assert!(!take(&store, id, 1, "8").await);
    // The end of 8 is not that of the attempt.
    assert_eq!(only_offer(&store).await.cluster_job, "7");
}

async fn a_process_that_is_faster_than_the_note_keeps_its_job(store: JobStore) {
    let id = accept(&store, "a").await.id;
    assert!(take(&store, id, 1, "7").await);
    assert!(store.offered(id, 1, "7").await.unwrap(), "it is wanted");
    assert!(!store.offered(id, 1, "8").await.unwrap());
    assert!(only_offer(&store).await.claimed);
}

async fn a_job_that_another_server_runs_is_left_alone(store: JobStore) {
    let id = accept(&store, "a").await.id;
    assert!(store.offered(id, 1, "7").await.unwrap());
    assert_eq!(store.claim("a server").await.unwrap().unwrap().attempt, 1);
    let offer = only_offer(&store).await;
    assert!(!offer.claimed && offer.is_passed());
    assert_eq!(store.withdraw(&offer, &OfferEnd::Passed).await.unwrap(), Some(Status::Running));
    assert!(store.offers().await.unwrap().is_empty());
    assert!(store.heartbeat(id, 1, &Default::default()).await.unwrap());
}

async fn what_deleted_jobs_leave_is_remembered(store: JobStore) {
    let (id, _) = taken(&store, 1, "7", None).await;
    assert!(store.finish(id, 1, &Outcome::Succeeded).await.unwrap());
    store.delete(id).await.unwrap();
    let leftovers = store.leftovers().await.unwrap();
    assert_eq!(leftovers, [Leftover { id, sweep: None, cluster_job: "7".into() }]);
    store.forget_leftovers(&leftovers).await.unwrap();
    assert!(store.leftovers().await.unwrap().is_empty());
}

async fn the_end_of_a_process_means_what_it_should(store: JobStore) {
    let (id, offer) = taken(&store, 1, "canceled", None).await;
    assert_eq!(store.withdraw(&offer, &OfferEnd::Canceled).await.unwrap(), Some(Status::Canceled));
    assert!(store.get(id).await.unwrap().unwrap().finished_at.is_some());

    let (id, offer) = taken(&store, 1, "interrupted", None).await;
    assert_eq!(store.withdraw(&offer, &OfferEnd::Interrupted).await.unwrap(), Some(Status::Queued));
    let job = store.get(id).await.unwrap().unwrap();
    assert_eq!((job.attempt, job.deaths, job.started_at), (1, 0, None));
    assert_eq!(store.candidates(10).await.unwrap()[0].attempt, 2);

    let (id, offer) = taken(&store, 2, "done", Some(id)).await;
    assert!(store.finish(id, 2, &Outcome::Succeeded).await.unwrap());
    let offer = Offer { status: Status::Succeeded, ..offer };
    assert_eq!(store.withdraw(&offer, &OfferEnd::Canceled).await.unwrap(), Some(Status::Succeeded), "it was too late");

    let (id, offer) = taken(&store, 1, "unwanted", None).await;
    store.cancel(id).await.unwrap();
    assert_eq!(store.withdraw(&offer, &OfferEnd::Interrupted).await.unwrap(), Some(Status::Canceled));
    assert!(store.offers().await.unwrap().is_empty());
}

async fn deaths_are_counted_once(store: JobStore) {
    let failure = Failure::new("crashed", "it fell");
    let id = accept(&store, "a").await.id;
    for attempt in 1..=MAX_DEATHS {
        let (_, offer) = taken(&store, attempt, &format!("{attempt}"), Some(id)).await;
        if attempt == 2 {
            // Its device was lost, and the process said so before it ended.
            store.lose(id, attempt, &failure).await.unwrap();
            let offer = only_offer(&store).await;
            store.withdraw(&offer, &OfferEnd::Died(failure.clone())).await.unwrap();
        } else {
            store.withdraw(&offer, &OfferEnd::Died(failure.clone())).await.unwrap();
        }
        let expected = if attempt < MAX_DEATHS { Status::Queued } else { Status::Failed };
        assert_eq!(status(&store, id).await, expected, "after attempt {attempt}");
    }
    let job = store.get(id).await.unwrap().unwrap();
    assert_eq!((job.deaths, job.failure), (MAX_DEATHS, Some(failure)));
}

async fn times_that_were_up_are_counted_until_there_is_a_checkpoint(store: JobStore) {
    let up = OfferEnd::TimedOut(Failure::new("crashed", "its time was up"));
    let id = accept(&store, "a").await.id;
    for attempt in 1..=MAX_DEATHS + 2 {
        taken(&store, attempt, &format!("{attempt}"), Some(id)).await;
        if attempt == 3 {
            assert!(store.checkpointed(id, attempt, 1).await.unwrap());
        }
        assert_eq!(store.put_back(id, attempt).await.unwrap(), Some(Status::Queued));
        store.withdraw(&only_offer(&store).await, &up).await.unwrap();
    }
    let job = store.get(id).await.unwrap().unwrap();
    assert_eq!((job.status, job.deaths), (Status::Failed, MAX_DEATHS));
}

async fn an_end_that_comes_late_changes_nothing(store: JobStore) {
    let (id, old) = taken(&store, 1, "7", None).await;
    store.put_back(id, 1).await.unwrap();
    assert_eq!(store.withdraw(&old, &OfferEnd::Canceled).await.unwrap(), None, "the job has moved on");
    store.withdraw(&only_offer(&store).await, &OfferEnd::Interrupted).await.unwrap();
    let (_, new) = taken(&store, 2, "8", Some(id)).await;
    assert_eq!(store.withdraw(&old, &OfferEnd::Canceled).await.unwrap(), None);
    assert_eq!(status(&store, id).await, Status::Running);
    assert_eq!(store.withdraw(&new, &OfferEnd::Interrupted).await.unwrap(), Some(Status::Queued));
}
