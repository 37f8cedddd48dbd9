//! Fixed corotated elasticity (Stomakhin, Howes, Schroeder and Teran 2012, "Energetically consistent invertible
//! elasticity"): ψ = μ Σ (σ_i − 1)² + ½ λ (J − 1)², P = 2μ (F − R) + λ (J − 1) J F⁻ᵀ. Finite and restoring for every F,
//! inverted ones included.

use super::lame;
use super::principal::{Principal, product};
use super::stretch::largest_stretch_squared;
use crate::scene::schema::Elastic;
use crate::sim::linalg::{Matrix, Vector, add_scaled, det, mul_transpose};
use crate::sim::real::Real;
use crate::sim::svd::{polar_rotation, svd};

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FixedCorotated<T> {
    /// Lamé's parameters (Pa).
    pub mu: T,
    pub lambda: T,
}

impl<T: Real> FixedCorotated<T> {
    pub fn new(elastic: &Elastic) -> Self {
        let (mu, lambda) = lame(elastic);
        Self { mu: T::from_f64(mu), lambda: T::from_f64(lambda) }
    }

    /// ψ(F) (J/m³).
    pub fn energy<const D: usize>(&self, f: &Matrix<T, D>) -> T {
        Principal::energy(self, &svd(f).sigma, T::ZERO)
    }

    /// τ(F) (Pa).
    pub fn kirchhoff<const D: usize>(&self, f: &Matrix<T, D>) -> Matrix<T, D> {
        self.kirchhoff_with_rotation(f, &polar_rotation(f))
    }

    /// τ(F) (Pa) for an F whose polar rotation R is at hand: 2μ (F − R) Fᵀ + λ (J − 1) J I.
    #[inline(always)]
    pub fn kirchhoff_with_rotation<const D: usize>(&self, f: &Matrix<T, D>, r: &Matrix<T, D>) -> Matrix<T, D> {
        let j = det(f);
        let mut tau = mul_transpose(&add_scaled(f, -T::ONE, r), f);
        for i in 0..D {
            for k in 0..D {
                tau[i][k] *= T::TWO * self.mu;
            }
            tau[i][i] += self.lambda * (j - T::ONE) * j;
        }
        tau
    }

    /// Bound on the stiffness ρ0 c² (Pa) at F, see `Principal::stiffness`.
    #[inline(always)]
    pub fn stiffness_at<const D: usize>(&self, f: &Matrix<T, D>) -> T {
        let j = det(f);
        T::TWO * self.mu * largest_stretch_squared(f) + self.lambda * j * j
    }
}

/// The law in principal space, for the plastic laws that build on it.
impl<T: Real> Principal<T> for FixedCorotated<T> {
    const PLASTIC: bool = false;

    fn energy<const D: usize>(&self, sigma: &Vector<T, D>, _plastic: T) -> T {
        let stretch: T = sigma.iter().map(|&s| (s - T::ONE) * (s - T::ONE)).sum();
        let dilation = product(sigma) - T::ONE;
        self.mu * stretch + T::HALF * self.lambda * dilation * dilation
    }

    fn kirchhoff<const D: usize>(&self, sigma: &Vector<T, D>, _plastic: T) -> Vector<T, D> {
        let j = product(sigma);
        sigma.map(|s| T::TWO * self.mu * (s - T::ONE) * s + self.lambda * (j - T::ONE) * j)
    }

    /// σ_i² ψ_ii = 2μ σ_i² + λ J²; across the axes 2μ σ_j² (1 − 1/(σ_i + σ_j)) is less.
    fn stiffness<const D: usize>(&self, sigma: &Vector<T, D>, _plastic: T) -> T {
        let j = product(sigma);
        let most = sigma.iter().copied().fold(sigma[0], T::max);
        T::TWO * self.mu * most * most + self.lambda * j * j
    }
}
