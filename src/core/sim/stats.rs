//! What happened in a frame, besides the particles.

use serde::{Deserialize, Serialize};

use super::reaction::Reaction;

/// What happened in one frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FrameStats {
    pub steps: u64,
    /// Mean step (s); 0 for frame 0.
    pub dt_s: f64,
    /// Particles that were reset because they were alone on their nodes.
    pub isolated_reset: u64,
    /// Mean force and torque on every surface, in the order of [`super::reaction`]; empty for
    /// frame 0.
    pub reactions: Vec<Reaction>,
    /// The steps of an implicit engine, in order; empty for an explicit one.
    pub solves: Vec<Solve>,
}

/// Convergence of one implicit step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Solve {
    /// Time at the step's end (s).
    pub time_s: f64,
    pub dt_s: f64,
    /// Outer iterations: Newton or quasi-Newton steps.
    pub iterations: u32,
    /// Iterations of the linear solvers inside the outer iterations; a V-cycle counts as one.
    pub inner_iterations: u32,
    /// What is left, in the norm of the tolerance: the estimated error of Δv relative to its size, or
    /// ε sqrt(Σ |r_i|² / tol_i² / n), the residual in the characteristic norm (HOT §5.2).
    pub residual: f64,
    /// Halvings of the line search.
    pub halvings: u32,
    /// Levels of the hierarchy; 1 without one.
    pub levels: u32,
    /// Non-zero blocks of the finest matrix; 0 without a matrix.
    pub nonzeros: u64,
    pub converged: bool,
}
