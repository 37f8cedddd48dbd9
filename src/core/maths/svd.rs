//! Singular value and polar decompositions of 2 × 2 and 3 × 3 matrices.
//!
//! This is the rotation variant: F = U diag(σ) Vᵀ with det U = det V = +1, |σ| descending, and the
//! last (smallest) singular value carrying the sign of det F. Elastic laws need it for inverted F,
//! because it gives the shortest way back (Irving, Teran and Fedkiw 2004, "Invertible finite
//! elements").

use super::linalg::{Matrix, Vector, add_scaled, cofactor, det, dot, double_dot, identity, mul_transpose, transpose};
use super::real::Real;

/// F = U diag(sigma) Vᵀ.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Svd<T, const D: usize> {
    pub u: Matrix<T, D>,
    pub sigma: Vector<T, D>,
    pub v: Matrix<T, D>,
}

/// Sweeps of column rotations. Convergence is quadratic, and 5 have been enough for f64.
const SWEEPS: usize = 8;

/// The decomposition by one-sided Jacobi (Hestenes 1958): pairs of columns of F are rotated until
/// all are orthogonal. Their lengths are the singular values. Even the smallest have high relative
/// accuracy, because FᵀF is never formed.
///
/// 1. scale F by its largest entry (entries of 1e-30 must not underflow when squared);
/// 2. up to 8 sweeps over the column pairs, accumulating the rotations in V;
/// 3. order columns by length, negating one of each swapped pair, so that V stays a rotation;
/// 4. u1 = c1/|c1|, u2 = c2 without its part along u1, normalised, u3 = u1 × u2; the last σ is u·c,
///    with its sign.
///
/// A direction that F does not determine (length zero) is filled with any orthogonal one.
pub fn svd<T: Real, const D: usize>(f: &Matrix<T, D>) -> Svd<T, D> {
    let scale = f.iter().flatten().fold(T::ZERO, |m, x| m.max(x.abs()));
    if !(scale > T::ZERO && scale.is_finite()) {
        // Zero: any rotations are right. Not finite: the caller sees it in sigma.
        return Svd { u: identity(), sigma: [scale; D], v: identity() };
    }
    // Columns as rows: c[k] is column k of F.
    let mut c = transpose(f);
    for x in c.iter_mut().flatten() {
        *x = *x / scale;
    }
    let mut v: Matrix<T, D> = identity();
    for _ in 0..SWEEPS {
        let mut rotated = false;
        for p in 0..D - 1 {
            for q in p + 1..D {
                rotated |= orthogonalise(&mut c, &mut v, p, q);
            }
        }
        if !rotated {
            break;
        }
    }
    for p in 0..D - 1 {
        for q in p + 1..D {
            if dot(&c[p], &c[p]) < dot(&c[q], &c[q]) {
                swap_columns(&mut c, p, q);
                swap_columns(&mut v, p, q);
            }
        }
    }
    let mut u: Matrix<T, D> = identity();
    let mut sigma = [T::ZERO; D];
    sigma[0] = dot(&c[0], &c[0]).sqrt();
    u[0] = scaled(&c[0], T::ONE / sigma[0]);
    if D == 3 {
        u[1] = unit_orthogonal_to(&u[0], &c[1]);
        sigma[1] = dot(&u[1], &c[1]);
    }
    u[D - 1] = completing_rotation(&u);
    sigma[D - 1] = dot(&u[D - 1], &c[D - 1]);
    for s in &mut sigma {
        *s *= scale;
    }
    Svd { u: transpose(&u), sigma, v: transpose(&v) }
}

/// Rotates columns p and q (rows of `c`) until they are orthogonal, and `v` with them. Returns
/// false if they were orthogonal to rounding already.
fn orthogonalise<T: Real, const D: usize>(c: &mut Matrix<T, D>, v: &mut Matrix<T, D>, p: usize, q: usize) -> bool {
    let (alpha, beta, gamma) = (dot(&c[p], &c[p]), dot(&c[q], &c[q]), dot(&c[p], &c[q]));
    if gamma.abs() <= T::EPSILON * (alpha * beta).sqrt() || gamma.abs() < T::TINY {
        return false;
    }
    let zeta = (beta - alpha) / (T::TWO * gamma);
    let t = T::ONE.copysign(zeta) / (zeta.abs() + (T::ONE + zeta * zeta).sqrt());
    let cos = T::ONE / (T::ONE + t * t).sqrt();
    let sin = t * cos;
    for m in [c, v] {
        for k in 0..D {
            (m[p][k], m[q][k]) = (cos * m[p][k] - sin * m[q][k], sin * m[p][k] + cos * m[q][k]);
        }
    }
    true
}

/// Swaps rows p and q and negates one, which is a rotation by a quarter turn.
fn swap_columns<T: Real, const D: usize>(m: &mut Matrix<T, D>, p: usize, q: usize) {
    m.swap(p, q);
    m[p] = scaled(&m[p], -T::ONE);
}

fn scaled<T: Real, const D: usize>(a: &Vector<T, D>, s: T) -> Vector<T, D> {
    a.map(|x| x * s)
}

/// The unit vector along the part of `c` that is orthogonal to the unit vector `u`. If nothing is
/// left of `c`, any unit vector orthogonal to `u`.
fn unit_orthogonal_to<T: Real, const D: usize>(u: &Vector<T, D>, c: &Vector<T, D>) -> Vector<T, D> {
    let mut axis = [T::ZERO; D];
    let smallest = (0..D).fold(0, |m, k| if u[k].abs() < u[m].abs() { k } else { m });
    axis[smallest] = T::ONE;
    // The squared length must be a normal number, or the result would not have unit length.
    let mut w = if dot(c, c) > T::TINY / T::EPSILON { scaled(c, T::ONE / dot(c, c).sqrt()) } else { axis };
    // A column that is nothing but rounding along u needs a second projection.
    for attempt in 0..3 {
        let along = dot(u, &w);
        for k in 0..D {
            w[k] -= along * u[k];
        }
        let length = dot(&w, &w).sqrt();
        w = if attempt == 0 && length < T::EPSILON.sqrt() { axis } else { scaled(&w, T::ONE / length) };
    }
    w
}

/// The last row that makes the rows of `u` a rotation.
fn completing_rotation<T: Real, const D: usize>(u: &Matrix<T, D>) -> Vector<T, D> {
    cofactor(u)[D - 1]
}

/// The rotation R of F = R S that is closest to F (det R = +1 for inverted F too).
pub fn polar_rotation<T: Real, const D: usize>(f: &Matrix<T, D>) -> Matrix<T, D> {
    let (r, converged) = polar_newton(f);
    if converged { r } else { polar_by_svd(f) }
}

/// R = U Vᵀ, for every F.
pub fn polar_by_svd<T: Real, const D: usize>(f: &Matrix<T, D>) -> Matrix<T, D> {
    let Svd { u, v, .. } = svd(f);
    mul_transpose(&u, &v)
}

/// Newton steps after which the fast path gives up. In f64 that is enough to reach rounding for
/// every F that it accepts.
pub const NEWTON_STEPS: usize = 7;

/// The fast path accepts F with det F above this share of ‖F‖ᴰ (Frobenius). Nearer to singular, the
/// sign of det F and the iteration lose digits that the SVD keeps.
const NEWTON_DETERMINANT: f64 = 1e-3;

/// The fast path of [`polar_rotation`], and whether it converged: Newton's iteration from F, see
/// [`newton_step`].
pub fn polar_newton<T: Real, const D: usize>(f: &Matrix<T, D>) -> (Matrix<T, D>, bool) {
    let mut x = *f;
    for _ in 0..NEWTON_STEPS {
        let (next, converged) = newton_step(&x);
        x = next;
        if converged {
            return (x, is_regular(f));
        }
    }
    (x, false)
}

/// Whether Newton's iteration can be trusted for F: det F is well above 0.
#[inline(always)]
pub fn is_regular<T: Real, const D: usize>(f: &Matrix<T, D>) -> bool {
    let square = double_dot(f, f);
    let size = if D == 2 { square } else { square * square.sqrt() };
    det(f) > T::from_f64(NEWTON_DETERMINANT) * size
}

/// X ← ½ (γ X + X⁻ᵀ/γ) with Frobenius scaling γ² = ‖X⁻ᵀ‖/‖X‖ (Higham 1986, "Computing the polar
/// decomposition"), and whether the result is a rotation to rounding. It has no branches, so that
/// loops over particles vectorise.
#[inline(always)]
pub fn newton_step<T: Real, const D: usize>(x: &Matrix<T, D>) -> (Matrix<T, D>, bool) {
    let cof = cofactor(x);
    let j = dot(&x[0], &cof[0]);
    let ratio = (double_dot(&cof, &cof) / double_dot(x, x)).sqrt(); // ‖cof‖/‖X‖ = |j| ‖X⁻ᵀ‖/‖X‖
    let gamma = (ratio / j.abs()).sqrt();
    let (a, b) = (T::HALF * gamma, T::HALF / (gamma * j));
    let mut next = *x;
    for i in 0..D {
        for k in 0..D {
            next[i][k] = a * x[i][k] + b * cof[i][k];
        }
    }
    let step = add_scaled(&next, -T::ONE, x);
    // Convergence is quadratic: a last step of size s leaves an error of s²/2. NaN compares false.
    (next, double_dot(&step, &step) < T::EPSILON)
}

#[cfg(test)]
mod tests;
