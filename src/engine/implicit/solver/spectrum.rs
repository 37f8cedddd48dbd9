//! The largest eigenvalue of D⁻¹A, A given by its products.

use nalgebra::DMatrix;

use super::objective::NodeVectors;
use super::verbs::{apply_blocks, axpy, dot, xpby};
use gridfall_core::maths::linalg::{Matrix, Vector};
use gridfall_core::maths::real::Real;

/// Lanczos steps; power iteration underestimates the eigenvalue by enough to make the cycle
/// diverge.
const STEPS: usize = 12;
/// Factor by which the largest Ritz value is raised.
const MARGIN: f64 = 1.1;

/// 1.1 × the largest Ritz value of 12 Lanczos steps for D⁻¹A. Lanczos' tridiagonal
/// matrix is read off conjugate gradients.
pub fn largest_eigenvalue<T: Real, const D: usize>(
    multiply: impl Fn(&[Vector<T, D>], &mut [Vector<T, D>]),
    inverse_diagonal: &[Matrix<T, D>],
) -> f64 {
    let n = inverse_diagonal.len();
    let wide = |v: &[Vector<T, D>]| -> NodeVectors<D> { v.iter().map(|v| v.map(|x| x.to_f64())).collect() };
    let mut r: Vec<Vector<T, D>> = (0..n).map(|i| std::array::from_fn(|a| noise((D * i + a) as u64))).collect();
    let mut z = vec![[T::ZERO; D]; n];
    let mut ap = z.clone();
    // A right-hand side D × noise is noise in the eigenbasis of D⁻¹A, whatever the scales of the
    // nodes.
    multiply(&r, &mut ap);
    r.copy_from_slice(&ap);
    apply_blocks(inverse_diagonal, &r, &mut z);
    let mut p = z.clone();
    let mut zr = dot(&wide(&z), &wide(&r));
    let mut tridiagonal = DMatrix::<f64>::zeros(STEPS, STEPS);
    let (mut old_alpha, mut beta, mut steps) = (1.0, 0.0, 0);
    for k in 0..STEPS {
        multiply(&p, &mut ap);
        let pap = dot(&wide(&p), &wide(&ap));
        if !(pap > 0.0 && zr > 0.0) {
            break;
        }
        let alpha = zr / pap;
        tridiagonal[(k, k)] = 1.0 / alpha + beta / old_alpha;
        axpy(T::from_f64(-alpha), &ap, &mut r);
        apply_blocks(inverse_diagonal, &r, &mut z);
        let new = dot(&wide(&z), &wide(&r));
        (beta, old_alpha, steps) = (new / zr, alpha, k + 1);
        zr = new;
        if k + 1 < STEPS {
            tridiagonal[(k, k + 1)] = beta.max(0.0).sqrt() / alpha;
            tridiagonal[(k + 1, k)] = tridiagonal[(k, k + 1)];
        }
        xpby(&z, T::from_f64(beta), &mut p);
    }
    if steps == 0 {
        return MARGIN;
    }
    MARGIN * tridiagonal.view((0, 0), (steps, steps)).into_owned().symmetric_eigenvalues().max()
}

/// A fixed pseudo-random number in [−1, 1) for every place.
fn noise<T: Real>(place: u64) -> T {
    // SplitMix64's finaliser (Steele, Lea & Flood 2014).
    let mut x = place.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    x = (x ^ x >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ x >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
    T::from_f64(((x ^ x >> 31) >> 11) as f64 / (1u64 << 52) as f64 - 1.0)
}
