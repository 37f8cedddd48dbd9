//! Particles to grid and back, for one step of any length (APIC and MLS: NUMERICS §1; PIC has
//! B = 0).
//!
//! m_i = Σ w m, m_i v_i = Σ w m (v_p + B D⁻¹ (x_i − x_p)); v_p = share Σ w v_i, B = share Σ w v_i
//! (x_i − x_p)ᵀ; F ← (I + dt share Σ v_i gᵀ) F, then the return map; x ← x + dt v.

use rayon::prelude::*;

use super::state::{BodySetup, State};
use super::topology::Topology;
use gridfall_core::maths::linalg::{Matrix, Vector, add_scaled, apply, identity, mul};
use gridfall_core::sim::setup::{Axis, Setup};

/// A node before the step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Node<const D: usize> {
    /// kg.
    pub mass: f64,
    /// m/s.
    pub velocity: Vector<f64, D>,
    /// ξ_i = Σ w m ξ_p / m_i (Pa), the mean characteristic stiffness of its particles (HOT §5.2).
    pub stiffness: f64,
}

/// All nodes of a topology.
pub fn particles_to_grid<const D: usize>(
    setup: &Setup,
    topology: &Topology<D>,
    state: &State<D>,
    bodies: &[BodySetup],
) -> Vec<Node<D>> {
    let affine: Vec<Matrix<f64, D>> =
        (0..state.x.len()).into_par_iter().map(|p| mul(&state.b[p], &topology.stencils[p].inverse_moment)).collect();
    let bring = |group: usize, shares: &mut [Node<D>]| {
        for p in topology.members(group) {
            let body = &bodies[state.body[p] as usize];
            let (w, _) = topology.stencil(p);
            for (local, share) in shares.iter_mut().enumerate() {
                let m = w[local] * body.mass;
                let turn = apply(&affine[p], &topology.arm(setup, p, &state.x[p], local));
                share.mass += m;
                share.stiffness += m * body.characteristic;
                for a in 0..D {
                    share.velocity[a] += m * (state.v[p][a] + turn[a]);
                }
            }
        }
    };
    let zero = Node { mass: 0.0, velocity: [0.0; D], stiffness: 0.0 };
    let add = |sum: &mut Node<D>, share: &Node<D>| {
        sum.mass += share.mass;
        sum.stiffness += share.stiffness;
        (0..D).for_each(|a| sum.velocity[a] += share.velocity[a]);
    };
    let mut nodes = topology.gather(zero, bring, add);
    nodes.par_iter_mut().filter(|node| node.mass > 0.0).for_each(|node| {
        node.velocity = node.velocity.map(|p| p / node.mass);
        node.stiffness /= node.mass;
    });
    nodes
}

/// What the particles did in a step.
#[derive(Clone, Copy, Debug, Default)]
pub struct Moves {
    /// Largest distance of a particle (dx).
    pub farthest_dx: f64,
    /// Fastest particle (m/s).
    pub max_speed_m_s: f64,
    /// First particle, by place in the state, that is no longer finite.
    pub lost: Option<usize>,
    /// First particle that is more than a cell outside a wall.
    pub outside: Option<usize>,
}

/// The particles after a step of `dt` (s) with these node velocities (m/s) at its end.
pub fn grid_to_particles<const D: usize>(
    setup: &Setup,
    topology: &Topology<D>,
    state: &State<D>,
    bodies: &[BodySetup],
    velocities: &[Vector<f64, D>],
    dt: f64,
) -> (State<D>, Moves) {
    let share = topology.interpolation.shape.share;
    let affine = setup.transfer.is_affine();
    let advance = |p: usize| {
        let (w, g) = topology.stencil(p);
        let nodes = topology.nodes_of(topology.group_of[p] as usize);
        let (mut v, mut b, mut grad_v) = ([0.0; D], [[0.0; D]; D], [[0.0; D]; D]);
        for (local, &node) in nodes.iter().enumerate() {
            let velocity = &velocities[node as usize];
            let arm = topology.arm(setup, p, &state.x[p], local);
            for a in 0..D {
                let weighted = share * w[local] * velocity[a];
                v[a] += weighted;
                for c in 0..D {
                    b[a][c] += weighted * arm[c];
                    grad_v[a][c] += share * velocity[a] * g[local][c];
                }
            }
        }
        let mut f = mul(&add_scaled(&identity(), dt, &grad_v), &state.f[p]);
        let mut plastic = state.plastic[p];
        let law = &bodies[state.body[p] as usize].law;
        if law.is_plastic() {
            law.return_map(&mut f, &mut plastic);
        }
        let x = setup.wrapped(std::array::from_fn(|a| state.x[p][a] + dt * v[a]));
        (x, v, if affine { b } else { [[0.0; D]; D] }, f, plastic)
    };
    let count = state.x.len();
    let moved: Vec<_> = (0..count).into_par_iter().with_min_len(64).map(advance).collect();
    let mut moves = Moves::default();
    for (p, (x, v, b, f, _)) in moved.iter().enumerate() {
        let finite = v.iter().chain(b.iter().flatten()).chain(f.iter().flatten()).all(|c| c.is_finite());
        if !finite {
            moves.lost.get_or_insert(p);
        }
        if (0..D).any(|a| is_outside(setup, a, x[a])) {
            moves.outside.get_or_insert(p);
        }
        let speed = v.iter().map(|c| c * c).sum::<f64>().sqrt();
        moves.max_speed_m_s = moves.max_speed_m_s.max(speed);
        moves.farthest_dx = moves.farthest_dx.max(speed * dt / setup.dx);
    }
    let after = State {
        x: moved.iter().map(|m| m.0).collect(),
        v: moved.iter().map(|m| m.1).collect(),
        b: moved.iter().map(|m| m.2).collect(),
        f: moved.iter().map(|m| m.3).collect(),
        plastic: moved.iter().map(|m| m.4).collect(),
        body: state.body.clone(),
        touch: state.touch.clone(),
    };
    (after, moves)
}

fn is_outside(setup: &Setup, a: usize, x: f64) -> bool {
    let x = (x - setup.origin[a]) / setup.dx;
    matches!(setup.axes[a], Axis::Walls(_)) && !(-1.0..=setup.cells[a] as f64 + 1.0).contains(&x)
}
