//! A step as a minimisation problem: its grid, surfaces, energy, gradient and Hessian.

mod assembly;
mod boundary;
mod contact;
pub mod discretisation;
mod friction;
pub mod potential;
pub mod state;
mod stencil;
mod topology;
pub mod transfer;
