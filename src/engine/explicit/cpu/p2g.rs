//! Particles to grid: m_i = Σ w m, p_i = Σ w m (v + C (x_i − x_p)) + dt f_i, per grid of the dual
//! pair (CK-MPM, eqs. 15–22).
//!
//! C = B D(x)⁻¹ at the particle's new position. Force: −V0 τ diag(p)⁻¹ (x_i − x_p − x̄_s) w with x̄_s the mean of
//! grid s (MLS), −V0 τ D⁻¹ (x_i − x_p) w (MLS as published) or −V0 τ ∇w (APIC, PIC).
//! In: particles of a block. Out: its tile. One thread a block.

use super::chunk::{Chunk, LANES, Lanes, MatrixLanes, State, Stencils, matrix, set_matrix, vector};
use super::constants::Constants;
use super::tile::{MASS, Node, Walk, add_scaled, index, scale};
use gridfall_core::material::{Damping, Law};
use gridfall_core::maths::linalg::{Matrix, add_scaled as add_scaled_matrix, apply, scaled_identity};
use gridfall_core::maths::real::Real;
use gridfall_core::maths::svd::{NEWTON_STEPS, is_regular, newton_step, polar_by_svd};
use gridfall_core::maths::widest::widest;
use gridfall_core::sim::kernel::ShapeFunction;
use gridfall_core::sim::setup::Transfer;

widest! {
    /// Adds a chunk's particles, whose stresses are `tau`, to its block's tile, with the impulses of what pushes them.
    pub fn scatter[T: Real, K: ShapeFunction<G, W>, const D: usize, const G: usize, const W: usize][T, K, D, G, W](
        constants: &Constants<T, D>,
        chunk: &Chunk<T, D>,
        dt: T,
        tau: &MatrixLanes<T, D>,
        pushed: Option<&[Lanes<T>; D]>,
        tile: &mut [Node<T>],
    ) {
        let body = &constants.bodies[chunk.body as usize];
        let stencils = Stencils::<T, D, G, W>::new::<K>(&chunk.x);

        // Momentum is w (m v ∓ push + affine d) − Σ_a pull_a ∂w/∂x_a with d = (x_i − x_p)/dx.
        let (mut affine, mut pulls) = ([[[T::ZERO; LANES]; D]; D], [[[T::ZERO; LANES]; D]; D]);
        let mut push = [[T::ZERO; LANES]; D];
        let impulse = dt * body.volume0 / constants.dx;
        for l in 0..LANES {
            let (mut moment, mut pull) = (matrix(&chunk.b, l), matrix(tau, l));
            for i in 0..D {
                for k in 0..D {
                    pull[i][k] *= -impulse;
                    let force = if constants.transfer == Transfer::MlsPublished { pull[i][k] } else { T::ZERO };
                    moment[i][k] = body.mass * moment[i][k] + force;
                }
            }
            let mut slope = stencils.times_inverse_moment::<K>(&moment, l);
            if constants.transfer.is_centred() {
                let force = stencils.times_inverse_spread(&pull, l);
                slope = add_scaled_matrix(&slope, T::ONE, &force);
                let about = apply(&force, &vector(&stencils.skew, l));
                for i in 0..D {
                    push[i][l] = about[i];
                }
            }
            set_matrix(&mut affine, l, &slope);
            set_matrix(&mut pulls, l, &pull);
        }
        for l in 0..chunk.count {
            // Columns as nodes: what a step along an axis changes.
            let mut column = [[T::ZERO; 4]; D];
            let mut pull = [[T::ZERO; 4]; D];
            let mut value = [T::ZERO; 4];
            for i in 0..D {
                value[i] = body.mass * chunk.v[i][l] + pushed.map_or(T::ZERO, |pushed| pushed[i][l]);
                for k in 0..D {
                    column[k][i] = affine[i][k][l];
                    pull[k][i] = pulls[i][k][l];
                }
            }
            value[MASS] = body.mass;
            let mut values = [value; G];
            for i in 0..D {
                for g in 0..G {
                    values[g][i] += if g == 0 { -push[i][l] } else { push[i][l] };
                }
            }
            let lowest = &constants.layout.lowest;
            if constants.transfer.is_mls() {
                scatter_lane::<T, D, G, W, false>(lowest, &stencils, l, &values, &column, &pull, tile);
            } else {
                scatter_lane::<T, D, G, W, true>(lowest, &stencils, l, &values, &column, &pull, tile);
            }
        }
    }
}

/// Adds w (value_g + Σ_a column_a d_a) and, in the gradient form, Σ_a pull_a ∂w/∂x_a to the particle's nodes.
#[inline(always)]
fn scatter_lane<T: Real, const D: usize, const G: usize, const W: usize, const GRADIENT: bool>(
    lowest: &[i32; 2],
    s: &Stencils<T, D, G, W>,
    l: usize,
    values: &[Node<T>; G],
    column: &[Node<T>; D],
    pull: &[Node<T>; D],
    tile: &mut [Node<T>],
) {
    let walk = const { Walk::new(D, G, W) };
    let (middle, inner) = (D - 2, D - 1);
    for g in 0..G {
        let mut base = [0; D];
        let mut origin = values[g];
        for a in 0..D {
            base[a] = s.base[a][g][l];
            origin = add_scaled(origin, s.offset[a][g][l], column[a]);
        }
        let start = index::<D, G, W>(g, base, lowest[g]);
        for i in 0..walk.outer {
            let (at_i, w_i, slope_i) = if D == 3 {
                (add_scaled(origin, T::from_i32(i as i32), column[0]), s.weight[0][g][i][l], s.slope[0][g][i][l])
            } else {
                (origin, T::ONE, T::ZERO)
            };
            for j in 0..W {
                let at_j = add_scaled(at_i, T::from_i32(j as i32), column[middle]);
                let (w_j, slope_j) = (s.weight[middle][g][j][l], s.slope[middle][g][j][l]);
                let w_ij = w_i * w_j;
                let mut across = scale(w_i * slope_j, pull[middle]);
                if D == 3 {
                    across = add_scaled(across, slope_i * w_j, pull[0]);
                }
                let along = scale(w_ij, pull[inner]);
                let row = start + i * walk.outer_stride + j * walk.middle_stride;
                let row = &mut tile[row..row + W];
                for k in 0..W {
                    let at_k = add_scaled(at_j, T::from_i32(k as i32), column[inner]);
                    let w_k = s.weight[inner][g][k][l];
                    row[k] = add_scaled(row[k], w_ij * w_k, at_k);
                    if GRADIENT {
                        row[k] = add_scaled(row[k], w_k, across);
                        row[k] = add_scaled(row[k], s.slope[inner][g][k][l], along);
                    }
                }
            }
        }
    }
}

widest! {
    /// Kirchhoff stress τ (Pa) of the particles of a chunk. Returns the largest ratio of a
    /// particle's stiffness to that at rest.
    pub fn stress[T: Real, const D: usize][T, D](law: &Law<T>, chunk: &Chunk<T, D>, tau: &mut MatrixLanes<T, D>) -> T {
        let mut stiffening = [T::ONE; LANES];
        match (law, &chunk.state) {
            (Law::FixedCorotated(law), State::Solid { f: lanes, .. }) => {
                let rotation = rotations(lanes);
                for l in 0..LANES {
                    let f = matrix(lanes, l);
                    set_matrix(tau, l, &law.kirchhoff_with_rotation(&f, &matrix(&rotation, l)));
                    stiffening[l] = law.stiffness_at(&f);
                }
            }
            (Law::NeoHookean(law), State::Solid { f: lanes, .. }) => {
                for l in 0..LANES {
                    let f = matrix(lanes, l);
                    set_matrix(tau, l, &law.kirchhoff(&f));
                    stiffening[l] = law.stiffness_at(&f);
                }
            }
            (Law::WeaklyCompressibleFluid(fluid), State::Fluid { j: lanes, grad_v }) => {
                for l in 0..LANES {
                    let j = lanes[l];
                    let pressure = fluid.pressure(j);
                    set_matrix(tau, l, &fluid.kirchhoff(j, pressure, &matrix(grad_v, l)));
                    stiffening[l] = law.stiffness_at_rest() * fluid.stiffening(j, pressure);
                }
            }
            (_, State::Solid { f, plastic, .. }) => {
                for l in 0..chunk.count {
                    let (stress, ratio) = law.kirchhoff(&matrix(f, l), plastic[l]);
                    set_matrix(tau, l, &stress);
                    stiffening[l] = law.stiffness_at_rest() * ratio;
                }
            }
            (_, State::Fluid { .. }) => unreachable!("a fluid has a fluid's law"),
        }
        let most = stiffening[..chunk.count].iter().copied().fold(T::ZERO, T::max);
        most / law.stiffness_at_rest()
    }
}

widest! {
    /// Adds the viscous stress of damping to `tau`.
    pub fn damp[T: Real, const D: usize][T, D](
        damping: &Damping<T>,
        chunk: &Chunk<T, D>,
        tau: &mut MatrixLanes<T, D>,
    ) {
        let State::Solid { grad_v: Some(grad_v), .. } = &chunk.state else {
            unreachable!("a damped body's chunks keep ∇v");
        };
        for l in 0..LANES {
            let viscous = damping.kirchhoff(&matrix(grad_v, l));
            for i in 0..D {
                for k in 0..D {
                    tau[i][k][l] += viscous[i][k];
                }
            }
        }
    }
}

/// Polar rotations of the particles of a chunk.
#[inline(always)]
fn rotations<T: Real, const D: usize>(f: &MatrixLanes<T, D>) -> MatrixLanes<T, D> {
    let mut rotation = *f;
    // Newton's iteration in step, so that the loops over lanes are vectorised.
    let mut done = [false; LANES];
    for _ in 0..NEWTON_STEPS {
        for l in 0..LANES {
            let (next, converged) = newton_step(&matrix(&rotation, l));
            set_matrix(&mut rotation, l, &next);
            done[l] = converged;
        }
        if !done.contains(&false) {
            break;
        }
    }
    for l in 0..LANES {
        done[l] &= is_regular(&matrix(f, l));
    }
    if done.contains(&false) {
        rotate_the_rest(f, &done, &mut rotation);
    }
    rotation
}

/// Polar rotations of the particles that the fast path refused.
#[cold]
#[inline(never)]
fn rotate_the_rest<T: Real, const D: usize>(
    f: &MatrixLanes<T, D>,
    done: &Lanes<bool>,
    rotation: &mut MatrixLanes<T, D>,
) {
    for l in (0..LANES).filter(|&l| !done[l]) {
        let f: Matrix<T, D> = matrix(f, l);
        // A state that is not finite has no rotation; it shows as a velocity that is not finite in the next G2P.
        let finite = f.iter().flatten().all(|x| x.is_finite());
        set_matrix(rotation, l, &if finite { polar_by_svd(&f) } else { scaled_identity(T::ONE) });
    }
}
