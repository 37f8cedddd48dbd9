//! The part of the simulation that depends on the kernel, behind one interface: everything else is
//! compiled once per scalar and dimension.

use std::marker::PhantomData;

use super::chunk::{Chunk, LANES, Lanes, MatrixLanes, Stencils, matrix, set_matrix};
use super::constants::Constants;
use super::fill::Around;
use super::tile::{Layout, Node};
use super::{fill, g2p, isolated, p2g};
use gridfall_core::maths::real::Real;
use gridfall_core::sim::kernel::{Compact, Cubic, Linear, Quadratic, ShapeFunction};
use gridfall_core::sim::setup::Kernel;

/// Transfers between the particles of a chunk and the nodes of its block's tile.
pub trait Interpolation<T, const D: usize>: Send + Sync {
    fn layout(&self) -> Layout;
    /// [`g2p::gather`].
    fn gather(
        &self,
        constants: &Constants<T, D>,
        chunk: &mut Chunk<T, D>,
        tile: &[Node<T>],
        around: &Around<T, D>,
        grad_v: &mut MatrixLanes<T, D>,
        fill: &mut Lanes<T>,
    );
    /// [`fill::scatter`].
    fn scatter_volume(&self, constants: &Constants<T, D>, chunk: &Chunk<T, D>, volumes: &mut [T]);
    /// [`p2g::scatter`].
    fn scatter(
        &self,
        constants: &Constants<T, D>,
        chunk: &Chunk<T, D>,
        dt: T,
        tau: &MatrixLanes<T, D>,
        pushed: Option<&[Lanes<T>; D]>,
        tile: &mut [Node<T>],
    );
    /// [`isolated::find`].
    fn isolated(&self, constants: &Constants<T, D>, chunk: &Chunk<T, D>, tile: &[Node<T>]) -> Lanes<bool>;
    /// [`isolated::reset`].
    fn reset(&self, constants: &Constants<T, D>, chunk: &mut Chunk<T, D>, isolated: &Lanes<bool>);
    /// C = B D⁻¹ (1/s).
    fn affine_rates(&self, constants: &Constants<T, D>, chunk: &Chunk<T, D>) -> MatrixLanes<T, D>;
}

struct Form<K, const G: usize, const W: usize>(PhantomData<K>);

impl<T: Real, K: ShapeFunction<G, W>, const D: usize, const G: usize, const W: usize> Interpolation<T, D>
    for Form<K, G, W>
{
    fn layout(&self) -> Layout {
        Layout::of::<K, G, W>()
    }

    fn gather(
        &self,
        constants: &Constants<T, D>,
        chunk: &mut Chunk<T, D>,
        tile: &[Node<T>],
        around: &Around<T, D>,
        grad_v: &mut MatrixLanes<T, D>,
        fill: &mut Lanes<T>,
    ) {
        g2p::gather::<T, K, D, G, W>(constants, chunk, tile, around, grad_v, fill);
    }

    fn scatter_volume(&self, constants: &Constants<T, D>, chunk: &Chunk<T, D>, volumes: &mut [T]) {
        fill::scatter::<T, K, D, G, W>(constants, chunk, volumes);
    }

    fn scatter(
        &self,
        constants: &Constants<T, D>,
        chunk: &Chunk<T, D>,
        dt: T,
        tau: &MatrixLanes<T, D>,
        pushed: Option<&[Lanes<T>; D]>,
        tile: &mut [Node<T>],
    ) {
        p2g::scatter::<T, K, D, G, W>(constants, chunk, dt, tau, pushed, tile);
    }

    fn isolated(&self, constants: &Constants<T, D>, chunk: &Chunk<T, D>, tile: &[Node<T>]) -> Lanes<bool> {
        isolated::find::<T, K, D, G, W>(constants, chunk, tile)
    }

    fn reset(&self, constants: &Constants<T, D>, chunk: &mut Chunk<T, D>, isolated: &Lanes<bool>) {
        isolated::reset::<T, K, D, G, W>(constants, chunk, isolated);
    }

    fn affine_rates(&self, constants: &Constants<T, D>, chunk: &Chunk<T, D>) -> MatrixLanes<T, D> {
        let stencils = Stencils::<T, D, G, W>::new::<K>(&chunk.x);
        let mut rates = chunk.b;
        for l in 0..LANES {
            let c = stencils.times_inverse_moment::<K>(&matrix(&chunk.b, l), l);
            set_matrix(&mut rates, l, &c.map(|row| row.map(|c| c / constants.dx)));
        }
        rates
    }
}

/// The transfers of a kernel.
pub fn interpolation<T: Real, const D: usize>(kernel: Kernel) -> Box<dyn Interpolation<T, D>> {
    match kernel {
        Kernel::Compact => Box::new(Form::<Compact, 2, 2>(PhantomData)),
        Kernel::Quadratic => Box::new(Form::<Quadratic, 1, 3>(PhantomData)),
        Kernel::Cubic => Box::new(Form::<Cubic, 1, 4>(PhantomData)),
        Kernel::Linear => Box::new(Form::<Linear, 1, 2>(PhantomData)),
    }
}
