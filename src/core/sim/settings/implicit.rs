//! Settings of the implicit integrator.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Implicit {
    pub method: Method,
    /// ε of the node-wise characteristic norm (HOT §5.2); a step has converged when its scaled residual is below it.
    pub tolerance: f64,
    /// Levels of the multigrid hierarchy, the grid of the particles included.
    pub levels: u32,
    pub smoother: Smoother,
    pub coarse_solve: CoarseSolve,
    /// Whether the L-BFGS methods rebuild their model of the Hessian within a step: after 2 and 5
    /// iterations while far from the tolerance, and every 16. As published they build it once per step.
    pub rebuild: bool,
    /// A step ends unconverged after so many outer iterations, which the diagnostics say.
    pub max_iterations: u32,
}

impl Default for Implicit {
    fn default() -> Self {
        Self {
            method: Method::Hot,
            tolerance: 1e-7,
            levels: 3,
            smoother: Smoother::Chebyshev,
            coarse_solve: CoarseSolve::Fixed,
            rebuild: true,
            max_iterations: 1000,
        }
    }
}

/// How the step's minimisation is done. HOT is the default; the others are there to be compared with it (HOT §7).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// L-BFGS around one V-cycle of the node-embedding Galerkin multigrid.
    Hot,
    /// HOT with quadratic instead of linear embedding of nodes.
    HotQuadratic,
    /// Projected Newton, conjugate gradients preconditioned by the diagonal blocks, on the assembled matrix.
    PnPcg,
    /// The same without a matrix.
    PnPcgMf,
    /// Projected Newton, conjugate gradients preconditioned by symmetric Gauss–Seidel.
    PnPcgSgs,
    /// Projected Newton, conjugate gradients preconditioned by HOT's V-cycle.
    PnMgpcg,
    /// L-BFGS around an inexact solve with the Hessian.
    LbfgsH,
    /// L-BFGS around a V-cycle whose coarse matrices are assembled from particle quadrature.
    LbfgsGmg,
    /// Matrix-free Newton–Krylov stopped by the plain norm of the residual (Gast et al. 2015).
    Gast15,
    /// Alternating directions, first order (Fang et al. 2019); elastic materials.
    Admm,
}

impl Method {
    pub const ALL: [Self; 10] = [
        Self::Hot,
        Self::HotQuadratic,
        Self::PnPcg,
        Self::PnPcgMf,
        Self::PnPcgSgs,
        Self::PnMgpcg,
        Self::LbfgsH,
        Self::LbfgsGmg,
        Self::Gast15,
        Self::Admm,
    ];
}

/// The smoother of the V-cycle.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Smoother {
    /// A Chebyshev polynomial of the block-Jacobi-preconditioned matrix.
    Chebyshev,
    /// One symmetric sweep of coloured block Gauss–Seidel, as published.
    GaussSeidel,
}

/// The solve on the coarsest level.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum CoarseSolve {
    /// A fixed linear operator: a dense factorisation while small, else a fixed Chebyshev polynomial.
    Fixed,
    /// Conjugate gradients to a tolerance that follows the right-hand side, as published.
    Adaptive,
}
