//! The implicit step on the device (HOT), 3D, f32; twin of `crate::implicit`. Sums over particles
//! are gathered, never scattered, in an order that does not depend on scheduling.

mod buffers;
mod contact;
mod engine;
pub mod interface;
pub mod layout;
pub mod linear;
mod particles;
mod readback;
pub mod stages;
mod step;

pub use engine::supports;
pub use layout::Tangent;
pub use readback::{LinkReading, NodeReading, ParticleReading, SortReading, SystemReading};
pub use step::DeviceStep;
