//! Explicit MPM.

pub mod cpu;
