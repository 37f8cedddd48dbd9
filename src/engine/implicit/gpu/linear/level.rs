//! Device memory of a level of the hierarchy.

use wgpu::{BindingResource, Buffer, BufferBinding, BufferUsages};

use super::lattice::Lattice;
use super::layout;
use crate::contract::EngineError;
use crate::gpu::device::Gpu;
use crate::implicit::gpu::interface::{System, slots};
use gridfall_core::sim::setup::Kernel;

/// Bytes between slots that are bound one at a time: the largest offset alignment of any device.
pub const SLOT: u64 = 256;
/// Slots for Chebyshev coefficients, the most steps of a polynomial.
pub const MAX_DEGREE: u32 = 64;

/// A level's matrix, its smoother's data and its vectors, see `wgsl/implicit/linear/level.wgsl`.
pub struct Level {
    pub lattice: Lattice,
    pub shape: layout::Level,
    pub uniform: Buffer,
    pub ids: Buffer,
    pub columns: Buffer,
    pub values: Buffer,
    /// Of the dense table; unused on the finest level.
    pub table: Buffer,
    pub sums: Buffer,
    /// Towards the finer level.
    pub children: Buffer,
    /// Towards the coarser one.
    pub parents: Buffer,
    pub inverse: Buffer,
    pub coefficients: Buffer,
    pub lanczos: Buffer,
    pub partials: [Buffer; 2],
    pub products: Buffer,
    pub b: Buffer,
    pub d: Buffer,
    pub r: Buffer,
    pub x: [Buffer; 2],
}

pub fn buffer(gpu: &Gpu, label: &str, bytes: u64) -> Buffer {
    gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some(label),
        size: bytes.max(16),
        usage: BufferUsages::STORAGE | BufferUsages::UNIFORM | BufferUsages::COPY_SRC | BufferUsages::COPY_DST,
        mapped_at_creation: false,
    })
}

/// A slot of a buffer.
pub fn slot(buffer: &Buffer, index: u32) -> BindingResource<'_> {
    let size = wgpu::BufferSize::new(SLOT);
    BindingResource::Buffer(BufferBinding { buffer, offset: SLOT * u64::from(index), size })
}

impl Level {
    /// The finest level: matrix and nodes are the system's.
    pub fn finest(gpu: &Gpu, system: &System, lattice: Lattice) -> Self {
        let none = buffer(gpu, "none", 16);
        let matrix = [&system.ids, &system.columns, &system.values].map(Buffer::clone);
        let mut level = Self::with(gpu, lattice, u64::from(system.stride), matrix, [&none, &none, &none]);
        level.shape = layout::Level { sliding: 1, ..lattice.level(system.rows, system.stride) };
        level
    }

    /// The finest level again, with the memory it had for vectors, for a system of the same stride.
    pub fn finest_again(mut self, system: &System, lattice: Lattice) -> Self {
        [self.ids, self.columns, self.values] = [&system.ids, &system.columns, &system.values].map(Buffer::clone);
        self.shape = layout::Level { sliding: 1, ..lattice.level(system.rows, system.stride) };
        self.lattice = lattice;
        self
    }

    /// A coarse level whose nodes are yet to be counted, with the table to do it.
    pub fn table(gpu: &Gpu, lattice: Lattice) -> Result<Self, EngineError> {
        let entries = lattice.entries();
        fits(gpu, 4 * entries, "the table of a coarse level")?;
        if entries.div_ceil(1024) > 65535 {
            return Err(EngineError::Capacity(format!(
                "a coarse level spans {entries} nodes, which is more than can be counted"
            )));
        }
        let [none, table] = [("none", 16), ("table", 4 * entries)].map(|(label, size)| buffer(gpu, label, size));
        let sums = buffer(gpu, "sums", 4 * entries.div_ceil(1024));
        let matrix = [&none, &none, &none].map(Buffer::clone);
        Ok(Self::with(gpu, lattice, 0, matrix, [&table, &sums, &none]))
    }

    /// Sees to room for `rows` nodes.
    pub fn make_room(&mut self, gpu: &Gpu, kernel: Kernel, rows: u32) -> Result<(), EngineError> {
        if rows > self.shape.stride {
            // Some more than now, so that a growing body does not ask anew every step.
            let stride = (rows + rows / 4).next_multiple_of(256);
            let (n, slots) = (u64::from(stride), u64::from(slots(kernel)));
            fits(gpu, 36 * n * slots, "the matrix of a coarse level")?;
            let matrix = [("ids", 16 * n), ("columns", 4 * n * slots), ("values", 36 * n * slots)]
                .map(|(label, size)| buffer(gpu, label, size));
            let children = buffer(gpu, "children", 27 * 4 * n);
            *self = Self::with(gpu, self.lattice, n, matrix, [&self.table, &self.sums, &children]);
            self.shape.stride = stride;
        }
        self.shape = self.lattice.level(rows, self.shape.stride);
        Ok(())
    }

    fn with(
        gpu: &Gpu,
        lattice: Lattice,
        n: u64,
        [ids, columns, values]: [Buffer; 3],
        [table, sums, children]: [&Buffer; 3],
    ) -> Self {
        let field = |label| buffer(gpu, label, 12 * n);
        Self {
            lattice,
            shape: layout::Level::default(),
            uniform: buffer(gpu, "level", size_of::<layout::Level>() as u64),
            ids,
            columns,
            values,
            table: table.clone(),
            sums: sums.clone(),
            children: children.clone(),
            parents: buffer(gpu, "parents", 32 * n),
            inverse: buffer(gpu, "inverse", 24 * n),
            coefficients: buffer(gpu, "coefficients", SLOT * u64::from(MAX_DEGREE)),
            lanczos: buffer(gpu, "lanczos", size_of::<layout::Lanczos>() as u64),
            partials: [buffer(gpu, "partials", 1024), buffer(gpu, "partials", 1024)],
            products: buffer(gpu, "products", n.div_ceil(8)),
            b: field("b"),
            d: field("d"),
            r: field("r"),
            x: [field("x"), field("x")],
        }
    }

    /// Tells the device of the level's shape.
    pub fn upload(&self, gpu: &Gpu) {
        gpu.queue.write_buffer(&self.uniform, 0, bytemuck::bytes_of(&self.shape));
    }

    /// Workgroups of a thread a row.
    pub fn by_row(&self) -> [u32; 2] {
        [self.shape.rows.div_ceil(64), 1]
    }

    /// Workgroups of a thread a row and slot.
    pub fn by_entry(&self, slots: u32) -> [u32; 2] {
        [self.shape.rows.div_ceil(64), slots]
    }

    /// Workgroups of 1024 entries of the table.
    pub fn by_part(&self) -> [u32; 2] {
        [self.lattice.entries().div_ceil(1024) as u32, 1]
    }

    /// Workgroups of a product, 32 rows each.
    pub fn by_product(&self) -> [u32; 2] {
        [self.shape.rows.div_ceil(32), 1]
    }

    /// Workgroups of a reduction.
    pub fn by_sum(&self) -> [u32; 2] {
        [self.shape.groups, 1]
    }
}

fn fits(gpu: &Gpu, bytes: u64, what: &str) -> Result<(), EngineError> {
    let most = gpu.limits.max_storage_buffer_binding_size.min(gpu.limits.max_buffer_size);
    if bytes > most {
        return Err(EngineError::Capacity(format!(
            "{what} would take {bytes} bytes; one buffer holds at most {most} on this device: use a larger domain.dx, the explicit \
             integrator, or the CPU engine"
        )));
    }
    Ok(())
}
