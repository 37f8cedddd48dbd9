//! Minimisation of an [`objective::Objective`]: descent with L-BFGS or Newton's method, Krylov
//! solvers, the Galerkin hierarchy and its V-cycle, ADMM. `policy` decides when to stop, rebuild
//! and retreat, here and on the GPU.

mod admm;
mod coarse;
mod condensed;
mod descent;
pub(crate) mod factor;
mod galerkin;
mod gauss_seidel;
pub(crate) mod hierarchy;
pub(crate) mod krylov;
mod lbfgs;
mod line_search;
mod newton;
pub mod objective;
pub(crate) mod policy;
pub(crate) mod smoother;
mod solve;
pub mod sparse;
mod spectrum;
mod tolerance;
pub(crate) mod turning;
pub(crate) mod vcycle;
pub(crate) mod verbs;

#[cfg(test)]
mod fixture;
#[cfg(test)]
mod tests;

pub(crate) use solve::solve;
