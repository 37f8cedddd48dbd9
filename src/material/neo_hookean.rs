//! Compressible neo-Hookean elasticity (Bonet and Wood, "Nonlinear continuum mechanics for finite element analysis",
//! §6.4.3): ψ = ½ μ (tr FᵀF − d) − μ ln J + ½ λ ln² J, τ = μ (F Fᵀ − I) + λ ln J I. Infinite at J = 0, undefined (NaN)
//! below: an inverted particle is a divergence that the engine reports.

use super::lame;
use super::stretch::largest_stretch_squared;
use crate::scene::schema::Elastic;
use crate::sim::linalg::{Matrix, det, double_dot, mul_transpose};
use crate::sim::real::Real;

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NeoHookean<T> {
    /// Lamé's parameters (Pa).
    pub mu: T,
    pub lambda: T,
}

impl<T: Real> NeoHookean<T> {
    pub fn new(elastic: &Elastic) -> Self {
        let (mu, lambda) = lame(elastic);
        Self { mu: T::from_f64(mu), lambda: T::from_f64(lambda) }
    }

    /// ψ(F) (J/m³).
    pub fn energy<const D: usize>(&self, f: &Matrix<T, D>) -> T {
        let ln_j = det(f).ln();
        let stretch = T::HALF * (double_dot(f, f) - T::from_f64(D as f64));
        self.mu * (stretch - ln_j) + T::HALF * self.lambda * ln_j * ln_j
    }

    /// τ(F) (Pa).
    #[inline(always)]
    pub fn kirchhoff<const D: usize>(&self, f: &Matrix<T, D>) -> Matrix<T, D> {
        let ln_j = det(f).ln();
        let mut tau = mul_transpose(f, f);
        for i in 0..D {
            for k in 0..D {
                tau[i][k] *= self.mu;
            }
            tau[i][i] += self.lambda * ln_j - self.mu;
        }
        tau
    }

    /// Bound on the stiffness ρ0 c² (Pa) at F: σ_i² ψ_ii = μ (σ_i² + 1) + λ (1 − ln J); across the axes μ σ_j² is less.
    #[inline(always)]
    pub fn stiffness_at<const D: usize>(&self, f: &Matrix<T, D>) -> T {
        self.mu * (largest_stretch_squared(f) + T::ONE) + self.lambda * (T::ONE - det(f).ln())
    }
}
