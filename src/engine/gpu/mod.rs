//! What the GPU engines share: the device, its memory, and programs. Only this folder and the
//! engines' `gpu` folders name wgpu, and nothing here knows an engine.

pub(crate) mod device;
pub(crate) mod memory;
pub mod program;
mod source;

pub use device::{AdapterSummary, Gpu, WORKGROUP, WORKGROUP_BYTES, list_adapters};
pub use program::{STORAGE_BUFFERS, Shader, Variant};
pub use source::{file, files};
