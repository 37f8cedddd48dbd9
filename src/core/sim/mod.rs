//! The discretisation and the state of a simulation: settings, particles, interpolation kernels,
//! colliders, sources, the stable time step, diagnostics and predicted cost.

pub mod collider;
pub mod contact;
pub mod cost;
pub mod diagnostics;
pub mod divergence;
pub mod excerpt;
#[cfg(test)]
mod fixture;
pub mod inlet;
pub mod kernel;
pub mod moments;
pub mod notice;
pub mod pair;
pub mod particles;
pub mod reaction;
pub mod settings;
pub mod setup;
pub mod side;
pub mod source;
pub mod stats;
pub mod surface;
pub mod timestep;
pub mod touch;
pub mod volume;
