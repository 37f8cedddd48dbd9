//! Rust twins of the structs in `wgsl/implicit/layout.wgsl`; `tests/twins/layout.rs` compares every
//! offset with naga's.

use bytemuck::{Pod, Zeroable};

pub const ERROR_NAN: u32 = 1;
pub const ERROR_DOMAIN: u32 = 4;

/// Channels of what a particle remembers of contact: its collider, radius and stretch.
pub const TOUCH_CHANNELS: usize = 5;
/// In the channel of the collider: it has met no faces yet (`UNMET` in the shaders).
pub const UNMET: f32 = -1.0;
/// In linear.w of a pose: the collider is there, and was not when particles last met faces.
pub const APPEARS: f32 = 2.0;
/// Values a particle and face in `press`: force and stiffness.
pub const PRESS_CHANNELS: usize = 9;
/// Entries of `holding`: what has changed, mass, springs by body.
pub const HOLDING_LIMITS: usize = 0;
pub const HOLDING_GRIPS: usize = 1;
pub const HOLDING_MASS: usize = 2;
pub const HOLDING_BODIES: usize = 3;

/// The derivative that the matrix is made of, see [`crate::implicit::solver::objective::Objective`].
#[repr(u32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tangent {
    /// At the trial: that of `hessian`.
    Trial,
    /// At the step's start, turned to where the trial is: `tangent` of elastic bodies.
    Turned,
    /// `tangent` of bodies that flow within the step.
    Flowing,
}

#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub struct Params {
    pub blocks: [u32; 3],
    pub particles: u32,
    pub cells: [f32; 3],
    pub dx: f32,
    pub gravity: [f32; 3],
    pub dt: f32,
    pub pad: [i32; 3],
    pub capacity: u32,
    pub periodic: [u32; 3],
    pub colliders: u32,
    pub room: u32,
    pub stride: u32,
    pub rows: u32,
    pub mass_floor: f32,
    pub tangent: u32,
    pub flowing: u32,
    pub touch: u32,
    pub links: u32,
    pub link_room: u32,
    pub mass_unit: f32,
    pub spare0: u32,
    pub spare1: u32,
    pub walls: [[f32; 4]; 6],
}

#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Report {
    pub error: u32,
    pub error_particle: u32,
    pub max_shift: u32,
    pub max_speed: u32,
    pub blocks: u32,
    pub rows: u32,
    pub separating: u32,
    pub released: u32,
    pub rubbing: u32,
    pub most_strain: u32,
    pub links: u32,
    pub spare0: u32,
}

#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub struct Sweep {
    pub r0: [f32; 4],
    pub r1: [f32; 4],
    pub r2: [f32; 4],
}

#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub struct Touch {
    pub normal: [f32; 4],
    pub velocity: [f32; 4],
    pub arm: [f32; 4],
    pub impulse: [f32; 4],
}

#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Link {
    pub particle: u32,
    pub collider: u32,
    pub body: u32,
    pub grip: u32,
    pub limit: f32,
}
