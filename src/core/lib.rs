//! What a simulation consists of, independent of the scene format and of the device that runs it.
//!
//! * [`maths`]: scalars, small matrices, decompositions;
//! * [`material`]: constitutive laws and their parameters;
//! * [`sim`]: particles, interpolation kernels, colliders, the time step, diagnostics, predicted
//!   cost.

pub mod material;
pub mod maths;
pub mod sim;
