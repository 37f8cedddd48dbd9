//! Triangle meshes: reading them, checking whether they are closed, and sampling their distance.

mod bvh;
mod filled;
mod gltf;
pub mod heightfield;
mod inside;
mod mend;
mod nearest;
pub mod ply;
mod read;
mod sample;
mod sheet;
mod triangles;

pub use filled::filled_volume;
pub use mend::{Mended, mend, mend_sheet};
pub use read::{format, read};
pub use sample::{MAX_SAMPLES, Plan};
pub use triangles::{MeshError, TriangleMesh};

#[cfg(test)]
mod tests;
