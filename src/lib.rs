//! Gridfall: a headless, GPU-first compute service for the material point method (MPM).
//!
//! Dependencies point down only; `docs/ARCHITECTURE.md` draws the picture and `tests/tidy.rs` holds it.

pub mod backend;
pub mod bench;
pub mod cli;
pub mod cpu;
pub mod engine;
pub mod gpu;
pub mod http;
pub mod implicit;
pub mod jobs;
pub mod material;
pub mod provenance;
pub mod recording;
pub mod run;
pub mod scene;
pub mod sim;
pub mod store;
pub mod verify;
