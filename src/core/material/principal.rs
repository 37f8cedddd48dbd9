//! Isotropic laws in principal space, where each takes a few lines: F = U Σ Vᵀ, τ = U diag(τ_i) Uᵀ,
//! and a return map changes Σ alone.

use crate::maths::linalg::{Matrix, Vector, apply, dot, mul_transpose};
use crate::maths::real::Real;
use crate::maths::svd::{Svd, svd};

/// Lower bound of the stretches that laws see, so that logarithms of flat and inverted states
/// exist.
pub const MIN_STRETCH: f64 = 1e-4;
/// Upper bound of the stretches that laws see, so that products of three fit f32.
pub const MAX_STRETCH: f64 = 1e4;

/// An isotropic law. `sigma` are the singular values of F, clamped to [`MIN_STRETCH`,
/// `MAX_STRETCH`]. `plastic` is the scalar plastic state; each law says what it means, if
/// anything.
pub trait Principal<T: Real> {
    /// Whether the law is plastic. An elastic law leaves F as it is, inverted states included.
    const PLASTIC: bool = true;

    /// ψ (J/m³).
    fn energy<const D: usize>(&self, sigma: &Vector<T, D>, plastic: T) -> T;

    /// Principal Kirchhoff stresses τ_i = σ_i ∂ψ/∂σ_i (Pa).
    fn kirchhoff<const D: usize>(&self, sigma: &Vector<T, D>, plastic: T) -> Vector<T, D>;

    /// Bound on the stiffness ρ0 c² (Pa) of waves through a body at this state, c² = (1/ρ0)
    /// max(σ_i² ψ_ii, σ_j² (σ_i ψ_i − σ_j ψ_j) / (σ_i² − σ_j²)) (Sun, Shinar & Schroeder 2020);
    /// λ + 2μ at rest.
    fn stiffness<const D: usize>(&self, sigma: &Vector<T, D>, plastic: T) -> T;

    /// The state on the yield surface that a trial state outside it returns to. `None` inside,
    /// where nothing flows.
    fn return_map<const D: usize>(&self, _sigma: &Vector<T, D>, _plastic: T) -> Option<(Vector<T, D>, T)> {
        None
    }

    /// Return map and stress for singular values as a decomposition gives them.
    #[inline(always)]
    fn flow<const D: usize>(&self, sigma: &Vector<T, D>, plastic: T) -> Flow<T, D> {
        let trial = clamped(sigma);
        let (after, state) = self.return_map(&trial, plastic).unwrap_or((trial, plastic));
        Flow {
            sigma: after,
            plastic: state,
            moved: Self::PLASTIC && after != *sigma,
            tau: self.kirchhoff(&after, state),
            stiffness: self.stiffness(&after, state),
        }
    }

    /// ∂τ_i/∂ε_j (Pa), τ the stress after the return map and ε = ln σ before it, for Newton's
    /// method: what has no potential is left out or not symmetric, as each law says.
    fn returned_tangent<const D: usize>(&self, sigma: &Vector<T, D>, plastic: T) -> Matrix<T, D>;
}

#[inline(always)]
pub fn clamped<T: Real, const D: usize>(sigma: &Vector<T, D>) -> Vector<T, D> {
    let mut clamped = *sigma;
    for s in &mut clamped {
        *s = s.max(T::from_f64(MIN_STRETCH)).min(T::from_f64(MAX_STRETCH));
    }
    clamped
}

/// ln σ_i.
#[inline(always)]
pub fn logarithms<T: Real, const D: usize>(sigma: &Vector<T, D>) -> Vector<T, D> {
    let mut strain = *sigma;
    for e in &mut strain {
        *e = e.ln();
    }
    strain
}

/// Σ a_i.
#[inline(always)]
pub fn total<T: Real, const D: usize>(a: &Vector<T, D>) -> T {
    let mut sum = a[0];
    for i in 1..D {
        sum += a[i];
    }
    sum
}

/// ψ(F) (J/m³).
pub fn energy<T: Real, const D: usize>(law: &impl Principal<T>, f: &Matrix<T, D>, plastic: T) -> T {
    law.energy(&clamped(&svd(f).sigma), plastic)
}

/// τ(F) (Pa), and ρ0 c² (Pa) of [`Principal::stiffness`].
pub fn kirchhoff<T: Real, const D: usize>(law: &impl Principal<T>, f: &Matrix<T, D>, plastic: T) -> (Matrix<T, D>, T) {
    let Svd { u, sigma, .. } = svd(f);
    let sigma = clamped(&sigma);
    let tau = law.kirchhoff(&sigma, plastic);
    (spectral(&u, &tau, &u), law.stiffness(&sigma, plastic))
}

/// A state on or inside the yield surface, with its stress and stiffness.
#[derive(Clone, Copy, Debug)]
pub struct Flow<T, const D: usize> {
    pub sigma: Vector<T, D>,
    pub plastic: T,
    /// Whether the return map changed `sigma`.
    pub moved: bool,
    /// Principal Kirchhoff stresses (Pa).
    pub tau: Vector<T, D>,
    /// ρ0 c² (Pa), see `Principal::stiffness`.
    pub stiffness: T,
}

/// U diag(values) Vᵀ.
pub fn spectral<T: Real, const D: usize>(u: &Matrix<T, D>, values: &Vector<T, D>, v: &Matrix<T, D>) -> Matrix<T, D> {
    let mut scaled = *u;
    for i in 0..D {
        for k in 0..D {
            scaled[i][k] *= values[k];
        }
    }
    mul_transpose(&scaled, v)
}

/// Π σ_i.
#[inline(always)]
pub fn product<T: Real, const D: usize>(sigma: &Vector<T, D>) -> T {
    let mut j = sigma[0];
    for i in 1..D {
        j *= sigma[i];
    }
    j
}

/// Σ a_i / D, and a_i − that.
#[inline(always)]
pub fn mean_and_deviator<T: Real, const D: usize>(a: &Vector<T, D>) -> (T, Vector<T, D>) {
    let mean = total(a) / T::from_i32(D as i32);
    let mut deviator = *a;
    for x in &mut deviator {
        *x += -mean;
    }
    (mean, deviator)
}

/// bulk 1 1ᵀ + along n nᵀ + across (I − 1 1ᵀ/d − n nᵀ), n the direction of a deviator: the tangent
/// of a radial return.
pub fn radial<T: Real, const D: usize>(deviator: &Vector<T, D>, bulk: T, along: T, across: T) -> Matrix<T, D> {
    let length = norm(deviator).max(T::TINY);
    let n = deviator.map(|e| e / length);
    let mut tangent = [[bulk - across / T::from_i32(D as i32); D]; D];
    for i in 0..D {
        for j in 0..D {
            tangent[i][j] += (along - across) * n[i] * n[j];
        }
        tangent[i][i] += across;
    }
    tangent
}

/// The stiffness C − (C m)(C m)ᵀ/(m·C m) that is left of C where a body flows freely along m. With
/// m = 0 it is C.
pub fn flowing_along<T: Real, const D: usize>(c: &Matrix<T, D>, m: &Vector<T, D>) -> Matrix<T, D> {
    let stress = apply(c, m);
    let divisor = dot(m, &stress).max(T::TINY);
    let mut left = *c;
    for i in 0..D {
        for j in 0..D {
            left[i][j] += -(stress[i] / divisor * stress[j]);
        }
    }
    left
}

/// Euclidean length.
#[inline(always)]
pub fn norm<T: Real, const D: usize>(a: &Vector<T, D>) -> T {
    dot(a, a).sqrt()
}
