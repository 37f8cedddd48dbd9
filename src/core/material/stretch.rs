//! Stretches without a decomposition.

use crate::maths::linalg::{Matrix, double_dot, mul_transpose, trace};
use crate::maths::real::Real;

/// Upper bound on the largest σ_i²: m + √((d − 1)/d) ‖dev F Fᵀ‖, m the mean (Wolkowicz & Styan
/// 1980, "Bounds for eigenvalues using traces"). It is exact in 2D, and in 3D when the two smaller
/// ones are equal.
#[inline(always)]
pub fn largest_stretch_squared<T: Real, const D: usize>(f: &Matrix<T, D>) -> T {
    let mut deviator = mul_transpose(f, f);
    let mean = trace(&deviator) / T::from_f64(D as f64);
    for i in 0..D {
        deviator[i][i] -= mean;
    }
    mean + (T::from_f64((D - 1) as f64 / D as f64) * double_dot(&deviator, &deviator)).sqrt()
}
