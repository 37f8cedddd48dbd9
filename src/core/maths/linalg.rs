//! Vectors and square matrices of 2 or 3 dimensions as plain arrays, in row-major order.
//!
//! Free functions over arrays are inlined completely, so that loops over particles that call them
//! vectorise as a whole.

use super::real::Real;

/// A vector of `D` components.
pub type Vector<T, const D: usize> = [T; D];
/// A `D` × `D` matrix, row-major.
pub type Matrix<T, const D: usize> = [[T; D]; D];

/// The identity times `diagonal`.
#[inline(always)]
pub fn scaled_identity<T: Real, const D: usize>(diagonal: T) -> Matrix<T, D> {
    let mut m = [[T::ZERO; D]; D];
    for i in 0..D {
        m[i][i] = diagonal;
    }
    m
}

#[inline(always)]
pub fn identity<T: Real, const D: usize>() -> Matrix<T, D> {
    scaled_identity(T::ONE)
}

#[inline(always)]
pub fn dot<T: Real, const D: usize>(a: &Vector<T, D>, b: &Vector<T, D>) -> T {
    let mut sum = a[0] * b[0];
    for i in 1..D {
        sum += a[i] * b[i];
    }
    sum
}

/// a b.
#[inline(always)]
pub fn mul<T: Real, const D: usize>(a: &Matrix<T, D>, b: &Matrix<T, D>) -> Matrix<T, D> {
    let mut m = [[T::ZERO; D]; D];
    for i in 0..D {
        for j in 0..D {
            let mut sum = a[i][0] * b[0][j];
            for k in 1..D {
                sum += a[i][k] * b[k][j];
            }
            m[i][j] = sum;
        }
    }
    m
}

/// a bᵀ.
#[inline(always)]
pub fn mul_transpose<T: Real, const D: usize>(a: &Matrix<T, D>, b: &Matrix<T, D>) -> Matrix<T, D> {
    let mut m = [[T::ZERO; D]; D];
    for i in 0..D {
        for j in 0..D {
            m[i][j] = dot(&a[i], &b[j]);
        }
    }
    m
}

/// a x.
#[inline(always)]
pub fn apply<T: Real, const D: usize>(a: &Matrix<T, D>, x: &Vector<T, D>) -> Vector<T, D> {
    let mut y = [T::ZERO; D];
    for i in 0..D {
        y[i] = dot(&a[i], x);
    }
    y
}

#[inline(always)]
pub fn transpose<T: Real, const D: usize>(a: &Matrix<T, D>) -> Matrix<T, D> {
    let mut m = *a;
    for i in 0..D {
        for j in 0..D {
            m[i][j] = a[j][i];
        }
    }
    m
}

/// a + s b.
#[inline(always)]
pub fn add_scaled<T: Real, const D: usize>(a: &Matrix<T, D>, s: T, b: &Matrix<T, D>) -> Matrix<T, D> {
    let mut m = *a;
    for i in 0..D {
        for j in 0..D {
            m[i][j] += s * b[i][j];
        }
    }
    m
}

#[inline(always)]
pub fn trace<T: Real, const D: usize>(a: &Matrix<T, D>) -> T {
    let mut sum = a[0][0];
    for i in 1..D {
        sum += a[i][i];
    }
    sum
}

/// a : b, the sum of products of entries.
#[inline(always)]
pub fn double_dot<T: Real, const D: usize>(a: &Matrix<T, D>, b: &Matrix<T, D>) -> T {
    let mut sum = dot(&a[0], &b[0]);
    for i in 1..D {
        sum += dot(&a[i], &b[i]);
    }
    sum
}

/// Cofactor matrix, det(a) a⁻ᵀ; it exists for singular matrices too.
#[inline(always)]
pub fn cofactor<T: Real, const D: usize>(a: &Matrix<T, D>) -> Matrix<T, D> {
    let mut m = *a;
    if D == 2 {
        m[0][0] = a[1][1];
        m[0][1] = -a[1][0];
        m[1][0] = -a[0][1];
        m[1][1] = a[0][0];
    } else {
        for i in 0..D {
            let (p, q) = ((i + 1) % D, (i + 2) % D);
            for j in 0..D {
                let (r, s) = ((j + 1) % D, (j + 2) % D);
                m[i][j] = a[p][r] * a[q][s] - a[p][s] * a[q][r];
            }
        }
    }
    m
}

#[inline(always)]
pub fn det<T: Real, const D: usize>(a: &Matrix<T, D>) -> T {
    dot(&a[0], &cofactor(a)[0])
}

/// Determinant of a row-major 3 × 3 array.
pub fn determinant(a: &[f64; 9]) -> f64 {
    det(&from_row_major::<f64, 3>(a))
}

/// The upper left `D` × `D` part of a row-major 3 × 3 array.
pub fn from_row_major<T: Real, const D: usize>(a: &[f64; 9]) -> Matrix<T, D> {
    let mut m = [[T::ZERO; D]; D];
    for i in 0..D {
        for j in 0..D {
            m[i][j] = T::from_f64(a[3 * i + j]);
        }
    }
    m
}

/// The matrix as the upper left part of a row-major 3 × 3 array whose remaining diagonal is `rest`.
pub fn to_row_major<T: Real, const D: usize>(m: &Matrix<T, D>, rest: f64) -> [f64; 9] {
    let mut a = [0.0, 0.0, 0.0, 0.0, rest, 0.0, 0.0, 0.0, rest];
    for i in 0..D {
        for j in 0..D {
            a[3 * i + j] = m[i][j].to_f64();
        }
    }
    a
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cofactor_is_the_determinant_times_the_inverse_transpose() {
        let a = [[2.0, 1.0, 0.5], [-1.0, 3.0, 0.25], [0.5, -2.0, 1.5]];
        let product = mul_transpose(&a, &cofactor(&a));
        for i in 0..3 {
            for j in 0..3 {
                let expected = if i == j { det(&a) } else { 0.0 };
                assert!((product[i][j] - expected).abs() < 1e-14, "{product:?}");
            }
        }
        let b = [[2.0, 1.0], [-1.0, 3.0]];
        assert_eq!(mul_transpose(&b, &cofactor(&b)), [[7.0, 0.0], [0.0, 7.0]]);
        assert_eq!(det(&b), 7.0);
    }

    #[test]
    fn products_transpose_and_row_major_agree() {
        let a = [[1.0, 2.0], [3.0, 4.0]];
        let b = [[5.0, -6.0], [7.0, 8.0]];
        assert_eq!(mul(&a, &b), mul_transpose(&a, &transpose(&b)));
        assert_eq!(apply(&a, &[1.0, -1.0]), [-1.0, -1.0]);
        assert_eq!(double_dot(&a, &b), trace(&mul_transpose(&a, &b)));
        let flat = to_row_major(&a, 1.0);
        assert_eq!(flat, [1.0, 2.0, 0.0, 3.0, 4.0, 0.0, 0.0, 0.0, 1.0]);
        assert_eq!(from_row_major::<f64, 2>(&flat), a);
        assert_eq!(determinant(&flat), det(&a));
        assert_eq!(add_scaled(&a, 2.0, &identity()), [[3.0, 2.0], [3.0, 6.0]]);
    }
}
