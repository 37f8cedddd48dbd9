//! What a simulation is made of, without knowing how a scene is written or which device computes it.
//!
//! * [`maths`]: scalars, small matrices, decompositions;
//! * [`material`]: constitutive laws and their parameters;
//! * [`sim`]: particles, grid kernels, colliders, time step, diagnostics, predicted cost.

pub mod material;
pub mod maths;
pub mod sim;
