//! Compressible neo-Hookean elasticity (Bonet and Wood, "Nonlinear continuum mechanics for finite
//! element analysis", §6.4.3): ψ = ½ μ (tr FᵀF − d) − μ ln J + ½ λ ln² J,
//! τ = μ (F Fᵀ − I) + λ ln J I.
//!
//! ψ is infinite at J = 0 and undefined (NaN) below. An inverted particle is a divergence, which
//! the engine reports.

use super::derivatives::Derivatives;
use super::lame;
use super::parameters::Elastic;
use super::principal::product;
use super::stretch::largest_stretch_squared;
use crate::maths::linalg::{Matrix, Vector, cofactor, det, dot, double_dot, mul, mul_transpose, trace, transpose};
use crate::maths::real::Real;

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
        self.energy_and_pk1(f).0
    }

    /// ψ(F) (J/m³) and P(F) = F⁻ᵀ (2μ E + λ ln J I) (Pa). Both are computed from Green's strain
    /// E = ½ (FᵀF − I), because tr FᵀF − d − 2 ln J would lose half the digits of a small strain.
    /// At J ≤ 0, ψ is infinite and P is meaningless.
    pub fn energy_and_pk1<const D: usize>(&self, f: &Matrix<T, D>) -> (T, Matrix<T, D>) {
        let cofactor = cofactor(f);
        let j = dot(&f[0], &cofactor[0]);
        let mut twice_e = mul(&transpose(f), f);
        for i in 0..D {
            twice_e[i][i] += -T::ONE;
        }
        // J² − 1 = det(I + 2E) − 1 = tr 2E + (the rest).
        let trace = trace(&twice_e);
        let mut rest = T::HALF * (trace * trace - double_dot(&twice_e, &twice_e));
        if D == 3 {
            rest += det(&twice_e);
        }
        let dilation = trace + rest;
        let ln_j2 = if dilation.abs() < T::HALF { dilation.ln_1p() } else { T::TWO * j.ln() };
        let energy = T::HALF * self.mu * (trace - ln_j2) + T::from_f64(0.125) * self.lambda * ln_j2 * ln_j2;
        let mut second = twice_e.map(|row| row.map(|e| self.mu * e));
        for i in 0..D {
            second[i][i] += T::HALF * self.lambda * ln_j2;
        }
        let pk1 = mul(&cofactor, &second).map(|row| row.map(|x| x / j));
        (if j > T::ZERO { energy } else { T::ONE / T::ZERO }, pk1)
    }

    /// ψ_i = μ (σ_i − 1/σ_i) + λ ln J/σ_i.
    pub fn derivatives<const D: usize>(&self, sigma: &Vector<T, D>) -> Derivatives<T, D> {
        let mut f = [[T::ZERO; D]; D];
        for i in 0..D {
            f[i][i] = sigma[i];
        }
        let (energy, pk1) = self.energy_and_pk1(&f);
        let ln_j = product(sigma).ln();
        let (mut gradient, mut hessian) = ([T::ZERO; D], [[T::ZERO; D]; D]);
        for i in 0..D {
            gradient[i] = pk1[i][i];
            for k in 0..D {
                hessian[i][k] = self.lambda / (sigma[i] * sigma[k]);
            }
            hessian[i][i] += self.mu + (self.mu - self.lambda * ln_j) / (sigma[i] * sigma[i]);
        }
        Derivatives { energy, gradient, hessian }
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

    /// Bound on the stiffness ρ0 c² (Pa) at F: σ_i² ψ_ii = μ (σ_i² + 1) + λ (1 − ln J). Across the
    /// axes, μ σ_j² is less.
    #[inline(always)]
    pub fn stiffness_at<const D: usize>(&self, f: &Matrix<T, D>) -> T {
        self.mu * (largest_stretch_squared(f) + T::ONE) + self.lambda * (T::ONE - det(f).ln())
    }
}
