//! Particles that share no node with another, and their reset (Bai & Schroeder §5): alone, a
//! particle oscillates against its own nodes, and steps of varying length can feed that without
//! bound. So at every frame boundary, where the step may change, F ← I (a fluid's J ← 1) and C ← a
//! rigid rotation `[ω]`; position, velocity and angular momentum stay.
//!
//! The paper takes the skew part of C. Where D is not a multiple of I (compact kernel) that is not
//! the rotation with the particle's angular momentum L_k = ε_kij B_ji (per mass); B = `[ω]` D has
//! it for (tr D I − D) ω = L.

use super::chunk::{Chunk, LANES, Lanes, State, Stencils, matrix, set_matrix};
use super::constants::Constants;
use super::fill::each_node;
use super::tile::{MASS, Node};
use gridfall_core::maths::linalg::{Matrix, apply, cofactor, det, scaled_identity, trace};
use gridfall_core::maths::real::Real;
use gridfall_core::sim::kernel::ShapeFunction;

/// Others may add this share to Σ w m_i before a particle counts as accompanied: what they
/// contribute below is no support, and f32 sums are good to less. Twin: `ALONE` in wgsl/g2p.wgsl.
pub const ALONE: f64 = 1e-4;

/// Which particles of a chunk have their nodes to themselves, by the masses in the tile that they gather from.
pub fn find<T: Real, K: ShapeFunction<G, W>, const D: usize, const G: usize, const W: usize>(
    constants: &Constants<T, D>,
    chunk: &Chunk<T, D>,
    tile: &[Node<T>],
) -> Lanes<bool> {
    let mass = constants.bodies[chunk.body as usize].mass;
    let stencils = Stencils::<T, D, G, W>::new::<K>(&chunk.x);
    let own = stencils.own_share();
    let mut alone = [false; LANES];
    for l in 0..chunk.count {
        let mut total = T::ZERO;
        each_node(&constants.layout, &stencils, None, l, |at, w| total += w * tile[at][MASS]);
        let total = total / T::from_i32(G as i32);
        alone[l] = total < mass * own[l] * T::from_f64(1.0 + ALONE);
    }
    alone
}

/// Resets the marked particles, which are where the step has taken them.
pub fn reset<T: Real, K: ShapeFunction<G, W>, const D: usize, const G: usize, const W: usize>(
    constants: &Constants<T, D>,
    chunk: &mut Chunk<T, D>,
    isolated: &Lanes<bool>,
) {
    let stencils = Stencils::<T, D, G, W>::new::<K>(&chunk.x);
    for l in (0..LANES).filter(|&l| isolated[l]) {
        match &mut chunk.state {
            State::Solid { f, .. } => set_matrix(f, l, &scaled_identity(T::ONE)),
            State::Fluid { j, .. } => j[l] = T::ONE,
        }
        if constants.transfer.is_affine() {
            let d = stencils.times_moment(&scaled_identity(T::ONE), l);
            let spin = rotation_of(&matrix(&chunk.b, l), &d);
            set_matrix(&mut chunk.b, l, &stencils.times_moment(&spin, l));
        }
    }
}

/// `[ω]` for which `[ω]` D has the angular momentum of B.
fn rotation_of<T: Real, const D: usize>(b: &Matrix<T, D>, d: &Matrix<T, D>) -> Matrix<T, D> {
    let mut spin = [[T::ZERO; D]; D];
    if D == 2 {
        let omega = (b[1][0] - b[0][1]) / trace(d);
        (spin[1][0], spin[0][1]) = (omega, -omega);
        return spin;
    }
    let mut inertia = scaled_identity(trace(d));
    let mut momentum = [T::ZERO; D];
    for i in 0..D {
        let (j, k) = ((i + 1) % D, (i + 2) % D);
        momentum[i] = b[k][j] - b[j][k];
        for k in 0..D {
            inertia[i][k] -= d[i][k];
        }
    }
    // The inertia is symmetric: its inverse is its cofactor matrix over its determinant.
    let omega = apply(&cofactor(&inertia), &momentum);
    for i in 0..D {
        let (j, k) = ((i + 1) % D, (i + 2) % D);
        let w = omega[i] / det(&inertia);
        (spin[k][j], spin[j][k]) = (w, -w);
    }
    spin
}
