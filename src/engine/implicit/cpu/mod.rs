//! The implicit engine on the CPU.

mod engine;

pub use engine::ImplicitEngine;
