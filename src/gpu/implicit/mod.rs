//! The implicit step on the device (HOT), 3D, f32; twin of `crate::implicit`. Sums over particles are gathered, never scattered, in an
//! order that does not depend on scheduling.

pub mod interface;
