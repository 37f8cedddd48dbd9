//! Energies with their derivatives in principal space, for the implicit integrator.
//!
//! Here plasticity is lagged: within a step every law is elastic, and its plastic state is fixed
//! (`flowing.rs` is the alternative). The stress differs from that of the explicit integrator in two
//! ways, because a line search also tries states that no body ever reaches:
//! * Fixed corotated energies, including those of von Mises and snow, take signed stretches without
//!   a clamp. They are finite and restoring everywhere.
//! * Energies in logarithmic strain (Hencky, NACC) take ln σ down to σ = [`EXTENSION`]. Below that
//!   they continue along its tangent, through flat into inverted states. ψ and its gradient stay
//!   continuous, ψ grows without bound under compression, and no stretch is clamped.
//!
//! Neo-Hookean keeps its barrier: ψ is infinite at J ≤ 0.

use super::parameters::Elasticity;
use super::principal::{Principal, spectral};
use super::stiffness::Projected;
use super::{FixedCorotated, Law, Nacc, NeoHookean, StvkHencky};
use crate::maths::linalg::{Matrix, Vector};
use crate::maths::real::Real;
use crate::maths::svd::{Svd, svd};

/// Below this stretch, logarithmic strain is replaced by its tangent, ln s + (σ − s)/s.
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

/// The elastic energies that the laws use.
pub(super) enum Elastic<T> {
    FixedCorotated(FixedCorotated<T>),
    NeoHookean(NeoHookean<T>),
    Hencky(StvkHencky<T>),
    CamClay(Nacc<T>),
}

impl<T: Real> Law<T> {
    /// The elastic law within a step.
    ///
    /// # Panics
    /// For fluids. Scenes with fluids are refused before they get here.
    pub(super) fn elastic(&self, plastic: T) -> Elastic<T> {
        match self {
            Self::FixedCorotated(law) => Elastic::FixedCorotated(*law),
            Self::NeoHookean(law) => Elastic::NeoHookean(*law),
            Self::StvkHencky(law) => Elastic::Hencky(*law),
            Self::DruckerPrager(law) => Elastic::Hencky(law.elastic),
            Self::MohrCoulomb(law) => Elastic::Hencky(law.elastic),
            Self::Nacc(law) => Elastic::CamClay(*law),
            Self::VonMises(law) => match law.elasticity {
                Elasticity::Hencky => Elastic::Hencky(law.hencky),
                Elasticity::FixedCorotated => Elastic::FixedCorotated(law.fixed_corotated()),
            },
            Self::Snow(law) => Elastic::FixedCorotated(law.hardened(plastic)),
            Self::WeaklyCompressibleFluid(_) => panic!("fluids are not integrated implicitly"),
        }
    }

    /// ψ, ∂ψ/∂σ and ∂²ψ/∂σ² at the signed singular values that [`svd`] gives. At J ≤ 0 the
    /// neo-Hookean energy is infinite and its derivatives are meaningless.
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

    /// ψ(F) (J/m³) and P(F) (Pa), consistent with [`Self::derivatives`]. A line search evaluates
    /// this; it decomposes F at most once.
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

    /// ξ = ‖∂P/∂F(I)‖ (Pa), the Frobenius norm over all d² × d² entries (HOT §5.2). Every law obeys
    /// Hooke's law at rest.
    pub fn characteristic<const D: usize>(&self) -> T {
        let (mu, lambda) = self.moduli();
        let (d, along) = (T::from_i32(D as i32), lambda + T::TWO * mu);
        (d * along * along + d * (d - T::ONE) * (lambda * lambda + T::TWO * mu * mu)).sqrt()
    }
}

/// The stretch e^ε of the extended logarithmic strain ε(σ), with ε′ and ε″.
pub(super) fn extend<T: Real>(sigma: T) -> (T, T, T) {
    let s = T::from_f64(EXTENSION);
    if sigma >= s {
        (sigma, T::ONE / sigma, -T::ONE / (sigma * sigma))
    } else {
        (s * ((sigma - s) / s).exp(), T::ONE / s, T::ZERO)
    }
}

/// ψ_i = τ_i ε′_i of a law in logarithmic strain.
pub(super) fn gradient<T: Real, const D: usize>(sigma: &Vector<T, D>, tau: &Vector<T, D>) -> Vector<T, D> {
    std::array::from_fn(|i| tau[i] * extend(sigma[i]).1)
}

/// ψ_ij = ∂τ_i/∂ε_j ε′_i ε′_j + δ_ij τ_i ε″_i of a law in logarithmic strain, given ∂τ_i/∂ε_j as
/// `tangent`.
pub(super) fn hessian<T: Real, const D: usize>(
    sigma: &Vector<T, D>,
    tau: &Vector<T, D>,
    tangent: &Matrix<T, D>,
) -> Matrix<T, D> {
    let mut hessian = *tangent;
    for i in 0..D {
        let (_, slope, curvature) = extend(sigma[i]);
        for j in 0..D {
            hessian[i][j] *= slope * extend(sigma[j]).1;
        }
        hessian[i][i] += tau[i] * curvature;
    }
    hessian
}

/// Derivatives of a law in logarithmic strain, given ∂τ_i/∂ε_j as `tangent`.
fn extended<T: Real, L: Principal<T>, const D: usize>(
    sigma: &Vector<T, D>,
    law: &L,
    plastic: T,
    tangent: impl Fn(&Vector<T, D>) -> Matrix<T, D>,
) -> Derivatives<T, D> {
    let stretch = sigma.map(|s| extend(s).0);
    let tau = law.kirchhoff(&stretch, plastic);
    Derivatives {
        energy: law.energy(&stretch, plastic),
        gradient: gradient(sigma, &tau),
        hessian: hessian(sigma, &tau, &tangent(&stretch)),
    }
}

fn extended_energy_and_pk1<T: Real, L: Principal<T>, const D: usize>(
    f: &Matrix<T, D>,
    law: &L,
    plastic: T,
) -> (T, Matrix<T, D>) {
    let Svd { u, sigma, v } = svd(f);
    let stretch = sigma.map(|s| extend(s).0);
    let gradient = gradient(&sigma, &law.kirchhoff(&stretch, plastic));
    (law.energy(&stretch, plastic), spectral(&u, &gradient, &v))
}
