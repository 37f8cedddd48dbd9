//! Explicit MPM: the CPU engine, which runs everything, and the GPU engine for 3D in f32.

pub mod cpu;
pub mod gpu;
