//! Implicit Euler as minimisation (Wang et al. 2020, "Hierarchical Optimization Time Integration
//! for CFL-rate MPM stepping", HOT): the step's Δv minimises E(Δv) = ½ Σ m_i |Δv_i|² + Σ V0
//! ψ((I + dt ∇v) Fⁿ) − dt Σ m_i g·Δv_i.
//!
//! `physics` makes a step's objective and `solver` minimises it, knowing nothing of particles.
//! `engine` runs frames over the stages of a step, which `cpu` has in f64 and `gpu` in f32.

mod cpu;
pub(crate) mod engine;
pub mod gpu;
pub mod physics;
pub mod solver;
mod step;

pub use engine::ImplicitEngine;
