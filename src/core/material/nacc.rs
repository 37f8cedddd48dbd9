//! Non-associative Cam Clay (Wolper et al. 2019, "CD-MPM: continuum damage material point methods
//! for dynamic fracture animation", §4.2).
//!
//! Elasticity: ψ = ½ μ (J^(−2/d) tr b − d) + ½ κ (½ (J² − 1) − ln J), κ = λ + 2μ/d. With b_i = σ_i²
//! the stresses are s_i = μ J^(−2/d) dev(b)_i, p = −½ κ (J² − 1), τ_i = s_i − p.
//!
//! The yield surface is an ellipse in p and q = √((6 − d)/2) ‖s‖: y
//! = (1 + 2β) q² + M² (p + β p0)(p − p0) ≤ 0, with p0 = κ (1e-5 + sinh(ξ max(−α, 0))). The plastic
//! state α is the logarithm of the plastic volume ratio. Compaction (falling α) hardens; extension
//! softens until the material has come apart.
//!
//! Beyond the tips (p > p0, p < −β p0) the state returns to the tip and α absorbs the volume
//! change. Elsewhere the deviator is shortened at equal volume, and α moves as if the state had
//! returned towards the ellipse's centre. When it shortens the deviator, the paper keeps the old
//! tr b, which changes J. Here the trace is solved for, so that J and p are kept and the state ends
//! exactly on the surface.

use super::lame;
use super::parameters;
use super::principal::{Principal, mean_and_deviator, norm, product, radial};
use crate::maths::linalg::{Matrix, Vector, mul};
use crate::maths::real::Real;

/// Plastic state: α = ln J_plastic.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Nacc<T> {
    /// Lamé's parameters (Pa).
    pub mu: T,
    pub lambda: T,
    pub m: T,
    pub beta: T,
    pub xi: T,
}

/// p0 = κ (this + sinh …): the cohesion that is left when all hardening is gone.
pub const RESIDUAL: f64 = 1e-5;
/// Bound on ξ α in the hardening law. p cannot exceed ½ κ, so nothing changes beyond sinh⁻¹(½).
const MAX_HARDENING: f64 = 4.0;

impl<T: Real> Nacc<T> {
    pub fn new(material: &parameters::Nacc, elastic: &parameters::Elastic) -> Self {
        let (mu, lambda) = lame(elastic);
        let [mu, lambda, m, beta, xi] = [mu, lambda, material.m, material.beta, material.xi].map(T::from_f64);
        Self { mu, lambda, m, beta, xi }
    }

    fn kappa(&self, dimension: usize) -> T {
        self.lambda + T::TWO * self.mu / T::from_i32(dimension as i32)
    }

    /// p0 / κ.
    fn strength(&self, alpha: T) -> T {
        let e = (self.xi * (-alpha).max(T::ZERO)).min(T::from_f64(MAX_HARDENING)).exp();
        T::from_f64(RESIDUAL) + T::HALF * (e - T::ONE / e)
    }

    /// J^(−2/d) b_i.
    fn isochoric<const D: usize>(sigma: &Vector<T, D>, j: T) -> Vector<T, D> {
        let scale = j.powf(T::from_f64(-2.0 / D as f64));
        sigma.map(|s| scale * s * s)
    }

    /// Yield function y / κ², p/κ and q/κ.
    pub fn yield_function<const D: usize>(&self, sigma: &Vector<T, D>, alpha: T) -> (T, T, T) {
        let j = product(sigma);
        let p = -T::HALF * (j * j - T::ONE);
        let (_, deviator) = mean_and_deviator(&Self::isochoric(sigma, j));
        let q = Self::q_factor::<D>() * self.mu / self.kappa(D) * norm(&deviator);
        (self.ellipse(p, q, self.strength(alpha)), p, q)
    }

    /// ∂τ_i/∂ε_j, ε = ln σ (Pa), of the elastic law: μ ∂dev(b)_i/∂ε_j + κ J².
    pub(super) fn tangent<const D: usize>(&self, sigma: &Vector<T, D>) -> Matrix<T, D> {
        let j = product(sigma);
        let slope = deviator_slope(&Self::isochoric(sigma, j));
        slope.map(|row| row.map(|x| self.mu * x + self.kappa(D) * j * j))
    }

    fn q_factor<const D: usize>() -> T {
        T::from_f64((0.5 * (6 - D) as f64).sqrt())
    }

    /// The q/κ of the ellipse at p/κ.
    fn largest_q(&self, p: T, p0: T) -> T {
        let square = -self.m * self.m * (p + self.beta * p0) * (p - p0) / (T::ONE + T::TWO * self.beta);
        square.max(T::ZERO).sqrt()
    }

    fn ellipse(&self, p: T, q: T, p0: T) -> T {
        (T::ONE + T::TWO * self.beta) * q * q + self.m * self.m * (p + self.beta * p0) * (p - p0)
    }

    /// The p/κ at which the line from the ellipse's centre through (p, q) crosses the ellipse.
    fn towards_centre(&self, p: T, q: T, p0: T) -> T {
        let centre = T::HALF * (T::ONE - self.beta) * p0;
        let (dp, m2) = (p - centre, self.m * self.m);
        // At the fraction t of the way, t² (m² dp² + (1 + 2β) q²) = m² ((1 + β) p0 / 2)².
        let half_axis = T::HALF * (T::ONE + self.beta) * p0;
        let square = m2 * dp * dp + (T::ONE + T::TWO * self.beta) * q * q;
        centre + dp * (m2 * half_axis * half_axis / square.max(T::TINY)).sqrt().min(T::ONE)
    }
}

/// ∂dev(b)_i/∂ε_j = 2 δ_ij b_i − (2/d) (b_i + b_j) + (2/d²) tr b, b isochoric and ε = ln σ.
fn deviator_slope<T: Real, const D: usize>(b: &Vector<T, D>) -> Matrix<T, D> {
    let d = T::from_i32(D as i32);
    let mean = b.iter().copied().sum::<T>() / d;
    let mut slope = [[T::ZERO; D]; D];
    for i in 0..D {
        for k in 0..D {
            slope[i][k] = T::TWO / d * (mean - b[i] - b[k]);
        }
        slope[i][i] += T::TWO * b[i];
    }
    slope
}

/// The mean m of the isochoric b with the deviator d, solved from Π (d_i + m) = 1. Newton's
/// iteration starts from above and converges monotonically.
fn isochoric_mean<T: Real, const D: usize>(deviator: &Vector<T, D>, start: T) -> T {
    let mut m = start;
    for _ in 0..8 {
        let terms = deviator.map(|d| d + m);
        let value = product(&terms) - T::ONE;
        let mut slope = T::ZERO;
        for i in 0..D {
            let mut others = T::ONE;
            for k in 0..D {
                if k != i {
                    others *= terms[k];
                }
            }
            slope += others;
        }
        m -= value / slope;
    }
    m
}

impl<T: Real> Principal<T> for Nacc<T> {
    fn energy<const D: usize>(&self, sigma: &Vector<T, D>, _alpha: T) -> T {
        // In terms of e = dev ln σ and ln J. The sums e^2x − 1 − 2x keep the digits that tr b − d
        // and J² − 1 − 2 ln J lose near rest.
        let excess = |x: T| (T::TWO * x).exp_m1() - T::TWO * x;
        let (mean, deviator) = mean_and_deviator(&sigma.map(T::ln));
        let isochoric = deviator.iter().map(|&e| excess(e)).sum::<T>();
        let volume = excess(mean * T::from_i32(D as i32));
        T::HALF * self.mu * isochoric + T::HALF * T::HALF * self.kappa(D) * volume
    }

    fn kirchhoff<const D: usize>(&self, sigma: &Vector<T, D>, _alpha: T) -> Vector<T, D> {
        let j = product(sigma);
        let (_, deviator) = mean_and_deviator(&Self::isochoric(sigma, j));
        deviator.map(|d| self.mu * d + T::HALF * self.kappa(D) * (j * j - T::ONE))
    }

    /// σ_i² ψ_ii = ½ μ ((2 − 8/d) b_i + (4/d² + 2/d) tr b) J^(−2/d) + ½ κ (J² + 1). Across the axes
    /// it is μ J^(−2/d) b_j.
    fn stiffness<const D: usize>(&self, sigma: &Vector<T, D>, _alpha: T) -> T {
        let j = product(sigma);
        let b = Self::isochoric(sigma, j);
        let trace = b.iter().copied().sum::<T>();
        let (own, all) = (2.0 - 8.0 / D as f64, 4.0 / (D * D) as f64 + 2.0 / D as f64);
        let mut worst = T::ZERO;
        for &b in &b {
            let along = T::HALF * (T::from_f64(own) * b + T::from_f64(all) * trace);
            worst = worst.max(self.mu * along + T::HALF * self.kappa(D) * (j * j + T::ONE)).max(self.mu * b);
        }
        worst
    }

    fn return_map<const D: usize>(&self, sigma: &Vector<T, D>, alpha: T) -> Option<(Vector<T, D>, T)> {
        let (y, p, q) = self.yield_function(sigma, alpha);
        let p0 = self.strength(alpha);
        let j = product(sigma);
        let to_tip = |p: T| {
            let j_tip = (T::ONE - T::TWO * p).max(T::ZERO).sqrt();
            ([j_tip.powf(T::from_f64(1.0 / D as f64)); D], alpha + (j / j_tip).ln())
        };
        if p > p0 {
            return Some(to_tip(p0));
        }
        if p < -self.beta * p0 {
            return Some(to_tip(-self.beta * p0));
        }
        if y <= T::ZERO {
            return None;
        }
        let kept = self.largest_q(p, p0) / q;
        let (mean, deviator) = mean_and_deviator(&Self::isochoric(sigma, j));
        let deviator = deviator.map(|d| kept * d);
        let mean = isochoric_mean(&deviator, mean);
        let stretch = j.powf(T::from_f64(1.0 / D as f64));
        let sigma = deviator.map(|d| stretch * (d + mean).max(T::TINY).sqrt());
        let p_surface = self.towards_centre(p, q, p0);
        let j_surface = (T::ONE - T::TWO * p_surface).max(T::TINY).sqrt();
        Some((sigma, alpha + (j / j_surface).ln()))
    }

    /// Beyond the tips the stress is constant. Elsewhere τ_i = r dev(b)_i/‖dev(b)‖ − p; the radius
    /// r(p) is held fixed, as for Drucker–Prager. Symmetric to the first order in the strain.
    fn returned_tangent<const D: usize>(&self, sigma: &Vector<T, D>, alpha: T) -> Matrix<T, D> {
        let (y, p, q) = self.yield_function(sigma, alpha);
        let p0 = self.strength(alpha);
        if p > p0 || p < -self.beta * p0 {
            return [[T::ZERO; D]; D];
        }
        if y <= T::ZERO {
            return self.tangent(sigma);
        }
        let j = product(sigma);
        let b = Self::isochoric(sigma, j);
        let kept = self.largest_q(p, p0) / q;
        let across = radial(&mean_and_deviator(&b).1, T::ZERO, T::ZERO, self.mu * kept);
        mul(&across, &deviator_slope(&b)).map(|row| row.map(|x| x + self.kappa(D) * j * j))
    }
}
