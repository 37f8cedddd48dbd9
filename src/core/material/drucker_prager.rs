//! Cohesionless Drucker–Prager sand (Klár et al. 2016, "Drucker–Prager elastoplasticity for sand
//! animation", §6) with the volume correction of Tampubolon et al. 2017 ("Multi-species simulation
//! of porous sand and water mixtures", §4.3.4).
//!
//! Hencky elasticity inside the cone ‖dev ε‖ + α (dλ + 2μ)/(2μ) tr ε ≤ 0, α = √(2/3) 2
//! sin φ / (3 − sin φ). The plastic state v_c ≥ 0 is the logarithm of the volume that the sand
//! gained while its grains were apart. Sand resists compression only after it has lost that volume
//! again. With ε' = ε + v_c/d:
//! * tr ε' ≥ 0: no contact, ε ← 0, v_c ← tr ε';
//! * otherwise ε ← ε', projected onto the cone at equal trace if it lies outside, v_c ← 0.

use super::StvkHencky;
use super::parameters;
use super::principal::{Principal, mean_and_deviator, norm};
use crate::maths::linalg::Vector;
use crate::maths::real::Real;

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DruckerPrager<T> {
    pub elastic: StvkHencky<T>,
    /// α of the cone.
    pub slope: T,
}

impl<T: Real> DruckerPrager<T> {
    pub fn new(material: &parameters::DruckerPrager, elastic: &parameters::Elastic) -> Self {
        let sin = material.friction_angle_degrees.to_radians().sin();
        let slope = (2.0f64 / 3.0).sqrt() * 2.0 * sin / (3.0 - sin);
        Self { elastic: StvkHencky::new(elastic), slope: T::from_f64(slope) }
    }

    /// Norm of the deviator that the cone allows at a negative trace.
    fn radius(&self, dimension: usize, trace: T) -> T {
        let d = T::from_i32(dimension as i32);
        let StvkHencky { mu, lambda } = self.elastic;
        -self.slope * (d * lambda + T::TWO * mu) / (T::TWO * mu) * trace
    }
}

impl<T: Real> Principal<T> for DruckerPrager<T> {
    fn energy<const D: usize>(&self, sigma: &Vector<T, D>, plastic: T) -> T {
        self.elastic.energy(sigma, plastic)
    }

    fn kirchhoff<const D: usize>(&self, sigma: &Vector<T, D>, plastic: T) -> Vector<T, D> {
        self.elastic.kirchhoff(sigma, plastic)
    }

    fn stiffness<const D: usize>(&self, sigma: &Vector<T, D>, plastic: T) -> T {
        self.elastic.stiffness(sigma, plastic)
    }

    fn return_map<const D: usize>(&self, sigma: &Vector<T, D>, plastic: T) -> Option<(Vector<T, D>, T)> {
        let d = T::from_i32(D as i32);
        let (mean, deviator) = mean_and_deviator(&sigma.map(T::ln));
        let mean = mean + plastic / d;
        let trace = d * mean;
        if trace >= T::ZERO {
            return Some(([T::ONE; D], trace));
        }
        let (length, allowed) = (norm(&deviator), self.radius(D, trace));
        if length <= allowed && plastic == T::ZERO {
            return None;
        }
        let kept = if length > allowed { allowed / length } else { T::ONE };
        Some((deviator.map(|e| (mean + kept * e).exp()), T::ZERO))
    }
}
