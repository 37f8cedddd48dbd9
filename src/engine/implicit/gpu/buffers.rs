//! Device memory of an implicit simulation beside its [`System`]: sizes in one place, checked before anything is allocated; bind groups.

use std::collections::HashMap;

use wgpu::BufferUsages as Usage;

use super::interface::System;
use super::layout::{Params, Status, Sweep, Touch};
use super::pipelines::Pipelines;
use super::shaders::Stage;
use crate::contract::EngineError;
use crate::explicit::gpu::layout as shared;
use crate::gpu::device::Gpu;
use gridfall_core::sim::reaction::WALLS;
use gridfall_core::sim::setup::Kernel;

/// Entries that a workgroup of a prefix sum takes.
const SCAN_CHUNK: usize = 2048;

/// What decides the size of every buffer.
#[derive(Clone, Copy, Debug)]
pub struct Sizes {
    pub kernel: Kernel,
    /// All that there will be.
    pub particles: usize,
    /// Channels of a particle's state: v, B, F and, if any law has one, the plastic state.
    pub channels: usize,
    /// Blocks of the dense table.
    pub table: usize,
    /// Slots for blocks that particles touch.
    pub capacity: usize,
    pub bodies: usize,
    pub materials: usize,
    pub sdf_ops: usize,
    pub sdf_samples: usize,
    pub colliders: usize,
}

impl Sizes {
    pub fn grids(&self) -> usize {
        if self.kernel == Kernel::Quadratic { 1 } else { 2 }
    }

    /// Cells of a block that particles are sorted by.
    pub fn cells(&self) -> usize {
        (4 * self.grids()).pow(3)
    }

    /// Sums of the surfaces' reactions of a block.
    pub fn reaction_sums(&self) -> usize {
        6 * (WALLS + self.colliders)
    }

    fn bytes(&self) -> Vec<(&'static str, usize)> {
        let (n, blocks) = (self.particles, self.capacity);
        let nodes = blocks * self.grids() * 64;
        let scanned = self.table.max(nodes).max(blocks * self.cells());
        vec![
            ("status", size_of::<Status>()),
            ("table", self.table * 4),
            ("block_list", blocks * 4),
            ("prefix", (self.table.max(nodes) + 1) * 4),
            ("counts", blocks * self.cells() * 4),
            ("starts", (blocks * self.cells() + 1) * 4),
            ("totals", scanned.div_ceil(SCAN_CHUNK) * 4),
            ("list", n * 4),
            ("keys", n * 8),
            ("position_in", n * 16),
            ("tag_in", n * 8),
            ("state_in", n * self.channels * 4),
            ("position", n * 16),
            ("tag", n * 8),
            ("state", n * self.channels * 4),
            ("node", nodes * 16),
            ("node_scale", nodes * 4),
            ("moving", nodes * 16),
            ("freedom", nodes * 16),
            ("begin", nodes * 16),
            ("row_of", nodes * 4),
            ("predicted", n * 36),
            ("push", n * 36),
            ("tensor", n * 180),
            ("partials", blocks * (1 + self.grids()) * 8),
            ("bodies", self.bodies * size_of::<shared::Body>()),
            ("materials", self.materials * size_of::<shared::Material>()),
            ("characteristic", self.bodies * 4),
            ("sdf_ops", self.sdf_ops.max(1) * size_of::<shared::SdfOp>()),
            ("sdf_samples", self.sdf_samples.max(1) * 4),
            ("colliders", self.colliders.max(1) * size_of::<shared::Collider>()),
            ("poses", self.colliders.max(1) * size_of::<shared::Pose>()),
            ("sweeps", self.colliders.max(1) * size_of::<Sweep>()),
            ("touches", 3 * nodes * size_of::<Touch>()),
            ("presses", blocks * self.grids() * 16),
            ("reactions", blocks * self.reaction_sums() * 4),
        ]
    }

    fn check(&self, limits: &wgpu::Limits) -> Result<(), EngineError> {
        let most = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size);
        match self.bytes().iter().find(|b| b.1 as u64 > most) {
            Some((name, bytes)) => Err(EngineError::Capacity(format!(
                "buffer `{name}` would take {bytes} bytes for {} particles and {} blocks; one buffer holds at most {most} on this device: \
                 use fewer particles, a larger domain.dx, or the CPU engine",
                self.particles, self.capacity
            ))),
            None => Ok(()),
        }
    }
}

/// The buffers that a larger number of blocks makes anew; nothing in them outlives a step.
const BY_CAPACITY: [&str; 15] = [
    "block_list",
    "prefix",
    "counts",
    "starts",
    "totals",
    "node",
    "node_scale",
    "moving",
    "freedom",
    "begin",
    "row_of",
    "partials",
    "touches",
    "presses",
    "reactions",
];

/// All buffers, and the bind groups of all stages.
pub struct Buffers {
    pub sizes: Sizes,
    pub params: wgpu::Buffer,
    pub system: System,
    storage: HashMap<&'static str, wgpu::Buffer>,
    binds: HashMap<Stage, wgpu::BindGroup>,
    /// Prefix sums of `table`, `counts` and `row_of`.
    pub scans: [(wgpu::BindGroup, usize); 3],
}

impl Buffers {
    /// Allocates zeroed buffers. Errors: [`EngineError::Capacity`] when one does not fit the device.
    pub fn new(gpu: &Gpu, pipelines: &Pipelines, sizes: Sizes, system: System) -> Result<Self, EngineError> {
        sizes.check(&gpu.limits)?;
        let params = gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("params"),
            size: size_of::<Params>() as u64,
            usage: Usage::UNIFORM | Usage::COPY_DST,
            mapped_at_creation: false,
        });
        let storage: HashMap<_, _> =
            sizes.bytes().into_iter().map(|(name, bytes)| (name, storage_buffer(gpu, name, bytes))).collect();
        let binds = bind_stages(gpu, pipelines, &params, &storage, &system);
        let scans = bind_scans(gpu, pipelines, &storage);
        gpu.check()?;
        Ok(Self { sizes, params, system, storage, binds, scans })
    }

    pub fn get(&self, name: &str) -> &wgpu::Buffer {
        &self.storage[name]
    }

    pub fn bind(&self, stage: Stage) -> &wgpu::BindGroup {
        &self.binds[&stage]
    }

    /// Makes room for `capacity` blocks.
    pub fn grow(&mut self, gpu: &Gpu, pipelines: &Pipelines, capacity: usize) -> Result<(), EngineError> {
        let sizes = Sizes { capacity, ..self.sizes };
        sizes.check(&gpu.limits)?;
        for (name, bytes) in sizes.bytes().into_iter().filter(|(name, _)| BY_CAPACITY.contains(name)) {
            self.storage.insert(name, storage_buffer(gpu, name, bytes));
        }
        self.sizes = sizes;
        self.rebind(gpu, pipelines)
    }

    /// Another system, with more room.
    pub fn replace_system(&mut self, gpu: &Gpu, pipelines: &Pipelines, system: System) -> Result<(), EngineError> {
        self.system = system;
        self.rebind(gpu, pipelines)
    }

    fn rebind(&mut self, gpu: &Gpu, pipelines: &Pipelines) -> Result<(), EngineError> {
        self.binds = bind_stages(gpu, pipelines, &self.params, &self.storage, &self.system);
        self.scans = bind_scans(gpu, pipelines, &self.storage);
        gpu.check()
    }
}

fn storage_buffer(gpu: &Gpu, name: &str, bytes: usize) -> wgpu::Buffer {
    gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some(name),
        size: bytes.max(4) as u64,
        usage: Usage::STORAGE | Usage::COPY_SRC | Usage::COPY_DST,
        mapped_at_creation: false,
    })
}

fn bind_stages(
    gpu: &Gpu,
    pipelines: &Pipelines,
    params: &wgpu::Buffer,
    storage: &HashMap<&'static str, wgpu::Buffer>,
    system: &System,
) -> HashMap<Stage, wgpu::BindGroup> {
    let bind = |(stage, compiled): (&Stage, &super::pipelines::Compiled)| {
        let mut entries = vec![wgpu::BindGroupEntry { binding: 0, resource: params.as_entire_binding() }];
        entries.extend(compiled.storage.iter().map(|&(binding, name)| wgpu::BindGroupEntry {
            binding,
            resource: storage.get(name).unwrap_or_else(|| of_system(system, name)).as_entire_binding(),
        }));
        let group = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some(stage.name()),
            layout: &compiled.layout,
            entries: &entries,
        });
        (*stage, group)
    };
    pipelines.stages.iter().map(bind).collect()
}

/// A buffer of the system by its name in the shaders.
fn of_system<'a>(system: &'a System, name: &str) -> &'a wgpu::Buffer {
    match name {
        "ids" => &system.ids,
        "columns" => &system.columns,
        "values" => &system.values,
        "freedoms" => &system.freedoms,
        "masses" => &system.masses,
        "scales" => &system.scales,
        "dv" => &system.dv,
        "trial" => &system.trial,
        "gradient" => &system.gradient,
        "energy" => &system.energy,
        "control" => &system.control,
        other => panic!("no buffer `{other}`"),
    }
}

fn bind_scans(
    gpu: &Gpu,
    pipelines: &Pipelines,
    storage: &HashMap<&'static str, wgpu::Buffer>,
) -> [(wgpu::BindGroup, usize); 3] {
    [("table", "prefix"), ("counts", "starts"), ("row_of", "prefix")].map(|(from, to)| {
        let resources = [&storage[from], &storage[to], &storage["totals"]];
        let entries: Vec<_> = (0u32..)
            .zip(resources)
            .map(|(binding, buffer)| wgpu::BindGroupEntry { binding, resource: buffer.as_entire_binding() })
            .collect();
        let group = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some(from),
            layout: &pipelines.scan_layout,
            entries: &entries,
        });
        (group, storage[from].size() as usize / 4)
    })
}
