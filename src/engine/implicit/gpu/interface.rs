//! What the two halves of an implicit step on the device share: the step's physics fills a
//! [`System`] and evaluates its objective; the minimiser (`linear`) solves it.

use wgpu::{Buffer, ComputePass};

use super::layout::Tangent;
use crate::contract::EngineError;
use crate::gpu::Gpu;
use crate::gpu::memory::{Memory, Size, Sizes, storage};
use crate::implicit::solver::objective::Renewed;
use gridfall_core::sim::setup::Kernel;

/// In the buffer `columns`: no neighbour there.
pub const NO_NODE: u32 = u32::MAX;

/// The minimisation problem of one step (HOT §4), in device memory; twin of
/// [`crate::implicit::solver::objective::Objective`].
///
/// Vectors are channel-major: component a of node i is at `a * stride + i`. `rows` nodes are there,
/// `stride` have room, and what lies between is undefined. The buffers:
///
/// - `ids`, `array<vec4<i32>>`: index x, y, z in the grid, and which grid (0, or 1 of the compact
///   kernel's pair, at −¼ dx). In the order of blocks of 4³.
/// - `columns`, `array<u32>`, `[slot * stride + row]`: the neighbour's row, or [`NO_NODE`]. Slots,
///   x slowest and z fastest: quadratic, offsets −2..=2; compact, offsets −1..=1 on the own grid,
///   then 64 on the other: −1..=2 for grid 0, −2..=1 for grid 1.
/// - `values`, `array<f32>`, `[(slot * 9 + 3 a + c) * stride + row]`: entry (a, c) of the Hessian's
///   block (kg), S folded in, trace/3 · (I − S) added on the diagonals of sliding nodes. Blocks
///   without a neighbour are zero.
/// - `anchors`, `array<f32>`, `[(3 a + c) * stride + row]`: the sum of a row's blocks (kg), known better
///   than the blocks are: stiff bodies hold nothing when they move as a whole. Then, by row, the row that
///   it is taken relative to, which the minimiser finds out.
/// - `freedoms`, `array<vec4<f32>>`: w = 0 free; 1: slides along the plane with normal xyz,
///   S = I − n nᵀ; 2: along the line xyz, S = t tᵀ.
/// - `masses`, `array<f32>` (kg).
/// - `scales`, `array<f32>`: tol_i / ε = 24 dx² dt ξ_i (kg m/s).
/// - `speeds`, `array<f32>`: |v| at the step's start (m/s).
/// - `dv`: Δv (m/s), a vector a node. In: where to start. Out: the minimum.
/// - `trial`: Δv at which [`Evaluate`] looks.
/// - `gradient`: ∇E there (kg m/s), projected by S.
/// - `energy`: E there (J) as an unevaluated sum of two, `[high, low]`. Where a material forbids the
///   state, 1e38 or more, or not finite.
/// - `control`, `array<u32, 4>`: while entry 0 is not zero, evaluations do nothing. The others are
///   the minimiser's.
pub struct System {
    pub kernel: Kernel,
    /// Nodes of the system.
    pub rows: u32,
    /// Room for nodes, a multiple of 256; larger after a step that needed more, with new buffers.
    pub stride: u32,
    /// Bounds of the indices in `ids`: `lowest[a] ≤ id[a] < lowest[a] + extent[a]`. Periodic axes:
    /// from 0 to the number of cells.
    pub lowest: [i32; 3],
    pub extent: [u32; 3],
    pub periodic: [bool; 3],
    pub memory: Memory,
}

/// Neighbour slots of a row.
pub fn slots(kernel: Kernel) -> u32 {
    if kernel == Kernel::Quadratic { 125 } else { 91 }
}

/// The buffers of a matrix with room for `stride` rows.
pub(super) fn matrix(kernel: Kernel, stride: u32) -> [Size; 4] {
    let (n, slots) = (stride as usize, slots(kernel) as usize);
    [
        storage("ids", 16 * n),
        storage("columns", 4 * n * slots),
        storage("values", 36 * n * slots),
        storage("anchors", 40 * n),
    ]
}

/// Buffers for `stride` nodes.
pub(super) fn sizes(buffers: Vec<Size>, stride: u32) -> Sizes {
    let remedy = "use a larger domain.dx, the explicit integrator, or the CPU engine";
    Sizes { buffers, load: format!("{stride} nodes"), remedy }
}

impl System {
    /// Room for `stride` nodes. Errors: [`EngineError::Capacity`] when a buffer does not fit the
    /// device.
    pub fn new(gpu: &Gpu, kernel: Kernel, stride: u32) -> Result<Self, EngineError> {
        let stride = stride.next_multiple_of(256);
        let n = stride as usize;
        let mut buffers = matrix(kernel, stride).to_vec();
        buffers.extend([
            storage("freedoms", 16 * n),
            storage("masses", 4 * n),
            storage("scales", 4 * n),
            storage("speeds", 4 * n),
            storage("dv", 12 * n),
            storage("trial", 12 * n),
            storage("gradient", 12 * n),
            storage("energy", 8),
            storage("control", 16),
        ]);
        Ok(Self {
            kernel,
            rows: 0,
            stride,
            lowest: [0; 3],
            extent: [0; 3],
            periodic: [false; 3],
            memory: Memory::new(gpu, &sizes(buffers, stride))?,
        })
    }

    pub fn get(&self, name: &str) -> &Buffer {
        self.memory.get(name)
    }
}

/// E, ∇E and ∇²E of a system.
pub trait Evaluate {
    /// Records the dispatches that read `trial` and write `gradient` and `energy`, unless
    /// `control[0]` is set when they run.
    fn record(&self, pass: &mut ComputePass);

    /// Records the dispatches that write `values` and `anchors`, the Hessian at `trial`, which the
    /// last evaluation has seen.
    fn record_hessian(&self, pass: &mut ComputePass);

    /// Which derivative [`Self::record_hessian`] takes from now on; see
    /// [`crate::implicit::solver::objective::Objective::tangent`].
    fn set_tangent(&self, _tangent: Tangent) {}

    /// As [`crate::implicit::solver::objective::Objective::reach`], of the direction in `trial`.
    fn reach(&self) -> Result<f64, EngineError> {
        Ok(1.0)
    }

    /// As [`crate::implicit::solver::objective::Objective::renew`], at `dv`.
    fn renew(&self) -> Result<Renewed, EngineError> {
        Ok(Renewed::Nothing)
    }

    /// As [`crate::implicit::solver::objective::Objective::sharpness`].
    fn sharpness(&self) -> f64 {
        1.0
    }

    /// What gravity does in a step (m/s).
    fn fall_m_s(&self) -> f64;
}
