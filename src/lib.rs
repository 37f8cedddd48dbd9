//! Gridfall: a headless, GPU-first compute service for the material point method (MPM).
//!
//! This package holds the command line, the verification cases and the benchmarks. Everything else
//! is in the crates of the workspace; `docs/ARCHITECTURE.md` has the map.

pub mod bench;
pub mod cli;
pub mod laboratory;
pub mod verify;
