//! Weakly compressible fluid with the Tait (Cole) equation of state (Tampubolon et al. 2017, "Multi-species simulation of
//! porous sand and water mixtures"; CK-MPM §6): p = B (J^−γ − 1), B = K/γ with K the bulk modulus at rest;
//! σ = −p I + μ (∇v + ∇vᵀ). Its only state is J, J ← (1 + dt tr ∇v) J.

use crate::scene::schema::Fluid;
use crate::sim::linalg::Matrix;
use crate::sim::real::Real;

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

    /// τ = J (−p I + μ (∇v + ∇vᵀ)) (Pa).
    #[inline(always)]
    pub fn kirchhoff<const D: usize>(&self, j: T, grad_v: &Matrix<T, D>) -> Matrix<T, D> {
        let pressure = self.pressure(j);
        let mut tau = *grad_v;
        for i in 0..D {
            for k in 0..D {
                tau[i][k] = j * self.viscosity * (grad_v[i][k] + grad_v[k][i]);
            }
            tau[i][i] -= j * pressure;
        }
        tau
    }
}
