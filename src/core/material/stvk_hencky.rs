//! St. Venant–Kirchhoff elasticity in Hencky (logarithmic) strain: with ε_i = ln σ_i,
//! ψ = μ Σ ε_i² + ½ λ (Σ ε_i)², τ_i = 2μ ε_i + λ Σ ε_i.
//!
//! Plastic laws build on it, because a return map along a straight line in ε is exact
//! (Klár et al. 2016, "Drucker–Prager elastoplasticity for sand animation", §5).

use super::lame;
use super::parameters::Elastic;
use super::principal::{Principal, logarithms, total};
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

    /// τ (Pa) at the strain ε.
    #[inline(always)]
    pub(super) fn stress<const D: usize>(&self, strain: &Vector<T, D>) -> Vector<T, D> {
        let across = self.lambda * total(strain);
        let mut tau = *strain;
        for i in 0..D {
            tau[i] = T::TWO * self.mu * strain[i] + across;
        }
        tau
    }

    /// [`Principal::stiffness`] at the strain ε. Along the axes σ_i² ψ_ii = λ + 2μ − τ_i. Across them
    /// 2μ Δ/(1 − e^−2Δ) ≤ μ (1 + 2Δ), Δ the difference of two strains.
    #[inline(always)]
    pub(super) fn stiffness_at<const D: usize>(&self, strain: &Vector<T, D>) -> T {
        let (mut low, mut high) = (strain[0], strain[0]);
        for i in 1..D {
            low = low.min(strain[i]);
            high = high.max(strain[i]);
        }
        let two_mu = T::TWO * self.mu;
        let least = two_mu * low + self.lambda * total(strain);
        let across = self.mu * (T::ONE + T::TWO * (high - low));
        (self.lambda + two_mu - least).max(across)
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

    #[inline(always)]
    fn kirchhoff<const D: usize>(&self, sigma: &Vector<T, D>, _plastic: T) -> Vector<T, D> {
        self.stress(&logarithms(sigma))
    }

    #[inline(always)]
    fn stiffness<const D: usize>(&self, sigma: &Vector<T, D>, _plastic: T) -> T {
        self.stiffness_at(&logarithms(sigma))
    }
}
