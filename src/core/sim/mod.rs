//! The discretisation: particles, grid kernels, transfers, time step and diagnostics. No GPU, no runtime, no HTTP.

pub mod collider;
pub mod contact;
pub mod cost;
pub mod diagnostics;
pub mod divergence;
#[cfg(test)]
mod fixture;
pub mod kernel;
pub mod moments;
pub mod particles;
pub mod reaction;
pub mod settings;
pub mod setup;
pub mod source;
pub mod stats;
pub mod timestep;
