//! Drucker–Prager sand (Klár et al. 2016, "Drucker–Prager elastoplasticity for sand animation", §6)
//! with cohesion, dilatancy and an opening between its grains (`opening.rs`).
//!
//! Hencky elasticity inside the cone ‖dev τ‖ + α tr τ ≤ β, or with K = (dλ + 2μ)/(2μ)
//! ‖dev ε‖ + α K tr ε ≤ β/(2μ). A strain outside flows along dev ε/‖dev ε‖ + α_ψ, α_ψ the same
//! function of the dilatancy angle as α is of the friction angle. The tip is at τ_i = c cot φ.
//!
//! A cone has one strength at a pressure, and a friction angle has a different one in every stress
//! state. `cone` says in which of them the two are the same; α = g sin φ, β = d g c cos φ:
//! * triaxial compression, as published: g = √(2/3) 2/(3 − sin φ).
//! * plane strain (Drucker & Prager 1952). All flow is in the plane once it is all plastic, so the
//!   stress across has dev τ_z = −α_ψ ‖dev τ‖. With that, 3 α_ψ = sin ψ √(2 − 3 α_ψ²) dilates by ψ
//!   and g = ⅔/(√(2 − 3 α_ψ²) + α_ψ sin φ) fails at φ. In two dimensions, where dev τ has two
//!   components and the stress across does not count, g = 1/√2 for both.

use super::StvkHencky;
use super::opening;
use super::parameters::{self, Cone};
use super::principal::{Flow, Principal, clamped, flowing_along, logarithms, mean_and_deviator, norm, radial};
use crate::maths::linalg::{Matrix, Vector};
use crate::maths::real::Real;

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DruckerPrager<T> {
    pub elastic: StvkHencky<T>,
    /// In two and in three dimensions.
    slopes: [Slopes<T>; 2],
}

/// Slopes of a cone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Slopes<T> {
    /// α.
    pub friction: T,
    /// α_ψ.
    pub dilatancy: T,
    /// β/(2μ).
    pub strength: T,
}

impl<T: Real> DruckerPrager<T> {
    pub fn new(material: &parameters::DruckerPrager, elastic: &parameters::Elastic) -> Self {
        let slopes = [2, 3].map(|dimension| Slopes::new(material, elastic, dimension));
        Self { elastic: StvkHencky::new(elastic), slopes }
    }

    /// The cone in a number of dimensions.
    #[inline(always)]
    pub fn slopes(&self, dimension: usize) -> Slopes<T> {
        self.slopes[dimension - 2]
    }

    /// α K: how the norm of the deviator that the cone allows grows with −tr ε.
    #[inline(always)]
    pub fn growth(&self, dimension: usize) -> T {
        let StvkHencky { mu, lambda } = self.elastic;
        self.slopes(dimension).friction * (T::from_i32(dimension as i32) * lambda + T::TWO * mu) / (T::TWO * mu)
    }
}

/// A trial strain beside the cone, once compression has closed what it can of the opening.
struct Trial<T, const D: usize> {
    deviator: Vector<T, D>,
    /// ‖dev ε‖.
    length: T,
    /// tr ε after closing, and v_c.
    trace: T,
    apart: T,
    /// d α_ψ, 0 while the grains are apart.
    dilation: T,
    /// tr ε at the tip, and what the state opens beyond it. Negative where it does not.
    tip: T,
    opened: T,
    /// By how much ‖dev ε‖ flows if it does not open. Not positive inside the cone.
    flow: T,
    /// Whether a change of volume only opens or closes what is between the grains.
    closing: bool,
}

impl<T: Real> DruckerPrager<T> {
    #[inline(always)]
    fn trial<const D: usize>(&self, sigma: &Vector<T, D>, plastic: T) -> Trial<T, D> {
        let d = T::from_i32(D as i32);
        let (mean, deviator) = mean_and_deviator(&logarithms(sigma));
        let (trace, apart) = opening::close(d * mean, plastic);
        let Slopes { dilatancy, strength, .. } = self.slopes(D);
        let dilation = if apart > T::ZERO { T::ZERO } else { d * dilatancy };
        let (growth, length) = (self.growth(D), norm(&deviator));
        let tip = opening::tip(strength, growth);
        let opened = trace - tip - dilation * length;
        let flow = (length + growth * trace - strength) / (T::ONE + growth * dilation);
        let closing = mean < T::ZERO && apart > T::ZERO;
        Trial { deviator, length, trace, apart, dilation, tip, opened, flow, closing }
    }

    /// The strain on or inside the yield surface, v_c there, and whether either is not that of the trial
    /// state. Without branches, so that loops over particles vectorise.
    #[inline(always)]
    fn returned<const D: usize>(&self, trial: &Trial<T, D>, plastic: T) -> (Vector<T, D>, T, bool) {
        let Trial { deviator, length, trace, apart, dilation, tip, opened, flow, .. } = *trial;
        let (opens, flows) = (opened >= T::ZERO, flow > T::ZERO);
        let flow = if flows { flow } else { T::ZERO };
        let kept = if flows { T::ONE - flow / length } else { T::ONE };
        let kept = if opens { T::ZERO } else { kept };
        let mean = (if opens { tip } else { trace - flow * dilation }) / T::from_i32(D as i32);
        let mut strain = deviator;
        for e in &mut strain {
            *e = mean + kept * *e;
        }
        (strain, if opens { apart + opened } else { apart }, opens | flows | (apart != plastic))
    }
}

impl<T: Real> Slopes<T> {
    fn new(material: &parameters::DruckerPrager, elastic: &parameters::Elastic, dimension: usize) -> Self {
        let (phi, psi) = (material.friction_angle_degrees.to_radians(), material.dilatancy_angle_degrees.to_radians());
        let sin = phi.sin();
        let compression = |sin: f64| (2.0f64 / 3.0).sqrt() * 2.0 / (3.0 - sin);
        let (friction, dilatancy) = match (material.cone, dimension) {
            (Cone::TriaxialCompression, _) => (compression(sin), psi.sin() * compression(psi.sin())),
            (Cone::PlaneStrain, 2) => (0.5f64.sqrt(), 0.5f64.sqrt() * psi.sin()),
            (Cone::PlaneStrain, _) => {
                let dilatancy = psi.sin() * (2.0 / (9.0 + 3.0 * psi.sin() * psi.sin())).sqrt();
                let across = (2.0 - 3.0 * dilatancy * dilatancy).sqrt() + dilatancy * sin;
                (2.0 / 3.0 / across, dilatancy)
            }
        };
        let strength = dimension as f64 * friction * material.cohesion * phi.cos();
        let [friction, dilatancy] = [friction * sin, dilatancy].map(T::from_f64);
        Self { friction, dilatancy, strength: T::from_f64(strength / (2.0 * super::lame(elastic).0)) }
    }
}

impl<T: Real> Principal<T> for DruckerPrager<T> {
    fn energy<const D: usize>(&self, sigma: &Vector<T, D>, plastic: T) -> T {
        self.elastic.energy(sigma, plastic)
    }

    #[inline(always)]
    fn kirchhoff<const D: usize>(&self, sigma: &Vector<T, D>, plastic: T) -> Vector<T, D> {
        self.elastic.kirchhoff(sigma, plastic)
    }

    #[inline(always)]
    fn stiffness<const D: usize>(&self, sigma: &Vector<T, D>, plastic: T) -> T {
        self.elastic.stiffness(sigma, plastic)
    }

    fn return_map<const D: usize>(&self, sigma: &Vector<T, D>, plastic: T) -> Option<(Vector<T, D>, T)> {
        let (strain, apart, changed) = self.returned(&self.trial(sigma, plastic), plastic);
        changed.then(|| (strain.map(T::exp), apart))
    }

    /// As the return map and the stress after it, with one logarithm and one exponential an axis.
    #[inline(always)]
    fn flow<const D: usize>(&self, sigma: &Vector<T, D>, plastic: T) -> Flow<T, D> {
        let trial = clamped(sigma);
        let (strain, state, changed) = self.returned(&self.trial(&trial, plastic), plastic);
        let (mut after, mut moved) = (trial, false);
        for i in 0..D {
            let stretch = strain[i].exp();
            after[i] = if changed { stretch } else { trial[i] };
            moved |= after[i] != sigma[i];
        }
        Flow {
            sigma: after,
            plastic: state,
            moved,
            tau: self.elastic.stress(&strain),
            stiffness: self.elastic.stiffness_at(&strain),
        }
    }

    /// That of flow which is associated with a cone of the dilatancy angle, of the same radius
    /// ‖dev ε‖ at this state: without dilatancy the radius is fixed at that of the trial state's
    /// pressure. It is exact where the two angles are the same. With the true growth of the radius
    /// it would not be symmetric, and symmetrised it would dilate.
    fn returned_tangent<const D: usize>(&self, sigma: &Vector<T, D>, plastic: T) -> Matrix<T, D> {
        let Trial { deviator, length, dilation, opened, flow, closing, .. } = self.trial(sigma, plastic);
        let two_mu = T::TWO * self.elastic.mu;
        let bulk = if closing { T::ZERO } else { self.elastic.bulk(D) };
        if opened >= T::ZERO {
            return [[T::ZERO; D]; D];
        }
        if flow <= T::ZERO {
            return radial(&deviator, bulk, two_mu, two_mu);
        }
        let stiffness = radial(&deviator, bulk, two_mu, two_mu * (T::ONE - flow / length));
        let dilation = dilation / T::from_i32(D as i32);
        flowing_along(&stiffness, &deviator.map(|e| e / length + dilation))
    }
}
