//! A server that is asked to end saves what it runs.

use super::support::Server;
use super::work::{compare, scenes, undisturbed};

#[test]
fn a_job_goes_on_where_the_server_was_stopped() {
    let dir = tempfile::tempdir().unwrap();
    let expected = undisturbed(&dir.path().join("undisturbed"));
    for (kind, scene) in scenes().into_iter().enumerate() {
        let data_dir = dir.path().join(format!("stopped-{kind}"));
        let server = Server::start(&data_dir);
        let job = server.submit(scene);
        server.wait_for_frames(&job, 10);
        assert!(server.terminate().success());
        let server = Server::start(&data_dir);
        let ended = server.wait_for(&job, "succeeded");
        compare(&server, &job, &expected[kind]);
        assert_eq!(ended["attempt"], 2);
        // Not from the start, although no checkpoint was due before.
        let log = std::fs::read_to_string(server.job_dir(&job).join("log.txt")).unwrap();
        assert!(log.contains("attempt 2 runs after frame"), "{log}");
        // What only a job that goes on needs is removed.
        let (checkpoints, first) = (server.file(&job, "checkpoints"), server.job_dir(&job).join("1"));
        server.wait_until(&job, "the end of its checkpoints", |_| !checkpoints.exists() && !first.exists());
    }
}
