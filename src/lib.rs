//! Gridfall: a headless, GPU-first compute service for the material point method (MPM).
//!
//! This package is the command line, the known answers and the measurements. What it drives lies in the crates of the workspace;
//! `docs/ARCHITECTURE.md` draws the map.

pub mod bench;
pub mod cli;
pub mod verify;
