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

    /// The same Hessian as a product without a matrix.
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
