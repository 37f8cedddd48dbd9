//! The GPU engine: explicit MPM in 3D, f32, in fused G2P2G compute shaders (`wgsl/`).
//!
//! The only module that names wgpu. `device` finds and opens adapters, `shaders` composes WGSL, `layout` holds the twins of
//! shader structs, `buffers` owns device memory, `upload` turns a problem into device data, `stages` records dispatches,
//! `engine` runs frames and answers for overflow, re-planning and errors, `readback` brings states home.

mod buffers;
#[cfg(test)]
mod derivative_tests;
mod device;
mod engine;
pub mod implicit;
#[cfg(test)]
mod law_tests;
pub mod layout;
mod readback;
pub mod shaders;
mod stages;
pub mod timing;
mod upload;

pub use device::{AdapterSummary, Gpu, list_adapters};
pub use engine::{GpuEngine, Staged, supports};
pub use readback::GridNode;
