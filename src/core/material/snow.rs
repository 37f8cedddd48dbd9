//! Snow (Stomakhin et al. 2013, "A material point method for snow simulation", §5): fixed corotated
//! elasticity with stretches clamped to [1 − θc, 1 + θs]. What the clamp removes goes into the
//! plastic volume ratio J_p, and the moduli grow with e^(ξ (1 − J_p)). ξ = 0 is snow without
//! hardening.

use super::FixedCorotated;
use super::parameters;
use super::principal::{Principal, product};
use crate::maths::linalg::{Matrix, Vector};
use crate::maths::real::Real;

/// Plastic state: J_p, 1 at rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Snow<T> {
    pub elastic: FixedCorotated<T>,
    /// 1 − θc and 1 + θs.
    pub least: T,
    pub most: T,
    /// ξ.
    pub hardening: T,
}

impl<T: Real> Snow<T> {
    pub fn new(material: &parameters::Snow, elastic: &parameters::Elastic) -> Self {
        Self {
            elastic: FixedCorotated::new(elastic),
            least: T::from_f64(1.0 - material.critical_compression),
            most: T::from_f64(1.0 + material.critical_stretch),
            hardening: T::from_f64(material.hardening),
        }
    }

    /// The elastic law at a plastic volume ratio.
    pub(super) fn hardened(&self, plastic: T) -> FixedCorotated<T> {
        let factor = (self.hardening * (T::ONE - plastic)).exp();
        FixedCorotated { mu: factor * self.elastic.mu, lambda: factor * self.elastic.lambda }
    }
}

impl<T: Real> Principal<T> for Snow<T> {
    fn energy<const D: usize>(&self, sigma: &Vector<T, D>, plastic: T) -> T {
        Principal::energy(&self.hardened(plastic), sigma, plastic)
    }

    fn kirchhoff<const D: usize>(&self, sigma: &Vector<T, D>, plastic: T) -> Vector<T, D> {
        Principal::kirchhoff(&self.hardened(plastic), sigma, plastic)
    }

    fn stiffness<const D: usize>(&self, sigma: &Vector<T, D>, plastic: T) -> T {
        Principal::stiffness(&self.hardened(plastic), sigma, plastic)
    }

    fn return_map<const D: usize>(&self, sigma: &Vector<T, D>, plastic: T) -> Option<(Vector<T, D>, T)> {
        let clamped = sigma.map(|s| s.max(self.least).min(self.most));
        // Further extension would only shrink moduli that have vanished already.
        let volume = (plastic * product(sigma) / product(&clamped)).min(T::from_f64(MAX_PLASTIC_VOLUME));
        (clamped != *sigma).then_some((clamped, volume))
    }

    /// That of the axes that are not clamped, among themselves, and that of hardening for those that
    /// are, −ξ J_p τ_i for all i and each such j: its diagonal, √(τ_i τ_j) beside it, and 0 where
    /// it softens. Left out: the stress that an axis causes across clamped ones, which do not cause
    /// one in return.
    fn returned_tangent<const D: usize>(&self, sigma: &Vector<T, D>, plastic: T) -> Matrix<T, D> {
        let (after, plastic) = self.return_map(sigma, plastic).unwrap_or((*sigma, plastic));
        let law = self.hardened(plastic);
        let mut tangent = law.returned_tangent(&after, plastic);
        let hardening = Principal::kirchhoff(&law, &after, plastic)
            .map(|tau| (-(self.hardening * plastic * tau)).max(T::ZERO).sqrt());
        for i in 0..D {
            for j in 0..D {
                match (after[i] != sigma[i], after[j] != sigma[j]) {
                    (false, false) => {}
                    (true, true) => tangent[i][j] = hardening[i] * hardening[j],
                    _ => tangent[i][j] = T::ZERO,
                }
            }
        }
        tangent
    }
}

/// Largest J_p kept; the moduli have vanished long before that.
pub const MAX_PLASTIC_VOLUME: f64 = 1e4;
