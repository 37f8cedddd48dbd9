//! The engines: explicit and implicit MPM, each on the CPU and on the GPU, and which of them runs a problem.
//!
//! Only the `gpu` folders name wgpu.

pub mod choice;
mod contract;
pub mod explicit;
pub mod gpu;
pub mod implicit;
mod keys;
pub mod programs;
mod state;

pub use contract::{Backend, Control, Engine, EngineError, FrameStats, NoControl, Pending, Solve, StateError, View};
