//! Fixed corotated elasticity (Stomakhin, Howes, Schroeder and Teran 2012, "Energetically
//! consistent invertible elasticity"): ψ = μ Σ (σ_i − 1)² + ½ λ (J − 1)²,
//! P = 2μ (F − R) + λ (J − 1) J F⁻ᵀ. Finite and restoring for every F, inverted ones included.

use super::derivatives::Derivatives;
use super::lame;
use super::parameters::Elastic;
use super::principal::{Principal, product};
use super::stretch::largest_stretch_squared;
use crate::maths::linalg::{Matrix, Vector, add_scaled, cofactor, det, dot, double_dot, mul_transpose};
use crate::maths::real::Real;
use crate::maths::svd::{polar_rotation, svd};

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

    /// τ(F) (Pa) given the polar rotation R of F: 2μ (F − R) Fᵀ + λ (J − 1) J I.
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

    /// ψ(F) (J/m³) and P(F) (Pa) from the polar rotation alone, as Σ (σ_i − 1)² = ‖F − R‖².
    pub fn energy_and_pk1<const D: usize>(&self, f: &Matrix<T, D>) -> (T, Matrix<T, D>) {
        let cofactor = cofactor(f);
        let strain = add_scaled(f, -T::ONE, &polar_rotation(f));
        let dilation = dot(&f[0], &cofactor[0]) - T::ONE;
        let energy = self.mu * double_dot(&strain, &strain) + T::HALF * self.lambda * dilation * dilation;
        let pressure = strain.map(|row| row.map(|e| T::TWO * self.mu * e));
        (energy, add_scaled(&pressure, self.lambda * dilation, &cofactor))
    }

    /// ψ_i = 2μ (σ_i − 1) + λ (J − 1) J/σ_i. J/σ_i is computed without the division, so that it
    /// exists for flat states too.
    pub fn derivatives<const D: usize>(&self, sigma: &Vector<T, D>) -> Derivatives<T, D> {
        let dilation = product(sigma) - T::ONE;
        let (mut gradient, mut hessian) = ([T::ZERO; D], [[T::ZERO; D]; D]);
        for i in 0..D {
            let without_i = product_without(sigma, i, i);
            gradient[i] = T::TWO * self.mu * (sigma[i] - T::ONE) + self.lambda * dilation * without_i;
            for j in 0..D {
                hessian[i][j] = self.lambda * without_i * product_without(sigma, j, j);
                hessian[i][j] +=
                    if i == j { T::TWO * self.mu } else { self.lambda * dilation * product_without(sigma, i, j) };
            }
        }
        Derivatives { energy: Principal::energy(self, sigma, T::ZERO), gradient, hessian }
    }

    /// d(2μ (σ − 1) σ)/d ln σ (Pa).
    pub(super) fn shear_tangent(&self, sigma: T) -> T {
        T::TWO * self.mu * (T::TWO * sigma - T::ONE) * sigma
    }

    /// d(λ (J − 1) J)/d ln J (Pa).
    pub(super) fn volume_tangent(&self, j: T) -> T {
        self.lambda * (T::TWO * j - T::ONE) * j
    }

    /// Bound on the stiffness ρ0 c² (Pa) at F, see `Principal::stiffness`.
    #[inline(always)]
    pub fn stiffness_at<const D: usize>(&self, f: &Matrix<T, D>) -> T {
        let j = det(f);
        T::TWO * self.mu * largest_stretch_squared(f) + self.lambda * j * j
    }
}

/// Π σ_k over all k other than i and j.
fn product_without<T: Real, const D: usize>(sigma: &Vector<T, D>, i: usize, j: usize) -> T {
    (0..D).filter(|&k| k != i && k != j).fold(T::ONE, |p, k| p * sigma[k])
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

    /// 2μ (2σ_i − 1) σ_i δ_ij + λ (2J − 1) J.
    fn returned_tangent<const D: usize>(&self, sigma: &Vector<T, D>, _plastic: T) -> Matrix<T, D> {
        let mut tangent = [[self.volume_tangent(product(sigma)); D]; D];
        for i in 0..D {
            tangent[i][i] += self.shear_tangent(sigma[i]);
        }
        tangent
    }

    /// σ_i² ψ_ii = 2μ σ_i² + λ J². Across the axes, 2μ σ_j² (1 − 1/(σ_i + σ_j)) is less.
    fn stiffness<const D: usize>(&self, sigma: &Vector<T, D>, _plastic: T) -> T {
        let j = product(sigma);
        let most = sigma.iter().copied().fold(sigma[0], T::max);
        T::TWO * self.mu * most * most + self.lambda * j * j
    }
}
