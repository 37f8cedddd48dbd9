//! The discretisation: particles, grid kernels, transfers, time step and diagnostics. No GPU, no runtime, no HTTP.

pub mod collider;
pub mod contact;
pub mod cost;
pub mod diagnostics;
pub mod divergence;
pub mod kernel;
pub mod moments;
pub mod particles;
pub mod problem;
pub mod reaction;
pub mod settings;
pub mod source;
pub mod stats;
pub mod timestep;
