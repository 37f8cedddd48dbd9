//! Device memory: every size in one place, checked before anything is allocated, and the two bind groups.

use wgpu::BufferUsages as Usage;

use super::layout::{self, BLOCK_NODES, NODE_CHANNELS, VELOCITY_CHANNELS, WORK_MAX};
use super::upload::FrameData;
use crate::contract::EngineError;
use crate::gpu::device::{Gpu, STORAGE_BUFFERS};
use gridfall_core::sim::reaction::WALLS;

/// Steps whose collider poses are uploaded at once, the most that one submission holds.
pub const CHUNK_STEPS: usize = 256;

/// What decides the size of every buffer.
#[derive(Clone, Copy, Debug)]
pub struct Sizes {
    /// All that there will be.
    pub particles: usize,
    /// Blocks of the dense table.
    pub table: usize,
    /// Slots for active blocks.
    pub capacity: usize,
    pub grids: usize,
    /// Deformation channels: 1 (fluids only), 9 or 10 (with plastic state).
    pub channels: usize,
    pub bodies: usize,
    pub materials: usize,
    pub sdf_ops: usize,
    pub sdf_samples: usize,
    pub colliders: usize,
}

impl Sizes {
    /// Bytes by binding 1…26, in order.
    fn bytes(&self) -> [(&'static str, usize); STORAGE_BUFFERS as usize] {
        let grid = self.capacity * self.grids * BLOCK_NODES * NODE_CHANNELS * 4;
        let particles = self.particles;
        [
            ("status", size_of::<layout::Status>()),
            ("table", self.table * 4),
            ("table", self.table * 4),
            ("blocks", (self.capacity + 1) * 4),
            ("blocks", (self.capacity + 1) * 4),
            ("grid", grid),
            ("grid", grid),
            ("bins", self.capacity * 4),
            ("work", (self.capacity + particles / WORK_MAX + 1) * size_of::<layout::Work>()),
            ("destinations", particles * 8),
            ("list", particles * 4),
            ("position", particles * 16),
            ("position", particles * 16),
            ("deformation", particles * self.channels * 4),
            ("deformation", particles * self.channels * 4),
            ("frame_position", particles * 16),
            ("frame_velocity", particles * VELOCITY_CHANNELS * 4),
            ("frame_deformation", particles * self.channels * 4),
            ("body_of", particles * 4),
            ("bodies", self.bodies * size_of::<layout::Body>()),
            ("materials", self.materials * size_of::<layout::Material>()),
            ("sdf_ops", self.sdf_ops.max(1) * size_of::<layout::SdfOp>()),
            ("colliders", self.colliders.max(1) * size_of::<layout::Collider>()),
            ("poses", (self.colliders.max(1) * CHUNK_STEPS) * size_of::<layout::Pose>()),
            ("sdf_samples", self.sdf_samples.max(1) * 4),
            ("reactions", layout::REPLICAS * self.reaction_sums() * 8),
        ]
    }

    /// Sums of one replica of the surfaces' reactions.
    pub fn reaction_sums(&self) -> usize {
        6 * (WALLS + self.colliders)
    }

    /// Device memory that the scene takes (bytes).
    pub fn total_bytes(&self) -> usize {
        self.bytes().iter().map(|b| b.1).sum()
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

/// All buffers of one simulation.
pub struct Buffers {
    pub sizes: Sizes,
    /// Particles that there are, of the room for [`Sizes::particles`].
    pub live: usize,
    pub params: wgpu::Buffer,
    pub dispatches: wgpu::Buffer,
    /// By binding, without `params`.
    storage: Vec<wgpu::Buffer>,
    /// `bind[i]`: side i is `_in`, the other `_out`.
    pub bind: [wgpu::BindGroup; 2],
    pub dispatch_bind: wgpu::BindGroup,
}

/// Bindings by name (see `wgsl/shared/layout.wgsl`); of a pair, the one that is `_in` when side 0 is in.
pub mod binding {
    pub const STATUS: usize = 1;
    pub const TABLE: usize = 2;
    pub const BLOCKS: usize = 4;
    pub const GRID: usize = 6;
    pub const BINS: usize = 8;
    pub const WORK: usize = 9;
    pub const POSITION: usize = 12;
    pub const DEFORMATION: usize = 14;
    pub const FRAME_POSITION: usize = 16;
    pub const FRAME_VELOCITY: usize = 17;
    pub const FRAME_DEFORMATION: usize = 18;
    pub const BODY_OF: usize = 19;
    pub const BODIES: usize = 20;
    pub const MATERIALS: usize = 21;
    pub const SDF_OPS: usize = 22;
    pub const COLLIDERS: usize = 23;
    pub const POSES: usize = 24;
    pub const SDF_SAMPLES: usize = 25;
    pub const REACTIONS: usize = 26;
}

/// First bindings of the `_in`/`_out` pairs.
const PAIRS: [usize; 5] = [binding::TABLE, binding::BLOCKS, binding::GRID, binding::POSITION, binding::DEFORMATION];

/// Buffers whose size follows the number of block slots.
const BY_CAPACITY: [usize; 6] =
    [binding::BLOCKS, binding::BLOCKS + 1, binding::GRID, binding::GRID + 1, binding::BINS, binding::WORK];

impl Buffers {
    /// Allocates zeroed buffers. Errors: [`EngineError::Capacity`] when one does not fit the device.
    pub fn new(gpu: &Gpu, sizes: Sizes) -> Result<Self, EngineError> {
        sizes.check(&gpu.limits)?;
        let device = &gpu.device;
        let params = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("params"),
            size: size_of::<layout::Params>() as u64,
            usage: Usage::UNIFORM | Usage::COPY_DST,
            mapped_at_creation: false,
        });
        let dispatches = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("dispatches"),
            size: 8 * 16,
            usage: Usage::STORAGE | Usage::INDIRECT | Usage::COPY_DST,
            mapped_at_creation: false,
        });
        let storage: Vec<_> = sizes.bytes().iter().map(|&(name, bytes)| storage_buffer(device, name, bytes)).collect();
        let dispatch_bind = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("dispatches"),
            layout: &gpu.dispatch_layout,
            entries: &[wgpu::BindGroupEntry { binding: 0, resource: dispatches.as_entire_binding() }],
        });
        let bind = [0, 1].map(|side| bind_group(gpu, &params, &storage, side));
        gpu.check()?;
        Ok(Self { sizes, live: 0, params, dispatches, storage, bind, dispatch_bind })
    }

    /// Buffer at a binding, as bound when side 0 is in.
    pub fn get(&self, binding: usize) -> &wgpu::Buffer {
        &self.storage[binding - 1]
    }

    /// The `_in` buffer of a pair for a side.
    pub fn of_side(&self, pair: usize, side: usize) -> &wgpu::Buffer {
        self.get(pair + side)
    }

    /// Writes states behind those that there are, for which there must be room.
    pub fn put_states(&mut self, gpu: &Gpu, data: &FrameData, body_of: &[u32]) {
        let (first, stride, n) = (self.live, self.sizes.particles, data.position.len());
        let put = |b: usize, at: usize, bytes: &[u8]| gpu.queue.write_buffer(self.get(b), at as u64, bytes);
        let channels = |b: usize, values: &[f32]| {
            for (k, channel) in values.chunks_exact(n.max(1)).enumerate() {
                put(b, 4 * (k * stride + first), bytemuck::cast_slice(channel));
            }
        };
        put(binding::FRAME_POSITION, 16 * first, bytemuck::cast_slice(&data.position));
        put(binding::BODY_OF, 4 * first, bytemuck::cast_slice(body_of));
        channels(binding::FRAME_VELOCITY, &data.velocity);
        channels(binding::FRAME_DEFORMATION, &data.deformation);
        self.live += n;
    }

    /// Makes room for `capacity` blocks; the grid and block list of `keep` survive.
    pub fn grow(&mut self, gpu: &Gpu, capacity: usize, keep: usize) -> Result<(), EngineError> {
        let sizes = Sizes { capacity, ..self.sizes };
        sizes.check(&gpu.limits)?;
        let bytes = sizes.bytes();
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        for b in BY_CAPACITY {
            let (name, size) = bytes[b - 1];
            let larger = storage_buffer(&gpu.device, name, size);
            if b == binding::BLOCKS + keep || b == binding::GRID + keep || b == binding::WORK {
                let old = self.get(b);
                encoder.copy_buffer_to_buffer(old, 0, &larger, 0, old.size());
            }
            self.storage[b - 1] = larger;
        }
        gpu.queue.submit([encoder.finish()]);
        self.sizes = sizes;
        self.bind = [0, 1].map(|side| bind_group(gpu, &self.params, &self.storage, side));
        gpu.check()
    }
}

fn storage_buffer(device: &wgpu::Device, name: &str, bytes: usize) -> wgpu::Buffer {
    device.create_buffer(&wgpu::BufferDescriptor {
        label: Some(name),
        size: bytes.next_multiple_of(4) as u64,
        usage: Usage::STORAGE | Usage::COPY_SRC | Usage::COPY_DST,
        mapped_at_creation: false,
    })
}

fn bind_group(gpu: &Gpu, params: &wgpu::Buffer, storage: &[wgpu::Buffer], side: usize) -> wgpu::BindGroup {
    let mut entries = vec![wgpu::BindGroupEntry { binding: 0, resource: params.as_entire_binding() }];
    for binding in 1..=storage.len() {
        let pair = PAIRS.iter().find(|&&p| p == binding || p + 1 == binding);
        // With side 1 in, the two buffers of a pair change places.
        let at = match pair {
            Some(p) if side == 1 => 2 * p + 1 - binding,
            _ => binding,
        };
        entries.push(wgpu::BindGroupEntry { binding: binding as u32, resource: storage[at - 1].as_entire_binding() });
    }
    gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: Some(["side 0", "side 1"][side]),
        layout: &gpu.layout,
        entries: &entries,
    })
}
