//! What the GPU engines share. Only this folder and the engines' `gpu` folders name wgpu.

pub(crate) mod device;

pub use device::{AdapterSummary, Gpu, list_adapters};
