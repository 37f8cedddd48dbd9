//! Energies with their derivatives in principal space, for the implicit integrator.
//!
//! Plasticity is lagged there: within a step every law is elastic, with the plastic state that it has. Two things differ from the stress of the explicit
//! integrator, because a line search also tries states that no body is ever in:
//! * Fixed corotated energies, those of von Mises and snow included, take signed stretches as they are, without a clamp: finite and restoring everywhere.
//! * Energies in logarithmic strain (Hencky, NACC) take ln σ down to σ = [`EXTENSION`] and go on along its tangent, through flat into inverted states: ψ and
//!   its gradient stay continuous, ψ grows without bound against compression, and no stretch is clamped.
//!
//! Neo-Hookean keeps its barrier: infinite at J ≤ 0.

use super::parameters::Elasticity;
use super::principal::{Principal, spectral};
use super::stiffness::Projected;
use super::{FixedCorotated, Law, Nacc, NeoHookean, StvkHencky};
use crate::maths::linalg::{Matrix, Vector};
use crate::maths::real::Real;
use crate::maths::svd::{Svd, svd};

/// Stretch below which logarithmic strain is replaced by its tangent, ln s + (σ − s)/s.
pub const EXTENSION: f64 = 0.1;

/// ψ(σ) and its derivatives with respect to the signed singular values of F.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Derivatives<T, const D: usize> {
    /// ψ (J/m³).
    pub energy: T,
    /// ∂ψ/∂σ_i, the principal values of P (Pa).
    pub gradient: Vector<T, D>,
    /// ∂²ψ/∂σ_i∂σ_j (Pa).
    pub hessian: Matrix<T, D>,
}

/// The energies that the laws are made of.
enum Elastic<T> {
    FixedCorotated(FixedCorotated<T>),
    NeoHookean(NeoHookean<T>),
    Hencky(StvkHencky<T>),
    CamClay(Nacc<T>),
}

impl<T: Real> Law<T> {
    /// The elastic law within a step.
    ///
    /// # Panics
    /// For fluids, whose scenes are refused before they get here.
    fn elastic(&self, plastic: T) -> Elastic<T> {
        match self {
            Self::FixedCorotated(law) => Elastic::FixedCorotated(*law),
            Self::NeoHookean(law) => Elastic::NeoHookean(*law),
            Self::StvkHencky(law) => Elastic::Hencky(*law),
            Self::DruckerPrager(law) => Elastic::Hencky(law.elastic),
            Self::Nacc(law) => Elastic::CamClay(*law),
            Self::VonMises(law) => match law.elasticity {
                Elasticity::Hencky => Elastic::Hencky(law.hencky),
                Elasticity::FixedCorotated => Elastic::FixedCorotated(law.fixed_corotated()),
            },
            Self::Snow(law) => Elastic::FixedCorotated(law.hardened(plastic)),
            Self::WeaklyCompressibleFluid(_) => panic!("fluids are not integrated implicitly"),
        }
    }

    /// ψ, ∂ψ/∂σ and ∂²ψ/∂σ² at the signed singular values that [`svd`] gives. Neo-Hookean: infinite energy, and derivatives
    /// without meaning, at J ≤ 0.
    ///
    /// # Panics
    /// For fluids.
    pub fn derivatives<const D: usize>(&self, sigma: &Vector<T, D>, plastic: T) -> Derivatives<T, D> {
        match self.elastic(plastic) {
            Elastic::FixedCorotated(law) => law.derivatives(sigma),
            Elastic::NeoHookean(law) => law.derivatives(sigma),
            Elastic::Hencky(law) => extended(sigma, &law, plastic, |_| law.tangent()),
            Elastic::CamClay(law) => extended(sigma, &law, plastic, |stretch| law.tangent(stretch)),
        }
    }

    /// ψ(F) (J/m³) and P(F) (Pa), consistent with [`Self::derivatives`]: what a line search evaluates, with at most one
    /// decomposition of F.
    ///
    /// # Panics
    /// For fluids.
    pub fn energy_and_pk1<const D: usize>(&self, f: &Matrix<T, D>, plastic: T) -> (T, Matrix<T, D>) {
        match self.elastic(plastic) {
            Elastic::FixedCorotated(law) => law.energy_and_pk1(f),
            Elastic::NeoHookean(law) => law.energy_and_pk1(f),
            Elastic::Hencky(law) => extended_energy_and_pk1(f, &law, plastic),
            Elastic::CamClay(law) => extended_energy_and_pk1(f, &law, plastic),
        }
    }

    /// ∂P/∂F at F with its negative eigenvalues set to 0.
    ///
    /// # Panics
    /// For fluids.
    pub fn projected_derivative<const D: usize>(&self, f: &Matrix<T, D>, plastic: T) -> Projected<T, D> {
        let decomposed = svd(f);
        Projected::exact(&decomposed, &self.derivatives(&decomposed.sigma, plastic)).clamped()
    }

    /// ξ = ‖∂P/∂F(I)‖ (Pa), Frobenius over all d² × d² entries (HOT §5.2); every law obeys Hooke's at rest.
    pub fn characteristic<const D: usize>(&self) -> T {
        let (mu, lambda) = self.moduli();
        let (d, along) = (T::from_i32(D as i32), lambda + T::TWO * mu);
        (d * along * along + d * (d - T::ONE) * (lambda * lambda + T::TWO * mu * mu)).sqrt()
    }
}

/// The stretch e^ε of the extended logarithmic strain ε(σ), and ε′, ε″.
fn extend<T: Real>(sigma: T) -> (T, T, T) {
    let s = T::from_f64(EXTENSION);
    if sigma >= s {
        (sigma, T::ONE / sigma, -T::ONE / (sigma * sigma))
    } else {
        (s * ((sigma - s) / s).exp(), T::ONE / s, T::ZERO)
    }
}

/// Of a law in logarithmic strain, whose ∂τ_i/∂ε_j `tangent` gives: ψ_i = τ_i ε′_i, ψ_ij = ∂τ_i/∂ε_j ε′_i ε′_j + δ_ij τ_i ε″_i.
fn extended<T: Real, L: Principal<T>, const D: usize>(
    sigma: &Vector<T, D>,
    law: &L,
    plastic: T,
    tangent: impl Fn(&Vector<T, D>) -> Matrix<T, D>,
) -> Derivatives<T, D> {
    let stretch = sigma.map(|s| extend(s).0);
    let tau = law.kirchhoff(&stretch, plastic);
    let (mut gradient, mut hessian) = (tau, tangent(&stretch));
    for i in 0..D {
        let (_, slope, curvature) = extend(sigma[i]);
        for j in 0..D {
            hessian[i][j] *= slope * extend(sigma[j]).1;
        }
        hessian[i][i] += tau[i] * curvature;
        gradient[i] *= slope;
    }
    Derivatives { energy: law.energy(&stretch, plastic), gradient, hessian }
}

fn extended_energy_and_pk1<T: Real, L: Principal<T>, const D: usize>(
    f: &Matrix<T, D>,
    law: &L,
    plastic: T,
) -> (T, Matrix<T, D>) {
    let Svd { u, sigma, v } = svd(f);
    let stretch = sigma.map(|s| extend(s).0);
    let mut gradient = law.kirchhoff(&stretch, plastic);
    for i in 0..D {
        gradient[i] *= extend(sigma[i]).1;
    }
    (law.energy(&stretch, plastic), spectral(&u, &gradient, &v))
}
