//! Runs frames on the device: plan, submit without reading back, then answer for what the device
//! reported.

use std::io::{Read, Write};
use std::sync::Arc;

use super::buffers::{Buffers, Counts};
use super::layout::{self, Params, Report};
use super::readback;
use super::scene::{self, SceneData};
use super::segment::Course;
use super::stages::{Placed, Stages};
use super::table;
use super::upload::DeviceLayout;
use super::view::Viewer;
use crate::contract::{Backend, Control, Engine, EngineError, FrameStats, Pending, StateError, TakePlaces};
use crate::gpu::memory::Memory;
use crate::gpu::program::{Dispatch, Programs, Tools};
use crate::gpu::{Fills, Gpu, Variant};
use gridfall_core::sim::divergence;
use gridfall_core::sim::excerpt::Choice;
use gridfall_core::sim::particles::Particles;
use gridfall_core::sim::reaction::{self, Reaction};
use gridfall_core::sim::setup::Setup;
use gridfall_core::sim::side::{self, Plates};
use gridfall_core::sim::timestep::{self, Extremes, StepPlan};
use gridfall_core::sim::touch;

/// Fixed-point units of a full node's mass, and of its momentum at the velocity of scale: 2^27
/// leaves a factor of 4 up to the soft limit and 8 up to the hard one, and resolves 1e-8 of a full
/// node.
const FULL_NODE: f64 = 134_217_728.0;
/// A frame that needs more plans than this is not going to finish.
const MAX_PLANS: u32 = 64;

/// An explicit simulation on a GPU.
pub struct GpuEngine {
    pub(super) gpu: Arc<Gpu>,
    pub(super) programs: Programs,
    pub(super) setup: Setup,
    pub(super) layout: DeviceLayout,
    pub(super) buffers: Buffers,
    pub(super) stages: Stages,
    pub(super) params: Params,
    backend: Backend,
    pub(super) time_s: f64,
    pub(super) steps: u64,
    /// Bound on node speeds at the frame's start (m/s).
    pub(super) max_speed: f64,
    /// Demand of the materials at the frame's start (1/s²).
    pub(super) max_demand: f64,
    /// Particles reset in this frame.
    isolated: u64,
    /// Coarsening of the fixed-point scales that this run has needed.
    pub(super) mass_range: f64,
    pub(super) momentum_range: f64,
    pub(super) chunk: usize,
    /// Particles on the device, by body.
    pub(super) population: Vec<u64>,
    /// Made when first asked for.
    pub(super) viewer: Option<Viewer>,
}

impl GpuEngine {
    /// Loads a problem at time 0. `reason` says why this device was chosen.
    ///
    /// Errors: unsupported scenes, capacity, a lost device.
    pub fn new(gpu: Arc<Gpu>, setup: &Setup, mut particles: Particles, reason: &str) -> Result<Self, EngineError> {
        super::supports(setup).map_err(EngineError::Unsupported)?;
        let layout = DeviceLayout::new(setup);
        let extremes = timestep::initial_extremes(setup, &particles);
        touch::begin(setup, &mut particles, 0.0);
        let scene = SceneData::new(setup);
        let blocks = layout.active_blocks(&particles, &Plates::of(setup, 0.0))?;
        let counts = Counts::of(setup, scene.sizes(), setup.total_particles(), blocks);
        let buffers = Buffers::new(&gpu, counts)?;
        scene.write(&gpu, &buffers.memory);
        let programs = Programs::new(Variant::of(setup));
        let stages = Stages::new(Tools { gpu: &gpu, programs: &programs }, &buffers.memory, setup);
        let backend = gpu.backend(reason);
        let params = layout.params(setup);
        let max_speed = extremes.speed_m_s + 3.0f64.sqrt() * setup.dx * extremes.affine_rate_1_s;
        let mut engine = Self {
            gpu,
            programs,
            setup: setup.clone(),
            layout,
            buffers,
            stages,
            params,
            backend,
            time_s: 0.0,
            steps: 0,
            max_speed,
            max_demand: extremes.demand_1_s2,
            isolated: 0,
            mass_range: 1.0,
            momentum_range: 1.0,
            chunk: 1,
            population: vec![0; setup.bodies.len()],
            viewer: None,
        };
        engine.put(&particles)?;
        Ok(engine)
    }

    /// Device memory that a scene with so many particles in so many blocks would begin with (bytes).
    ///
    /// Errors: [`EngineError::Capacity`] when a buffer is larger than the device has any.
    pub fn bytes_for(gpu: &Gpu, setup: &Setup, particles: usize, blocks: usize) -> Result<usize, EngineError> {
        let sizes = Counts::of(setup, SceneData::new(setup).sizes(), particles, blocks).sizes();
        sizes.check(&gpu.limits)?;
        Ok(sizes.total_bytes())
    }

    /// Device memory in use (bytes).
    pub fn device_bytes(&self) -> usize {
        self.buffers.counts.sizes().total_bytes()
    }

    /// The device it runs on.
    pub fn gpu(&self) -> &Arc<Gpu> {
        &self.gpu
    }

    pub(super) fn memory(&self) -> &Memory {
        &self.buffers.memory
    }

    /// Accounts for steps that were submitted outside a frame, after they ended.
    pub(super) fn settle(&mut self, steps: u64, dt_s: f64) -> Result<(), EngineError> {
        let report = self.read_report()?;
        if report.halt != 0 || report.error != 0 || report.finished == 0 {
            return Err(self.failure(&report, dt_s));
        }
        self.arrive(&report);
        self.steps += steps;
        self.time_s += steps as f64 * dt_s;
        Ok(())
    }

    /// Takes over what the last `g2p` measured.
    pub(super) fn arrive(&mut self, report: &Report) {
        self.max_speed = f64::from(f32::from_bits(report.max_speed));
        self.max_demand = f64::from(f32::from_bits(report.max_demand));
        self.isolated += u64::from(report.isolated);
    }

    pub(super) fn set_course(&mut self, course: &Course) {
        let dt_s = course.dt_s;
        let p = &self.setup;
        let densest = p.bodies.iter().map(|b| b.mass / b.volume0).fold(0.0, f64::max);
        let full = densest * p.dx.powi(3);
        let wave = timestep::max_wave_speed_m_s(p);
        let gravity = p.gravity.iter().map(|g| g * g).sum::<f64>().sqrt();
        // Momentum comes from motion and from stress impulses, which are below c · strain a node.
        let speed =
            (4.0 * (self.max_speed + gravity * p.frame_s)).max(wave / 8.0).min(p.dx / dt_s) * self.momentum_range;
        // Powers of two, so that scaling is exact: all nodes inside a body share one mass, and the
        // rounding of one product would be a steady drift of its momentum.
        let power_of_two = |x: f64| x.log2().floor().exp2() as f32;
        self.params.mass_scale = power_of_two(FULL_NODE / (full * self.mass_range));
        self.params.momentum_scale = power_of_two(FULL_NODE / (full * speed));
        self.params.cell_scale = match Fills::of(&self.setup) {
            Fills::Volume => power_of_two(FULL_NODE / self.mass_range),
            // All have one density.
            _ => (f64::from(self.params.mass_scale) * full) as f32,
        };
        self.params.dt = dt_s as f32;
        self.params.first_kick = course.first_kick_s as f32;
        self.params.last_kick = if course.staggered { 0.5 * dt_s } else { dt_s } as f32;
        self.params.last_step = (course.passes() - 1) as u32;
        self.params.end_dt = if course.staggered { 0.0 } else { dt_s } as f32;
        self.params.resets = u32::from(!course.part);
        self.params.steps = self.steps as u32;
        self.params.soft_shift = p.cfl as f32;
        self.params.soft_growth = timestep::MAX_GROWTH as f32;
        self.params.soft_demand = (timestep::REPLAN_DEMAND / (dt_s * dt_s)) as f32;
        self.params.capacity = self.buffers.counts.capacity as u32;
        self.params.table_shift = table::shift(self.buffers.counts.capacity);
    }

    pub(super) fn write_params(&self) {
        self.memory().write(&self.gpu, "params", 0, &[self.params]);
    }

    pub(super) fn write_report(&self, report: &Report) {
        self.memory().write(&self.gpu, "report", 0, &[*report]);
    }

    pub(super) fn read_report(&self) -> Result<Report, EngineError> {
        Ok(self.memory().read::<Report>(&self.gpu, "report", 1)?[0])
    }

    /// Collider poses of the passes `first..first + count` of the segment, and those after them.
    /// `moving`: passes that move particles; in the others velocities are those of an instant.
    pub(super) fn write_poses(&mut self, first: u64, count: usize, dt_s: f64, moving: u64) {
        if self.setup.colliders.is_empty() {
            return;
        }
        let poses: Vec<layout::Pose> = (first..=first + count as u64)
            .flat_map(|pass| {
                let (t, move_s) = (self.time_s + pass as f64 * dt_s, if pass < moving { dt_s } else { 0.0 });
                self.setup.colliders.iter().map(move |c| (c, t, move_s))
            })
            .map(|(c, t, move_s)| scene::pose(c, self.setup.origin, t, move_s))
            .collect();
        self.memory().write(&self.gpu, "poses", 0, &poses);
        self.params.first_step = first as u32;
        self.write_params();
    }

    pub(super) fn submit<'a>(&self, work: impl IntoIterator<Item = &'a Dispatch<Placed>>) -> wgpu::SubmissionIndex {
        self.gpu.pass(|pass| work.into_iter().for_each(|dispatch| self.record(pass, dispatch)))
    }

    pub(super) fn record(&self, pass: &mut wgpu::ComputePass, dispatch: &Dispatch<Placed>) {
        dispatch.record(pass, self.buffers.groups(dispatch.extent, self.gpu.workgroup));
    }

    /// Plans `left_s` (s) of a frame in steps of at most `longest_s`.
    fn plan(&mut self, left_s: f64, longest_s: f64) -> Result<StepPlan, EngineError> {
        // The bound on node speeds has the affine part in it.
        let extremes = Extremes {
            speed_m_s: self.max_speed,
            affine_rate_1_s: 0.0,
            node_speed_m_s: self.max_speed,
            demand_1_s2: self.max_demand,
        };
        let plan = timestep::plan_frame(&self.setup, &extremes, left_s).no_longer_than(longest_s);
        if let Some(reason) = plan.endless() {
            let particles = self.snapshot()?;
            let what = divergence::endless(&self.setup, &particles, &reason);
            return Err(EngineError::Diverged { step: self.steps, time_s: self.time_s, what });
        }
        Ok(plan)
    }
}

impl Engine for GpuEngine {
    fn backend(&self) -> &Backend {
        &self.backend
    }

    fn advance_frame(&mut self, frame_s: f64, control: &dyn Control) -> Result<FrameStats, EngineError> {
        if self.buffers.live == 0 {
            // Sources that have not opened yet.
            self.time_s += frame_s;
            return Ok(FrameStats::default());
        }
        let mut steps = 0;
        let mut done_s = 0.0;
        let mut longest_s = f64::INFINITY;
        let mut ahead_s = 0.0;
        self.isolated = 0;
        let start_s = self.time_s;
        let mut impulses = vec![Reaction::default(); reaction::surfaces(&self.setup)];
        let sided = self.params.sided != 0;
        let mut plans = 0;
        let mut rest: Option<StepPlan> = None;
        while plans < MAX_PLANS {
            let plan = match rest.take() {
                Some(plan) => plan,
                None => {
                    plans += 1;
                    self.plan(frame_s - done_s, longest_s)?
                }
            };
            let course = Course::of(&self.setup, plan.dt_s, plan.steps, ahead_s);
            // Every part of a course begins with a look at the sides of plates.
            let asked = if sided { side::steps_between(&self.setup, self.max_speed, plan.dt_s) } else { u64::MAX };
            let course = course.first(asked);
            let segment = self.run_segment(&course, control)?;
            ahead_s = segment.ahead_s;
            let too_long = segment.halt & layout::HALT_REPLAN != 0;
            longest_s = if too_long { timestep::SHRINK * plan.dt_s } else { plan.dt_s };
            steps += segment.steps;
            self.steps += segment.steps;
            self.time_s += segment.steps as f64 * plan.dt_s;
            done_s += segment.steps as f64 * plan.dt_s;
            reaction::add_all(&mut impulses, &segment.impulses);
            if segment.halt & layout::HALT_MASS != 0 {
                self.mass_range *= 4.0;
                self.momentum_range *= 4.0;
            }
            if segment.halt & layout::HALT_MOMENTUM != 0 {
                self.momentum_range *= 8.0;
            }
            if segment.halt == 0 && segment.steps < plan.steps {
                rest = Some(StepPlan { steps: plan.steps - segment.steps, ..plan });
            }
            if segment.steps == plan.steps {
                self.time_s = start_s + frame_s;
                let reactions = impulses.iter().map(|j| j.times(1.0 / frame_s)).collect();
                let isolated_reset = self.isolated;
                return Ok(FrameStats {
                    steps,
                    dt_s: frame_s / steps as f64,
                    isolated_reset,
                    reactions,
                    solves: Vec::new(),
                });
            }
        }
        Err(EngineError::Diverged {
            step: self.steps,
            time_s: self.time_s,
            what: format!("a frame needed more than {MAX_PLANS} plans"),
        })
    }

    fn append(&mut self, mut particles: Particles) -> Result<(), EngineError> {
        touch::begin(&self.setup, &mut particles, self.time_s);
        self.put(&particles)?;
        let speed = |v: &[f64; 3]| v.iter().map(|v| v * v).sum::<f64>().sqrt();
        self.max_speed = particles.v.iter().map(speed).fold(self.max_speed, f64::max);
        self.gpu.check()
    }

    fn snapshot(&mut self) -> Result<Particles, EngineError> {
        readback::particles(&self.gpu, &self.buffers, &self.layout)
    }

    fn save(&mut self, to: &mut dyn Write) -> Result<(), StateError> {
        self.save_state(to)
    }

    fn restore(&mut self, from: &mut dyn Read) -> Result<(), StateError> {
        self.restore_state(from)
    }

    fn view(&mut self, _setup: &Setup, choices: &[Choice]) -> Result<Pending, EngineError> {
        self.ask(choices)
    }

    fn positions(&mut self, _setup: &Setup, take: &mut TakePlaces) -> Result<(), EngineError> {
        readback::positions(&self.gpu, &self.buffers, &self.layout, take)
    }
}
