//! Rust twins of the structs in `wgsl/explicit/layout.wgsl` and `wgsl/shared/structs.wgsl`;
//! `tests/twins/layout.rs` compares every offset with naga's.

use bytemuck::{Pod, Zeroable};
use gridfall_core::sim::pair;

/// Nodes of one grid in a block.
pub const BLOCK_NODES: usize = 64;
/// Values a node: mass, momentum, and what fills it.
pub const NODE_CHANNELS: usize = 5;
/// v and B of a particle.
pub const VELOCITY_CHANNELS: usize = 12;
/// What a particle remembers of contact: its collider, radius and stretch (`wgsl/explicit/touching.wgsl`).
pub const TOUCH_CHANNELS: usize = 5;
/// Blocks of room around a domain with walls: particles may stand a little beyond a wall, and
/// scatter further.
pub const PAD_BLOCKS: usize = 2;
/// Entries of the block table that are looked at before a block is given up (`PROBES` in the shaders).
pub const TABLE_PROBES: u32 = 128;
/// Most particles in a work item (`WORK_MAX` in the shaders).
pub const WORK_MAX: usize = 1024;

/// Most channels of a buffer of states (`PART_CHANNELS` in the shaders).
pub const PART_CHANNELS: usize = 5;
/// Buffers with v and B of particles by id, and their channels.
pub const MOTION: [(&str, usize); 3] = [
    ("frame_velocity", PART_CHANNELS),
    ("frame_velocity_1", PART_CHANNELS),
    ("frame_velocity_2", VELOCITY_CHANNELS - 2 * PART_CHANNELS),
];

/// Of so many channels of a deformation, those in its first buffer, and in the other.
pub fn deformation_parts(channels: usize) -> [usize; 2] {
    let first = channels.min(PART_CHANNELS);
    [first, channels - first]
}

/// Particles whose sums `measure` makes one record of, and the pairs of numbers in it (`PART` and `RECORD` in the
/// shader).
pub const PART: usize = 2048;
pub const RECORD: usize = 11;
/// Numbers of a particle that `select` copies before those of its deformation (`PLAIN` in the shader).
pub const PLAIN: usize = 8;

/// Particles whose states inside a frame lie together, channel by channel (`wgsl/explicit/state_io.wgsl`).
pub const STATE_GROUP: usize = 32;

/// Place of the first channel of a particle's state inside a frame; others follow at multiples of [`STATE_GROUP`].
pub fn place_of_state(particle: usize, channels: usize) -> usize {
    particle / STATE_GROUP * STATE_GROUP * channels + particle % STATE_GROUP
}

/// Most layers of blocks: bodies with contact of their own, and one for all others.
pub const MOST_FIELDS: usize = pair::MOST + 1;

/// Copies of the surfaces' sums, which the host adds up (`REPLICAS` in the shaders).
pub const REPLICAS: usize = 16;
/// Units of such a sum per fixed-point unit of momentum (`REACTION_UNITS` in the shaders).
pub const REACTION_UNITS: f64 = 64.0;

pub const HALT_BLOCKS: u32 = 1;
pub const HALT_REPLAN: u32 = 2;
pub const HALT_ERROR: u32 = 4;
pub const HALT_MASS: u32 = 8;
pub const HALT_MOMENTUM: u32 = 16;

pub const ERROR_NAN: u32 = 1;
pub const ERROR_CFL: u32 = 2;
pub const ERROR_DOMAIN: u32 = 4;
pub const ERROR_RANGE: u32 = 8;

/// Bytes of an indirect dispatch.
pub const DISPATCH_BYTES: usize = 16;

/// Indirect dispatches, in the order of `GROUPS_*` in `wgsl/explicit/bin.wgsl`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum Groups {
    /// A workgroup a work item.
    Work = 0,
    /// A workgroup an active block.
    Blocks = 1,
}
pub const DISPATCHES: usize = 2;

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
    pub mass_scale: f32,
    pub momentum_scale: f32,
    pub soft_shift: f32,
    pub first_step: u32,
    pub soft_demand: f32,
    pub soft_growth: f32,
    pub live: u32,
    pub cell_scale: f32,
    pub first_kick: f32,
    pub last_kick: f32,
    pub last_step: u32,
    pub end_dt: f32,
    pub fields: u32,
    pub sided: u32,
    pub resets: u32,
    pub steps: u32,
    pub lowest: [f32; 3],
    pub table_shift: u32,
    pub highest: [f32; 3],
    pub spare1: u32,
    pub outer_low: [f32; 3],
    pub spare2: u32,
    pub outer_high: [f32; 3],
    pub spare3: u32,
    pub walls: [[f32; 4]; 6],
    pub contacts: [[f32; 4]; MOST_FIELDS],
}

#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Report {
    pub halt: u32,
    pub asks: u32,
    pub error: u32,
    pub error_particle: u32,
    pub max_shift: u32,
    pub max_speed: u32,
    pub max_demand: u32,
    pub started: u32,
    pub step: u32,
    pub ran: u32,
    pub blocks: u32,
    pub wanted: u32,
    pub needed: u32,
    pub work: u32,
    pub work_count: u32,
    pub cursor: u32,
    pub isolated: u32,
    pub finished: u32,
}

impl Report {
    /// Before a frame's first stage.
    pub fn frame_start() -> Self {
        Self { error_particle: u32::MAX, ..Self::default() }
    }
}

#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub struct Body {
    pub mass: f32,
    pub volume: f32,
    pub material: u32,
    pub demand: f32,
    pub rate: f32,
    pub full: f32,
    pub crowded: f32,
    pub stiffness: f32,
    pub damping: f32,
    pub spacing: f32,
    pub spare0: u32,
    pub spare1: u32,
}

#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub struct Material {
    pub model: u32,
    pub a: f32,
    pub b: f32,
    pub c: f32,
    pub d: f32,
    pub e: f32,
    pub damping: f32,
    pub spare: u32,
}

#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub struct SdfOp {
    pub r0: [f32; 4],
    pub r1: [f32; 4],
    pub r2: [f32; 4],
    pub size: [f32; 3],
    pub code: u32,
    pub grid: [u32; 4],
}

#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub struct Collider {
    pub first: u32,
    pub count: u32,
    pub kind: u32,
    pub friction: f32,
    pub slack: f32,
    pub touches: u32,
    pub spare0: u32,
    pub spare1: u32,
}

#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub struct Pose {
    pub r0: [f32; 4],
    pub r1: [f32; 4],
    pub r2: [f32; 4],
    pub linear: [f32; 4],
    pub angular: [f32; 4],
    pub center: [f32; 4],
}

#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub struct Work {
    pub block: u32,
    pub start: u32,
    pub count: u32,
    pub touched: u32,
    pub at: [i32; 3],
    pub layer: u32,
}
