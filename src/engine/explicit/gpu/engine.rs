//! Runs frames on the device: plan, submit without reading back, then answer for what the device reported.

use std::collections::VecDeque;
use std::sync::Arc;
use std::time::Instant;

use super::buffers::{Buffers, CHUNK_STEPS, Sizes, binding};
use super::layout::{self, Params, Status};
use super::readback::{self, GridNode};
use super::stages::{self, Dispatch, FRAME_END, FRAME_START, STEP};
use super::upload::{self, Frame};
use crate::contract::{Backend, Control, Engine, EngineError, FrameStats};
use crate::gpu::device::{Gpu, Pipelines, Variant};
use gridfall_core::sim::divergence::{Suspect, likely_cause};
use gridfall_core::sim::particles::Particles;
use gridfall_core::sim::reaction::{self, Reaction};
use gridfall_core::sim::setup::{Kernel, Precision, Setup, Transfer};
use gridfall_core::sim::timestep::{self, Extremes};

/// Fixed-point units of a full node's mass, and of its momentum at the velocity of scale: 2^27 leaves a factor of 4 up to the
/// soft limit and 8 up to the hard one, and resolves 1e-8 of a full node.
const FULL_NODE: f64 = 134_217_728.0;
/// A chunk of steps should take about this long, so that a cancel is heard soon.
const CHUNK_SECONDS: f64 = 0.1;
/// A frame that needs more plans than this is not going to finish.
const MAX_PLANS: u32 = 64;

/// An explicit simulation on a GPU.
pub struct GpuEngine {
    gpu: Arc<Gpu>,
    pipelines: Arc<Pipelines>,
    setup: Setup,
    frame: Frame,
    buffers: Buffers,
    params: Params,
    backend: Backend,
    time_s: f64,
    steps: u64,
    /// Bound on node speeds at the frame's start (m/s).
    max_speed: f64,
    /// Demand of the materials at the frame's start (1/s²).
    max_demand: f64,
    /// Particles reset in this frame.
    isolated: u64,
    /// Coarsening of the fixed-point scales that this run has needed.
    mass_range: f64,
    momentum_range: f64,
    chunk: usize,
}

/// How a run of equal steps ended.
struct Segment {
    /// Steps done.
    steps: u64,
    halt: u32,
    /// Impulses that surfaces took.
    impulses: Vec<Reaction>,
}

/// Whether the GPU engine can run a problem at all; the reason if not.
pub fn supports(setup: &Setup) -> Result<(), String> {
    if setup.dimension != 3 {
        return Err("the GPU engine is 3D only".into());
    }
    if !matches!(setup.kernel, Kernel::Compact | Kernel::Quadratic) {
        return Err("the GPU engine has the compact and the quadratic kernel".into());
    }
    if setup.transfer == Transfer::Pic {
        return Err("the GPU engine has the transfers apic and mls".into());
    }
    if setup.precision != Precision::F32 {
        return Err("the GPU engine is f32 only".into());
    }
    Ok(())
}

impl GpuEngine {
    /// Loads a problem at time 0. `reason` says why this device was chosen.
    ///
    /// Errors: unsupported scenes, capacity, a lost device.
    pub fn new(gpu: Arc<Gpu>, setup: &Setup, particles: Particles, reason: &str) -> Result<Self, EngineError> {
        supports(setup).map_err(EngineError::Unsupported)?;
        let mut frame = Frame::new(setup);
        let extremes = timestep::initial_extremes(setup, &particles);
        let data = frame.data(&particles)?;
        let (sdf_ops, sdf_samples, colliders) = upload::colliders(setup);
        let sizes = Sizes {
            particles: setup.total_particles(),
            table: frame.table_len(),
            // Room to spread before the first growth.
            capacity: frame.active_blocks(&data.position) * 5 / 4 + 64,
            grids: upload::grid_offsets(setup.kernel).len(),
            channels: frame.channels,
            bodies: setup.bodies.len(),
            materials: setup.materials.len(),
            sdf_ops: sdf_ops.len(),
            sdf_samples: sdf_samples.len(),
            colliders: colliders.len(),
        };
        let mut buffers = Buffers::new(&gpu, sizes)?;
        buffers.put_states(&gpu, &data, &particles.body);
        frame.body_of = particles.body;
        let write = |b: usize, bytes: &[u8]| gpu.queue.write_buffer(buffers.get(b), 0, bytes);
        write(binding::BODIES, bytemuck::cast_slice(&upload::bodies(setup)));
        write(binding::MATERIALS, bytemuck::cast_slice(&upload::materials(setup)));
        write(binding::SDF_OPS, bytemuck::cast_slice(&sdf_ops));
        write(binding::SDF_SAMPLES, bytemuck::cast_slice(&sdf_samples));
        write(binding::COLLIDERS, bytemuck::cast_slice(&colliders));
        let pipelines = gpu.pipelines(Variant::of(setup))?;
        let backend = gpu.backend(reason);
        let params = frame.params(setup);
        let max_speed = extremes.speed_m_s + 3.0f64.sqrt() * setup.dx * extremes.affine_rate_1_s;
        gpu.check()?;
        Ok(Self {
            gpu,
            pipelines,
            setup: setup.clone(),
            frame,
            buffers,
            params,
            backend,
            time_s: 0.0,
            steps: 0,
            max_speed,
            max_demand: extremes.demand_1_s2,
            isolated: 0,
            mass_range: 1.0,
            momentum_range: 1.0,
            chunk: 4,
        })
    }

    /// Device memory in use (bytes).
    pub fn device_bytes(&self) -> usize {
        self.buffers.sizes.total_bytes()
    }

    /// The device it runs on.
    pub fn gpu(&self) -> &Arc<Gpu> {
        &self.gpu
    }

    pub(super) fn compiled(&self) -> &Pipelines {
        &self.pipelines
    }

    pub(super) fn buffers(&self) -> &Buffers {
        &self.buffers
    }

    /// Accounts for steps that were submitted outside a frame, after they ended.
    pub(super) fn settle(&mut self, steps: u64, dt_s: f64) -> Result<(), EngineError> {
        let status = self.read_status()?;
        if status.halt != 0 || status.finished == 0 {
            return Err(self.failure(&status, dt_s));
        }
        self.arrive(&status);
        self.steps += steps;
        self.time_s += steps as f64 * dt_s;
        Ok(())
    }

    /// Takes over what the last `g2p` measured.
    fn arrive(&mut self, status: &Status) {
        self.max_speed = f64::from(f32::from_bits(status.max_speed));
        self.max_demand = f64::from(f32::from_bits(status.max_demand));
        self.isolated += u64::from(status.isolated);
    }

    fn set_scales(&mut self, dt_s: f64) {
        let p = &self.setup;
        let densest = p.bodies.iter().map(|b| b.mass / b.volume0).fold(0.0, f64::max);
        let full = densest * p.dx.powi(3);
        let wave = timestep::max_wave_speed_m_s(p);
        let gravity = p.gravity.iter().map(|g| g * g).sum::<f64>().sqrt();
        // Momentum comes from motion and from stress impulses, which are below c · strain a node.
        let speed =
            (4.0 * (self.max_speed + gravity * p.frame_s)).max(wave / 8.0).min(p.dx / dt_s) * self.momentum_range;
        // Powers of two, so that scaling is exact: all nodes inside a body share one mass, and the rounding of one product
        // would be a steady drift of its momentum.
        let power_of_two = |x: f64| x.log2().floor().exp2() as f32;
        self.params.mass_scale = power_of_two(FULL_NODE / (full * self.mass_range));
        self.params.momentum_scale = power_of_two(FULL_NODE / (full * speed));
        self.params.dt = dt_s as f32;
        self.params.soft_shift = p.cfl as f32;
        self.params.soft_growth = timestep::MAX_GROWTH as f32;
        self.params.soft_demand = (timestep::REPLAN_DEMAND / (dt_s * dt_s)) as f32;
        self.params.capacity = self.buffers.sizes.capacity as u32;
    }

    fn write_params(&self) {
        self.gpu.queue.write_buffer(&self.buffers.params, 0, bytemuck::bytes_of(&self.params));
    }

    fn write_status(&self, status: &Status) {
        self.gpu.queue.write_buffer(self.buffers.get(binding::STATUS), 0, bytemuck::bytes_of(status));
    }

    fn read_status(&self) -> Result<Status, EngineError> {
        Ok(readback::read::<Status>(&self.gpu, self.buffers.get(binding::STATUS), 1)?[0])
    }

    /// Collider poses of the steps `first..first + count` of the segment.
    pub(super) fn write_poses(&mut self, first: u64, count: usize, dt_s: f64) {
        if self.setup.colliders.is_empty() {
            return;
        }
        let poses: Vec<layout::Pose> = (0..count as u64)
            .flat_map(|k| {
                let t = self.time_s + (first + k) as f64 * dt_s;
                self.setup.colliders.iter().map(move |c| (c, t))
            })
            .map(|(c, t)| upload::pose(c, self.setup.origin, t))
            .collect();
        self.gpu.queue.write_buffer(self.buffers.get(binding::POSES), 0, bytemuck::cast_slice(&poses));
        self.params.first_step = first as u32;
        self.write_params();
    }

    fn submit(&self, work: impl IntoIterator<Item = (&'static [Dispatch], usize)>) -> wgpu::SubmissionIndex {
        let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
        {
            let mut pass = encoder.begin_compute_pass(&Default::default());
            for (list, side) in work {
                for &d in list {
                    stages::record(&mut pass, d, &self.pipelines, &self.buffers, side, self.gpu.workgroup);
                }
            }
        }
        self.gpu.queue.submit([encoder.finish()])
    }

    /// Full states → grid on side 0.
    pub(super) fn start(&mut self, dt_s: f64) {
        self.set_scales(dt_s);
        self.params.first_step = 0;
        self.write_params();
        self.write_status(&Status::frame_start());
        let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
        for side in 0..2 {
            encoder.clear_buffer(self.buffers.of_side(binding::TABLE, side), 0, None);
            encoder.clear_buffer(self.buffers.of_side(binding::BLOCKS, side), 0, Some(4));
        }
        encoder.clear_buffer(self.buffers.get(binding::REACTIONS), 0, None);
        self.gpu.queue.submit([encoder.finish()]);
        self.submit([(&FRAME_START[..], 1)]);
    }

    /// Runs `total` equal steps or fewer, until the device has a reason to stop.
    fn run_segment(&mut self, dt_s: f64, total: u64, control: &dyn Control) -> Result<Segment, EngineError> {
        self.start(dt_s);
        let mut done = 0;
        loop {
            self.run_steps(done, dt_s, total, control)?;
            let status = self.read_status()?;
            // The start's own commit counts up from -1 to 0.
            let started = status.step != u32::MAX;
            done = if started { u64::from(status.step) } else { 0 };
            if status.halt & layout::HALT_ERROR != 0 {
                return Err(self.failure(&status, dt_s));
            }
            if status.halt & layout::HALT_BLOCKS != 0 {
                self.grow(&status, (done % 2) as usize)?;
                if started {
                    self.write_status(&Status { halt: status.halt & !layout::HALT_BLOCKS, ..status });
                } else {
                    self.start(dt_s);
                }
                continue;
            }
            if status.finished == 0 {
                // A guard asked for another plan: the step at hand is complete on the grid, so bring it home as it is.
                self.write_status(&Status { halt: 0, ..status });
                self.write_poses(done, 1, dt_s);
                self.submit([(&FRAME_END[..], (done % 2) as usize)]);
                let end = self.read_status()?;
                if end.halt & layout::HALT_ERROR != 0 {
                    return Err(self.failure(&end, dt_s));
                }
                self.arrive(&end);
                return Ok(Segment { steps: done + 1, halt: status.halt, impulses: self.impulses()? });
            }
            self.arrive(&status);
            return Ok(Segment { steps: total, halt: 0, impulses: self.impulses()? });
        }
    }

    fn impulses(&self) -> Result<Vec<Reaction>, EngineError> {
        readback::reactions(&self.gpu, &self.buffers, &self.params)
    }

    /// Submits steps `done..total`, at most two chunks ahead of the device, and nothing is read back.
    fn run_steps(&mut self, done: u64, dt_s: f64, total: u64, control: &dyn Control) -> Result<(), EngineError> {
        let mut in_flight: VecDeque<(wgpu::SubmissionIndex, usize)> = VecDeque::new();
        let mut next = done;
        let mut completed = done;
        let mut finished = Instant::now();
        while next < total {
            if control.canceled() {
                self.gpu.wait(None)?;
                return Err(EngineError::Canceled);
            }
            let count = self.chunk.min((total - next) as usize);
            self.write_poses(next, count, dt_s);
            let work = (next..next + count as u64)
                .map(|k| (if k + 1 == total { &FRAME_END[..] } else { &STEP[..] }, (k % 2) as usize));
            let submission = self.submit(work);
            next += count as u64;
            in_flight.push_back((submission, count));
            if in_flight.len() > 1 {
                let (oldest, count) = in_flight.pop_front().expect("two are in flight");
                self.gpu.wait(Some(oldest))?;
                let per_step = finished.elapsed().as_secs_f64() / count as f64;
                finished = Instant::now();
                self.chunk = ((CHUNK_SECONDS / per_step) as usize).clamp(1, 2 * self.chunk).min(CHUNK_STEPS);
                completed += count as u64;
                control.progress(self.steps + completed, self.time_s + completed as f64 * dt_s);
            }
        }
        Ok(())
    }

    fn grow(&mut self, status: &Status, side: usize) -> Result<(), EngineError> {
        let old = self.buffers.sizes.capacity;
        let capacity = (status.needed as usize * 5 / 4 + 64).max(old * 3 / 2);
        self.buffers.grow(&self.gpu, capacity, side)?;
        self.params.capacity = capacity as u32;
        self.write_params();
        // The interrupted activation left claims without slots.
        let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
        encoder.clear_buffer(self.buffers.of_side(binding::TABLE, 1 - side), 0, None);
        encoder.clear_buffer(self.buffers.of_side(binding::BLOCKS, 1 - side), 0, Some(4));
        self.gpu.queue.submit([encoder.finish()]);
        tracing::debug!(old, capacity, "grid grown");
        Ok(())
    }

    fn failure(&self, status: &Status, dt_s: f64) -> EngineError {
        let step = self.steps + u64::from(status.index);
        let time_s = self.time_s + f64::from(status.index) * dt_s;
        let id = status.error_particle as usize;
        let (who, cause) = self.suspect(id).unwrap_or_default();
        if status.error & layout::ERROR_DOMAIN != 0 && status.error & layout::ERROR_NAN == 0 {
            return EngineError::LeftDomain { step, time_s, what: who };
        }
        let fault = if status.error & layout::ERROR_NAN != 0 {
            "is no longer finite"
        } else if status.error & layout::ERROR_CFL != 0 {
            "moved more than a cell in one step"
        } else {
            return EngineError::Diverged {
                step,
                time_s,
                what: "a node's mass or momentum passed the fixed-point range; likely cause: speeds grew without bound"
                    .into(),
            };
        };
        EngineError::Diverged {
            step,
            time_s,
            what: format!("{who} {fault}; likely cause, from the frame's start: {cause}"),
        }
    }

    /// A particle's name, and what its state at the frame's start says about a failure.
    fn suspect(&self, id: usize) -> Option<(String, String)> {
        let p = readback::particles(&self.gpu, &self.buffers, &self.frame).ok()?;
        let body = *p.body.get(id)? as usize;
        let speed_m_s = p.v[id].iter().map(|v| v * v).sum::<f64>().sqrt();
        let cause = likely_cause(&self.setup, &Suspect { body, f: p.f[id], speed_m_s });
        Some((format!("particle {id} (body \"{}\")", self.setup.bodies[body].name), cause))
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
        self.isolated = 0;
        let start_s = self.time_s;
        let mut impulses = vec![Reaction::default(); reaction::surfaces(&self.setup)];
        for _ in 0..MAX_PLANS {
            // The bound on node speeds has the affine part in it.
            let extremes = Extremes { speed_m_s: self.max_speed, affine_rate_1_s: 0.0, demand_1_s2: self.max_demand };
            let plan = timestep::plan_frame(&self.setup, &extremes, frame_s - done_s).no_longer_than(longest_s);
            let segment = self.run_segment(plan.dt_s, plan.steps, control)?;
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

    fn append(&mut self, particles: Particles) -> Result<(), EngineError> {
        let data = self.frame.data(&particles)?;
        self.buffers.put_states(&self.gpu, &data, &particles.body);
        self.frame.body_of.extend(&particles.body);
        self.params.live = self.buffers.live as u32;
        let speed = |v: &[f64; 3]| v.iter().map(|v| v * v).sum::<f64>().sqrt();
        self.max_speed = particles.v.iter().map(speed).fold(self.max_speed, f64::max);
        self.gpu.check()
    }

    fn snapshot(&mut self) -> Result<Particles, EngineError> {
        readback::particles(&self.gpu, &self.buffers, &self.frame)
    }
}

/// One step taken stage by stage, for comparison with the CPU engine's stages.
pub struct Staged<'a> {
    engine: &'a mut GpuEngine,
    dt_s: f64,
}

impl<'a> Staged<'a> {
    /// Transfers the particles to the grid; the nodes carry momentum.
    pub fn p2g(engine: &'a mut GpuEngine, dt_s: f64) -> Result<(Self, Vec<GridNode>), EngineError> {
        engine.start(dt_s);
        let staged = Self { engine, dt_s };
        let nodes = staged.nodes(false)?;
        Ok((staged, nodes))
    }

    /// Updates the grid; the nodes carry velocity.
    pub fn grid_update(&mut self) -> Result<Vec<GridNode>, EngineError> {
        self.engine.write_poses(0, 1, self.dt_s);
        self.engine.submit([(&FRAME_END[..2], 0)]);
        self.nodes(true)
    }

    /// Finishes the step.
    pub fn g2p(self) -> Result<Particles, EngineError> {
        self.engine.submit([(&FRAME_END[2..], 0)]);
        let status = self.engine.read_status()?;
        if status.halt & layout::HALT_ERROR != 0 {
            return Err(self.engine.failure(&status, self.dt_s));
        }
        self.engine.snapshot()
    }

    fn nodes(&self, updated: bool) -> Result<Vec<GridNode>, EngineError> {
        let e = &self.engine;
        readback::nodes(&e.gpu, &e.buffers, &e.setup, &e.params, 0, updated)
    }
}
