//! The discretisation: particles, grid kernels, transfers, time step and diagnostics. No GPU, no runtime, no HTTP.

pub mod collider;
pub mod particles;
pub mod problem;
