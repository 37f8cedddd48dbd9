//! Named benchmark cases and their measurement: a warm-up, then the median of several frames on one
//! engine.

pub mod implicit;

use std::time::Instant;

use serde::{Deserialize, Serialize};

use gridfall_core::sim::setup::{Kernel, Material, Precision, Problem};
use gridfall_core::sim::timestep;
use gridfall_engine::choice::Devices;
use gridfall_engine::explicit::cpu::CpuEngine;
use gridfall_engine::explicit::gpu::{GpuEngine, timing};
use gridfall_engine::{Backend, Engine, EngineError, NoControl};
use gridfall_recording::provenance;
use gridfall_scene::{self as scene, Fault};

/// Number of frames that are measured.
const FRAMES: usize = 5;
/// Target wall time of a measured frame.
const FRAME_WALL_S: f64 = 0.4;
/// Grid traffic per particle at 8 particles per cell (bytes per step), in addition to reading and
/// writing the particle's own state once.
const GRID_BYTES: f64 = 24.0;

/// Size of a case: cells along the body's edge.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Size {
    Small,
    Medium,
    Large,
}

impl Size {
    pub const ALL: [Size; 3] = [Size::Small, Size::Medium, Size::Large];

    /// About 8 n³ particles: 17 thousand, 262 thousand, 2.1 million.
    fn cells(self) -> usize {
        match self {
            Size::Small => 13,
            Size::Medium => 32,
            Size::Large => 64,
        }
    }

    pub fn name(self) -> &'static str {
        match self {
            Size::Small => "small",
            Size::Medium => "medium",
            Size::Large => "large",
        }
    }
}

/// The named cases.
pub const CASES: [&str; 2] = ["fluid-dam-break", "fixed-corotated-pair"];

/// The scene of a case, as JSON.
pub fn scene_json(case: &str, size: Size, kernel: Kernel, precision: Precision) -> String {
    let n = size.cells() as f64;
    let dx = 0.5 / n;
    let (kernel, precision) = (serde_json::json!(kernel), serde_json::json!(precision));
    let solver = format!(r#""solver": {{ "kernel": {kernel}, "precision": {precision} }}"#);
    let wall = r#"{"contact":"separate"}"#;
    let walls = format!(r#""boundary": {{ "x": {wall}, "y": {wall}, "z": {wall} }}"#);
    let time = r#""time": { "end": 1 }, "output": { "fields": [] }"#;
    if case == CASES[0] {
        // A column of n × n × n cells in a tank three times as long.
        format!(
            r#"{{ "gridfall": 1, "name": "{case}",
            "domain": {{ "min": [0,0,0], "max": [1.5,0.5,1], "dx": {dx}, {walls} }},
            "gravity": [0,0,-9.81],
            "materials": {{
              "water": {{ "model": "weakly-compressible-fluid", "density": 1000, "bulk_modulus": 2e5 }} }},
            "bodies": [
              {{ "name": "column", "material": "water",
                 "shape": {{ "box": {{ "min": [0,0,0], "max": [0.5,0.5,0.5] }} }} }} ],
            {time}, {solver} }}"#
        )
    } else {
        // Two cubes of half that volume each that collide, rotating so that F is not a multiple of
        // I.
        format!(
            r#"{{ "gridfall": 1, "name": "{case}",
            "domain": {{ "min": [0,0,0], "max": [1.5,0.5,1], "dx": {dx}, {walls} }},
            "materials": {{
              "jelly": {{ "model": "fixed-corotated", "density": 1000,
                         "youngs_modulus": 1e6, "poissons_ratio": 0.3 }} }},
            "bodies": [
              {{ "name": "left", "material": "jelly", "velocity": [1,0,0], "angular_velocity": [0,0,2],
                 "shape": {{ "box": {{ "min": [0.25,0.05,0.3], "max": [0.65,0.45,0.7] }} }} }},
              {{ "name": "right", "material": "jelly", "velocity": [-1,0,0], "angular_velocity": [0,2,0],
                 "shape": {{ "box": {{ "min": [0.85,0.05,0.3], "max": [1.25,0.45,0.7] }} }} }} ],
            {time}, {solver} }}"#
        )
    }
}

/// Median, minimum and maximum of several frames.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Spread {
    pub median: f64,
    pub min: f64,
    pub max: f64,
}

impl Spread {
    fn of(mut values: Vec<f64>) -> Self {
        values.sort_by(f64::total_cmp);
        Self { median: values[values.len() / 2], min: values[0], max: values[values.len() - 1] }
    }
}

/// GPU time of a stage.
#[derive(Clone, Debug, Serialize)]
pub struct StageTime {
    pub stage: &'static str,
    /// Mean over the profiled steps (µs per step).
    pub us_per_step: f64,
}

/// One measured case.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    pub case: String,
    pub size: String,
    pub particles: usize,
    pub kernel: Kernel,
    pub precision: Precision,
    pub dt_s: f64,
    pub backend: Backend,
    pub particle_steps_per_s: Spread,
    /// Wall time for a second of simulated time; this includes the effect of the kernel's step.
    pub wall_s_per_simulated_s: f64,
    /// Minimum memory traffic per particle and step (bytes).
    pub floor_bytes: f64,
    /// Bytes read and written per second by a plain copy.
    pub copy_bandwidth_b_s: f64,
    /// Share of that bandwidth that the minimum traffic needs at this speed.
    pub floor_share: f64,
    /// Empty on the CPU, and on GPUs without timestamps.
    pub stages: Vec<StageTime>,
    pub version: &'static str,
    pub commit: &'static str,
}

/// What can go wrong: the user's scene, or the device.
#[derive(Debug, thiserror::Error)]
pub enum BenchError {
    #[error("the scene has faults")]
    Faults(Vec<Fault>),
    #[error(transparent)]
    Engine(#[from] EngineError),
}

/// The problem of a scene document.
pub fn problem(json: &str) -> Result<Problem, BenchError> {
    let scene = scene::parse(json).map_err(BenchError::Faults)?;
    scene::problem(&scene, &scene::Limits::default()).map_err(BenchError::Faults)
}

/// Measures a problem on the device that suits it.
pub fn measure(devices: &Devices, problem: &Problem, case: &str, size: &str) -> Result<Row, BenchError> {
    let plan = timestep::plan_frame(
        &problem.setup,
        &timestep::initial_extremes(&problem.setup, &problem.particles),
        problem.setup.frame_s,
    );
    if problem.particles.is_empty() {
        let reason = "nothing is there at the start, and sources are not measured";
        return Err(BenchError::Engine(EngineError::Unsupported(reason.into())));
    }
    let mut engine = Measured::load(devices, problem)?;
    let (rates, steps_per_frame) = rates(engine.get(), problem, plan.dt_s)?;
    let (copy_bandwidth_b_s, stages) = match &mut engine {
        Measured::Gpu(gpu) => {
            let profile = gpu.profile((steps_per_frame as u64).min(100), plan.dt_s)?;
            let times = profile.into_iter().flat_map(|p| {
                p.stage_s.into_iter().map(move |(stage, s)| StageTime { stage, us_per_step: 1e6 * s / p.steps as f64 })
            });
            (timing::copy_bandwidth(gpu.gpu())?, times.collect())
        }
        Measured::Cpu(_) => (memory_bandwidth_b_s(), Vec::new()),
    };
    let rate = Spread::of(rates);
    let floor_bytes = floor_bytes(problem);
    Ok(Row {
        case: case.into(),
        size: size.into(),
        particles: problem.particles.len(),
        kernel: problem.setup.kernel,
        precision: problem.setup.precision,
        dt_s: plan.dt_s,
        backend: engine.get().backend().clone(),
        particle_steps_per_s: rate,
        wall_s_per_simulated_s: problem.particles.len() as f64 / (rate.median * plan.dt_s),
        floor_bytes,
        copy_bandwidth_b_s,
        floor_share: rate.median * floor_bytes / copy_bandwidth_b_s,
        stages,
        version: provenance::VERSION,
        commit: provenance::COMMIT,
    })
}

/// An engine whose kind is known, because only a GPU reports stage times.
enum Measured {
    Cpu(Box<CpuEngine>),
    Gpu(Box<GpuEngine>),
}

impl Measured {
    fn load(devices: &Devices, problem: &Problem) -> Result<Self, EngineError> {
        Ok(match devices.gpu() {
            Some(gpu) => Self::Gpu(Box::new(GpuEngine::new(
                gpu.clone(),
                &problem.setup,
                problem.particles.clone(),
                devices.reason(),
            )?)),
            None => Self::Cpu(Box::new(
                CpuEngine::new(&problem.setup, problem.particles.clone())?.because(devices.reason()),
            )),
        })
    }

    fn get(&mut self) -> &mut dyn Engine {
        match self {
            Self::Cpu(e) => e.as_mut(),
            Self::Gpu(e) => e.as_mut(),
        }
    }
}

/// Particle-steps per second of each measured frame, and the steps of a frame.
fn rates(engine: &mut dyn Engine, problem: &Problem, dt_s: f64) -> Result<(Vec<f64>, usize), EngineError> {
    let mut frame = |steps: usize| -> Result<(f64, f64), EngineError> {
        let begin = Instant::now();
        let stats = engine.advance_frame(steps as f64 * dt_s, &NoControl)?;
        let wall = begin.elapsed().as_secs_f64();
        Ok((problem.particles.len() as f64 * stats.steps as f64 / wall, wall / stats.steps as f64))
    };
    // Warm-up: pipelines, caches, clocks. Then as many steps per frame as give a fair sample.
    frame(4)?;
    let per_step = frame(4)?.1;
    let steps = ((FRAME_WALL_S / per_step) as usize).clamp(4, 400);
    let rates = (0..FRAMES).map(|_| Ok(frame(steps)?.0)).collect::<Result<_, EngineError>>()?;
    Ok((rates, steps))
}

/// Bytes that must be moved per particle and step: position and deformation read and written once,
/// and the particle's share of the grid.
fn floor_bytes(problem: &Problem) -> f64 {
    let scalar = if problem.setup.precision == Precision::F64 { 8.0 } else { 4.0 };
    let state = |material: &Material| match material {
        Material::WeaklyCompressibleFluid(_) => 4.0,
        solid => 12.0 + f64::from(u8::from(solid.has_plastic_state())),
    };
    let of_bodies: f64 = problem
        .setup
        .bodies
        .iter()
        .map(|b| b.particles.len() as f64 * state(&problem.setup.materials[b.material]))
        .sum();
    2.0 * scalar * of_bodies / problem.particles.len() as f64 + GRID_BYTES * scalar / 4.0
}

/// Bytes read and written per second by copies of large arrays on all threads; the best of several.
fn memory_bandwidth_b_s() -> f64 {
    use rayon::prelude::*;
    const CHUNK: usize = 8 << 20;
    let from = vec![1u8; 16 * CHUNK];
    let mut to = vec![0u8; 16 * CHUNK];
    let mut best: f64 = 0.0;
    for _ in 0..4 {
        let begin = Instant::now();
        to.par_chunks_mut(CHUNK).zip(from.par_chunks(CHUNK)).for_each(|(to, from)| to.copy_from_slice(from));
        best = best.max(2.0 * from.len() as f64 / begin.elapsed().as_secs_f64());
    }
    std::hint::black_box(&to);
    best
}
