//! Unfinished recordings: a snapshot changes nothing, and what is recovered can be recovered again.

use std::path::Path;
use std::sync::Mutex;

use gridfall_engine::Control;
use gridfall_engine::choice::{Choice, Devices};
use gridfall_recording::run::{self, FrameReport, Observer, Outputs, Subject};
use gridfall_recording::{self as recording, Appearance};
use gridfall_scene::{self as scene, Limits};
use serde_json::json;

use super::campaign;

/// The length of the recording after each frame.
struct Ends<'a>(&'a Path, Mutex<Vec<u64>>);

impl Control for Ends<'_> {}

impl Observer for Ends<'_> {
    fn frame(&self, _: &FrameReport) {
        self.1.lock().unwrap().push(std::fs::metadata(self.0).unwrap().len());
    }
}

/// A few frames of two particles, as a process that died left them, whole and cut off.
fn unfinished(dir: &Path) -> Vec<Vec<u8>> {
    let document = json!({
        "gridfall": 1, "name": "two", "dimension": 2, "domain": { "min": [0, 0], "max": [1, 1], "dx": 0.125 },
        "materials": { "m": { "model": "neo-hookean", "density": 2, "youngs_modulus": 1, "poissons_ratio": 0.3 } },
        "bodies": [{ "name": "b", "material": "m", "shape": { "box": { "min": [0.4, 0.4], "max": [0.5, 0.5] } } }],
        "time": { "end": 0.05, "frame_rate": 60 },
    });
    let scene = scene::from_value(&document).unwrap();
    let problem = scene::problem(&scene, &Limits::default()).unwrap();
    let mut engine =
        Devices::open(Choice::Cpu, None).unwrap().engine(&problem.setup, problem.particles.clone()).unwrap();
    let outputs = Outputs {
        recording: dir.join("two.mcap"),
        thumbnail: None,
        diagnostics: None,
        solver: None,
        state: None,
        checkpoints: None,
    };
    let partial = recording::partial_path(&outputs.recording);
    let ends = Ends(&partial, Mutex::default());
    let appearance = Appearance::new(&problem.setup, &problem.particles);
    let scene_json = scene.to_json();
    let subject = Subject { scene_json: &scene_json, setup: &problem.setup, appearance: &appearance };
    run::run(subject, &mut *engine, &outputs, &ends).unwrap();
    let bytes = std::fs::read(&outputs.recording).unwrap();
    let ends = ends.1.into_inner().unwrap();
    let cut = |end: u64| bytes[..end as usize].to_vec();
    [ends[0], ends[1], ends[ends.len() - 1], ends[0] - 9, bytes.len() as u64].map(cut).into()
}

#[test]
fn recording() {
    let dir = tempfile::tempdir().unwrap();
    let corpus = unfinished(dir.path());
    let (partial, target) = (dir.path().join("a.mcap.partial"), dir.path().join("a.mcap"));
    let other = dir.path().join("b.mcap");
    campaign::run("recording", corpus, |input| {
        // Frames are looked for in it as if it grew, and as if it were finished.
        for (path, grows) in [(recording::partial_path(&other), true), (other.clone(), false)] {
            std::fs::write(&path, input).unwrap();
            let mut index = recording::FrameIndex::default();
            let looked = index.look(&other);
            let foreign = !recording::embedded::is_recording(input);
            assert!(looked.is_ok() || !grows || foreign, "{looked:?}");
            for frame in 0..index.len().min(3) {
                let _ = index.points(&other, frame).map(|cloud| cloud.map(|cloud| cloud.take(Some("speed"), 10)));
            }
            std::fs::remove_file(&path).unwrap();
        }
        std::fs::write(&partial, input).unwrap();
        let seen = recording::snapshot(&partial);
        assert!(std::fs::read(&partial).unwrap() == input, "a snapshot changed the file");
        let mut growing = recording::Growing::open(&partial).unwrap();
        growing.look().unwrap();
        assert_eq!(growing.safe(), seen.as_ref().map_or(0, |snapshot| snapshot.prefix));
        for chunk in 0..growing.chunks() {
            // Damaged ones are errors.
            let _ = growing.messages(chunk);
        }
        let recovered = recording::recover(&partial, &target);
        if let Ok(frames) = recovered {
            // Its new index is no part of what is recovered.
            std::fs::rename(&target, &partial).unwrap();
            assert_eq!(recording::recover(&partial, &target).ok(), Some(frames), "it is not recovered again");
        }
        // What is not recovered stays.
        assert!(recovered.is_ok() || partial.exists());
        format!("{:?} {:?}", seen.map(|snapshot| snapshot.frames).is_ok(), recovered.map_err(|error| error.to_string()))
    });
}
