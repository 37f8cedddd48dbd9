//! `gridfall run`: runs a scene without a server.

use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use clap::Args;
use indicatif::ProgressBar;
use serde_json::json;

use super::device::DeviceArguments;
use super::talk::{bar, remark};
use super::{CliError, interrupt};
use gridfall_core::sim::setup::{Problem, Setup};
use gridfall_engine::choice::Devices;
use gridfall_engine::{Backend, Control, EngineError};
use gridfall_recording::Appearance;
use gridfall_recording::embedded;
use gridfall_recording::partial_path;
use gridfall_recording::run::{self, FrameReport, Observer, Outputs, RunError, Subject};
use gridfall_scene::assets::LocalFiles;
use gridfall_scene::{self as scene, Limits, Scene, shown};

/// So many bytes tell a recording from a scene.
const MAGIC_BYTES: u64 = 8;
/// More than the scene of a recording takes.
const MOST_SCENE_BYTES: u64 = 1 << 30;

/// Run a scene here, without a server, and write its recording.
#[derive(Debug, Args)]
pub struct Arguments {
    /// The scene (JSON), or a recording, whose scene is run again; - reads standard input.
    scene: PathBuf,
    /// The recording; SCENE's name with .mcap in the current directory by default.
    #[arg(short, long, value_name = "OUT.mcap")]
    output: Option<PathBuf>,
    /// Also write the diagnostics, a row a frame.
    #[arg(long, value_name = "OUT.csv")]
    diagnostics: Option<PathBuf>,
    /// Also write how the implicit integrator fared, a row a step.
    #[arg(long, value_name = "OUT.csv")]
    solver_diagnostics: Option<PathBuf>,
    /// Stop after this many frames.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    frames: Option<u32>,
    /// Replace a value of the scene, such as solver.kernel=quadratic; may be given several times.
    #[arg(long = "set", value_name = "PATH=VALUE")]
    overrides: Vec<String>,
    /// Print a summary as JSON on standard output.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    device: DeviceArguments,
}

pub fn execute(arguments: Arguments) -> Result<(), CliError> {
    let (scene, mut problem) = load(&arguments.scene, &arguments.overrides)?;
    if let Some(frames) = arguments.frames {
        problem.setup.frames = problem.setup.frames.min(frames);
    }
    let recording = arguments.output.unwrap_or_else(|| default_output(&arguments.scene));
    let outputs = Outputs {
        state: problem.setup.keep_state.then(|| recording.with_extension("state.npz")),
        recording,
        thumbnail: None,
        diagnostics: arguments.diagnostics,
        solver: arguments.solver_diagnostics,
        checkpoints: None,
    };
    let device_failure = |error: EngineError| CliError::BadInput(error.to_string());
    let devices =
        Devices::open(arguments.device.choice(), arguments.device.adapter.as_deref()).map_err(device_failure)?;
    let Problem { setup, particles } = problem;
    let appearance = Appearance::new(&setup, &particles);
    let mut engine = devices.engine(&setup, particles).map_err(device_failure)?;
    let backend = engine.backend().clone();
    let particles = setup.total_particles();
    remark(format_args!("{}: {particles} particles, {} frames; {}", scene.name, setup.frames, describe(&backend)));
    remark(integration(&setup));
    setup.notices.iter().for_each(|notice| remark(format_args!("notice: {}", shown(&notice.to_string()))));

    let interrupted = interrupt::flag().map_err(|error| CliError::Failed(error.to_string()))?;
    let started = Instant::now();
    let progress = Progress { bar: bar(u64::from(setup.frames)), interrupted, particles, started };
    let scene_json = scene.to_json();
    let subject = Subject { scene_json: &scene_json, setup: &setup, appearance: &appearance };
    let ran = run::run(subject, engine.as_mut(), &outputs, &progress);
    progress.bar.finish_and_clear();
    let summary = ran.map_err(|error| match error {
        RunError::Engine(EngineError::Canceled) => {
            CliError::Failed(format!("interrupted; {} has the frames so far", outputs.recording.display()))
        }
        error => CliError::Failed(error.to_string()),
    })?;

    let wall_s = started.elapsed().as_secs_f64();
    let speed = particles as f64 * summary.steps as f64 / wall_s;
    if arguments.json {
        let report = json!({
            "recording": outputs.recording,
            "diagnostics": outputs.diagnostics,
            "solver_diagnostics": outputs.solver,
            "state": outputs.state,
            "particles": particles,
            "frames_written": summary.frames_written,
            "steps": summary.steps,
            "sim_time": summary.time_s,
            "wall_s": wall_s,
            "particle_steps_per_s": speed,
            "backend": backend,
            "integrator": setup.integrator,
            "integrator_reason": setup.integrator_reason,
            "notices": setup.notices,
        });
        println!("{report:#}");
    } else {
        remark(format_args!(
            "wrote {} ({} frames, {} steps, {wall_s:.1} s, {:.2} M particle-steps/s)",
            outputs.recording.display(),
            summary.frames_written,
            summary.steps,
            speed / 1e6
        ));
        if let Some(state) = &outputs.state {
            remark(format_args!("wrote {}, for a scene to start with", state.display()));
        }
    }
    Ok(())
}

/// Reads and checks a scene file.
pub fn load(path: &Path, overrides: &[String]) -> Result<(Scene, Problem), CliError> {
    let name = if path == Path::new("-") { "standard input".to_owned() } else { path.display().to_string() };
    let text = read(path).map_err(|reason| CliError::BadInput(format!("cannot read {name}: {reason}")))?;
    judged(path, name, &text, overrides)
}

/// Reads the scene that a recording carries, finished or not. Files that it names are in the recording's folder.
pub fn load_recorded(recording: &Path) -> Result<Problem, CliError> {
    let partial = partial_path(recording);
    let path = if recording.exists() { recording } else { &partial };
    let name = recording.display().to_string();
    let text = recorded(path).map_err(|reason| CliError::BadInput(format!("cannot draw {name}: {reason}")))?;
    let problem = judged(path, format!("the scene of {name}"), &text, &[])?.1;
    Ok(problem)
}

fn judged(path: &Path, name: String, text: &str, overrides: &[String]) -> Result<(Scene, Problem), CliError> {
    let scene = scene::parse_with(text, overrides);
    let files = files_beside(path);
    let judged =
        scene.and_then(|scene| scene::problem_with(&scene, &Limits::default(), &files).map(|problem| (scene, problem)));
    judged.map_err(|faults| CliError::Faults { scene: name, faults })
}

/// The text of a scene, or of the one that a recording carries.
pub fn read(path: &Path) -> Result<String, String> {
    let mut bytes = Vec::new();
    if path == Path::new("-") {
        std::io::stdin().read_to_end(&mut bytes).map_err(|error| error.to_string())?;
        return if embedded::is_recording(&bytes) { embedded::scene(&bytes) } else { text(bytes) };
    }
    let mut file = File::open(path).map_err(|error| error.to_string())?;
    file.by_ref().take(MAGIC_BYTES).read_to_end(&mut bytes).map_err(|error| error.to_string())?;
    let recording = embedded::is_recording(&bytes);
    // The scene is at the beginning of what may be gigabytes.
    file.take(if recording { MOST_SCENE_BYTES } else { u64::MAX })
        .read_to_end(&mut bytes)
        .map_err(|error| error.to_string())?;
    if recording { embedded::scene(&bytes) } else { text(bytes) }
}

/// The scene that a recording carries.
fn recorded(path: &Path) -> Result<String, String> {
    let mut bytes = Vec::new();
    let file = File::open(path).map_err(|error| error.to_string())?;
    file.take(MOST_SCENE_BYTES).read_to_end(&mut bytes).map_err(|error| error.to_string())?;
    embedded::scene(&bytes)
}

fn text(bytes: Vec<u8>) -> Result<String, String> {
    String::from_utf8(bytes).map_err(|error| format!("it is neither UTF-8 nor a recording: {error}"))
}

/// The files that a scene may name: those in its folder, or in the current one if the scene comes
/// from standard input.
fn files_beside(scene: &Path) -> LocalFiles {
    LocalFiles { folder: scene.parent().map(Path::to_owned).unwrap_or_default() }
}

fn default_output(scene: &Path) -> PathBuf {
    let stem = scene.file_stem().filter(|stem| *stem != "-").map_or("scene".into(), PathBuf::from);
    stem.with_extension("mcap")
}

/// Which device runs, and why.
pub fn describe(backend: &Backend) -> String {
    format!("on {} ({}): {}", backend.device, backend.kind, backend.reason)
}

/// How the problem is integrated, and why.
pub fn integration(setup: &Setup) -> String {
    format!("{}: {}", setup.integrator.name(), setup.integrator_reason)
}

struct Progress {
    bar: ProgressBar,
    interrupted: Arc<AtomicBool>,
    particles: usize,
    started: Instant,
}

impl Control for Progress {
    fn canceled(&self) -> bool {
        self.interrupted.load(Ordering::Relaxed)
    }

    fn progress(&self, step: u64, _time_s: f64) {
        let speed = self.particles as f64 * step as f64 / self.started.elapsed().as_secs_f64();
        self.bar.set_message(format!("frames, step {step}, {:.2} M particle-steps/s", speed / 1e6));
    }
}

impl Observer for Progress {
    fn frame(&self, report: &FrameReport) {
        self.bar.set_position(report.frame);
    }
}
