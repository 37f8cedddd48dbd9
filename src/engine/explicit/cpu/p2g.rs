//! Particles to grid: m_i = Σ w m, p_i = Σ w m (v + C (x_i − x_p)) + dt f_i, per grid of the dual
//! pair (CK-MPM, eqs. 15–22).
//!
//! C = B D(x)⁻¹ at the particle's new position. Force: −V0 τ diag(p)⁻¹ (x_i − x_p − x̄_s) w with x̄_s the mean of
//! grid s (MLS), −V0 τ D⁻¹ (x_i − x_p) w (MLS as published) or −V0 τ ∇w (APIC, PIC).
//! In: particles of a block. Out: its tile. One thread a block.

use super::chunk::{Chunk, LANES, Lanes, MatrixLanes, Others, State, Stencils, matrix, set_matrix, vector};
use super::constants::Constants;
use super::flow;
use super::near::{self, Near};
use super::tile::{MASS, Node};
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
        let mut values = chunk.v;
        for i in 0..D {
            for l in 0..LANES {
                values[i][l] = body.mass * values[i][l] + pushed.map_or(T::ZERO, |pushed| pushed[i][l]);
            }
        }
        let mut near = near::nothing::<T, G, W>();
        spread(&stencils, body.mass, &values, &push, &affine, &mut near);
        if !constants.transfer.is_mls() {
            spread_pull(&stencils, &Stencils::<T, D, G, W>::slopes::<K>(&chunk.x), &pulls, &mut near);
        }
        near::add::<T, D, G, W>(tile, &stencils.starts(&constants.layout.lowest), chunk.count, &near);
    }
}

/// w (value ∓ push + affine d), and w m.
#[inline(always)]
fn spread<T: Real, const D: usize, const G: usize, const W: usize>(
    s: &Stencils<T, D, G, W>,
    mass: T,
    values: &[Lanes<T>; D],
    push: &[Lanes<T>; D],
    affine: &MatrixLanes<T, D>,
    near: &mut Near<T, G, W>,
) {
    let (middle, inner) = (D - 2, D - 1);
    for g in 0..G {
        let sign = if g == 0 { -T::ONE } else { T::ONE };
        for i in 0..if D == 3 { W } else { 1 } {
            for l in 0..LANES {
                // Momentum grows by a column of the affine part from node to node.
                let mut at_i = [T::ZERO; D];
                for c in 0..D {
                    at_i[c] = values[c][l] + sign * push[c][l];
                    for a in 0..D {
                        let steps = if D == 3 && a == 0 { T::from_i32(i as i32) } else { T::ZERO };
                        at_i[c] += affine[c][a][l] * (s.offset[a][g][l] + steps);
                    }
                }
                let w_i = if D == 3 { s.weight[0][g][i][l] } else { T::ONE };
                for j in 0..W {
                    let w_j = w_i * s.weight[middle][g][j][l];
                    let mut at_j = at_i;
                    for k in 0..W {
                        let w = w_j * s.weight[inner][g][k][l];
                        let node = &mut near[g][i][j][k][l];
                        for c in 0..D {
                            node[c] = w * at_j[c];
                            at_j[c] += affine[c][inner][l];
                        }
                        node[MASS] = w * mass;
                    }
                    for c in 0..D {
                        at_i[c] += affine[c][middle][l];
                    }
                }
            }
        }
    }
}

/// Adds Σ_a pull_a ∂w/∂x_a.
#[inline(always)]
fn spread_pull<T: Real, const D: usize, const G: usize, const W: usize>(
    s: &Stencils<T, D, G, W>,
    slopes: &Others<T, D, G, W>,
    pull: &MatrixLanes<T, D>,
    near: &mut Near<T, G, W>,
) {
    let (middle, inner) = (D - 2, D - 1);
    for g in 0..G {
        for i in 0..if D == 3 { W } else { 1 } {
            for j in 0..W {
                for l in 0..LANES {
                    let (mut w_i, mut slope_i) = (T::ONE, T::ZERO);
                    if D == 3 {
                        (w_i, slope_i) = (s.weight[0][g][i][l], slopes[0][g][i][l]);
                    }
                    let (w_j, slope_j) = (s.weight[middle][g][j][l], slopes[middle][g][j][l]);
                    for k in 0..W {
                        let (w_k, slope_k) = (s.weight[inner][g][k][l], slopes[inner][g][k][l]);
                        for c in 0..D {
                            let mut force = w_i * slope_j * w_k * pull[c][middle][l];
                            if D == 3 {
                                force += slope_i * w_j * w_k * pull[c][0][l];
                            }
                            near[g][i][j][k][l][c] += force + w_i * w_j * slope_k * pull[c][inner][l];
                        }
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
                let (at_rest, still) = (law.stiffness_at_rest(), [[T::ZERO; D]; D]);
                for l in 0..LANES {
                    let j = lanes[l];
                    let pressure = fluid.pressure(j);
                    set_matrix(tau, l, &fluid.kirchhoff(j, pressure, &still));
                    stiffening[l] = at_rest * fluid.stiffening(j, pressure);
                }
                if let Some(grad_v) = grad_v {
                    for l in 0..LANES {
                        let viscous = fluid.kirchhoff(lanes[l], T::ZERO, &matrix(grad_v, l));
                        for i in 0..D {
                            for k in 0..D {
                                tau[i][k][l] += viscous[i][k];
                            }
                        }
                    }
                }
            }
            (_, State::Solid { f, plastic, .. }) => stiffening = flow::stress(law, f, plastic, chunk.count, tau),
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
