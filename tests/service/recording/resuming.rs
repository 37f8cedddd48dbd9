//! A run that goes on from a checkpoint leaves what a run that was never interrupted leaves, to the byte.

use std::path::Path;

use gridfall_core::sim::setup::{Integrator, Problem};
use gridfall_engine::Control;
use gridfall_recording::Appearance;
use gridfall_recording::checkpoint::{self, Checkpoint};
use gridfall_recording::run::{Earlier, Observer, Outputs, ResumeError, Run, RunError, Subject, Summary};

use super::fixture::{Ballistic, outputs, problem, run, scene};

/// Wants a checkpoint at every boundary.
struct Every;
impl Control for Every {}
impl Observer for Every {
    fn checkpoint_due(&self) -> bool {
        true
    }
    fn checkpoint_failed(&self, reason: &str) {
        panic!("{reason}");
    }
}

fn implicit() -> Problem {
    let mut problem = problem(0.1);
    problem.setup.integrator = Integrator::Implicit;
    problem
}

/// Goes on from a checkpoint, into another folder.
fn resume(problem: &Problem, earlier: &Earlier, out: &Outputs) -> Result<Result<Summary, RunError>, ResumeError> {
    let (scene_json, appearance) = (scene().to_json(), Appearance::new(&problem.setup, &problem.particles));
    let subject = Subject { scene_json: &scene_json, setup: &problem.setup, appearance: &appearance };
    let mut engine = Ballistic::new(problem, None);
    let run = Run::resume(subject, &mut engine, out, earlier)?;
    Ok(run.execute(&mut engine, &Every))
}

fn files(out: &Outputs) -> [Vec<u8>; 4] {
    let of = |path: &Path| std::fs::read(path).unwrap();
    [
        of(&out.recording),
        of(out.diagnostics.as_deref().unwrap()),
        of(out.solver.as_deref().unwrap()),
        of(out.thumbnail.as_deref().unwrap()),
    ]
}

#[test]
fn a_resumed_run_leaves_the_same_bytes() {
    let problem = implicit();
    let whole = tempfile::tempdir().unwrap();
    let whole_out = outputs(whole.path());
    run(&scene(), &problem, &mut Ballistic::new(&problem, None), &whole_out, &Every).unwrap();
    // Of five frames, the last has none, and two are kept.
    let kept = checkpoint::list(whole_out.checkpoints.as_deref().unwrap()).unwrap();
    let names: Vec<_> = kept.iter().map(|path| path.file_stem().unwrap().to_str().unwrap()).collect();
    assert_eq!(names, ["0000000004", "0000000003"]);
    for fails_at in 2..=5 {
        let first = tempfile::tempdir().unwrap();
        let first_out = outputs(first.path());
        let mut engine = Ballistic::new(&problem, Some(fails_at));
        run(&scene(), &problem, &mut engine, &first_out, &Every).unwrap_err();
        for path in checkpoint::list(first_out.checkpoints.as_deref().unwrap()).unwrap() {
            let earlier = Earlier { checkpoint: Checkpoint::open(&path).unwrap(), outputs: first_out.clone() };
            assert!(earlier.checkpoint.reached.frame < fails_at);
            let second = tempfile::tempdir().unwrap();
            let out = outputs(second.path());
            let summary = resume(&problem, &earlier, &out).unwrap().unwrap();
            assert_eq!(summary, Summary { frames_written: 6, steps: 20, time_s: 0.25 });
            assert!(files(&out) == files(&whole_out), "from {path:?}");
        }
    }
}

#[test]
fn what_is_damaged_or_of_another_scene_is_refused_with_the_reason() {
    let problem = implicit();
    let first = tempfile::tempdir().unwrap();
    let out = outputs(first.path());
    run(&scene(), &problem, &mut Ballistic::new(&problem, Some(4)), &out, &Every).unwrap_err();
    let path = checkpoint::list(out.checkpoints.as_deref().unwrap()).unwrap().remove(0);
    let earlier = Earlier { checkpoint: Checkpoint::open(&path).unwrap(), outputs: out.clone() };
    let second = tempfile::tempdir().unwrap();
    let fresh = outputs(second.path());

    // Any byte of a checkpoint.
    let bytes = std::fs::read(&path).unwrap();
    let broken = first.path().join("broken.checkpoint");
    let seed = 20_261_129;
    println!("seed {seed}");
    for k in 0..200usize {
        let mut damaged = bytes.clone();
        let at = (k * 2_654_435_761 + seed) % bytes.len();
        if k % 4 == 0 {
            damaged.truncate(at)
        } else {
            damaged[at] ^= 1 << (k % 8)
        }
        std::fs::write(&broken, &damaged).unwrap();
        let error = Checkpoint::open(&broken).unwrap_err().to_string();
        assert!(error.contains("is not a whole checkpoint"), "{error}");
    }

    // A recording that is shorter than when the checkpoint was made, or of other bytes.
    let recording = std::fs::read(&out.recording).unwrap();
    let length = earlier.checkpoint.reached.lengths[0] as usize;
    std::fs::write(&out.recording, &recording[..length - 1]).unwrap();
    assert!(matches!(resume(&problem, &earlier, &fresh), Err(ResumeError::Output(_))));
    let mut other = recording.clone();
    other[length / 2] ^= 4;
    std::fs::write(&out.recording, &other).unwrap();
    assert!(matches!(resume(&problem, &earlier, &fresh), Err(ResumeError::Output(_))));
    std::fs::write(&out.recording, &recording).unwrap();
    resume(&problem, &earlier, &fresh).unwrap().unwrap();

    let mut scene = scene();
    scene.seed = 5;
    let (scene_json, appearance) = (scene.to_json(), Appearance::new(&problem.setup, &problem.particles));
    let subject = Subject { scene_json: &scene_json, setup: &problem.setup, appearance: &appearance };
    let refused = Run::resume(subject, &mut Ballistic::new(&problem, None), &fresh, &earlier);
    assert!(matches!(refused, Err(ResumeError::Foreign(reason)) if reason.contains("scene ")));
}
