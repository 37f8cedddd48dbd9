//! Constitutive laws, one file each, generic in the scalar and the dimension (2: plane strain).
//!
//! Every law gives its energy density (J per m³ of the undeformed body) and the Kirchhoff stress
//! τ = P Fᵀ = J σ (Pa). A plastic law also has a return map and at most one scalar of plastic
//! state. The functions of this module evaluate any [`Material`] in f64, for diagnostics and
//! pictures.

mod damping;
mod derivatives;
mod drucker_prager;
pub mod element;
mod fixed_corotated;
mod measures;
mod mohr_coulomb;
mod nacc;
mod neo_hookean;
mod opening;
pub mod parameters;
mod principal;
mod samples;
mod snow;
mod stiffness;
mod stretch;
mod stvk_hencky;
mod von_mises;
mod weakly_compressible_fluid;

pub use damping::Damping;
pub use derivatives::{Derivatives, EXTENSION};
pub use drucker_prager::DruckerPrager;
pub use fixed_corotated::FixedCorotated;
pub use measures::{hencky_strain, plastic_strain};
pub use mohr_coulomb::MohrCoulomb;
pub use nacc::Nacc;
pub use neo_hookean::NeoHookean;
pub use principal::{Flow, Principal};
pub use samples::samples;
pub use snow::Snow;
pub use stiffness::{Projected, Tensor4};
pub use stvk_hencky::StvkHencky;
pub use von_mises::VonMises;
pub use weakly_compressible_fluid::WeaklyCompressibleFluid;

use crate::maths::linalg::{Matrix, Vector, det, determinant, from_row_major, scaled_identity, to_row_major};
use crate::maths::real::Real;
use crate::maths::svd::{Svd, svd};
use parameters::{Elastic, Material};

/// A constitutive law in the form in which it is evaluated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Law<T> {
    FixedCorotated(FixedCorotated<T>),
    NeoHookean(NeoHookean<T>),
    StvkHencky(StvkHencky<T>),
    WeaklyCompressibleFluid(WeaklyCompressibleFluid<T>),
    DruckerPrager(DruckerPrager<T>),
    MohrCoulomb(MohrCoulomb<T>),
    Nacc(Nacc<T>),
    VonMises(VonMises<T>),
    Snow(Snow<T>),
}

/// Evaluates an expression for the law as a [`principal::Principal`]. The other laws have arms of
/// their own.
macro_rules! principal {
    ($value:expr, $law:ident => $principal:expr, { $($pattern:pat => $other:expr),+ $(,)? }) => {
        match $value {
            Law::StvkHencky($law) => $principal,
            Law::DruckerPrager($law) => $principal,
            Law::MohrCoulomb($law) => $principal,
            Law::Nacc($law) => $principal,
            Law::VonMises($law) => $principal,
            Law::Snow($law) => $principal,
            $($pattern => $other),+
        }
    };
}

// Below the macro, which it uses.
mod flowing;

impl<T: Real> Law<T> {
    pub fn new(material: &Material) -> Self {
        let elastic = || material.elastic().expect("only fluids have none");
        match material {
            Material::FixedCorotated(elastic) => Self::FixedCorotated(FixedCorotated::new(elastic)),
            Material::NeoHookean(elastic) => Self::NeoHookean(NeoHookean::new(elastic)),
            Material::StvkHencky(elastic) => Self::StvkHencky(StvkHencky::new(elastic)),
            Material::WeaklyCompressibleFluid(fluid) => {
                Self::WeaklyCompressibleFluid(WeaklyCompressibleFluid::new(fluid))
            }
            Material::DruckerPrager(sand) => Self::DruckerPrager(DruckerPrager::new(sand, &elastic())),
            Material::MohrCoulomb(soil) => Self::MohrCoulomb(MohrCoulomb::new(soil, &elastic())),
            Material::Nacc(clay) => Self::Nacc(Nacc::new(clay, &elastic())),
            Material::VonMises(metal) => Self::VonMises(VonMises::new(metal, &elastic())),
            Material::Snow(snow) => Self::Snow(Snow::new(snow, &elastic())),
        }
    }

    /// Whether the law works in principal space.
    pub fn is_principal(&self) -> bool {
        principal!(self, _law => true, {
            Self::FixedCorotated(_) | Self::NeoHookean(_) | Self::WeaklyCompressibleFluid(_) => false,
        })
    }

    /// Whether [`Self::return_map`] can change F.
    pub fn is_plastic(&self) -> bool {
        fn plastic<T: Real, L: principal::Principal<T>>(_law: &L) -> bool {
            L::PLASTIC
        }
        principal!(self, law => plastic(law), {
            Self::FixedCorotated(_) | Self::NeoHookean(_) | Self::WeaklyCompressibleFluid(_) => false,
        })
    }

    /// ψ(F) (J/m³).
    pub fn energy<const D: usize>(&self, f: &Matrix<T, D>, plastic: T) -> T {
        principal!(self, law => principal::energy(law, f, plastic), {
            Self::FixedCorotated(law) => law.energy(f),
            Self::NeoHookean(law) => law.energy(f),
            Self::WeaklyCompressibleFluid(law) => law.energy(det(f)),
        })
    }

    /// τ(F) (Pa) without viscosity, and the ratio of the stiffness ρ0 c² of waves at F to that at
    /// rest. The ratio shortens the stable step.
    pub fn kirchhoff<const D: usize>(&self, f: &Matrix<T, D>, plastic: T) -> (Matrix<T, D>, T) {
        let at_rest = self.stiffness_at_rest();
        let (tau, stiffness) = principal!(self, law => principal::kirchhoff(law, f, plastic), {
            Self::FixedCorotated(law) => (law.kirchhoff(f), law.stiffness_at(f)),
            Self::NeoHookean(law) => (law.kirchhoff(f), law.stiffness_at(f)),
            Self::WeaklyCompressibleFluid(law) => {
                let j = det(f);
                let pressure = law.pressure(j);
                (scaled_identity(-j * pressure), at_rest * law.stiffening(j, pressure))
            },
        });
        (tau, stiffness / at_rest)
    }

    /// λ + 2μ (Pa).
    pub fn stiffness_at_rest(&self) -> T {
        let (mu, lambda) = self.moduli();
        lambda + T::TWO * mu
    }

    /// (μ, λ) at rest (Pa).
    fn moduli(&self) -> (T, T) {
        match self {
            Self::FixedCorotated(law) => (law.mu, law.lambda),
            Self::NeoHookean(law) => (law.mu, law.lambda),
            Self::StvkHencky(law) => (law.mu, law.lambda),
            Self::WeaklyCompressibleFluid(law) => (T::ZERO, law.b * law.gamma),
            Self::DruckerPrager(law) => (law.elastic.mu, law.elastic.lambda),
            Self::MohrCoulomb(law) => (law.elastic.mu, law.elastic.lambda),
            Self::Nacc(law) => (law.mu, law.lambda),
            Self::VonMises(law) => (law.hencky.mu, law.hencky.lambda),
            Self::Snow(law) => (law.elastic.mu, law.elastic.lambda),
        }
    }

    /// Return map and stress at singular values of F, for laws in principal space. `None` for the
    /// others.
    #[inline(always)]
    pub fn flow_principal<const D: usize>(&self, sigma: &Vector<T, D>, plastic: T) -> Option<Flow<T, D>> {
        principal!(self, law => Some(principal::Principal::flow(law, sigma, plastic)), {
            Self::FixedCorotated(_) | Self::NeoHookean(_) | Self::WeaklyCompressibleFluid(_) => None,
        })
    }

    /// Principal Kirchhoff stresses and the stiffness ρ0 c² (Pa) at singular values of F, for laws in principal
    /// space. `None` for the others.
    #[inline(always)]
    pub fn principal_stress<const D: usize>(&self, sigma: &Vector<T, D>, plastic: T) -> Option<(Vector<T, D>, T)> {
        fn at<T: Real, L: Principal<T>, const D: usize>(
            law: &L,
            sigma: &Vector<T, D>,
            plastic: T,
        ) -> (Vector<T, D>, T) {
            let sigma = principal::clamped(sigma);
            (law.kirchhoff(&sigma, plastic), law.stiffness(&sigma, plastic))
        }
        principal!(self, law => Some(at(law, sigma, plastic)), {
            Self::FixedCorotated(_) | Self::NeoHookean(_) | Self::WeaklyCompressibleFluid(_) => None,
        })
    }

    /// The logarithm of the volume that loose grains have gained apart from one another, beyond that
    /// of F. `None` for materials that are not loose grains.
    #[inline(always)]
    pub fn gained_volume(&self, plastic: T) -> Option<T> {
        matches!(self, Self::DruckerPrager(_) | Self::MohrCoulomb(_)).then_some(plastic)
    }

    /// Projects F and the plastic state onto the yield surface if they are outside it. Elastic laws
    /// leave them unchanged.
    pub fn return_map<const D: usize>(&self, f: &mut Matrix<T, D>, plastic: &mut T) {
        let Svd { u, sigma, v } = svd(f);
        if let Some(flow) = self.flow_principal(&sigma, *plastic) {
            if flow.moved {
                *f = principal::spectral(&u, &flow.sigma, &v);
            }
            *plastic = flow.plastic;
        }
    }
}

/// Lamé's parameters (μ, λ) of isotropic elasticity (Pa).
pub fn lame(elastic: &Elastic) -> (f64, f64) {
    let (e, nu) = (elastic.youngs_modulus, elastic.poissons_ratio);
    (e / (2.0 * (1.0 + nu)), e * nu / ((1.0 + nu) * (1.0 - 2.0 * nu)))
}

/// Plastic state of a body at rest.
pub fn initial_plastic_state(material: &Material) -> f64 {
    match material {
        Material::Nacc(clay) => clay.alpha0,
        Material::Snow(_) => 1.0,
        _ => 0.0,
    }
}

/// Energy per undeformed volume (J/m³) at the deformation gradient `f` (row-major 3 × 3). In plane
/// strain F_zz = 1, and all laws but NACC then agree with their three-dimensional form.
pub fn energy_density(material: &Material, dimension: usize, f: &[f64; 9], plastic: f64) -> f64 {
    let law = Law::new(material);
    match (&law, dimension) {
        (Law::Nacc(_), 2) => law.energy(&from_row_major::<f64, 2>(f), plastic),
        _ => law.energy(&from_row_major::<f64, 3>(f), plastic),
    }
}

/// Kirchhoff stress τ = J σ (Pa), row-major, without viscosity; arguments as [`energy_density`].
pub fn kirchhoff(material: &Material, dimension: usize, f: &[f64; 9], plastic: f64) -> [f64; 9] {
    let law = Law::new(material);
    match (&law, dimension) {
        (Law::Nacc(_), 2) => {
            let tau = law.kirchhoff(&from_row_major::<f64, 2>(f), plastic).0;
            to_row_major(&tau, 0.5 * (tau[0][0] + tau[1][1]))
        }
        _ => to_row_major(&law.kirchhoff(&from_row_major::<f64, 3>(f), plastic).0, 0.0),
    }
}

/// Cauchy stress σ (Pa), row-major, without viscosity; arguments as [`energy_density`].
pub fn cauchy(material: &Material, dimension: usize, f: &[f64; 9], plastic: f64) -> [f64; 9] {
    let j = determinant(f);
    kirchhoff(material, dimension, f, plastic).map(|tau| tau / j)
}

#[cfg(test)]
mod derivative_tests;
#[cfg(test)]
mod flowing_newton_tests;
#[cfg(test)]
mod flowing_tests;
#[cfg(test)]
mod granular_tests;
#[cfg(test)]
mod plastic_tests;
#[cfg(test)]
mod tests;
