//! Implicit Euler as minimisation (Wang et al. 2020, "Hierarchical Optimization Time Integration for CFL-rate MPM stepping", HOT):
//! the step's Δv minimises E(Δv) = ½ Σ m_i |Δv_i|² + Σ V0 ψ((I + dt ∇v) Fⁿ) − dt Σ m_i g·Δv_i.
//!
//! No GPU here: `gpu::implicit` has the same stages by the same names.

pub mod assembly;
pub mod boundary;
pub mod discretisation;
pub mod friction;
pub mod objective;
pub mod potential;
pub mod sparse;
pub mod state;
pub mod stencil;
pub mod step;
pub mod topology;
pub mod transfer;
