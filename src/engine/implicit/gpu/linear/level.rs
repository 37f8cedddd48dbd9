//! Device memory of a level of the hierarchy.

use wgpu::Buffer;

use super::lattice::Lattice;
use super::layout;
use crate::contract::EngineError;
use crate::gpu::Gpu;
use crate::gpu::memory::{Memory, SLOT, Scope, Size, storage, uniform};
use crate::implicit::gpu::interface::{System, matrix, sizes, slots};
use gridfall_core::sim::setup::Kernel;

/// Slots for Chebyshev coefficients, the most steps of a polynomial.
pub const MAX_DEGREE: usize = 64;
/// Most workgroups along an axis.
const MOST_PARTS: u64 = 65535;

/// A level's matrix, its smoother's data and its vectors.
///
/// Its buffers, beside those of a [`System`]'s matrix: `level`; `table` and `sums`, which number
/// the nodes; `children` towards the finer level and `parents` towards the coarser one; `inverse`
/// and `coefficients` of the smoother; `lanczos`, `products` and the pair `partials`; the vectors
/// `b`, `d`, `r` and the pair `x`.
pub struct Level {
    pub lattice: Lattice,
    pub shape: layout::Level,
    /// For neighbours of a row.
    pub slots: u32,
    pub memory: Memory,
}

/// What a level with room for `stride` nodes has beside its matrix.
fn vectors(stride: u32) -> Vec<Size> {
    let n = stride as usize;
    vec![
        uniform("level", size_of::<layout::Level>()),
        storage("parents", 32 * n),
        storage("inverse", 24 * n),
        storage("coefficients", SLOT as usize * MAX_DEGREE),
        storage("lanczos", size_of::<layout::Lanczos>()),
        storage("partials_in", 1024),
        storage("partials_out", 1024),
        storage("products", n.div_ceil(8)),
        storage("b", 12 * n),
        storage("d", 12 * n),
        storage("r", 12 * n),
        storage("x_in", 12 * n),
        storage("x_out", 12 * n),
    ]
}

impl Level {
    /// A level without memory.
    pub fn empty(lattice: Lattice, kernel: Kernel) -> Self {
        Self { lattice, shape: layout::Level::default(), slots: slots(kernel), memory: Memory::default() }
    }

    /// Becomes the finest level, whose matrix and nodes are the system's.
    pub fn be_finest(&mut self, gpu: &Gpu, system: &System, lattice: Lattice) -> Result<(), EngineError> {
        self.memory.grow(gpu, &sizes(vectors(system.stride), system.stride), 0, &[])?;
        for name in ["ids", "columns", "values", "anchors"] {
            self.memory.share(name, system.get(name));
        }
        self.lattice = lattice;
        self.shape = layout::Level { sliding: 1, ..lattice.level(system.rows, system.stride) };
        Ok(())
    }

    /// Becomes a coarse level whose nodes are yet to be counted, with the table to do it.
    pub fn be_coarse(&mut self, gpu: &Gpu, lattice: Lattice) -> Result<(), EngineError> {
        let (entries, parts) = (lattice.entries(), lattice.parts());
        if parts > MOST_PARTS {
            return Err(EngineError::Capacity(format!(
                "a coarse level spans {entries} nodes, which is more than can be counted"
            )));
        }
        let mut buffers = vectors(0);
        buffers.extend([storage("table", 4 * entries as usize), storage("sums", 4 * parts as usize)]);
        self.memory.grow(gpu, &sizes(buffers, entries as u32), 0, &[])?;
        self.lattice = lattice;
        self.shape = lattice.level(0, self.shape.stride);
        Ok(())
    }

    /// Sees to a coarse level's room for `rows` nodes.
    pub fn make_room(&mut self, gpu: &Gpu, kernel: Kernel, rows: u32) -> Result<(), EngineError> {
        let mut stride = self.shape.stride;
        if rows > stride {
            // Some more than now, so that a growing body does not ask anew every step.
            stride = (rows + rows / 4).next_multiple_of(256);
            let mut buffers = vectors(stride);
            buffers.extend(matrix(kernel, stride));
            buffers.push(storage("children", 27 * 4 * stride as usize));
            self.memory.grow(gpu, &sizes(buffers, stride), 0, &[])?;
        }
        self.shape = self.lattice.level(rows, stride);
        Ok(())
    }

    /// Tells the device of the level's shape.
    pub fn upload(&self, gpu: &Gpu) {
        self.memory.write(gpu, "level", 0, &[self.shape]);
    }

    pub fn get(&self, name: &str) -> &Buffer {
        self.memory.get(name)
    }

    /// x, of which there are two.
    pub fn x(&self, number: usize) -> &Buffer {
        self.memory.of_side("x_in", number)
    }

    /// What a program of this level sees: `own` buffers first, and x number `side` as `x_in`.
    pub fn scope<'a>(&'a self, side: usize, own: &[(&'a str, &'a Buffer)]) -> Scope<'a> {
        let named = own.iter().fold(Scope::default(), |scope, &(name, buffer)| scope.with(name, buffer));
        named.with("partials", self.get("partials_in")).and_side(&self.memory, side)
    }
}

/// What a program between two levels sees: the coarse one's buffers, the finer one's as `fine_…`,
/// and the system's; `x_in` is x of that number.
pub fn between<'a>(system: &'a System, [fine, coarse]: [&'a Level; 2], numbers: [usize; 2]) -> Scope<'a> {
    let shapes = Scope::default().with("fine", fine.get("level")).with("coarse", coarse.get("level"));
    shapes.prefixed("fine_", &fine.memory, numbers[0]).and_side(&coarse.memory, numbers[1]).and(&system.memory)
}
