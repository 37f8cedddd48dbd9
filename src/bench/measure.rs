//! The measurement of a problem: a warm-up, then rounds that all do the same work, each from the same saved state.

use std::time::Instant;

use super::machine::resident_bytes;
use super::row::{Row, Spread, Stage};
use super::{BenchError, problem};
use gridfall_core::sim::particles::Particles;
use gridfall_core::sim::setup::{Integrator, Material, Precision, Problem, Setup};
use gridfall_core::sim::timestep;
use gridfall_engine::choice::Devices;
use gridfall_engine::explicit::cpu::CpuEngine;
use gridfall_engine::explicit::gpu::GpuEngine;
use gridfall_engine::explicit::gpu::timing::Profile;
use gridfall_engine::{Engine, EngineError, NoControl};
use gridfall_recording::provenance;

/// Rounds that are measured.
const ROUNDS: usize = 5;
/// Target wall time of a round.
const ROUND_WALL_S: f64 = 0.4;
/// Fewest and most steps of a round.
const FEWEST_STEPS: u64 = 4;
const MOST_STEPS: u64 = 400;
/// Steps of the warm-up, in frames of so many: programs are compiled, bodies move and meet.
const WARM_UP_FRAMES: usize = 4;
const WARM_UP_STEPS: u64 = 16;
/// Steps whose stages are timed at most.
const TIMED_STEPS: u64 = 100;
/// Grid traffic per particle at 8 particles per cell (bytes per step), in addition to reading and
/// writing the particle's own state once.
const GRID_BYTES: f64 = 24.0;

/// Measures a scene, given as JSON, on the device that suits it. `bandwidth_b_s`: what [`super::copy_bandwidth`] says
/// of the device.
///
/// Errors: faults of the scene, scenes that are not measured, and those of the engine.
pub fn measure(devices: &Devices, bandwidth_b_s: f64, json: &str, case: &str) -> Result<Row, BenchError> {
    let before = resident_bytes();
    let Problem { setup, particles } = problem(json)?;
    let unsupported = |reason: &str| Err(BenchError::Engine(EngineError::Unsupported(reason.into())));
    if particles.is_empty() {
        return unsupported("nothing is there at the start, and sources are not measured");
    }
    if setup.integrator == Integrator::Implicit {
        return unsupported("it is implicit; `gridfall bench` measures solver.integrator = \"explicit\"");
    }
    let count = particles.len();
    let floor_bytes = floor_bytes(&setup, count);
    let extremes = timestep::initial_extremes(&setup, &particles);
    let dt_s = timestep::plan_frame(&setup, &extremes, setup.frame_s).dt_s;
    let mut engine = Measured::load(devices, &setup, particles)?;
    for _ in 0..WARM_UP_FRAMES {
        engine.get().advance_frame(WARM_UP_STEPS as f64 * dt_s, &NoControl)?;
    }
    let host_bytes = before.zip(resident_bytes()).map(|(before, now)| now.saturating_sub(before));
    let mut state = Vec::new();
    engine.get().save(&mut state)?;
    let trial = engine.round(&state, FEWEST_STEPS as f64 * dt_s)?;
    let wished = (ROUND_WALL_S / trial.wall_s * trial.steps as f64) as u64;
    let frame_s = wished.clamp(FEWEST_STEPS, MOST_STEPS) as f64 * dt_s;
    let rounds = (0..ROUNDS).map(|_| engine.round(&state, frame_s)).collect::<Result<Vec<_>, _>>()?;
    let steps = rounds[0].steps;
    let rates = rounds.iter().map(|round| count as f64 * round.steps as f64 / round.wall_s).collect();
    let rate = Spread::of(rates);
    let dt_s = frame_s / steps as f64;
    let mut row = Row {
        case: case.into(),
        particles: count,
        kernel: setup.kernel,
        precision: setup.precision,
        dt_s,
        backend: engine.get().backend().clone(),
        rounds: ROUNDS,
        steps,
        particle_steps_per_s: rate,
        wall_s_per_simulated_s: count as f64 / (rate.median * dt_s),
        floor_bytes,
        copy_bandwidth_b_s: bandwidth_b_s,
        floor_share: rate.median * floor_bytes / bandwidth_b_s,
        host_bytes,
        device_bytes: None,
        blocks: None,
        dispatches: None,
        stages: Vec::new(),
        version: provenance::VERSION.into(),
        commit: provenance::COMMIT.into(),
        compared: None,
    };
    if let Measured::Gpu(gpu) = &mut engine {
        row.device_bytes = Some(gpu.device_bytes() as u64);
        let traffic = gpu.traffic()?;
        row.blocks = Some(traffic.load.blocks);
        row.dispatches = Some(traffic.stages.len());
        let a_particle = |bytes: usize| Some(bytes as f64 / count as f64);
        row.stages = traffic
            .stages
            .iter()
            .map(|(name, moved)| Stage {
                stage: short(name),
                time_us: None,
                read_bytes: a_particle(moved.read),
                written_bytes: a_particle(moved.written),
            })
            .collect();
        add_times(gpu, &state, steps.min(TIMED_STEPS), dt_s, &mut row.stages)?;
    }
    Ok(row)
}

/// A stage's name without its folder.
fn short(name: &str) -> String {
    name.trim_start_matches("explicit/").into()
}

/// Times the stages in rounds of their own, and adds those that run once a frame.
fn add_times(
    gpu: &mut GpuEngine,
    state: &[u8],
    steps: u64,
    dt_s: f64,
    stages: &mut Vec<Stage>,
) -> Result<(), BenchError> {
    let mut profiles = Vec::new();
    for _ in 0..ROUNDS {
        gpu.restore(&mut &state[..])?;
        match gpu.profile(steps, dt_s)? {
            Some(profile) => profiles.push(profile),
            None => return Ok(()),
        }
    }
    let names: Vec<&str> = profiles[0].stage_s.keys().copied().collect();
    for name in names {
        let us = |p: &Profile| 1e6 * p.stage_s[name] / p.steps as f64;
        let time_us = Some(Spread::of(profiles.iter().map(us).collect()));
        match stages.iter_mut().find(|stage| stage.stage == name) {
            Some(stage) => stage.time_us = time_us,
            None => stages.push(Stage { stage: name.into(), time_us, read_bytes: None, written_bytes: None }),
        }
    }
    Ok(())
}

/// How long a round took.
struct Round {
    steps: u64,
    wall_s: f64,
}

/// An engine whose kind is known, because only a GPU reports stages.
enum Measured {
    Cpu(Box<CpuEngine>),
    Gpu(Box<GpuEngine>),
}

impl Measured {
    fn load(devices: &Devices, setup: &Setup, particles: Particles) -> Result<Self, EngineError> {
        Ok(match devices.gpu() {
            Some(gpu) => Self::Gpu(Box::new(GpuEngine::new(gpu.clone(), setup, particles, devices.reason())?)),
            None => Self::Cpu(Box::new(CpuEngine::new(setup, particles)?.because(devices.reason()))),
        })
    }

    fn get(&mut self) -> &mut dyn Engine {
        match self {
            Self::Cpu(e) => e.as_mut(),
            Self::Gpu(e) => e.as_mut(),
        }
    }

    /// Takes a frame from a saved state; what restoring takes does not count.
    fn round(&mut self, mut state: &[u8], frame_s: f64) -> Result<Round, BenchError> {
        self.get().restore(&mut state)?;
        if let Self::Gpu(engine) = self {
            let uploaded = engine.gpu().submit(|_| ());
            engine.gpu().wait(Some(uploaded))?;
        }
        let begin = Instant::now();
        let steps = self.get().advance_frame(frame_s, &NoControl)?.steps;
        Ok(Round { steps, wall_s: begin.elapsed().as_secs_f64() })
    }
}

/// Bytes that must be moved per particle and step: position and deformation read and written once,
/// and the particle's share of the grid.
fn floor_bytes(setup: &Setup, particles: usize) -> f64 {
    let scalar = if setup.precision == Precision::F64 { 8.0 } else { 4.0 };
    let state = |material: &Material| match material {
        Material::WeaklyCompressibleFluid(_) => 4.0,
        solid => 12.0 + f64::from(u8::from(solid.has_plastic_state())),
    };
    let of_bodies: f64 =
        setup.bodies.iter().map(|b| b.particles.len() as f64 * state(&setup.materials[b.material])).sum();
    2.0 * scalar * of_bodies / particles as f64 + GRID_BYTES * scalar / 4.0
}
