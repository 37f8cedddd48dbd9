//! The job store keeps its promises, whatever the order of calls, on SQLite and on PostgreSQL.

mod groups;
mod keys;
mod leases;
mod offers;
mod outages;
mod queue;
mod releases;
mod webhooks;

use gridfall_service::store::{Job, JobStore, NewJob, Submission};

use super::postgres;

/// Makes two tests of each function: one on SQLite, one on PostgreSQL.
macro_rules! on_both {
    ($($name:ident),+ $(,)?) => {
        mod on_sqlite {
            $(#[tokio::test(flavor = "multi_thread")]
            async fn $name() {
                let (_dir, store) = $crate::store::sqlite().await;
                super::$name(store).await;
            })+
        }

        mod on_postgres {
            $(#[tokio::test(flavor = "multi_thread")]
            async fn $name() {
                super::$name($crate::store::postgres().await).await;
            })+
        }
    };
}
use on_both;

async fn sqlite() -> (tempfile::TempDir, JobStore) {
    let dir = tempfile::tempdir().unwrap();
    let store = JobStore::open(&dir.path().join("jobs.sqlite")).await.unwrap();
    (dir, store)
}

async fn postgres() -> JobStore {
    JobStore::connect(&postgres::shared().database()).await.unwrap()
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
        request_sha256: name.into(),
        ..NewJob::default()
    }
}

async fn accept(store: &JobStore, name: &str) -> Job {
    match store.submit(&new_job(name), 100).await.unwrap() {
        Submission::Accepted(job) => job,
        other => panic!("{other:?}"),
    }
}
