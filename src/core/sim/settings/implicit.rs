//! Settings of the implicit integrator.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Settings of the implicit integrator.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Implicit {
    /// How a step's equations are solved.
    pub method: Method,
    /// What the tolerance is measured in; by default, for the method `newton` its `error`, for all others, which have
    /// no estimate of it, `characteristic`.
    pub norm: Option<Norm>,
    /// A step has converged when its residual in the norm is at most this; by default 1e-2 in the norm `error`, 1e-7
    /// in the norm `characteristic`.
    pub tolerance: Option<f64>,
    /// When plastic materials flow; by default, for the method `newton` within the step, for all others, which
    /// minimise an energy, after it.
    pub plasticity: Option<Plasticity>,
    /// Levels of the multigrid hierarchy, the grid of the particles included. The method `newton`
    /// adds levels until the coarsest one is small enough to be solved exactly.
    pub levels: u32,
    /// The smoother of the V-cycle.
    pub smoother: Smoother,
    /// The solve on the coarsest level.
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
            method: Method::Newton,
            norm: None,
            tolerance: None,
            plasticity: None,
            levels: 3,
            smoother: Smoother::Chebyshev,
            coarse_solve: CoarseSolve::Fixed,
            rebuild: true,
            max_iterations: 1000,
        }
    }
}

impl Implicit {
    /// The norm, given or not.
    pub fn norm(&self) -> Norm {
        let own = if self.method == Method::Newton { Norm::Error } else { Norm::Characteristic };
        self.norm.unwrap_or(own)
    }

    /// When materials flow, given or not.
    pub fn plasticity(&self) -> Plasticity {
        let own = if self.method == Method::Newton { Plasticity::Flowing } else { Plasticity::Lagged };
        self.plasticity.unwrap_or(own)
    }

    /// The tolerance, given or not.
    pub fn tolerance(&self) -> f64 {
        let usual = match self.norm() {
            Norm::Error => 1e-2,
            Norm::Characteristic => 1e-7,
        };
        self.tolerance.unwrap_or(usual)
    }
}

/// When plastic materials flow in an implicit step.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Plasticity {
    /// Within the step, whose forces are then those of the returned states.
    Flowing,
    /// After it, as published. Within the step all materials are elastic, so that what flows resists like a fluid of
    /// the viscosity μ dt.
    Lagged,
}

/// What the residual of an implicit step is measured in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Norm {
    /// The error of the step's velocity increments, estimated with the V-cycle, relative to their size; both in the
    /// norm of the nodes' masses. What gravity does in a step counts as the least size.
    Error,
    /// The node-wise characteristic norm, ε (HOT §5.2). It is scaled by stiffness, so it says little about accuracy.
    Characteristic,
}

/// How a step's equations are solved. Newton's method is the default; the others are there to be compared with it
/// (HOT §7).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// Newton's method with a Hessian that turns with the bodies, conjugate gradients preconditioned by HOT's V-cycle.
    Newton,
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
    pub const ALL: [Self; 11] = [
        Self::Newton,
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
