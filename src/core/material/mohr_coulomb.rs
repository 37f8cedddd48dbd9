//! Mohr–Coulomb: a friction angle φ that is the same in every stress state, a cohesion c and a
//! dilatancy angle ψ; with an opening between the grains (`opening.rs`).
//!
//! Hencky elasticity while τ_1 − τ_3 ≤ 2 c cos φ − (τ_1 + τ_3) sin φ, τ_1 the largest and τ_3 the
//! smallest principal stress (tension is positive). With ε in place of τ = 2μ ε + λ tr ε and
//! k = λ/(2μ), the excess of two axes over the surface is
//!
//!   f_ij = (1 + sin φ) ε_i − (1 − sin φ) ε_j + 2 k sin φ tr ε − C,  C = c cos φ/μ.
//!
//! Flow is along (1 + sin ψ, −(1 − sin ψ)) on those axes. The return is exact (Clausen, Damkilde &
//! Andersen 2007, "An efficient return algorithm for non-associated plasticity with linear yield
//! criteria in principal stress space"; de Souza Neto, Perić & Owen 2008, §8.2):
//! 1. beyond the tip, τ_i = c cot φ, to the tip, and the body opens: where the trace exceeds the
//!    tip's by more than the deviator dilates as it flows away;
//! 2. else to the plane f_13 = 0;
//! 3. if the order of the axes would change, to the edge where two planes meet, by the sum of their
//!    two flows: ε_2 = ε_3 (extension) or ε_1 = ε_2 (compression).
//!
//! In two dimensions, only stresses in the plane count: the one across is taken to be between them.
//! Without friction the law is Tresca's and has no tip.

use super::StvkHencky;
use super::opening;
use super::parameters;
use super::principal::{Principal, flowing_along, mean_and_deviator, radial};
use crate::maths::linalg::{Matrix, Vector};
use crate::maths::real::Real;

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MohrCoulomb<T> {
    pub elastic: StvkHencky<T>,
    pub sin_friction: T,
    pub sin_dilatancy: T,
    /// C = c cos φ/μ.
    pub strength: T,
}

impl<T: Real> MohrCoulomb<T> {
    pub fn new(material: &parameters::MohrCoulomb, elastic: &parameters::Elastic) -> Self {
        let (phi, psi) = (material.friction_angle_degrees.to_radians(), material.dilatancy_angle_degrees.to_radians());
        let strength = material.cohesion * phi.cos() / super::lame(elastic).0;
        let [sin_friction, sin_dilatancy, strength] = [phi.sin(), psi.sin(), strength].map(T::from_f64);
        Self { elastic: StvkHencky::new(elastic), sin_friction, sin_dilatancy, strength }
    }

    /// λ/(2μ).
    fn bulk(&self) -> T {
        self.elastic.lambda / (T::TWO * self.elastic.mu)
    }

    /// f_ij for two strains and their trace.
    pub fn excess(&self, most: T, least: T, trace: T) -> T {
        let sin = self.sin_friction;
        (T::ONE + sin) * most - (T::ONE - sin) * least + T::TWO * self.bulk() * sin * trace - self.strength
    }

    fn trial<const D: usize>(&self, sigma: &Vector<T, D>, plastic: T) -> Trial<T, D> {
        let d = T::from_i32(D as i32);
        let (mean, deviator) = mean_and_deviator(&sigma.map(T::ln));
        let (trace, apart) = opening::close(d * mean, plastic);
        let strain = deviator.map(|e| e + trace / d);
        let dilatancy = if apart > T::ZERO { T::ZERO } else { self.sin_dilatancy };
        // At the tip, (1/d + k) tr ε = C/(2 sin φ).
        let tip = opening::tip(self.strength, T::TWO * self.sin_friction * (T::ONE / d + self.bulk()));
        let opened = trace - tip - dilation_of_all(&strain, dilatancy);
        let closing = mean < T::ZERO && apart > T::ZERO;
        Trial { strain, trace, apart, dilatancy, tip, opened, closing }
    }

    /// Strains on the planes and edges that strains outside flow to, and the directions of the one
    /// or two flows; the second is 0 on a plane. `None` inside.
    fn flow<const D: usize>(
        &self,
        strain: &Vector<T, D>,
        trace: T,
        dilatancy: T,
    ) -> Option<(Vector<T, D>, [Vector<T, D>; 2])> {
        let order = falling(strain);
        let (high, middle, low) = (order[0], order[1], order[D - 1]);
        let excess = self.excess(strain[high], strain[low], trace);
        if excess <= T::ZERO {
            return None;
        }
        let (sin, more, less) = (self.sin_friction, T::ONE + dilatancy, T::ONE - dilatancy);
        let volume = T::TWO * T::TWO * self.bulk() * sin * dilatancy;
        let plane = T::TWO * (T::ONE + sin * dilatancy) + volume;
        let flow = excess / plane;
        let mut after = *strain;
        after[high] -= flow * more;
        after[low] += flow * less;
        let along = |most: usize, least: usize| {
            let mut direction = [T::ZERO; D];
            direction[most] = more;
            direction[least] = -less;
            direction
        };
        let mut directions = [along(high, low), [T::ZERO; D]];
        if D == 3 && (after[high] < strain[middle] || after[low] > strain[middle]) {
            if is_extended(strain[high], strain[middle], strain[low], dilatancy) {
                let second = self.excess(strain[high], strain[middle], trace);
                let flow = (excess + second) / (plane + (T::ONE + sin) * more + volume);
                after[high] = strain[high] - flow * more;
                after[low] = T::HALF * (strain[middle] + strain[low] + flow * less);
                after[middle] = after[low];
                directions[1] = along(high, middle);
            } else {
                let second = self.excess(strain[middle], strain[low], trace);
                let flow = (excess + second) / (plane + (T::ONE - sin) * less + volume);
                after[low] = strain[low] + flow * less;
                after[high] = T::HALF * (strain[high] + strain[middle] - flow * more);
                after[middle] = after[high];
                directions[1] = along(middle, low);
            }
        }
        Some((after, directions))
    }
}

/// A trial strain once compression has closed what it can of the opening.
struct Trial<T, const D: usize> {
    /// With its trace, both after closing, and v_c.
    strain: Vector<T, D>,
    trace: T,
    apart: T,
    /// sin ψ, 0 while the grains are apart.
    dilatancy: T,
    /// tr ε at the tip, and what the state opens beyond it. Negative where it does not.
    tip: T,
    opened: T,
    /// Whether a change of volume only opens or closes what is between the grains.
    closing: bool,
}

/// Whether flow on the plane of the largest and the smallest strain makes the two smaller ones
/// equal before it does the two larger ones.
fn is_extended<T: Real>(high: T, middle: T, low: T, dilatancy: T) -> bool {
    (T::ONE - dilatancy) * (high - middle) > (T::ONE + dilatancy) * (middle - low)
}

/// Volume by which a body dilates while all of its deviator flows.
fn dilation_of_all<T: Real, const D: usize>(strain: &Vector<T, D>, dilatancy: T) -> T {
    let order = falling(strain);
    let (high, middle, low) = (strain[order[0]], strain[order[1]], strain[order[D - 1]]);
    let three = T::ONE + T::TWO;
    if D == 2 {
        dilatancy * (high - low)
    } else if is_extended(high, middle, low, dilatancy) {
        T::TWO * dilatancy * (high - middle + high - low) / (three + dilatancy)
    } else {
        T::TWO * dilatancy * (high - low + middle - low) / (three - dilatancy)
    }
}

/// Indices from the largest entry to the smallest.
fn falling<T: Real, const D: usize>(a: &Vector<T, D>) -> [usize; D] {
    let mut order = std::array::from_fn(|i| i);
    for end in (1..D).rev() {
        for i in 0..end {
            if a[order[i]] < a[order[i + 1]] {
                order.swap(i, i + 1);
            }
        }
    }
    order
}

impl<T: Real> Principal<T> for MohrCoulomb<T> {
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
        let Trial { strain, trace, apart, dilatancy, tip, opened, .. } = self.trial(sigma, plastic);
        if opened >= T::ZERO {
            return Some(([(tip / T::from_i32(D as i32)).exp(); D], apart + opened));
        }
        match self.flow(&strain, trace, dilatancy) {
            Some((after, _)) => Some((after.map(T::exp), apart)),
            None => (apart != plastic).then(|| (strain.map(T::exp), apart)),
        }
    }

    /// That of flow on planes with the dilatancy angle in place of the friction angle, which are at
    /// this state where the true ones are. It is exact where the two angles are the same, as for
    /// Drucker–Prager.
    fn returned_tangent<const D: usize>(&self, sigma: &Vector<T, D>, plastic: T) -> Matrix<T, D> {
        let Trial { strain, trace, dilatancy, opened, closing, .. } = self.trial(sigma, plastic);
        if opened >= T::ZERO {
            return [[T::ZERO; D]; D];
        }
        let two_mu = T::TWO * self.elastic.mu;
        let bulk = if closing { T::ZERO } else { self.elastic.bulk(D) };
        let tangent = radial(&strain, bulk, two_mu, two_mu);
        let flow = self.flow(&strain, trace, dilatancy);
        flow.map_or(tangent, |(_, [first, second])| flowing_along(&flowing_along(&tangent, &first), &second))
    }
}
