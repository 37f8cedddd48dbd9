//! The linear algebra of the implicit step and its minimisation on the device; twin of the solver
//! in `crate::implicit`.
//!
//! `lattice` and `level` define a level of the hierarchy and hold its memory, `stages` lists
//! the dispatches, `hierarchy` builds the levels and the V-cycle, `smoother` their polynomials and
//! sweeps, and `coarse` solves on the last one. `newton` is the default method, `lbfgs` the
//! directions and line search of HOT's, and `minimiser` runs either.

mod coarse;
mod hierarchy;
mod lattice;
pub mod layout;
mod lbfgs;
mod level;
mod minimiser;
#[cfg(test)]
mod minimiser_tests;
mod newton;
#[cfg(test)]
mod operator_tests;
#[cfg(test)]
mod problem_tests;
#[cfg(test)]
mod search_tests;
mod smoother;
pub mod stages;

pub use minimiser::Minimiser;
