//! What the GPU engines share: the device, its memory, and programs. Only this folder and the
//! engines' `gpu` folders name wgpu, and nothing here knows an engine.

pub(crate) mod device;
pub(crate) mod memory;
pub mod program;
mod source;
mod variant;

pub use device::{AdapterSummary, Gpu, WORKGROUP, WORKGROUP_BYTES, list_adapters};
pub use program::{STORAGE_BUFFERS, Shader};
pub use source::{file, files};
pub use variant::{Fills, Surroundings, Variant, law_number};
