//! Constitutive laws, one file each, generic in the scalar and the dimension (2: plane strain).
//!
//! Every law gives its energy density (J per m³ of the undeformed body) and the Kirchhoff stress τ = P Fᵀ = J σ (Pa).
//! The functions of this module evaluate any [`Material`] in f64 for diagnostics and pictures.

mod fixed_corotated;
mod neo_hookean;
mod weakly_compressible_fluid;

pub use fixed_corotated::FixedCorotated;
pub use neo_hookean::NeoHookean;
pub use weakly_compressible_fluid::WeaklyCompressibleFluid;

use crate::scene::schema::{Elastic, Material};
use crate::sim::linalg::{det, from_row_major, scaled_identity, to_row_major};
use crate::sim::real::Real;

/// A law ready to be evaluated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Law<T> {
    FixedCorotated(FixedCorotated<T>),
    NeoHookean(NeoHookean<T>),
    WeaklyCompressibleFluid(WeaklyCompressibleFluid<T>),
}

impl<T: Real> Law<T> {
    pub fn new(material: &Material) -> Self {
        match material {
            Material::FixedCorotated(elastic) => Self::FixedCorotated(FixedCorotated::new(elastic)),
            Material::NeoHookean(elastic) => Self::NeoHookean(NeoHookean::new(elastic)),
            Material::WeaklyCompressibleFluid(fluid) => {
                Self::WeaklyCompressibleFluid(WeaklyCompressibleFluid::new(fluid))
            }
        }
    }
}

/// Lamé's parameters (μ, λ) of isotropic elasticity (Pa).
pub fn lame(elastic: &Elastic) -> (f64, f64) {
    let (e, nu) = (elastic.youngs_modulus, elastic.poissons_ratio);
    (e / (2.0 * (1.0 + nu)), e * nu / ((1.0 + nu) * (1.0 - 2.0 * nu)))
}

/// Energy per undeformed volume (J/m³) at the deformation gradient `f` (row-major 3 × 3; plane strain has F_zz = 1, so
/// one evaluation serves 2D and 3D).
pub fn energy_density(material: &Material, f: &[f64; 9]) -> f64 {
    let f = from_row_major::<f64, 3>(f);
    match Law::new(material) {
        Law::FixedCorotated(law) => law.energy(&f),
        Law::NeoHookean(law) => law.energy(&f),
        Law::WeaklyCompressibleFluid(law) => law.energy(det(&f)),
    }
}

/// Kirchhoff stress τ = J σ (Pa), row-major, without viscosity; arguments as [`energy_density`].
pub fn kirchhoff(material: &Material, f: &[f64; 9]) -> [f64; 9] {
    let f = from_row_major::<f64, 3>(f);
    let tau = match Law::new(material) {
        Law::FixedCorotated(law) => law.kirchhoff(&f),
        Law::NeoHookean(law) => law.kirchhoff(&f),
        Law::WeaklyCompressibleFluid(law) => scaled_identity(-det(&f) * law.pressure(det(&f))),
    };
    to_row_major(&tau, 0.0)
}

/// Cauchy stress σ (Pa), row-major, without viscosity; arguments as [`energy_density`].
pub fn cauchy(material: &Material, f: &[f64; 9]) -> [f64; 9] {
    let j = det(&from_row_major::<f64, 3>(f));
    kirchhoff(material, f).map(|tau| tau / j)
}

#[cfg(test)]
mod tests;
