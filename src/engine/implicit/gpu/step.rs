//! The stages of one implicit step, recorded and submitted; what to do between them is the engine's business.

use std::sync::Arc;

use super::buffers::{Buffers, Sizes};
use super::interface::{Evaluate, System};
use super::layout::{Params, Status, Sweep};
use super::pipelines::Pipelines;
use super::shaders::Stage;
use crate::contract::EngineError;
use crate::explicit::gpu::readback::read;
use crate::explicit::gpu::upload::{self, Frame};
use crate::gpu::device::{Gpu, Variant};
use crate::implicit::engine::Moved;
use gridfall_core::material::Law;
use gridfall_core::sim::collider::Collider;
use gridfall_core::sim::particles::Particles;
use gridfall_core::sim::reaction::{self, Reaction};
use gridfall_core::sim::setup::{Material, Setup};

/// Lanes of a workgroup (`LANES` in the shaders).
const LANES: usize = 64;
/// Nodes lighter than this share of a full one fall freely, without forces.
const LIGHTEST: f64 = 1e-12;

/// No body has so much energy (J): a material forbids the state.
const FORBIDDEN: f64 = 1e38;

/// Particles and grid of a simulation on the device.
pub struct DeviceStep {
    pub(super) gpu: Arc<Gpu>,
    pipelines: Arc<Pipelines>,
    pub(super) buffers: Buffers,
    pub(super) params: Params,
    pub(super) setup: Setup,
    pub(super) frame: Frame,
    /// Blocks that particles touch in this step.
    pub(super) blocks: usize,
    /// Whether a separating surface constrains any node.
    separating: bool,
}

impl DeviceStep {
    /// Loads a problem. Errors: capacity, a particle outside the domain, a lost device.
    pub fn new(gpu: Arc<Gpu>, setup: &Setup, particles: &Particles) -> Result<Self, EngineError> {
        let frame = Frame::new(setup);
        let data = frame.data(particles)?;
        let (sdf_ops, sdf_samples, colliders) = upload::colliders(setup);
        let sizes = Sizes {
            kernel: setup.kernel,
            particles: setup.total_particles(),
            channels: 12 + frame.channels,
            table: frame.table_len(),
            capacity: frame.active_blocks(&data.position) + 16,
            bodies: setup.bodies.len(),
            materials: setup.materials.len(),
            sdf_ops: sdf_ops.len(),
            sdf_samples: sdf_samples.len(),
            colliders: colliders.len(),
        };
        let pipelines = Pipelines::of(&gpu, Variant::of(setup))?;
        let system = System::new(&gpu, setup.kernel, 256)?;
        let buffers = Buffers::new(&gpu, &pipelines, sizes, system)?;
        let write = |name: &str, bytes: &[u8]| gpu.queue.write_buffer(buffers.get(name), 0, bytes);
        let characteristic = |b: &gridfall_core::sim::setup::Body| {
            Law::<f64>::new(&setup.materials[b.material]).characteristic::<3>() as f32
        };
        let characteristics: Vec<f32> = setup.bodies.iter().map(characteristic).collect();
        write("bodies", bytemuck::cast_slice(&upload::bodies(setup)));
        write("materials", bytemuck::cast_slice(&upload::materials(setup)));
        write("characteristic", bytemuck::cast_slice(&characteristics));
        write("sdf_ops", bytemuck::cast_slice(&sdf_ops));
        write("sdf_samples", bytemuck::cast_slice(&sdf_samples));
        write("colliders", bytemuck::cast_slice(&colliders));
        let densest = setup.bodies.iter().map(|b| b.mass / b.volume0).fold(0.0, f64::max);
        let scene = frame.params(setup);
        let params = Params {
            blocks: scene.blocks,
            cells: scene.cells,
            dx: scene.dx,
            gravity: scene.gravity,
            pad: scene.pad,
            periodic: scene.periodic,
            colliders: scene.colliders,
            walls: scene.walls,
            room: sizes.particles as u32,
            mass_floor: (LIGHTEST * densest * setup.dx.powi(3)) as f32,
            ..Params::default()
        };
        let mut stepper =
            Self { gpu, pipelines, buffers, params, setup: setup.clone(), frame, blocks: 0, separating: false };
        stepper.append(particles)?;
        Ok(stepper)
    }

    /// The system of the step that has begun.
    pub fn equations(&self) -> &System {
        &self.buffers.system
    }

    fn write_params(&self) {
        self.gpu.queue.write_buffer(&self.buffers.params, 0, bytemuck::bytes_of(&self.params));
    }

    /// One dispatch of workgroups, folded into two dimensions.
    fn dispatch(&self, pass: &mut wgpu::ComputePass, stage: Stage, groups: usize) {
        pass.set_pipeline(&self.pipelines.stages[&stage].pipeline);
        pass.set_bind_group(0, self.buffers.bind(stage), &[]);
        fold(pass, groups);
    }

    fn scan(&self, pass: &mut wgpu::ComputePass, which: usize) {
        let (bind, entries) = &self.buffers.scans[which];
        for (k, groups) in [entries.div_ceil(2048), 1, (entries + 1).div_ceil(256)].into_iter().enumerate() {
            pass.set_pipeline(&self.pipelines.scan[k]);
            pass.set_bind_group(0, bind, &[]);
            fold(pass, groups);
        }
    }

    pub(super) fn submit(&self, record: impl FnOnce(&mut wgpu::CommandEncoder)) {
        let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
        record(&mut encoder);
        self.gpu.queue.submit([encoder.finish()]);
    }

    fn pass(&self, record: impl FnOnce(&mut wgpu::ComputePass)) {
        self.submit(|encoder| record(&mut encoder.begin_compute_pass(&Default::default())));
    }

    fn status(&self) -> Result<Status, EngineError> {
        Ok(read::<Status>(&self.gpu, self.buffers.get("status"), 1)?[0])
    }

    /// Sorts the particles and gathers them on the nodes.
    fn sort(&mut self) {
        self.params.capacity = self.buffers.sizes.capacity as u32;
        self.write_params();
        let status = Status { error_particle: u32::MAX, ..Status::default() };
        self.gpu.queue.write_buffer(self.buffers.get("status"), 0, bytemuck::bytes_of(&status));
        let sizes = &self.buffers.sizes;
        let particles = self.live().div_ceil(LANES);
        self.submit(|encoder| {
            encoder.clear_buffer(self.buffers.get("table"), 0, None);
            encoder.clear_buffer(self.buffers.get("counts"), 0, None);
            let mut pass = encoder.begin_compute_pass(&Default::default());
            self.dispatch(&mut pass, Stage::Mark, particles);
            self.scan(&mut pass, 0);
            self.dispatch(&mut pass, Stage::Number, sizes.table.div_ceil(LANES));
            self.dispatch(&mut pass, Stage::Count, particles);
            self.scan(&mut pass, 1);
            self.dispatch(&mut pass, Stage::Place, particles);
            self.dispatch(&mut pass, Stage::Order, (sizes.capacity * sizes.cells()).div_ceil(LANES));
            self.dispatch(&mut pass, Stage::Reorder, particles);
            self.dispatch(&mut pass, Stage::P2g, sizes.capacity * sizes.grids());
        });
    }

    /// Decides what surfaces do in a step of `dt` (s) from `time_s`, and numbers the nodes of the system.
    fn bound(&mut self, time_s: f64, dt: f64) {
        self.params.dt = dt as f32;
        self.params.stride = self.buffers.system.stride;
        self.write_params();
        let separating = std::mem::offset_of!(Status, separating) as u64;
        self.gpu.queue.write_buffer(self.buffers.get("status"), separating, &[0; 4]);
        let colliders = &self.setup.colliders;
        let poses: Vec<_> = colliders.iter().map(|c| upload::pose(c, self.setup.origin, time_s)).collect();
        let sweeps: Vec<_> = colliders.iter().map(|c| sweep(c, time_s, dt)).collect();
        if !colliders.is_empty() {
            self.gpu.queue.write_buffer(self.buffers.get("poses"), 0, bytemuck::cast_slice(&poses));
            self.gpu.queue.write_buffer(self.buffers.get("sweeps"), 0, bytemuck::cast_slice(&sweeps));
        }
        let nodes = self.buffers.sizes.capacity * self.buffers.sizes.grids() * 64;
        self.pass(|pass| {
            self.dispatch(pass, Stage::Boundary, nodes.div_ceil(LANES));
            self.scan(pass, 2);
            self.dispatch(pass, Stage::Rows, nodes.div_ceil(LANES));
        });
    }

    /// Starts a step of `dt` (s) from `time_s`: sorts the particles unless `again`, and leaves the system with its rows, start and neighbours, but without
    /// a matrix. Errors: capacity, a particle outside the domain, a lost device.
    pub fn begin(&mut self, time_s: f64, dt: f64, again: bool) -> Result<(), EngineError> {
        if !again {
            self.sort();
        }
        let status = loop {
            self.bound(time_s, dt);
            let status = self.status()?;
            let (blocks, capacity) = (status.blocks as usize, self.buffers.sizes.capacity);
            if blocks > capacity {
                self.buffers.grow(&self.gpu, &self.pipelines, blocks * 5 / 4 + 16)?;
                self.sort();
            } else if status.rows > self.buffers.system.stride {
                let room = status.rows + status.rows / 8;
                let system = System::new(&self.gpu, self.setup.kernel, room)?;
                self.buffers.replace_system(&self.gpu, &self.pipelines, system)?;
            } else {
                break status;
            }
        };
        self.blocks = status.blocks as usize;
        self.separating = status.separating != 0;
        self.params.rows = status.rows;
        self.write_params();
        let system = &mut self.buffers.system;
        system.rows = status.rows;
        for a in 0..3 {
            let table = 4 * self.params.blocks[a];
            system.periodic[a] = self.params.periodic[a] != 0;
            (system.lowest[a], system.extent[a]) = (-self.params.pad[a], table);
        }
        let slots = super::interface::slots(self.setup.kernel);
        self.pass(|pass| {
            self.dispatch(pass, Stage::Predict, self.blocks);
            pass.set_pipeline(&self.pipelines.stages[&Stage::Columns].pipeline);
            pass.set_bind_group(0, self.buffers.bind(Stage::Columns), &[]);
            pass.dispatch_workgroups(status.rows.div_ceil(LANES as u32), slots, 1);
        });
        Ok(())
    }

    /// Makes `dv` the trial.
    pub(super) fn look_at_dv(&self, encoder: &mut wgpu::CommandEncoder) {
        let system = &self.buffers.system;
        encoder.copy_buffer_to_buffer(&system.dv, 0, &system.trial, 0, system.dv.size());
        encoder.clear_buffer(&system.control, 0, None);
    }

    /// E (J) at `dv`; ∇E is on the device.
    pub(super) fn energy(&self) -> Result<f64, EngineError> {
        self.submit(|encoder| {
            self.look_at_dv(encoder);
            self.record(&mut encoder.begin_compute_pass(&Default::default()));
        });
        let energy: Vec<f32> = read(&self.gpu, &self.buffers.system.energy, 2)?;
        Ok(f64::from(energy[0]) + f64::from(energy[1]))
    }

    /// Starts from rest where free fall is a state that a material forbids; only neo-Hookean ones do.
    pub fn avoid_forbidden_start(&self) -> Result<(), EngineError> {
        if !self.setup.materials.iter().any(|material| matches!(material, Material::NeoHookean(_))) {
            return Ok(());
        }
        if self.energy()? < FORBIDDEN {
            return Ok(());
        }
        let nodes = self.blocks * self.buffers.sizes.grids() * 64;
        self.pass(|pass| self.dispatch(pass, Stage::Rest, nodes.div_ceil(LANES)));
        Ok(())
    }

    /// After a solve: lets go of nodes that separating surfaces pull back, and adds the friction that the normal impulses at `dv` cause. Returns
    /// whether the system is another one now, to be solved once more.
    pub fn revise(&self) -> Result<bool, EngineError> {
        if !self.separating {
            return Ok(false);
        }
        let grids = self.buffers.sizes.grids();
        self.submit(|encoder| {
            self.look_at_dv(encoder);
            let mut pass = encoder.begin_compute_pass(&Default::default());
            self.dispatch(&mut pass, Stage::Strain, self.blocks);
            self.dispatch(&mut pass, Stage::Impulses, self.blocks * grids);
            self.dispatch(&mut pass, Stage::Weigh, 1);
            self.dispatch(&mut pass, Stage::Release, self.blocks * grids);
        });
        let status = self.status()?;
        Ok(status.released != 0 || status.rubbing != 0)
    }

    /// Ends the step with `dv`: reactions, particles. The step can be taken back by beginning it again.
    pub fn finish(&mut self) -> Result<Moved, EngineError> {
        let grids = self.buffers.sizes.grids();
        let reset = [0u32, u32::MAX, 0, 0];
        self.gpu.queue.write_buffer(self.buffers.get("status"), 0, bytemuck::cast_slice(&reset));
        self.submit(|encoder| {
            self.look_at_dv(encoder);
            let mut pass = encoder.begin_compute_pass(&Default::default());
            self.dispatch(&mut pass, Stage::Strain, self.blocks);
            self.dispatch(&mut pass, Stage::Impulses, self.blocks * grids);
            self.dispatch(&mut pass, Stage::Finish, self.blocks * grids);
            self.dispatch(&mut pass, Stage::Reactions, self.blocks);
            self.dispatch(&mut pass, Stage::G2p, self.blocks);
        });
        let status = self.status()?;
        let particle = |error: u32| (status.error & error != 0).then_some(status.error_particle as usize);
        Ok(Moved {
            farthest_dx: f64::from(f32::from_bits(status.max_shift)),
            max_speed_m_s: f64::from(f32::from_bits(status.max_speed)),
            lost: particle(super::layout::ERROR_NAN),
            outside: particle(super::layout::ERROR_DOMAIN),
            impulses: self.impulses()?,
        })
    }

    fn impulses(&self) -> Result<Vec<Reaction>, EngineError> {
        let sums = self.buffers.sizes.reaction_sums();
        let values: Vec<f32> = read(&self.gpu, self.buffers.get("reactions"), self.blocks * sums)?;
        let mut impulses = vec![Reaction::default(); reaction::surfaces(&self.setup)];
        for block in values.chunks_exact(sums) {
            for (impulse, part) in impulses.iter_mut().zip(block.chunks_exact(6)) {
                let [force, torque] = [0, 3].map(|k| [0, 1, 2].map(|a| f64::from(part[k + a])));
                impulse.add(&Reaction { force, torque });
            }
        }
        Ok(impulses)
    }
}

impl Evaluate for DeviceStep {
    fn record(&self, pass: &mut wgpu::ComputePass) {
        self.dispatch(pass, Stage::Strain, self.blocks);
        self.dispatch(pass, Stage::Gradient, self.blocks * self.buffers.sizes.grids());
        self.dispatch(pass, Stage::Energy, 1);
    }

    fn record_hessian(&self, pass: &mut wgpu::ComputePass) {
        self.dispatch(pass, Stage::Tensor, self.blocks);
        self.dispatch(pass, Stage::Assemble, self.params.rows as usize);
    }
}

/// Workgroups in two dimensions, of which one takes at most 65,535.
fn fold(pass: &mut wgpu::ComputePass, groups: usize) {
    if groups > 0 {
        pass.dispatch_workgroups(groups.min(32768) as u32, groups.div_ceil(32768) as u32, 1);
    }
}

/// The velocity field with which a collider's points go where they are after `dt` (s), about its centre: (R' Rᵀ − 1)/dt and (c' − c)/dt.
fn sweep(collider: &Collider, time_s: f64, dt: f64) -> Sweep {
    let (from, to) = (collider.motion.at(time_s), collider.motion.at(time_s + dt));
    let (r0, r1) = (from.pose.rotation, to.pose.rotation);
    let row = |i: usize| -> [f32; 4] {
        std::array::from_fn(|j| {
            if j == 3 {
                return ((to.center[i] - from.center[i]) / dt) as f32;
            }
            let turned: f64 = (0..3).map(|k| r1[3 * i + k] * r0[3 * j + k]).sum();
            ((turned - f64::from(u8::from(i == j))) / dt) as f32
        })
    };
    Sweep { r0: row(0), r1: row(1), r2: row(2) }
}
