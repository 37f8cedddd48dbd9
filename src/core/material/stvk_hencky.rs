//! St. Venant–Kirchhoff elasticity in Hencky (logarithmic) strain: with ε_i = ln σ_i,
//! ψ = μ Σ ε_i² + ½ λ (Σ ε_i)², τ_i = 2μ ε_i + λ Σ ε_i.
//!
//! Plastic laws build on it, because a return map along a straight line in ε is exact
//! (Klár et al. 2016, "Drucker–Prager elastoplasticity for sand animation", §5).

use super::lame;
use super::parameters::Elastic;
use super::principal::Principal;
use crate::maths::linalg::{Matrix, Vector};
use crate::maths::real::Real;

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StvkHencky<T> {
    /// Lamé's parameters (Pa).
    pub mu: T,
    pub lambda: T,
}

impl<T: Real> StvkHencky<T> {
    pub fn new(elastic: &Elastic) -> Self {
        let (mu, lambda) = lame(elastic);
        Self { mu: T::from_f64(mu), lambda: T::from_f64(lambda) }
    }

    /// λ + 2μ/d (Pa).
    pub(super) fn bulk(&self, dimension: usize) -> T {
        self.lambda + T::TWO * self.mu / T::from_i32(dimension as i32)
    }

    /// ∂τ_i/∂ε_j = 2μ δ_ij + λ (Pa).
    pub(super) fn tangent<const D: usize>(&self) -> Matrix<T, D> {
        let mut tangent = [[self.lambda; D]; D];
        for i in 0..D {
            tangent[i][i] += T::TWO * self.mu;
        }
        tangent
    }
}

impl<T: Real> Principal<T> for StvkHencky<T> {
    const PLASTIC: bool = false;

    fn energy<const D: usize>(&self, sigma: &Vector<T, D>, _plastic: T) -> T {
        let strain = sigma.map(T::ln);
        let trace = strain.iter().copied().sum::<T>();
        self.mu * strain.iter().map(|&e| e * e).sum::<T>() + T::HALF * self.lambda * trace * trace
    }

    fn returned_tangent<const D: usize>(&self, _sigma: &Vector<T, D>, _plastic: T) -> Matrix<T, D> {
        self.tangent()
    }

    fn kirchhoff<const D: usize>(&self, sigma: &Vector<T, D>, _plastic: T) -> Vector<T, D> {
        let strain = sigma.map(T::ln);
        let trace = strain.iter().copied().sum::<T>();
        strain.map(|e| T::TWO * self.mu * e + self.lambda * trace)
    }

    /// Along the axes σ_i² ψ_ii = λ + 2μ − τ_i. Across them 2μ Δ/(1 − e^−2Δ) ≤ μ (1 + 2Δ), Δ the
    /// difference of two strains.
    fn stiffness<const D: usize>(&self, sigma: &Vector<T, D>, plastic: T) -> T {
        let (mut low, mut high) = (sigma[0], sigma[0]);
        for s in sigma {
            low = low.min(*s);
            high = high.max(*s);
        }
        let tau = self.kirchhoff(sigma, plastic);
        let least = tau.iter().copied().fold(tau[0], T::min);
        let across = self.mu * (T::ONE + T::TWO * (high / low).ln());
        (self.lambda + T::TWO * self.mu - least).max(across)
    }
}
