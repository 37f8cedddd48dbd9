//! The step's minimisation problem as solvers see it.

use super::sparse::Bsr;
use gridfall_core::maths::linalg::{Matrix, Vector};

/// A vector per node of the system.
pub type NodeVectors<const D: usize> = Vec<Vector<f64, D>>;

/// Where a node lies: grid 0, or 1 of the compact kernel's dual pair, and its index there. Periodic
/// indices are wrapped.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct NodeId<const D: usize> {
    pub grid: u8,
    pub index: [i32; D],
}

/// How a node of the system may move.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Freedom<const D: usize> {
    Free,
    /// Along the surface with this unit normal: S = I − n nᵀ.
    Plane(Vector<f64, D>),
    /// Along this unit vector, where two surfaces meet: S = t tᵀ.
    Line(Vector<f64, D>),
}

impl<const D: usize> Freedom<D> {
    /// The projection S onto the directions in which the node may move; none if it is free.
    pub fn projection(&self) -> Option<Matrix<f64, D>> {
        let outer = |u: &Vector<f64, D>| u.map(|a| u.map(|b| a * b));
        match self {
            Self::Free => None,
            Self::Line(t) => Some(outer(t)),
            Self::Plane(n) => {
                let mut s = outer(n).map(|row| row.map(|x| -x));
                (0..D).for_each(|a| s[a][a] += 1.0);
                Some(s)
            }
        }
    }
}

/// Largest |dt ∇v| of what flows that an iteration may add.
const MOST_STRAIN: f64 = 0.3;

/// [`Objective::reach`] of a direction with this |dt ∇v| at most where a material flows.
pub fn reach_of(strain: f64) -> f64 {
    (MOST_STRAIN / strain).min(1.0)
}

/// What [`Objective::renew`] has changed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Renewed {
    Nothing,
    /// ∇E, by a little.
    Forces,
    /// ∇E and the Hessian, by much: faces press on other particles than before, or friction holds what slid.
    Contacts,
}

/// The step's minimisation problem over the velocity increments Δv of its nodes (m/s).
///
/// Nodes whose velocity is prescribed are not part of the system. A node that may only slide keeps
/// the other components of Δv that it starts with, and gradients and Hessians are projected by its
/// S, see [`Freedom`].
pub trait Objective<const D: usize>: Sync {
    /// The nodes of the system; their order is that of all [`NodeVectors`].
    fn nodes(&self) -> &[NodeId<D>];

    /// How each node may move.
    fn freedoms(&self) -> &[Freedom<D>];

    /// Cells of each grid along periodic axes.
    fn period(&self) -> [Option<i32>; D];

    /// True once the work shall stop; a solver then returns what it has.
    fn canceled(&self) -> bool {
        false
    }

    /// Masses of the nodes (kg).
    fn masses(&self) -> &[f64];

    /// Characteristic scale of each node's residual, tol_i / ε = 24 dx² dt ξ_i (kg m/s) (HOT eq.
    /// 9).
    fn scales(&self) -> &[f64];

    /// Where the minimisation starts: g dt on free nodes.
    fn start(&self) -> NodeVectors<D>;

    /// E (J); infinite where a material forbids the state.
    fn energy(&self, dv: &NodeVectors<D>) -> f64;

    /// E, and ∇E = −r (kg m/s), projected.
    fn energy_and_gradient(&self, dv: &NodeVectors<D>, gradient: &mut NodeVectors<D>) -> f64;

    /// The projected, positive definite Hessian at Δv (kg). Of a sliding node S H S, with
    /// trace(H_ii)/D · (I − S) added to its diagonal block.
    fn hessian(&self, dv: &NodeVectors<D>) -> Bsr<f64, D>;

    /// The Hessian for Newton's method at Δv (kg): like [`Self::hessian`], but of particles that are
    /// stretched as at the step's start, and turned to where they are at Δv. Along the way, a body
    /// that turns by θ is stretched by θ²/2 where nodes move straight; a Hessian there resists
    /// rotation. Materials that flow within the step resist as `elastic` ones in the first iteration,
    /// whose start is strained by its turn alone, and where flow has led astray.
    fn tangent(&self, dv: &NodeVectors<D>, elastic: bool) -> Bsr<f64, D>;

    /// The largest part of a direction p of Δv that a solver may go at once: where a material flows,
    /// its stress hardly depends on its strain, and a full Newton step is stress over inertia, far
    /// outside what its equations were linearised for.
    fn reach(&self, _p: &NodeVectors<D>) -> f64 {
        1.0
    }

    /// Fixes for an iteration from Δv what has no energy otherwise, the limits of friction.
    fn renew(&mut self, _dv: &NodeVectors<D>) -> Renewed {
        Renewed::Nothing
    }

    /// Part of the tolerance that the error of velocities may have, so that the forces of stiff faces have
    /// no larger error than the tolerance either; at most 1.
    fn sharpness(&self) -> f64 {
        1.0
    }

    /// The size (kg^½ m/s) below which changes of velocity, in the norm of the masses, do not
    /// matter: that of free fall in a step, or rounding's part of the velocities.
    fn least_change(&self) -> f64;

    /// [`Self::hessian`] as a product without a matrix.
    fn linearised<'a>(&'a self, dv: &NodeVectors<D>) -> Box<dyn LinearOperator<D> + 'a>;

    /// The Hessian on the grids coarsened `level` times, from the quadrature of the same particles
    /// with kernels of width 2^level dx, and the nodes there (geometric multigrid, HOT §7.3).
    fn coarse_hessian(&self, dv: &NodeVectors<D>, level: u32) -> (Vec<NodeId<D>>, Bsr<f64, D>);

    /// The problem with the particles' deformations as separate variables.
    fn splitting<'a>(&'a self) -> Box<dyn Splitting<D> + 'a>;
}

/// E with the deformation of every particle as a variable of its own, E(Δv, Z) = inertia + Σ V0
/// ψ(Z_p) with Z_p = F_p(Δv), and what alternating directions do with it (Fang et al. 2019).
pub trait Splitting<const D: usize>: Sync {
    /// F_p(Δv).
    fn deformations(&self, dv: &NodeVectors<D>) -> Vec<Matrix<f64, D>>;

    /// argmin over Z of V0 ψ(Z) + ½ w_p |Z − A_p|², w_p = V0 (λ + 2μ) (J), of every particle.
    fn proximal(&self, targets: &[Matrix<f64, D>]) -> Vec<Matrix<f64, D>>;

    /// ∇ of the inertia and of ½ Σ w_p |F_p(Δv) − A_p|² (kg m/s), projected.
    fn gradient(&self, dv: &NodeVectors<D>, targets: &[Matrix<f64, D>]) -> NodeVectors<D>;

    /// The second derivative of the same (kg), which does not depend on the state; constrained like
    /// [`Objective::hessian`].
    fn metric(&self) -> Bsr<f64, D>;
}

/// y = A x, symmetric.
pub trait LinearOperator<const D: usize>: Sync {
    fn apply(&self, x: &NodeVectors<D>, y: &mut NodeVectors<D>);

    /// Diagonal blocks of A.
    fn diagonal(&self) -> Vec<Matrix<f64, D>>;
}
