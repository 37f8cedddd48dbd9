//! The stages of one implicit step, recorded and submitted; what to do between them is the engine's
//! business.

use std::sync::Arc;

use super::buffers::{Buffers, Counts};
use super::contact::Contact;
use super::interface::{Evaluate, System};
use super::layout::{Params, Report, Sweep, TOUCH_CHANNELS, Tangent};
use super::stages::{Extent, Stages};
use crate::contract::EngineError;
use crate::explicit::gpu::scene::SceneData;
use crate::explicit::gpu::upload::DeviceLayout;
use crate::gpu::memory::Memory;
use crate::gpu::program::{Dispatches, Programs, Tools};
use crate::gpu::{Gpu, Variant};
use crate::implicit::engine::Moved;
use crate::implicit::solver::objective::{Renewed, reach_of};
use gridfall_core::material::Law;
use gridfall_core::sim::collider::Collider;
use gridfall_core::sim::particles::Particles;
use gridfall_core::sim::reaction::{self, Reaction};
use gridfall_core::sim::setup::{Body, Material, Plasticity, Setup};
use gridfall_core::sim::side::Plates;
use gridfall_core::sim::touch;

/// Nodes lighter than this share of a full one fall freely, without forces.
const FREE_FALL_SHARE: f64 = 1e-12;

/// No body has so much energy (J): a material forbids the state.
const FORBIDDEN: f64 = 1e38;

/// Particles and grid of a simulation on the device.
pub struct DeviceStep {
    pub(super) gpu: Arc<Gpu>,
    programs: Programs,
    pub(super) stages: Stages,
    pub(super) buffers: Buffers,
    pub(super) params: Params,
    pub(super) setup: Setup,
    pub(super) layout: DeviceLayout,
    /// Of the particles that there are.
    pub(super) body_of: Vec<u32>,
    /// Whether a separating surface constrains any node.
    separating: bool,
    /// Whether any material flows within the step.
    flows: bool,
    pub(super) contact: Contact,
}

impl DeviceStep {
    /// Loads a problem. Errors: capacity, a particle outside the domain, a lost device.
    pub fn new(gpu: Arc<Gpu>, setup: &Setup, particles: &Particles) -> Result<Self, EngineError> {
        let layout = DeviceLayout::new(setup);
        let active = layout.active_blocks(particles, &Plates::of(setup, 0.0))?;
        let scene = SceneData::new(setup);
        let touches = touch::acts(setup);
        let first_touch = if touches { 12 + layout.channels } else { 0 };
        let counts = Counts {
            kernel: setup.kernel,
            particles: setup.total_particles(),
            channels: 12 + layout.channels + if touches { TOUCH_CHANNELS } else { 0 },
            table: layout.table_len(),
            capacity: active + 16,
            bodies: setup.bodies.len(),
            touches,
            links: 0,
            scene: scene.sizes(),
        };
        let system = System::new(&gpu, setup.kernel, 256)?;
        let memory = Memory::new(&gpu, &counts.sizes())?;
        let characteristic = |b: &Body| Law::<f64>::new(&setup.materials[b.material]).characteristic::<3>() as f32;
        let characteristics: Vec<f32> = setup.bodies.iter().map(characteristic).collect();
        memory.write(&gpu, "characteristic", 0, &characteristics);
        scene.write(&gpu, &memory);
        let densest = setup.bodies.iter().map(|b| b.mass / b.volume0).fold(0.0, f64::max);
        let flowing = setup.implicit.plasticity() == Plasticity::Flowing;
        let flows = flowing && setup.materials.iter().any(|material| Law::<f64>::new(material).is_plastic());
        let shared = layout.params(setup);
        let params = Params {
            blocks: shared.blocks,
            cells: shared.cells,
            dx: shared.dx,
            gravity: shared.gravity,
            pad: shared.pad,
            periodic: shared.periodic,
            colliders: shared.colliders,
            walls: shared.walls,
            room: counts.particles as u32,
            touch: first_touch as u32,
            mass_floor: (FREE_FALL_SHARE * densest * setup.dx.powi(3)) as f32,
            flowing: u32::from(flowing),
            ..Params::default()
        };
        let programs = Programs::new(Variant::of(setup).coarse());
        let stages = Stages::new(Tools { gpu: &gpu, programs: &programs }, &memory, &system, touches);
        let buffers = Buffers { counts, memory, system, live: 0, blocks: 0, links: 0 };
        let (setup, contact) = (setup.clone(), Contact::default());
        let separating = false;
        let body_of = Vec::new();
        let mut stepper =
            Self { gpu, programs, stages, buffers, params, setup, layout, body_of, separating, flows, contact };
        stepper.append(particles)?;
        Ok(stepper)
    }

    /// The system of the step that has begun.
    pub fn equations(&self) -> &System {
        &self.buffers.system
    }

    pub(super) fn memory(&self) -> &Memory {
        &self.buffers.memory
    }

    fn write_params(&self) {
        self.memory().write(&self.gpu, "params", 0, &[self.params]);
    }

    fn read_report(&self) -> Result<Report, EngineError> {
        Ok(self.memory().read::<Report>(&self.gpu, "report", 1)?[0])
    }

    pub(super) fn run(&self, pass: &mut wgpu::ComputePass, list: &Dispatches<Extent>) {
        list.record_with(pass, |extent| self.buffers.groups(extent));
    }

    /// Sorts the particles and gathers them on the nodes.
    fn sort(&mut self) {
        self.params.capacity = self.buffers.counts.capacity as u32;
        self.write_params();
        let report = Report { error_particle: u32::MAX, ..Report::default() };
        self.memory().write(&self.gpu, "report", 0, &[report]);
        self.gpu.submit(|encoder| {
            encoder.clear_buffer(self.memory().get("table"), 0, None);
            encoder.clear_buffer(self.memory().get("counts"), 0, None);
            self.run(&mut encoder.begin_compute_pass(&Default::default()), &self.stages.sort);
        });
    }

    /// Decides what surfaces do in a step of `dt` (s) from `time_s`, and numbers the nodes of the
    /// system.
    fn bound(&mut self, time_s: f64, dt: f64) {
        self.params.dt = dt as f32;
        self.params.stride = self.buffers.system.stride;
        self.params.link_room = self.buffers.counts.links as u32;
        self.params.mass_unit = self.mass_unit();
        self.write_params();
        let separating = std::mem::offset_of!(Report, separating) / size_of::<u32>();
        self.memory().write(&self.gpu, "report", separating, &[0u32]);
        let colliders = &self.setup.colliders;
        if !colliders.is_empty() {
            let sweeps: Vec<_> = colliders.iter().map(|c| sweep(c, time_s, dt)).collect();
            self.memory().write(&self.gpu, "poses", 0, &self.poses(time_s, dt));
            self.memory().write(&self.gpu, "sweeps", 0, &sweeps);
        }
        self.gpu.submit(|encoder| encoder.clear_buffer(self.memory().get("holding"), 0, None));
        self.gpu.pass(|pass| self.run(pass, &self.stages.bound));
    }

    /// Finds the buffers anew, after some of them were made anew.
    fn rebind(&mut self) {
        let tools = Tools { gpu: &self.gpu, programs: &self.programs };
        let touches = self.buffers.counts.touches;
        self.stages = Stages::new(tools, &self.buffers.memory, &self.buffers.system, touches);
    }

    /// Makes room. Nothing that grows outlives a step.
    fn grow(&mut self) -> Result<(), EngineError> {
        let sizes = self.buffers.counts.sizes();
        self.buffers.memory.grow(&self.gpu, &sizes, 0, &[])?;
        self.rebind();
        Ok(())
    }

    /// Starts a step of `dt` (s) from `time_s`: sorts the particles unless `again`, and leaves the
    /// system with its rows, start and neighbours, but without a matrix. Errors: capacity, a
    /// particle outside the domain, a lost device.
    pub fn begin(&mut self, time_s: f64, dt: f64, again: bool) -> Result<(), EngineError> {
        if !again {
            self.sort();
        }
        let report = loop {
            self.bound(time_s, dt);
            let report = self.read_report()?;
            let (blocks, capacity) = (report.blocks as usize, self.buffers.counts.capacity);
            let (links, link_room) = (report.links as usize, self.buffers.counts.links);
            if blocks > capacity {
                self.buffers.counts.capacity = blocks * 5 / 4 + 16;
                self.grow()?;
                self.sort();
            } else if links > link_room {
                self.buffers.counts.links = links * 5 / 4 + 256;
                self.grow()?;
            } else if report.rows > self.buffers.system.stride {
                let room = report.rows + report.rows / 8;
                self.buffers.system = System::new(&self.gpu, self.setup.kernel, room)?;
                self.rebind();
            } else {
                break report;
            }
        };
        self.buffers.blocks = report.blocks as usize;
        self.buffers.links = report.links as usize;
        self.params.links = report.links;
        self.separating = report.separating != 0;
        self.params.rows = report.rows;
        self.write_params();
        let system = &mut self.buffers.system;
        system.rows = report.rows;
        for a in 0..3 {
            let table = 4 * self.params.blocks[a];
            system.periodic[a] = self.params.periodic[a] != 0;
            (system.lowest[a], system.extent[a]) = (-self.params.pad[a], table);
        }
        self.gpu.pass(|pass| self.run(pass, &self.stages.begin));
        self.begin_contact(time_s, dt)
    }

    /// Which derivative the matrix is made of from the next submission on. A step begins with that at
    /// the trial.
    pub fn set_tangent(&self, tangent: Tangent) {
        let place = std::mem::offset_of!(Params, tangent) / size_of::<u32>();
        self.memory().write(&self.gpu, "params", place, &[tangent as u32]);
    }

    /// The largest part of a direction p of Δv, which is in `trial`, that a solver may go at once; see
    /// [`crate::implicit::solver::objective::Objective::reach`].
    pub fn reach(&self) -> Result<f64, EngineError> {
        if !self.flows {
            return Ok(1.0);
        }
        let place = std::mem::offset_of!(Report, most_strain) / size_of::<u32>();
        self.memory().write(&self.gpu, "report", place, &[0u32]);
        self.gpu.pass(|pass| self.run(pass, &self.stages.reach));
        Ok(reach_of(f64::from(f32::from_bits(self.read_report()?.most_strain))))
    }

    /// Makes `dv` the trial.
    pub(super) fn look_at_dv(&self, encoder: &mut wgpu::CommandEncoder) {
        let system = &self.buffers.system;
        encoder.copy_buffer_to_buffer(system.get("dv"), 0, system.get("trial"), 0, None);
        encoder.clear_buffer(system.get("control"), 0, None);
    }

    /// E (J) at `dv`; ∇E is on the device.
    pub(super) fn energy(&self) -> Result<f64, EngineError> {
        self.gpu.submit(|encoder| {
            self.look_at_dv(encoder);
            self.record(&mut encoder.begin_compute_pass(&Default::default()));
        });
        let energy: Vec<f32> = self.buffers.system.memory.read(&self.gpu, "energy", 2)?;
        Ok(f64::from(energy[0]) + f64::from(energy[1]))
    }

    /// Starts from rest where free fall is a state that a material forbids; only neo-Hookean ones
    /// do.
    pub fn avoid_forbidden_start(&self) -> Result<(), EngineError> {
        if !self.setup.materials.iter().any(|material| matches!(material, Material::NeoHookean(_))) {
            return Ok(());
        }
        if self.energy()? < FORBIDDEN {
            return Ok(());
        }
        self.gpu.pass(|pass| self.run(pass, &self.stages.rest));
        Ok(())
    }

    /// After a solve: lets go of nodes that separating surfaces pull back, and adds the friction
    /// that the normal impulses at `dv` cause. Returns whether the system is another one now, to be
    /// solved once more.
    pub fn revise(&self) -> Result<bool, EngineError> {
        if !self.separating {
            return Ok(false);
        }
        self.gpu.submit(|encoder| {
            self.look_at_dv(encoder);
            self.run(&mut encoder.begin_compute_pass(&Default::default()), &self.stages.revise);
        });
        let report = self.read_report()?;
        let revised = report.released != 0 || report.rubbing != 0;
        if revised {
            self.renew_contact()?;
        }
        Ok(revised)
    }

    /// Ends the step with `dv`: reactions, particles. The step can be taken back by beginning it
    /// again.
    pub fn finish(&mut self) -> Result<Moved, EngineError> {
        self.memory().write(&self.gpu, "report", 0, &[0u32, u32::MAX, 0, 0]);
        self.gpu.submit(|encoder| {
            self.look_at_dv(encoder);
            self.run(&mut encoder.begin_compute_pass(&Default::default()), &self.stages.finish);
        });
        let report = self.read_report()?;
        let particle = |error: u32| (report.error & error != 0).then_some(report.error_particle as usize);
        Ok(Moved {
            farthest_dx: f64::from(f32::from_bits(report.max_shift)),
            max_speed_m_s: f64::from(f32::from_bits(report.max_speed)),
            lost: particle(super::layout::ERROR_NAN),
            outside: particle(super::layout::ERROR_DOMAIN),
            impulses: self.impulses()?,
        })
    }

    fn impulses(&self) -> Result<Vec<Reaction>, EngineError> {
        let sums = self.buffers.counts.scene.reaction_sums();
        let values: Vec<f32> = self.memory().read(&self.gpu, "reactions", self.buffers.blocks * sums)?;
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
        self.run(pass, &self.stages.evaluate);
    }

    fn record_hessian(&self, pass: &mut wgpu::ComputePass) {
        self.run(pass, &self.stages.hessian);
    }

    fn set_tangent(&self, tangent: Tangent) {
        Self::set_tangent(self, tangent);
    }

    fn reach(&self) -> Result<f64, EngineError> {
        Self::reach(self)
    }

    fn renew(&self) -> Result<Renewed, EngineError> {
        self.renew_contact()
    }

    fn sharpness(&self) -> f64 {
        self.contact_sharpness()
    }

    fn fall_m_s(&self) -> f64 {
        let gravity = self.setup.gravity;
        f64::from(self.params.dt) * gravity.iter().map(|g| g * g).sum::<f64>().sqrt()
    }
}

/// The velocity field with which a collider's points go where they are after `dt` (s), about its
/// centre: (R' Rᵀ − 1)/dt and (c' − c)/dt.
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
