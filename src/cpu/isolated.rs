//! Particles that share no node with another, and their reset (Bai & Schroeder §5): alone, a particle oscillates against its own nodes, and
//! steps of varying length can feed that without bound. So at every frame boundary, where the step may change,
//! F ← I (a fluid's J ← 1) and C ← its skew part; position, velocity and spin stay.

use super::chunk::{Chunk, LANES, Lanes, Stencils, matrix, set_matrix};
use super::g2p::gather_lane;
use super::solver::Setup;
use super::tile::{MASS, Node};
use crate::sim::kernel::Kernel;
use crate::sim::linalg::scaled_identity;
use crate::sim::real::Real;

/// Others may add this share to Σ w m_i before a particle counts as accompanied: what they contribute below is no support, and f32 sums
/// are good to less. Twin: `ALONE` in wgsl/g2p.wgsl.
pub const ALONE: f64 = 1e-4;

/// Which particles of a chunk have their nodes to themselves, by the masses in the tile that they gather from.
pub fn find<T: Real, K: Kernel<G, W>, const D: usize, const G: usize, const W: usize>(
    setup: &Setup<T, D>,
    chunk: &Chunk<T, D>,
    tile: &[Node<T>],
) -> Lanes<bool> {
    let mass = setup.bodies[chunk.body as usize].mass;
    let stencils = Stencils::<T, D, G, W>::new::<K>(&chunk.x);
    let own = stencils.own_share();
    let mut alone = [false; LANES];
    for l in 0..chunk.count {
        let (total, _) = gather_lane(&setup.layout.lowest, &stencils, &stencils.weight, l, tile);
        alone[l] = total[MASS] < mass * own[l] * T::from_f64(1.0 + ALONE);
    }
    alone
}

/// Resets the marked particles, which are where the step has taken them.
pub fn reset<T: Real, K: Kernel<G, W>, const D: usize, const G: usize, const W: usize>(
    setup: &Setup<T, D>,
    chunk: &mut Chunk<T, D>,
    isolated: &Lanes<bool>,
) {
    let stencils = Stencils::<T, D, G, W>::new::<K>(&chunk.x);
    for l in (0..LANES).filter(|&l| isolated[l]) {
        // J in the first entry of a fluid's F is 1 at rest, too.
        set_matrix(&mut chunk.f, l, &scaled_identity(T::ONE));
        if setup.affine {
            let c = stencils.times_inverse_moment::<K>(&matrix(&chunk.b, l), l);
            let mut spin = c;
            for i in 0..D {
                for k in 0..D {
                    spin[i][k] = T::HALF * (c[i][k] - c[k][i]);
                }
            }
            set_matrix(&mut chunk.b, l, &stencils.times_moment(&spin, l));
        }
    }
}
