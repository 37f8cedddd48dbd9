//! A database that an earlier release left opens, with its jobs as they were.

use std::path::Path;

use gridfall_service::store::{Filter, JobStore, Status, Submission};

use super::new_job;

#[tokio::test]
async fn the_database_of_release_0_1_opens_with_its_jobs() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("gridfall.sqlite");
    let kept = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/service/fixtures/release-0.1.sqlite");
    std::fs::copy(kept, &path).unwrap();
    let store = JobStore::open(&path).await.unwrap();

    let jobs = store.list(&Filter::default(), None, 10).await.unwrap();
    let seen: Vec<_> = jobs.iter().rev().map(|job| (job.name.as_str(), job.status, job.attempt)).collect();
    assert_eq!(
        seen,
        [
            ("twice dead", Status::Failed, 2),
            ("done", Status::Succeeded, 1),
            ("stopped", Status::Canceled, 1),
            ("under way", Status::Running, 1),
            ("waiting", Status::Queued, 0),
        ]
    );
    let [waiting, under_way, _, done, dead] = &jobs[..] else { panic!() };
    assert_eq!(dead.failure.as_ref().unwrap().code, "crashed");
    assert_eq!((done.progress.frames_written, done.particles, done.frames), (6, 64, 6));
    assert_eq!(done.backend.as_ref().unwrap().kind, "cpu");
    assert!(done.created_at <= done.started_at.unwrap() && done.started_at <= done.finished_at);

    // The server that ran it is dead, and its name was not written down.
    let recovered = store.recover("me", |_| String::new()).await.unwrap();
    assert_eq!(recovered.iter().map(|job| (job.id, job.status)).collect::<Vec<_>>(), [(under_way.id, Status::Queued)]);
    let claim = store.claim("me").await.unwrap().unwrap();
    assert_eq!((claim.id, claim.attempt, claim.deaths), (under_way.id, 2, 1));
    assert!(claim.scene.contains("fixed-corotated"));
    assert_eq!(store.claim("me").await.unwrap().unwrap().id, waiting.id);
    // The key that a request came with is still taken.
    let mut other = new_job("other");
    other.idempotency_key = Some("once".into());
    assert!(matches!(store.submit(&other, 100).await.unwrap(), Submission::KeyReused));
}
