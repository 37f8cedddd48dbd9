//! The explicit GPU engine: 3D, f32, in fused G2P2G compute shaders (`wgsl/`).
//!
//! `shaders` composes WGSL, `layout` holds the twins of shader structs, `buffers` owns device memory, `upload` turns a setup and its
//! particles into device data, `stages` records dispatches, `engine` runs frames and answers for overflow, re-planning and errors,
//! `readback` brings states home.

pub(crate) mod buffers;
#[cfg(test)]
mod derivative_tests;
mod engine;
#[cfg(test)]
mod law_tests;
pub mod layout;
pub(crate) mod readback;
pub mod shaders;
mod stages;
pub mod timing;
pub(crate) mod upload;

pub use engine::{GpuEngine, Staged, supports};
pub use readback::GridNode;
