//! The CPU engine: the reference for the GPU, the fallback, and the only one for 2D, f64, cubic, linear and PIC.
//!
//! Stages have the names of the shaders in `wgsl/`: bin, p2g, grid_update, g2p and the fused g2p2g.

mod bin;
mod chunk;
mod constants;
mod engine;
mod fill;
mod flow;
mod g2p;
mod grid_update;
mod interpolation;
mod isolated;
mod narrow;
mod near;
mod p2g;
mod pairs;
mod saved;
mod sides;
mod simulation;
mod stages;
mod tables;
mod tile;
mod touch;
mod walls;

pub use engine::CpuEngine;
pub use grid_update::NodeState;
pub use stages::{Moved, Stages, stages};
