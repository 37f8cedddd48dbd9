//! Tests of the data directory. Those of the jobs are in tests/service/store: they run on both databases.

use std::collections::HashSet;

use super::*;

#[test]
fn a_data_directory_has_one_server() {
    let dir = tempfile::tempdir().unwrap();
    let first = DataDir::open(dir.path()).unwrap();
    assert!(matches!(DataDir::open(dir.path()), Err(StoreError::Locked { .. })));
    drop(first);
    DataDir::open(dir.path()).unwrap();
}

#[test]
fn a_data_directory_keeps_the_name_of_its_server() {
    let dir = tempfile::tempdir().unwrap();
    let owner = || DataDir::open(dir.path()).unwrap().owner().unwrap();
    let first = owner();
    assert_eq!(owner(), first);
    std::fs::write(dir.path().join("owner"), "").unwrap();
    assert!(!owner().is_empty(), "a crash came before the name was written");
}

#[tokio::test]
async fn folders_of_forgotten_jobs_are_swept() {
    let dir = tempfile::tempdir().unwrap();
    let data = DataDir::open(dir.path()).unwrap();
    let (kept, forgotten) = (Uuid::now_v7(), Uuid::now_v7());
    data.job(kept).attempt(1).create().unwrap();
    data.job(forgotten).attempt(1).create().unwrap();
    assert!(!data.sweep(&data.left().await.unwrap(), &HashSet::from([kept])).await.unwrap());
    assert!(data.job(kept).attempts().unwrap() == [1]);
    assert!(data.job(forgotten).attempts().unwrap().is_empty());
}

#[tokio::test]
async fn another_database_costs_no_files() {
    let dir = tempfile::tempdir().unwrap();
    let data = DataDir::open(dir.path()).unwrap();
    let jobs = [Uuid::now_v7(), Uuid::now_v7()];
    jobs.iter().for_each(|&id| data.job(id).attempt(1).create().unwrap());
    assert!(data.sweep(&data.left().await.unwrap(), &HashSet::from([Uuid::now_v7()])).await.unwrap());
    assert!(jobs.iter().all(|&id| data.job(id).attempts().unwrap() == [1]));
}
