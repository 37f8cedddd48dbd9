//! Tests of the SVD and the polar decomposition by reconstruction.

use rand::{Rng, SeedableRng, rngs::StdRng};

use super::super::linalg::mul;
use super::*;

fn random<T: Real, const D: usize>(rng: &mut StdRng) -> Matrix<T, D> {
    let mut m = [[T::ZERO; D]; D];
    for x in m.iter_mut().flatten() {
        *x = T::from_f64(rng.random_range(-1.0..1.0));
    }
    m
}

fn rotation<T: Real, const D: usize>(rng: &mut StdRng) -> Matrix<T, D> {
    svd(&random(rng)).u
}

fn diagonal<T: Real, const D: usize>(sigma: [f64; D]) -> Matrix<T, D> {
    let mut m = [[T::ZERO; D]; D];
    for i in 0..D {
        m[i][i] = T::from_f64(sigma[i]);
    }
    m
}

fn difference<T: Real, const D: usize>(a: &Matrix<T, D>, b: &Matrix<T, D>) -> f64 {
    a.iter().flatten().zip(b.iter().flatten()).fold(0.0, |m, (x, y)| m.max((x.to_f64() - y.to_f64()).abs()))
}

/// Checks that U, V and R are rotations, that the singular values are ordered with the sign on the
/// last, and that the product is F again, within 16 roundings.
fn check<T: Real, const D: usize>(f: &Matrix<T, D>, what: &str) {
    let tolerance = 16.0 * T::EPSILON.to_f64();
    let Svd { u, sigma, v } = svd(f);
    for (name, m) in [("U", &u), ("V", &v), ("R", &polar_rotation(f))] {
        let error = difference(&mul_transpose(m, m), &identity());
        assert!(error < tolerance, "{what}: {name} is off orthogonality by {error:e} for F = {f:?}");
        assert!((det(m).to_f64() - 1.0).abs() < tolerance, "{what}: det {name} = {} for F = {f:?}", det(m));
    }
    for k in 1..D {
        assert!(sigma[k - 1] >= sigma[k].abs() * (T::ONE - T::from_f64(tolerance)), "{what}: order {sigma:?}");
    }
    let size = sigma[0].to_f64();
    let mut us = u;
    for row in &mut us {
        for k in 0..D {
            row[k] *= sigma[k];
        }
    }
    let error = difference(&mul_transpose(&us, &v), f);
    assert!(error <= tolerance * size, "{what}: U diag(s) Vt misses F = {f:?} by {error:e}");
    // S = RᵀF is symmetric.
    let s = mul(&transpose(&polar_rotation(f)), f);
    let error = difference(&s, &transpose(&s));
    assert!(error <= tolerance * size, "{what}: S is off symmetry by {error:e} for F = {f:?}");
}

fn check_all<T: Real, const D: usize>(spectra: &[[f64; D]]) {
    let seed = 7;
    println!("seed {seed}");
    let rng = &mut StdRng::seed_from_u64(seed);
    for _ in 0..500 {
        check::<T, D>(&random(rng), "random, inverted half the time");
        check::<T, D>(&rotation(rng), "a rotation");
        for sigma in spectra {
            let f = mul_transpose(&mul(&rotation(rng), &diagonal(*sigma)), &rotation(rng));
            check::<T, D>(&f, &format!("spectrum {sigma:?}"));
            check::<T, D>(&diagonal(*sigma), &format!("diagonal {sigma:?}"));
        }
    }
}

const SPECTRA_3: [[f64; 3]; 14] = [
    [1.0, 1.0, 1.0],
    [1.0, 1.0, -1.0],
    [2.0, 1.0, 0.5],
    [1.0, 1.0, 1e-3],
    [1.0, 1e-4, -1e-4],
    [1.0, 1e-9, 1e-9],
    [1.0, 0.5, 0.0],
    [1.0, 0.0, 0.0],
    [0.0, 0.0, 0.0],
    [1.0, 1.0 - 1e-7, 1.0 - 2e-7],
    [1e-15, 1e-16, 1e-17],
    [1e15, 1e14, -1e13],
    [3.0, 3.0, -0.1],
    [1e3, 1.0, 1e-3],
];

#[test]
fn decompositions_hold_in_three_dimensions() {
    check_all::<f64, 3>(&SPECTRA_3);
    check_all::<f32, 3>(&SPECTRA_3);
}

#[test]
fn decompositions_hold_in_two_dimensions() {
    let spectra = SPECTRA_3.map(|s| [s[0], s[2]]);
    check_all::<f64, 2>(&spectra);
    check_all::<f32, 2>(&spectra);
}

#[test]
fn singular_values_are_those_that_were_put_in() {
    let rng = &mut StdRng::seed_from_u64(8);
    for _ in 0..200 {
        for sigma in [[1.3, 0.9, 0.4], [1.0, 1.0, -0.5], [2.0, 1e-6, 0.0]] {
            let f: Matrix<f64, 3> = mul_transpose(&mul(&rotation(rng), &diagonal(sigma)), &rotation(rng));
            for k in 0..3 {
                assert!((svd(&f).sigma[k] - sigma[k]).abs() < 1e-15 * 8.0, "{:?} {sigma:?}", svd(&f).sigma);
            }
        }
    }
}

#[test]
fn the_fast_path_takes_ordinary_deformations_and_agrees_with_the_svd() {
    fn check<T: Real, const D: usize>(rng: &mut StdRng) {
        for _ in 0..2000 {
            let sigma = [(); D].map(|()| rng.random_range(0.4..2.5));
            let f: Matrix<T, D> = mul_transpose(&mul(&rotation(rng), &diagonal(sigma)), &rotation(rng));
            let (r, converged) = polar_newton(&f);
            assert!(converged, "{f:?}");
            assert!(difference(&r, &polar_by_svd(&f)) < 16.0 * T::EPSILON.to_f64(), "{f:?}");
        }
    }
    let rng = &mut StdRng::seed_from_u64(9);
    check::<f32, 2>(rng);
    check::<f32, 3>(rng);
    check::<f64, 2>(rng);
    check::<f64, 3>(rng);
}

#[test]
fn the_fast_path_refuses_what_it_cannot_do() {
    for f in [[[1.0, 0.0], [0.0, -1.0]], [[1.0, 0.0], [0.0, 0.0]], [[f64::NAN, 0.0], [0.0, 1.0]]] {
        assert!(!polar_newton(&f).1, "{f:?}");
    }
}
