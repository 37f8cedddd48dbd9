//! A step as a minimisation problem: its grid, surfaces, energy, gradient and Hessian.

pub mod assembly;
pub mod boundary;
pub mod discretisation;
pub mod friction;
pub mod potential;
pub mod state;
pub mod stencil;
pub mod topology;
pub mod transfer;
