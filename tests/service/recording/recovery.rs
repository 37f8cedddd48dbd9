//! A recording that was cut off anywhere can be made valid, with every frame that was flushed.

use std::path::{Path, PathBuf};
use std::sync::Mutex;

use gridfall_core::sim::setup::Problem;
use gridfall_engine::Control;
use gridfall_recording as recording;
use gridfall_recording::run::{FrameReport, Observer};

use super::fixture::{Ballistic, outputs, problem, python, run, scene};

/// Where each frame of a recording ends on disk, and the bytes that a crash just after the last
/// frame leaves.
fn unfinished(problem: &Problem, directory: &Path) -> (Vec<u8>, Vec<u64>) {
    struct Lengths(PathBuf, Mutex<Vec<u64>>);
    impl Control for Lengths {}
    impl Observer for Lengths {
        fn frame(&self, _: &FrameReport) {
            self.1.lock().unwrap().push(std::fs::metadata(&self.0).unwrap().len());
        }
    }
    let out = outputs(directory);
    let lengths = Lengths(recording::partial_path(&out.recording), Default::default());
    run(&scene(), problem, &mut Ballistic::new(problem, None), &out, &lengths).unwrap();
    let ends = lengths.1.into_inner().unwrap();
    let mut bytes = std::fs::read(&out.recording).unwrap();
    bytes.truncate(*ends.last().unwrap() as usize);
    (bytes, ends)
}

#[test]
fn a_recording_cut_anywhere_keeps_every_flushed_frame() {
    let directory = tempfile::tempdir().unwrap();
    let (bytes, ends) = unfinished(&problem(0.1), directory.path());
    let whole = &python(&["--frames-only"], &[directory.path().join("out.mcap")])[0];
    // Around each frame's end, and evenly in between.
    let around = ends.iter().flat_map(|&end| [end - 1, end, end + 1]);
    let mut cuts: Vec<u64> = around.chain((1..40).map(|k| 60 + k * bytes.len() as u64 / 40)).collect();
    cuts.retain(|&cut| cut <= bytes.len() as u64);
    let mut paths = Vec::new();
    for &cut in &cuts {
        let partial = directory.path().join(format!("{cut}.mcap.partial"));
        let target = directory.path().join(format!("{cut}.mcap"));
        std::fs::write(&partial, &bytes[..cut as usize]).unwrap();
        let snapshot = recording::snapshot(&partial).unwrap();
        let frames = recording::recover(&partial, &target).unwrap();
        assert!(!partial.exists());
        let recovered = std::fs::read(&target).unwrap();
        // A snapshot is the same recording without touching the file.
        assert_eq!(frames, snapshot.frames);
        assert_eq!(recovered.len() as u64, snapshot.length());
        assert_eq!(&recovered[..snapshot.prefix as usize], &bytes[..snapshot.prefix as usize]);
        assert_eq!(&recovered[snapshot.prefix as usize..], snapshot.tail);
        paths.push(target);
    }
    for (cut, recovered) in cuts.iter().zip(python(&["--frames-only"], &paths)) {
        let flushed = ends.iter().filter(|&&end| end <= *cut).count();
        assert_eq!(recovered["frames"], flushed, "cut at {cut}, frames end at {ends:?}");
        let hashes = recovered["hashes"].as_array().unwrap();
        // The last frame of the complete recording has a closing line in its log.
        let comparable = flushed.min(ends.len() - 1);
        assert_eq!(hashes[..comparable], whole["hashes"].as_array().unwrap()[..comparable]);
        assert_eq!(hashes.len(), flushed);
    }
}

#[test]
fn recovery_cuts_off_damaged_chunks_and_refuses_other_files() {
    let directory = tempfile::tempdir().unwrap();
    let (mut bytes, ends) = unfinished(&problem(0.1), directory.path());
    let middle = (ends[2] + ends[3]) / 2;
    bytes[middle as usize] ^= 0xff;
    let (partial, target) = (directory.path().join("d.mcap.partial"), directory.path().join("d.mcap"));
    std::fs::write(&partial, &bytes).unwrap();
    assert_eq!(recording::recover(&partial, &target).unwrap(), 3);
    assert_eq!(python(&["--frames-only"], &[target])[0]["frames"], 3);

    for other in [&b""[..], b"\x89MCAP0\r\n", b"not a recording at all, but long enough to be one"] {
        std::fs::write(&partial, other).unwrap();
        let error = recording::recover(&partial, &directory.path().join("e.mcap")).unwrap_err();
        assert!(error.to_string().contains("not a recording"), "{error}");
        assert!(partial.exists(), "what cannot be recovered stays");
    }
}
