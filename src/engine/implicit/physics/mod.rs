//! A step as an objective: what particles and surfaces make of the grid, its energy, gradient and Hessian.

pub mod assembly;
pub mod boundary;
pub mod discretisation;
pub mod friction;
pub mod potential;
pub mod state;
pub mod stencil;
pub mod topology;
pub mod transfer;
