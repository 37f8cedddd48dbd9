//! A block's private copy of the nodes that its particles may touch.
//!
//! A block is home to the particles of 4 cells along each axis. They are binned again when one has
//! strayed more than a cell from home, so a tile has the nodes of 6 cells along each axis. P2G adds
//! into tiles that belong to one block each, and the grid sums the tiles in a fixed order: no two
//! threads write the same number, and no result depends on how many there are.

use gridfall_core::maths::real::Real;
use gridfall_core::sim::kernel::ShapeFunction;
use gridfall_core::sim::setup::{Axis, Setup};

/// Cells of a block along an axis.
pub const BLOCK: i32 = 4;
/// Cells that a particle may stray from its block before particles are binned again.
pub const SLACK: i32 = 1;

/// A node: momentum (kg·m/s) or velocity (m/s) in the first components, mass (kg) in the last.
pub type Node<T> = [T; 4];
/// Index of the mass in a [`Node`].
pub const MASS: usize = 3;

/// Nodes of a tile along an axis.
pub const fn width(grids: usize, nodes: usize) -> usize {
    // The two grids of the compact kernel are shifted against cells, which takes one node more.
    let shifted = if grids == 2 { 1 } else { 0 };
    (BLOCK + 2 * SLACK) as usize - 1 + nodes + shifted
}

/// The numbers by which kernels differ in blocks, grid and tiles: everything but the transfers
/// themselves is compiled once for all kernels.
#[derive(Clone, Copy, Debug)]
pub struct Layout {
    /// 1, or 2 for the dual pair.
    pub grids: usize,
    /// Where node 0 of each grid lies (dx).
    pub shift: [f64; 2],
    /// Block b is home to the positions from 4 b + `cell` on.
    pub cell: f64,
    /// Nodes of a tile along an axis.
    pub width: usize,
    /// Index of the lowest node of a tile on each grid, relative to the block's node 0.
    pub lowest: [i32; 2],
    /// [`ShapeFunction::inside`].
    pub inside: fn(f64) -> f64,
}

impl Layout {
    pub fn of<K: ShapeFunction<G, W>, const G: usize, const W: usize>() -> Self {
        let lowest = K::axis(K::CELL - SLACK as f64).base;
        let (first, last) = (0, G - 1);
        Self {
            grids: G,
            shift: [K::SHIFT[first], K::SHIFT[last]],
            cell: K::CELL,
            width: width(G, W),
            lowest: [lowest[first], lowest[last]],
            inside: K::inside,
        }
    }

    /// Nodes of a tile, all grids.
    pub fn tile(&self, dimension: usize) -> usize {
        self.grids * self.width.pow(dimension as u32)
    }

    /// Share of a node's room inside the walls of an axis of so many cells; `x`: its place there (dx).
    pub fn inside_walls(&self, axis: &Axis, cells: usize, x: f64) -> f64 {
        match axis {
            Axis::Periodic => 1.0,
            Axis::Walls(_) => ((self.inside)(x) + (self.inside)(cells as f64 - x) - 1.0).max(0.0),
        }
    }
}

/// Where in a tile the node `base` (relative to the block) of grid `g` is.
#[inline(always)]
pub fn index<const D: usize, const G: usize, const W: usize>(g: usize, base: [i32; D], lowest: i32) -> usize {
    let n = width(G, W);
    let mut at = g;
    for a in 0..D {
        at = at * n + (base[a] - lowest) as usize;
    }
    at
}

/// The W^D nodes of one particle on one grid of a tile: all axes but the last are walked by
/// strides, the last is contiguous.
pub struct Walk {
    /// Steps along the first axis of three; 1 in two dimensions.
    pub outer: usize,
    pub outer_stride: usize,
    pub middle_stride: usize,
}

impl Walk {
    pub const fn new(dimension: usize, grids: usize, nodes: usize) -> Self {
        let n = width(grids, nodes);
        Self { outer: if dimension == 3 { nodes } else { 1 }, outer_stride: n * n, middle_stride: n }
    }

    /// Entries of a tile from the first node to the last.
    #[inline(always)]
    pub const fn extent(&self, nodes: usize) -> usize {
        (self.outer - 1) * self.outer_stride + (nodes - 1) * self.middle_stride + nodes
    }
}

/// a + s b.
#[inline(always)]
pub fn add_scaled<T: Real>(a: Node<T>, s: T, b: Node<T>) -> Node<T> {
    [a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2], a[3] + s * b[3]]
}

/// Where a node is (m), in scene coordinates.
pub fn position<const D: usize>(setup: &Setup, node: [i32; D], shift: f64) -> [f64; 3] {
    let mut x = [0.0; 3];
    for a in 0..D {
        x[a] = setup.origin[a] + (node[a] as f64 + shift) * setup.dx;
    }
    x
}

#[cfg(test)]
mod tests {
    use super::*;
    use gridfall_core::sim::kernel::{Compact, Cubic, Linear, Quadratic};

    fn check<K: ShapeFunction<G, W>, const G: usize, const W: usize>() {
        let lowest = Layout::of::<K, G, W>().lowest;
        let (first, last) = (K::CELL - SLACK as f64, K::CELL + (BLOCK + SLACK) as f64 - 1e-9);
        for x in [first, first + 0.3, 0.0, 2.7, last - 0.3, last] {
            for g in 0..G {
                let (low, high) = (K::axis(x).base[g], K::axis(x).base[g] + W as i32 - 1);
                assert!(low >= lowest[g] && high < lowest[g] + width(G, W) as i32, "{low}..{high} at {x}");
            }
        }
    }

    #[test]
    fn tiles_hold_all_nodes_of_particles_within_the_slack() {
        check::<Compact, 2, 2>();
        check::<Linear, 1, 2>();
        check::<Quadratic, 1, 3>();
        check::<Cubic, 1, 4>();
    }
}
