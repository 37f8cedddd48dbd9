//! The explicit GPU engine: 3D, f32, in fused G2P2G compute shaders (`wgsl/explicit/`).
//!
//! `layout` holds the twins of shader structs, `buffers` says what device memory there is, `scene`
//! and `upload` turn a scene and its particles into device data, `stages` lists the dispatches of a
//! frame, `engine` plans frames, `segment` runs equal steps of one and answers for overflow, `failure`
//! for errors, `load` and `readback` bring states to the device and home, `view` what is recorded of frames,
//! `timing` and `traffic` say what a step costs, and `staged` stops between the stages of a step, so that they
//! and the `bookkeeping` can be looked at.

mod bookkeeping;
mod buffers;
#[cfg(test)]
mod derivative_tests;
mod engine;
mod failure;
#[cfg(test)]
mod flowing_tests;
#[cfg(test)]
mod law_tests;
pub mod layout;
mod load;
mod readback;
mod saved;
pub(crate) mod scene;
mod segment;
mod staged;
pub mod stages;
mod table;
pub mod timing;
mod traffic;
pub(crate) mod upload;
mod view;

pub use bookkeeping::{Blocks, Bookkeeping};
pub use engine::GpuEngine;
pub use readback::GridNode;
pub use staged::Staged;
pub use traffic::{Moved, Traffic};

use gridfall_core::sim::setup::{Kernel, Precision, Setup, Transfer};

/// Names of all programs.
pub fn programs() -> Vec<&'static str> {
    [stages::FRAME_START, stages::STEP, stages::FRAME_END]
        .concat()
        .into_iter()
        .map(|(name, _)| name)
        .chain(view::PROGRAMS)
        .collect()
}

/// Whether the GPU engine can run a problem at all; the reason if not.
pub fn supports(setup: &Setup) -> Result<(), String> {
    if setup.dimension != 3 {
        return Err("the GPU engine is 3D only".into());
    }
    if !matches!(setup.kernel, Kernel::Compact | Kernel::Quadratic) {
        return Err("the GPU engine has the compact and the quadratic kernel".into());
    }
    if !upload::is_numbered(setup) {
        return Err("the domain has more blocks of 4³ cells than the GPU engine can number (2³¹)".into());
    }
    if setup.transfer == Transfer::Pic {
        return Err("the GPU engine has the transfers apic, mls and mls-published".into());
    }
    if setup.precision != Precision::F32 {
        return Err("the GPU engine is f32 only".into());
    }
    Ok(())
}
