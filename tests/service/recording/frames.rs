//! Points of a frame are found in a recording while it grows, once it is finished, and after a crash.

use std::path::PathBuf;
use std::sync::Mutex;

use gridfall_engine::Control;
use gridfall_recording::run::{FrameReport, Observer};
use gridfall_recording::{FrameIndex, FramePoints, frame_points, partial_path};

use super::fixture::{Ballistic, messages, numbers, outputs, problem, python, run, scene};

/// Reads each frame as soon as it is written.
struct Reader {
    target: PathBuf,
    seen: Mutex<(FrameIndex, Vec<FramePoints>, Vec<u64>)>,
}

impl Control for Reader {}
impl Observer for Reader {
    fn frame(&self, report: &FrameReport) {
        let (index, seen, ends) = &mut *self.seen.lock().unwrap();
        assert_eq!(index.len(), report.frame, "a frame is there before it is written");
        let points = frame_points(index, &self.target, report.frame, (Some("speed"), usize::MAX)).unwrap();
        seen.push(points.expect("the frame is written"));
        ends.push(std::fs::metadata(partial_path(&self.target)).unwrap().len());
    }
}

#[test]
fn frames_of_a_growing_recording_are_those_of_the_finished_one() {
    let directory = tempfile::tempdir().unwrap();
    let (problem, out) = (problem(0.1), outputs(directory.path()));
    let reader = Reader { target: out.recording.clone(), seen: Mutex::default() };
    run(&scene(), &problem, &mut Ballistic::new(&problem, None), &out, &reader).unwrap();
    let (mut growing, seen, ends) = reader.seen.into_inner().unwrap();
    assert_eq!(seen.len() as u64, u64::from(problem.setup.frames) + 1);

    let mut index = FrameIndex::default();
    index.look(&out.recording).unwrap();
    growing.look(&out.recording).unwrap();
    assert_eq!((index.len(), growing.len()), (seen.len() as u64, seen.len() as u64));
    let official = &python(&[], std::slice::from_ref(&out.recording))[0];
    for (frame, points) in seen.iter().enumerate() {
        let again = index.points(&out.recording, frame as u64).unwrap().unwrap();
        assert_eq!(&again.take(Some("speed"), usize::MAX), points, "frame {frame}");
        assert_eq!(again.fields(), ["speed", "vx", "vy", "vz", "J", "von_mises", "pressure"]);
        let content = &messages(official, "/particles")[frame]["content"]["points"];
        for (axis, name) in ["x", "y", "z"].iter().enumerate() {
            let expected = numbers(&content[name]);
            assert_eq!(expected.len(), points.positions.len());
            for (position, expected) in points.positions.iter().zip(expected) {
                let position = points.origin[axis] + f64::from(position[axis]);
                assert!((position - expected).abs() < 1e-6, "{position} against {expected}");
            }
        }
        for (color, red) in again.take(None, usize::MAX).colors.iter().zip(numbers(&content["red"])) {
            assert_eq!(f64::from(color[0]), red);
        }
    }
    assert!(index.points(&out.recording, seen.len() as u64).unwrap().is_none());

    // Cut anywhere, the frames before are there.
    let bytes = std::fs::read(&out.recording).unwrap();
    let target = directory.path().join("cut.mcap");
    for cut in ends.iter().flat_map(|end| [end - 1, *end, end + 1]).chain((0..10).map(|k| k * ends[1] / 10)) {
        std::fs::write(partial_path(&target), &bytes[..cut as usize]).unwrap();
        let mut index = FrameIndex::default();
        index.look(&target).unwrap();
        let complete = ends.iter().filter(|end| **end <= cut).count();
        assert_eq!(index.len(), complete as u64, "cut at {cut}, frames end at {ends:?}");
        if let Some(last) = complete.checked_sub(1) {
            let cloud = index.points(&target, last as u64).unwrap().unwrap();
            assert_eq!(cloud.take(Some("speed"), usize::MAX), seen[last]);
        }
    }
}

#[test]
fn damage_is_an_error_and_what_is_not_there_too() {
    let directory = tempfile::tempdir().unwrap();
    let (problem, out) = (problem(0.1), outputs(directory.path()));
    run(&scene(), &problem, &mut Ballistic::new(&problem, None), &out, &super::fixture::Watch::new(u64::MAX)).unwrap();
    let mut index = FrameIndex::default();
    index.look(&out.recording).unwrap();
    let sound = std::fs::read(&out.recording).unwrap();
    // Every stretch of the file in turn, shorter than the frame; it is read as it was, or is said to be damaged.
    let whole = index.points(&out.recording, 2).unwrap().unwrap().take(None, usize::MAX);
    let mut damaged = 0;
    for at in (0..sound.len()).step_by(1.max(sound.len() / 1500)) {
        let mut bytes = sound.clone();
        bytes[at] ^= 0x5a;
        std::fs::write(&out.recording, &bytes).unwrap();
        match index.points(&out.recording, 2) {
            Ok(Some(cloud)) => assert_eq!(cloud.take(None, usize::MAX), whole, "a flip at {at} went unnoticed"),
            Ok(None) => panic!("the frame is gone"),
            Err(_) => damaged += 1,
        }
    }
    assert!(damaged > 0);
    let missing = FrameIndex::default().look(&directory.path().join("none.mcap")).unwrap_err();
    assert!(missing.to_string().contains("none.mcap"), "{missing}");
}
