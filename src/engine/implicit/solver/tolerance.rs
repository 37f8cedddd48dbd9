//! When a step has converged, and how accurately linear systems are solved on the way.

use super::objective::{NodeVectors, Objective};
use super::verbs::{norm, scaled_norm};

/// L2 norm of the gradient at which Gast et al. stop (kg m/s), as chosen for all scenes in HOT
/// §7.1, where the other methods stop at ε = 1e-7.
const GLOBAL: f64 = 1e-3;
/// The ε to which [`GLOBAL`] belongs; it scales in proportion with ε.
const REFERENCE: f64 = 1e-7;

/// The stopping test.
#[derive(Clone, Copy, Debug)]
pub enum Tolerance {
    /// ε of the node-wise characteristic norm (HOT §5.2).
    Characteristic(f64),
    /// The plain norm of the gradient (Gast et al. 2015).
    Global(f64),
}

impl Tolerance {
    /// Of the characteristic norm.
    pub fn characteristic(epsilon: f64) -> Self {
        Self::Characteristic(epsilon)
    }

    /// Of the plain norm, for the same setting: 10⁻³ kg m/s at ε = 1e-7.
    pub fn global(epsilon: f64) -> Self {
        Self::Global(GLOBAL * epsilon / REFERENCE)
    }

    /// Whether a gradient, whose residual in the characteristic norm is given, is small enough.
    pub fn reached<const D: usize>(&self, gradient: &NodeVectors<D>, residual: f64) -> bool {
        match *self {
            Self::Characteristic(epsilon) => residual <= epsilon,
            Self::Global(tolerance) => norm(gradient) <= tolerance,
        }
    }

    /// Factor by which a Newton step's linear solver shall reduce sqrt(rᵀP r), P the
    /// preconditioner, relative to its start: min(½, sqrt(max(size, τ))). For the characteristic
    /// norm size = sqrt(rᵀP r) and τ belongs to the stiffest material of the scene (HOT §5.3); Gast
    /// et al. take the plain norm and tolerance.
    pub fn reduction<const D: usize>(
        &self,
        objective: &dyn Objective<D>,
        gradient: &NodeVectors<D>,
        start: f64,
    ) -> f64 {
        let size_and_tau = match *self {
            Self::Characteristic(epsilon) => {
                let stiffest = objective.scales().iter().fold(0.0f64, |m, &s| m.max(s));
                start.sqrt().max(epsilon * (gradient.len() as f64).sqrt() * stiffest)
            }
            Self::Global(tolerance) => norm(gradient).max(tolerance),
        };
        size_and_tau.sqrt().min(0.5)
    }
}

/// sqrt(Σ |g_i|²/scale_i² / n), which is at most ε when converged.
pub fn residual<const D: usize>(objective: &dyn Objective<D>, gradient: &NodeVectors<D>) -> f64 {
    scaled_norm(gradient, objective.scales())
}
