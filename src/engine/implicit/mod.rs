//! Implicit Euler as minimisation (Wang et al. 2020, "Hierarchical Optimization Time Integration for CFL-rate MPM stepping", HOT):
//! the step's Δv minimises E(Δv) = ½ Σ m_i |Δv_i|² + Σ V0 ψ((I + dt ∇v) Fⁿ) − dt Σ m_i g·Δv_i.
//!
//! No GPU here: `gpu::implicit` has the same stages by the same names.

mod admm;
pub mod assembly;
pub mod boundary;
mod cholesky;
mod coarse;
mod descent;
pub mod discretisation;
mod engine;
pub mod friction;
pub mod galerkin;
mod gauss_seidel;
pub mod hierarchy;
mod krylov;
pub(crate) mod lbfgs;
mod line_search;
mod newton;
pub mod objective;
pub mod potential;
pub(crate) mod smoother;
mod solve;
pub mod sparse;
mod spectrum;
pub mod state;
pub mod stencil;
pub mod step;
mod tolerance;
pub mod topology;
pub mod transfer;
pub mod vcycle;
mod verbs;

#[cfg(test)]
mod fixture;
#[cfg(test)]
mod tests;

pub use engine::{FARTHEST_DX, ImplicitEngine};
pub use solve::solve;
