//! ∂P/∂F of isotropic laws, made positive semidefinite.
//!
//! In the bases of F = U Σ Vᵀ the d² × d² derivative is block diagonal (Stomakhin et al. 2012,
//! "Energetically consistent invertible elasticity"; Teran et al. 2005, "Robust quasistatic finite
//! elements and flesh simulation"). With dF' = Uᵀ dF V its blocks are:
//! * dP'_ii = Σ_j ψ_ij dF'_jj, a d × d matrix A;
//! * for each pair of axes i ≠ j a 2 × 2 matrix ½ [[m + p, m − p], [m − p, m + p]] of
//!   (dF'_ij, dF'_ji), with the eigenvalues m = (ψ_i − ψ_j)/(σ_i − σ_j) (shear) and p
//!   = (ψ_i + ψ_j)/(σ_i + σ_j) (rotation).
//!
//! Clamping the eigenvalues of A and each m and p at 0 therefore clamps those of the whole
//! derivative.

use super::derivatives::{Derivatives, EXTENSION};
use super::principal::spectral;
use crate::maths::linalg::{Matrix, Vector, apply, mul, mul_transpose, transpose};
use crate::maths::real::Real;
use crate::maths::svd::{Svd, svd};

/// A fourth-order tensor, K\[a\]\[b\]\[c\]\[d\].
pub type Tensor4<T, const D: usize> = [[[[T; D]; D]; D]; D];

/// ∂P/∂F at a state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Projected<T, const D: usize> {
    pub u: Matrix<T, D>,
    pub v: Matrix<T, D>,
    /// A (Pa).
    pub axial: Matrix<T, D>,
    /// (½ (m + p), ½ (m − p)) (Pa) of the pair of axes other than k. In two dimensions only k = 2
    /// exists.
    pub pairs: [[T; 2]; 3],
}

/// Smallest divisor σ_i + σ_j.
const LEAST_SUM: f64 = 1e-6;

/// (ψ_i − ψ_j)/(σ_i − σ_j) of a smooth ψ.
pub(super) fn shear<T: Real, const D: usize>(
    sigma: &Vector<T, D>,
    derivatives: &Derivatives<T, D>,
    i: usize,
    j: usize,
) -> T {
    let Derivatives { gradient: g, hessian: h, .. } = derivatives;
    // Half the second derivative across the two has an error of only the square of their difference.
    let near = || T::HALF * (h[i][i] + h[j][j]) - h[i][j];
    quotient(sigma[i], sigma[j], g[i] - g[j], near)
}

/// `difference`/(a − b), or `near` where the quotient would lose digits, near equal stretches.
pub(super) fn quotient<T: Real>(a: T, b: T, difference: T, near: impl Fn() -> T) -> T {
    let least = T::EPSILON.powf(T::from_f64(1.0 / 3.0)) * (a.abs() + b.abs()).max(T::from_f64(EXTENSION));
    if (a - b).abs() > least { difference / (a - b) } else { near() }
}

/// The pairs of axes, indexed by the axis that is not in the pair.
fn pairs<const D: usize>() -> impl Iterator<Item = (usize, usize, usize)> {
    [(0, 1, 2), (1, 2, 0), (2, 0, 1)].into_iter().filter(|&(_, i, j)| i < D && j < D)
}

impl<T: Real, const D: usize> Projected<T, D> {
    /// The derivative itself, which is indefinite where ψ is not convex.
    pub(super) fn exact(at: &Svd<T, D>, derivatives: &Derivatives<T, D>) -> Self {
        Self::with_shear(at, &derivatives.gradient, derivatives.hessian, |i, j| shear(&at.sigma, derivatives, i, j))
    }

    /// The derivative from ∂ψ/∂σ, ∂²ψ/∂σ² and m = (ψ_i − ψ_j)/(σ_i − σ_j) of two axes (Pa).
    pub(super) fn with_shear(
        at: &Svd<T, D>,
        gradient: &Vector<T, D>,
        axial: Matrix<T, D>,
        shear: impl Fn(usize, usize) -> T,
    ) -> Self {
        let mut values = [[T::ZERO; 2]; 3];
        for (k, i, j) in pairs::<D>() {
            let shear = shear(i, j);
            let turn = (gradient[i] + gradient[j]) / (at.sigma[i] + at.sigma[j]).max(T::from_f64(LEAST_SUM));
            values[k] = [T::HALF * (shear + turn), T::HALF * (shear - turn)];
        }
        Self { u: at.u, v: at.v, axial, pairs: values }
    }

    /// The nearest positive semidefinite tensor.
    pub(super) fn clamped(mut self) -> Self {
        self.axial = semidefinite(&self.axial);
        for pair in &mut self.pairs {
            let (shear, turn) = (pair[0] + pair[1], pair[0] - pair[1]);
            if shear < T::ZERO || turn < T::ZERO {
                let (shear, turn) = (shear.max(T::ZERO), turn.max(T::ZERO));
                *pair = [T::HALF * (shear + turn), T::HALF * (shear - turn)];
            }
        }
        self
    }

    /// dP = ∂P/∂F : dF.
    pub fn times(&self, df: &Matrix<T, D>) -> Matrix<T, D> {
        let d = mul(&mul(&transpose(&self.u), df), &self.v);
        let mut out = d;
        let mut diagonal = [T::ZERO; D];
        for i in 0..D {
            diagonal[i] = d[i][i];
        }
        let diagonal = apply(&self.axial, &diagonal);
        for i in 0..D {
            out[i][i] = diagonal[i];
        }
        for (k, i, j) in pairs::<D>() {
            let [same, cross] = self.pairs[k];
            out[i][j] = same * d[i][j] + cross * d[j][i];
            out[j][i] = same * d[j][i] + cross * d[i][j];
        }
        mul_transpose(&mul(&self.u, &out), &self.v)
    }

    /// K_abcd = Σ_kl F_bk F_dl ∂P_ak/∂F_cl (Pa): the derivative of P Fᵀ at fixed `f` with respect
    /// to a velocity gradient that acts on `f`. A pair of nodes then has the stiffness V0 Σ_bd g_b
    /// K_abcd g'_d. Symmetric under (ab) ↔ (cd).
    pub fn spatial(&self, f: &Matrix<T, D>) -> Tensor4<T, D> {
        let (u, w) = (transpose(&self.u), transpose(&mul(f, &self.v)));
        let mut k = [[[[T::ZERO; D]; D]; D]; D];
        // The derivative is a sum over pairs of the modes u_i v_jᵀ, and F maps v_j to w_j.
        for i in 0..D {
            let mut stress = [[T::ZERO; D]; D];
            for j in 0..D {
                add_outer(&mut stress, self.axial[i][j], &u[j], &w[j]);
            }
            add_product(&mut k, &u[i], &w[i], &stress);
        }
        for (n, i, j) in pairs::<D>() {
            let [same, cross] = self.pairs[n];
            for (i, j) in [(i, j), (j, i)] {
                let mut stress = [[T::ZERO; D]; D];
                add_outer(&mut stress, same, &u[i], &w[j]);
                add_outer(&mut stress, cross, &u[j], &w[i]);
                add_product(&mut k, &u[i], &w[j], &stress);
            }
        }
        k
    }
}

/// m += s a bᵀ.
#[inline(always)]
fn add_outer<T: Real, const D: usize>(m: &mut Matrix<T, D>, s: T, a: &Vector<T, D>, b: &Vector<T, D>) {
    for i in 0..D {
        for j in 0..D {
            m[i][j] += s * a[i] * b[j];
        }
    }
}

/// k += (a bᵀ) ⊗ m.
#[inline(always)]
fn add_product<T: Real, const D: usize>(k: &mut Tensor4<T, D>, a: &Vector<T, D>, b: &Vector<T, D>, m: &Matrix<T, D>) {
    for i in 0..D {
        for j in 0..D {
            let s = a[i] * b[j];
            for p in 0..D {
                for q in 0..D {
                    k[i][j][p][q] += s * m[p][q];
                }
            }
        }
    }
}

/// The nearest positive semidefinite matrix to a symmetric one: the matrix itself, or ½ (A + H)
/// with H = (A²)^½ from its polar decomposition (Higham 1988, "Computing a nearest symmetric
/// positive semidefinite matrix").
fn semidefinite<T: Real, const D: usize>(a: &Matrix<T, D>) -> Matrix<T, D> {
    if is_definite(a) {
        return *a;
    }
    let Svd { sigma, v, .. } = svd(a);
    let h = spectral(&v, &sigma.map(T::abs), &v);
    let mut nearest = *a;
    for i in 0..D {
        for j in 0..D {
            nearest[i][j] = T::HALF * (T::HALF * (a[i][j] + a[j][i]) + h[i][j]);
        }
    }
    nearest
}

/// Whether elimination meets only positive pivots.
fn is_definite<T: Real, const D: usize>(a: &Matrix<T, D>) -> bool {
    let mut a = *a;
    for k in 0..D {
        if a[k][k] <= T::ZERO {
            return false;
        }
        for i in k + 1..D {
            let factor = a[i][k] / a[k][k];
            for j in k + 1..D {
                a[i][j] -= factor * a[k][j];
            }
        }
    }
    true
}
