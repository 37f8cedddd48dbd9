//! Vectors and matrices of a document as three components and as row-major 3 × 3 arrays.

use gridfall_core::maths::linalg::{det, from_row_major};
use gridfall_core::sim::particles::IDENTITY;

/// A vector of the scene's dimension as three components; missing ones are zero.
pub(crate) fn vector3(v: &[f64]) -> [f64; 3] {
    std::array::from_fn(|a| v.get(a).copied().unwrap_or(0.0))
}

/// Length of a vector of any dimension.
pub(crate) fn length(v: &[f64]) -> f64 {
    v.iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// Angular velocity as three components; a single component turns about z.
pub(crate) fn spin(w: &[f64]) -> [f64; 3] {
    if let [w] = w { [0.0, 0.0, *w] } else { vector3(w) }
}

/// A matrix of the scene's dimension, row-major; what is missing is taken from the identity.
pub(crate) fn matrix3(rows: &[Vec<f64>]) -> [f64; 9] {
    let mut m = IDENTITY;
    for (i, row) in rows.iter().enumerate() {
        m[3 * i..3 * i + row.len()].copy_from_slice(row);
    }
    m
}

/// Determinant of a row-major matrix.
pub(crate) fn determinant(m: &[f64; 9]) -> f64 {
    det(&from_row_major::<f64, 3>(m))
}
