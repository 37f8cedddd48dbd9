//! Weakly compressible fluid with the Tait (Cole) equation of state (Tampubolon et al. 2017,
//! "Multi-species simulation of porous sand and water mixtures"; CK-MPM §6): p = B (J^−γ − 1),
//! B = K/γ with K the bulk modulus at rest; σ = −p I + μ (∇v + ∇vᵀ). Its only state is J,
//! J ← (1 + dt tr ∇v) J.

use super::parameters::Fluid;
use crate::maths::linalg::Matrix;
use crate::maths::real::Real;

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WeaklyCompressibleFluid<T> {
    /// K/γ (Pa).
    pub b: T,
    pub gamma: T,
    /// Dynamic viscosity (Pa·s).
    pub viscosity: T,
}

impl<T: Real> WeaklyCompressibleFluid<T> {
    pub fn new(fluid: &Fluid) -> Self {
        Self {
            b: T::from_f64(fluid.bulk_modulus / fluid.gamma),
            gamma: T::from_f64(fluid.gamma),
            viscosity: T::from_f64(fluid.viscosity),
        }
    }

    /// p(J) (Pa).
    #[inline(always)]
    pub fn pressure(&self, j: T) -> T {
        // J^-γ − 1 = e^(−γ ln J) − 1 without cancellation at rest.
        self.b * (-self.gamma * j.ln()).exp_m1()
    }

    /// ψ(J) = B ((J^(1−γ) − 1)/(γ − 1) + J − 1) (J/m³), the integral of −p from the rest state.
    pub fn energy(&self, j: T) -> T {
        let excess = self.gamma - T::ONE;
        let ln_j = j.ln();
        let compression = if excess == T::ZERO { -ln_j } else { (-excess * ln_j).exp_m1() / excess };
        self.b * (compression + (j - T::ONE))
    }

    /// τ = J (−p I + μ (∇v + ∇vᵀ)) (Pa) at the pressure p(J).
    #[inline(always)]
    pub fn kirchhoff<const D: usize>(&self, j: T, pressure: T, grad_v: &Matrix<T, D>) -> Matrix<T, D> {
        let mut tau = *grad_v;
        for i in 0..D {
            for k in 0..D {
                tau[i][k] = j * self.viscosity * (grad_v[i][k] + grad_v[k][i]);
            }
            tau[i][i] -= j * pressure;
        }
        tau
    }

    /// Ratio of the stiffness ρ0 c² to that at rest, the larger of two: of the bulk,
    /// J² ψ'' / K = J^(1−γ), and of a lone particle. The latter, with λ_J = ψ'(J)/(J − 1), is
    /// 2J³/(J + 1) λ_J/K for J ≥ 1 and (2 − J)² λ_J/K below (Sun, Shinar & Schroeder 2020).
    #[inline(always)]
    pub fn stiffening(&self, j: T, pressure: T) -> T {
        let modulus = self.b * self.gamma;
        let strain = j - T::ONE;
        // ψ' = −p; at rest the secant modulus is the tangent modulus.
        let secant = if strain.abs() > T::from_f64(1e-3) { -pressure / (strain * modulus) } else { T::ONE };
        let lone = if strain > T::ZERO { T::TWO * j * j * j / (j + T::ONE) } else { (T::TWO - j) * (T::TWO - j) };
        let bulk = j * (pressure / self.b + T::ONE);
        bulk.max(lone * secant)
    }
}
