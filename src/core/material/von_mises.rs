//! Von Mises plasticity without hardening: the norm of the Kirchhoff stress deviator is at most
//! √(2/3) σ_Y, σ_Y the yield stress in uniaxial tension.
//!
//! * Hencky: the deviator of ε is shortened, and tr ε and so J are kept exactly (radial return).
//! * Fixed corotated: the deviator of τ is shortened, and τ_i = 2μ (σ_i − 1) σ_i + λ (J − 1) J is
//!   solved for σ_i with J held fixed (HOT, Wang et al. 2020, as in its authors' code). The
//!   deviator does not depend on J, so the result lies exactly on the surface, while J changes by a
//!   second-order amount.
//!
//! In two dimensions, plane plastic flow has the same bound √(2/3) σ_Y (the stress across the plane
//! is then the mean of the other two). The radius therefore does not depend on the dimension.

use super::parameters::{self, Elasticity};
use super::principal::{Principal, mean_and_deviator, norm, product, radial};
use super::{FixedCorotated, StvkHencky};
use crate::maths::linalg::{Matrix, Vector, apply};
use crate::maths::real::Real;

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VonMises<T> {
    pub hencky: StvkHencky<T>,
    pub elasticity: Elasticity,
    /// √(2/3) σ_Y (Pa).
    pub radius: T,
}

impl<T: Real> VonMises<T> {
    pub fn new(material: &parameters::VonMises, elastic: &parameters::Elastic) -> Self {
        let radius = T::from_f64((2.0f64 / 3.0).sqrt() * material.yield_stress);
        Self { hencky: StvkHencky::new(elastic), elasticity: material.elasticity, radius }
    }

    /// Mean and deviator of the part of the principal stress that contributes to the deviator,
    /// 2μ ln σ or 2μ (σ − 1) σ (Pa), and the share of the deviator that the yield surface allows.
    /// `None` inside it.
    fn trial<const D: usize>(&self, sigma: &Vector<T, D>) -> (T, Vector<T, D>, Option<T>) {
        let two_mu = T::TWO * self.hencky.mu;
        let shear = match self.elasticity {
            Elasticity::Hencky => sigma.map(|s| two_mu * s.ln()),
            Elasticity::FixedCorotated => sigma.map(|s| two_mu * (s - T::ONE) * s),
        };
        let (mean, deviator) = mean_and_deviator(&shear);
        let length = norm(&deviator);
        (mean, deviator, (length > self.radius).then(|| self.radius / length))
    }

    pub(super) fn fixed_corotated(&self) -> FixedCorotated<T> {
        FixedCorotated { mu: self.hencky.mu, lambda: self.hencky.lambda }
    }
}

impl<T: Real> Principal<T> for VonMises<T> {
    fn energy<const D: usize>(&self, sigma: &Vector<T, D>, plastic: T) -> T {
        match self.elasticity {
            Elasticity::Hencky => self.hencky.energy(sigma, plastic),
            Elasticity::FixedCorotated => Principal::energy(&self.fixed_corotated(), sigma, plastic),
        }
    }

    fn kirchhoff<const D: usize>(&self, sigma: &Vector<T, D>, plastic: T) -> Vector<T, D> {
        match self.elasticity {
            Elasticity::Hencky => self.hencky.kirchhoff(sigma, plastic),
            Elasticity::FixedCorotated => Principal::kirchhoff(&self.fixed_corotated(), sigma, plastic),
        }
    }

    fn stiffness<const D: usize>(&self, sigma: &Vector<T, D>, plastic: T) -> T {
        match self.elasticity {
            Elasticity::Hencky => self.hencky.stiffness(sigma, plastic),
            Elasticity::FixedCorotated => Principal::stiffness(&self.fixed_corotated(), sigma, plastic),
        }
    }

    fn return_map<const D: usize>(&self, sigma: &Vector<T, D>, plastic: T) -> Option<(Vector<T, D>, T)> {
        let two_mu = T::TWO * self.hencky.mu;
        let (mean, deviator, kept) = self.trial(sigma);
        let kept = kept?;
        let on_surface = deviator.map(|x| mean + kept * x);
        let sigma = match self.elasticity {
            Elasticity::Hencky => on_surface.map(|x| (x / two_mu).exp()),
            // The larger root of 2μ (σ − 1) σ = x.
            Elasticity::FixedCorotated => {
                on_surface.map(|x| T::HALF * (T::ONE + (T::ONE + T::TWO * x / self.hencky.mu).max(T::ZERO).sqrt()))
            }
        };
        Some((sigma, plastic))
    }

    /// Hencky: exact and symmetric, the second derivative of μ |e|² for |e| ≤ k, else of
    /// μ k (2|e| − k), e = dev ε. Fixed corotated: exact, and symmetric to the first order in the
    /// elastic strain.
    fn returned_tangent<const D: usize>(&self, sigma: &Vector<T, D>, plastic: T) -> Matrix<T, D> {
        let two_mu = T::TWO * self.hencky.mu;
        let (_, deviator, kept) = self.trial(sigma);
        let (along, across) = kept.map_or((T::ONE, T::ONE), |kept| (T::ZERO, kept));
        if self.elasticity == Elasticity::Hencky {
            return radial(&deviator, self.hencky.bulk(D), along * two_mu, across * two_mu);
        }
        let law = self.fixed_corotated();
        let Some((after, _)) = self.return_map(sigma, plastic) else {
            return law.returned_tangent(sigma, plastic);
        };
        // The stress after the return, x' + λ (J' − 1) J', depends on the trial's x by x'(x).
        let mut tangent = radial(&deviator, T::ONE / T::from_i32(D as i32), along, across);
        let volume = law.volume_tangent(product(&after));
        let least = T::EPSILON.sqrt() * two_mu;
        let slopes = after.map(|s| T::ONE / law.shear_tangent(s).max(least));
        let dilation = apply(&tangent, &slopes);
        for row in &mut tangent {
            for j in 0..D {
                row[j] = (row[j] + volume * dilation[j]) * law.shear_tangent(sigma[j]);
            }
        }
        tangent
    }
}
