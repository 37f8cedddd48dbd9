//! A database that is not there: said at the start, survived later.

use std::process::Command;

use gridfall_service::store::{JobStore, Progress};

use super::{accept, postgres::Postgres};

#[tokio::test(flavor = "multi_thread")]
async fn a_database_that_comes_back_has_what_was_accepted() {
    let mut database = Postgres::start();
    let store = JobStore::connect(&database.database()).await.unwrap();
    let id = accept(&store, "a").await.id;
    let claim = store.claim("me").await.unwrap().unwrap();
    database.stop();
    assert!(store.ping().await.is_err());
    assert!(store.heartbeat(id, claim.attempt, &Progress::default()).await.is_err());
    database.restart();
    assert!(store.heartbeat(id, claim.attempt, &Progress::default()).await.unwrap());
}

#[test]
fn a_database_that_cannot_be_used_is_named_with_a_remedy_and_without_its_password() {
    let dir = tempfile::tempdir().unwrap();
    for (url, said) in [
        ("postgres://me:s3cret@127.0.0.1:1/jobs", "cannot connect to 127.0.0.1:1/jobs"),
        ("postgres://me:s3/cret@127.0.0.1/jobs", "--database: "),
        ("postgres://me:s3cret@127.0.0.1/jobs?sslmode=perhaps", "--database: "),
        ("mysql://me:s3cret@127.0.0.1/jobs", "no kind of database"),
        ("s3cret", "--database: "),
    ] {
        let ended = Command::new(env!("CARGO_BIN_EXE_gridfall"))
            .args(["serve", "--listen", "127.0.0.1:0", "--backend", "cpu", "--data-dir"])
            .arg(dir.path())
            .env("GRIDFALL_DATABASE", url)
            .output()
            .unwrap();
        let message = String::from_utf8(ended.stderr).unwrap();
        assert_eq!(ended.status.code(), Some(2), "{message}");
        assert!(message.contains(said) && message.contains("--database"), "{message}");
        assert!(!message.contains("s3cret") && !message.contains("s3"), "{message}");
    }
}
