//! Isotropic laws in principal space, where each takes a few lines: F = U Σ Vᵀ, τ = U diag(τ_i) Uᵀ,
//! and a return map changes Σ alone.

use crate::maths::linalg::{Matrix, Vector, mul_transpose};
use crate::maths::real::Real;
use crate::maths::svd::{Svd, svd};

/// Lower bound of the stretches that laws see, so that logarithms of flat and inverted states
/// exist.
pub const MIN_STRETCH: f64 = 1e-4;
/// Upper bound of the stretches that laws see, so that products of three fit f32.
pub const MAX_STRETCH: f64 = 1e4;

/// An isotropic law. `sigma` are the singular values of F, clamped to [[`MIN_STRETCH`],
/// [`MAX_STRETCH`]]. `plastic` is the scalar plastic state; each law says what it means, if
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
}

fn clamped<T: Real, const D: usize>(sigma: &Vector<T, D>) -> Vector<T, D> {
    sigma.map(|s| s.max(T::from_f64(MIN_STRETCH)).min(T::from_f64(MAX_STRETCH)))
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

/// Return map and stress for singular values as a decomposition gives them.
pub fn flow<T: Real, L: Principal<T>, const D: usize>(law: &L, sigma: &Vector<T, D>, plastic: T) -> Flow<T, D> {
    let trial = clamped(sigma);
    let (after, state) = law.return_map(&trial, plastic).unwrap_or((trial, plastic));
    Flow {
        sigma: after,
        plastic: state,
        moved: L::PLASTIC && after != *sigma,
        tau: law.kirchhoff(&after, state),
        stiffness: law.stiffness(&after, state),
    }
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
    let mean = a.iter().copied().sum::<T>() / T::from_i32(D as i32);
    (mean, a.map(|x| x - mean))
}

/// Euclidean length.
#[inline(always)]
pub fn norm<T: Real, const D: usize>(a: &Vector<T, D>) -> T {
    a.iter().map(|&x| x * x).sum::<T>().sqrt()
}
