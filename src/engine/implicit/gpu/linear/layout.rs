//! Rust twins of the structs in `wgsl/implicit/linear/`; `tests/twins/layout.rs` compares every offset
//! with naga's.

use bytemuck::{Pod, Zeroable};

/// Of `level.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Level {
    pub low: [i32; 3],
    pub rows: u32,
    pub blocks: [u32; 3],
    pub stride: u32,
    pub period: [i32; 3],
    pub grids: u32,
    pub groups: u32,
    pub degree: u32,
    pub range: f32,
    pub sliding: u32,
    pub factor: [i32; 3],
    pub spare: u32,
}

/// Of `state.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct State {
    pub energy: [f32; 2],
    pub residual2: f32,
    pub slope: f32,
    pub alpha: f32,
    pub halvings: u32,
    pub flags: u32,
    pub spare: u32,
}

/// Of `gauss_seidel.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Colour {
    pub colour: [i32; 3],
    pub half: u32,
    pub counts: [i32; 3],
    pub spare: u32,
}

/// Bits of [`State::flags`].
pub const ACCEPTED: u32 = 1;
pub const INDEFINITE: u32 = 2;
pub const DROPPED: u32 = 4;
pub const BROKEN: u32 = 8;

/// Of `cg.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Cg {
    pub zr: f32,
    pub beta: f32,
    pub alpha: f32,
    pub count: u32,
    pub size2: f32,
    pub mass: f32,
    pub motion2: f32,
    pub pap: f32,
}

/// Of `lanczos.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Lanczos {
    pub count: u32,
    pub rz: f32,
    pub spare0: u32,
    pub spare1: u32,
    pub alpha: [f32; 16],
    pub beta: [f32; 16],
}
