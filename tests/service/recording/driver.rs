//! The run driver is repeatable, publishes only complete files, and keeps what a run has when it
//! ends early.

use std::path::PathBuf;

use gridfall_engine::{Control, EngineError};
use gridfall_recording as recording;
use gridfall_recording::run::{FrameReport, Observer, RunError, Summary};

use super::fixture::{Ballistic, Watch, messages, outputs, problem, python, record, run, scene};

#[test]
fn the_same_run_gives_the_same_bytes() {
    let (first, second) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let problem = problem(0.05);
    let first = record(&problem, first.path());
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let second_out = pool.install(|| record(&problem, second.path()));
    assert!(std::fs::read(&first.recording).unwrap() == std::fs::read(&second_out.recording).unwrap());
    assert!(std::fs::read(first.thumbnail.unwrap()).unwrap() == std::fs::read(second_out.thumbnail.unwrap()).unwrap());
}

#[test]
fn nothing_has_its_final_name_before_it_is_complete() {
    struct Look(PathBuf);
    impl Control for Look {}
    impl Observer for Look {
        fn frame(&self, report: &FrameReport) {
            assert!(!self.0.exists());
            let snapshot = recording::snapshot(&recording::partial_path(&self.0)).unwrap();
            assert_eq!(snapshot.frames, report.frame + 1);
        }
    }
    let directory = tempfile::tempdir().unwrap();
    let (problem, out) = (problem(0.1), outputs(directory.path()));
    run(&scene(), &problem, &mut Ballistic::new(&problem, None), &out, &Look(out.recording.clone())).unwrap();
    let mut names: Vec<_> =
        std::fs::read_dir(directory.path()).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    names.sort();
    assert_eq!(names, ["out.csv", "out.mcap", "out.png", "solver.csv"]);
}

#[test]
fn failed_and_canceled_runs_keep_what_they_have() {
    let problem = problem(0.1);
    let failed = tempfile::tempdir().unwrap();
    let out = outputs(failed.path());
    let error =
        run(&scene(), &problem, &mut Ballistic::new(&problem, Some(3)), &out, &Watch::new(u64::MAX)).unwrap_err();
    assert!(matches!(error, RunError::Engine(EngineError::Diverged { .. })));
    assert_eq!(error.code(), "diverged");
    let recording = &python(&[], &[out.recording])[0];
    assert_eq!(messages(recording, "/diagnostics").len(), 3);
    assert_eq!(recording["metadata"]["result"]["status"], "failed");
    let last = messages(recording, "/log").last().unwrap()["content"].clone();
    assert_eq!(last["level"], "ERROR");
    assert!(last["message"].as_str().unwrap().contains("as ordered"));
    assert!(out.thumbnail.unwrap().exists());

    let canceled = tempfile::tempdir().unwrap();
    let out = outputs(canceled.path());
    let error = run(&scene(), &problem, &mut Ballistic::new(&problem, None), &out, &Watch::new(2)).unwrap_err();
    assert!(matches!(error, RunError::Engine(EngineError::Canceled)));
    let recording = &python(&[], &[out.recording])[0];
    // The cancellation comes with the second frame's report; the third may be computed and in
    // transit by then.
    assert!((2..=3).contains(&messages(recording, "/diagnostics").len()));
    assert_eq!(recording["metadata"]["result"]["status"], "canceled");
}

#[test]
fn a_summary_is_returned_and_a_missing_folder_is_a_clear_error() {
    let directory = tempfile::tempdir().unwrap();
    let problem = problem(0.1);
    let summary =
        run(&scene(), &problem, &mut Ballistic::new(&problem, None), &outputs(directory.path()), &Watch::new(u64::MAX));
    assert_eq!(summary.unwrap(), Summary { frames_written: 6, steps: 20, time_s: 0.25 });
    let nowhere = outputs(&directory.path().join("missing"));
    let error =
        run(&scene(), &problem, &mut Ballistic::new(&problem, None), &nowhere, &Watch::new(u64::MAX)).unwrap_err();
    assert_eq!(error.code(), "output");
    assert!(error.to_string().contains("missing"), "{error}");
}
