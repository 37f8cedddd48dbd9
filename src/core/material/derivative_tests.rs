//! Tests of the laws' derivatives for the implicit integrator: finite differences, and definiteness
//! after projection.

use nalgebra::DMatrix;
use rand::{Rng, SeedableRng, rngs::StdRng};

use super::principal::spectral;
use super::*;
use crate::maths::linalg::{add_scaled, double_dot, identity, mul, mul_transpose};
use crate::maths::svd::svd;

pub(super) const MODULUS: f64 = 1e5;

/// Every law that can be integrated implicitly, with its plastic state. Snow is given a state in
/// which it has hardened.
pub(super) fn laws() -> Vec<(Law<f64>, f64)> {
    let solid = samples().into_iter().filter(|m| !m.is_fluid());
    solid.map(|m| (Law::new(&m), if let Material::Snow(_) = m { 0.97 } else { initial_plastic_state(&m) })).collect()
}

pub(super) fn random<const D: usize>(rng: &mut StdRng) -> Matrix<f64, D> {
    let mut m = identity();
    for x in m.iter_mut().flatten() {
        *x = rng.random_range(-1.0..1.0);
    }
    m
}

pub(super) fn rotated<const D: usize>(rng: &mut StdRng, sigma: &Vector<f64, D>) -> Matrix<f64, D> {
    spectral(&svd(&random(rng)).u, sigma, &svd(&random(rng)).u)
}

/// Stretches: at rest, equal, nearly equal, large, small, flat, inverted, inverted and nearly
/// equal, nearly opposite.
const SPECTRA: [[f64; 3]; 13] = [
    [1.0, 1.0, 1.0],
    [1.3, 1.0, 0.8],
    [1.1, 1.1, 0.9],
    [1.2, 1.2 - 1e-6, 1.2 - 3e-5],
    [1.2, 1.2 - 1e-9, 0.7],
    [3.0, 1.1, 0.4],
    [0.6, 0.3, 0.2],
    [0.9, 0.12, 0.08],
    [1.2, 0.9, 0.0],
    [1.1, 0.04, 0.04 - 1e-7],
    [1.2, 0.9, -0.5],
    [1.2, 0.6, -0.55],
    [0.7, 0.4, -0.02],
];

pub(super) fn spectra<const D: usize>() -> impl Iterator<Item = Vector<f64, D>> {
    // In two dimensions, the first and the last entry.
    SPECTRA.into_iter().map(|s| std::array::from_fn(|i| if i + 1 == D { s[2] } else { s[i] }))
}

/// Whether the law is defined at these stretches: neo-Hookean bodies are never flat or inverted.
pub(super) fn exists<const D: usize>(law: &Law<f64>, sigma: &Vector<f64, D>) -> bool {
    !matches!(law, Law::NeoHookean(_)) || sigma[D - 1] > 0.0
}

/// Fourth-order central difference of an array.
pub(super) fn slope(h: f64, at: impl Fn(f64) -> Vec<f64>) -> Vec<f64> {
    let [a, b, c, d] = [-2.0, -1.0, 1.0, 2.0].map(|k| at(k * h));
    (0..a.len()).map(|i| (a[i] - 8.0 * b[i] + 8.0 * c[i] - d[i]) / (12.0 * h)).collect()
}

pub(super) fn distance<'a>(a: impl IntoIterator<Item = &'a f64>, b: impl IntoIterator<Item = &'a f64>) -> f64 {
    // NaN is kept: it is worse than any number.
    a.into_iter().zip(b).map(|(x, y)| (x - y).abs()).fold(0.0, |m, d| if d > m || d.is_nan() { d } else { m })
}

/// Checks ψ_i and ψ_ij in principal space, and P and ∂P/∂F at rotated states, for every law and
/// kind of state.
fn check<const D: usize>(seed: u64) {
    println!("seed {seed}");
    let rng = &mut StdRng::seed_from_u64(seed);
    for (law, plastic) in laws() {
        for sigma in spectra::<D>().filter(|s| exists(&law, s)) {
            let found = law.derivatives(&sigma, plastic);
            let size = found.hessian.iter().flatten().fold(MODULUS, |m, x| m.max(x.abs()));
            let h = 2e-4 * sigma.iter().fold(1.0f64, |m, s| if s.abs() > 1e-3 { m.min(s.abs()) } else { m });
            let along = |k: usize, t: f64| {
                let mut moved = sigma;
                moved[k] += t;
                law.derivatives(&moved, plastic)
            };
            for k in 0..D {
                let energy = slope(h, |t| vec![along(k, t).energy]);
                let error = distance(&[found.gradient[k]], &energy);
                assert!(error < 1e-7 * size, "{law:?}: ψ_{k} off by {error} at {sigma:?}");
                let error = distance(&found.hessian[k], &slope(h, |t| along(k, t).gradient.to_vec()));
                assert!(error < 1e-7 * size, "{law:?}: row {k} of the Hessian off by {error} at {sigma:?}");
            }
            for _ in 0..4 {
                let (f, g) = (rotated(rng, &sigma), random(rng));
                check_along(&law, plastic, &f, &g, h, size);
            }
        }
    }
}

/// Checks dψ = P : dF and dP = ∂P/∂F : dF along one direction.
fn check_along<const D: usize>(
    law: &Law<f64>,
    plastic: f64,
    f: &Matrix<f64, D>,
    g: &Matrix<f64, D>,
    h: f64,
    size: f64,
) {
    let (energy, pk1) = law.energy_and_pk1(f, plastic);
    let at = svd(f);
    let derivatives = law.derivatives(&at.sigma, plastic);
    let tangent = Projected::exact(&at, &derivatives);
    let size = tangent.pairs.iter().flatten().fold(size, |m, x| m.max(x.abs()));
    let error = (energy - derivatives.energy).abs();
    assert!(error < 1e-9 * size, "{law:?}: ψ off by {error} at {:?}", at.sigma);
    let error = distance(pk1.as_flattened(), spectral(&at.u, &derivatives.gradient, &at.v).as_flattened());
    assert!(error < 1e-9 * size, "{law:?}: P off by {error} at {:?}", at.sigma);
    let along = |t: f64| law.energy_and_pk1(&add_scaled(f, t, g), plastic);
    let error = distance(&[double_dot(&pk1, g)], &slope(h, |t| vec![along(t).0]));
    assert!(error < 1e-7 * size, "{law:?}: dψ off by {error} at {:?}", at.sigma);
    let expected = slope(h, |t| along(t).1.as_flattened().to_vec());
    let error = distance(tangent.times(g).as_flattened(), &expected);
    assert!(error < 1e-7 * size, "{law:?}: dP off by {error} at {:?}", at.sigma);
}

#[test]
fn derivatives_are_those_of_the_energy() {
    check::<3>(51);
    check::<2>(52);
}

#[test]
fn the_implicit_stress_is_that_of_the_explicit_integrator() {
    let rng = &mut StdRng::seed_from_u64(53);
    for (law, plastic) in laws() {
        for sigma in [[1.0, 1.0, 1.0], [1.1, 1.0, 0.8], [2.0, 0.6, 0.3]] {
            let f = rotated(rng, &sigma);
            let (energy, pk1) = law.energy_and_pk1(&f, plastic);
            let (tau, _) = law.kirchhoff(&f, plastic);
            let error = distance(mul_transpose(&pk1, &f).as_flattened(), tau.as_flattened());
            assert!(error < 1e-9 * MODULUS, "{law:?}: τ off by {error} at {sigma:?}");
            assert!((energy - law.energy(&f, plastic)).abs() < 1e-9 * MODULUS, "{law:?} at {sigma:?}");
        }
    }
}

/// The tensor as a D² × D² matrix.
pub(super) fn full<const D: usize>(tangent: &Projected<f64, D>) -> DMatrix<f64> {
    let mut m = DMatrix::zeros(D * D, D * D);
    for column in 0..D * D {
        let mut unit = [[0.0; D]; D];
        unit[column / D][column % D] = 1.0;
        for (row, value) in tangent.times(&unit).as_flattened().iter().enumerate() {
            m[(row, column)] = *value;
        }
    }
    m
}

/// Checks that the projected tensor is the exact one with its negative eigenvalues set to 0.
/// Returns the number of negative eigenvalues.
fn check_definiteness<const D: usize>(rng: &mut StdRng, law: &Law<f64>, plastic: f64, f: &Matrix<f64, D>) -> usize {
    let at = svd(f);
    let exact = Projected::exact(&at, &law.derivatives(&at.sigma, plastic));
    let projected = law.projected_derivative(f, plastic);
    let (before, after) = (full(&exact), full(&projected));
    let size = before.amax();
    assert!(
        (&before - before.transpose()).amax() <= 1e-12 * size && (&after - after.transpose()).amax() <= 1e-12 * size
    );
    let mut eigen = before.clone().symmetric_eigen();
    let negative = eigen.eigenvalues.iter().filter(|&&e| e < -1e-12 * size).count();
    if eigen.eigenvalues.min() > 1e-12 * size {
        assert_eq!(exact, projected, "{law:?}: changed though definite at {:?}", at.sigma);
    }
    eigen.eigenvalues.apply(|e| *e = e.max(0.0));
    let error = (eigen.recompose() - &after).amax();
    assert!(error <= 1e-11 * size, "{law:?}: {error:e} of {size:e} beside the nearest at {:?}", at.sigma);
    let least = after.clone().symmetric_eigen().eigenvalues.min();
    assert!(least >= -1e-12 * size, "{law:?}: eigenvalue {least:e} of {size:e} at {:?}", at.sigma);
    for _ in 0..4 {
        let g = random::<D>(rng);
        assert!(double_dot(&g, &projected.times(&g)) >= -1e-12 * size);
    }
    negative
}

fn check_random_states<const D: usize>(seed: u64) {
    println!("seed {seed}");
    let rng = &mut StdRng::seed_from_u64(seed);
    for (law, plastic) in laws() {
        let mut indefinite = 0;
        for size in [0.01, 0.3, 1.0].into_iter().cycle().take(300) {
            let f: Matrix<f64, D> = add_scaled(&identity(), size, &random(rng));
            if exists(&law, &svd(&f).sigma) {
                indefinite += check_definiteness(rng, &law, plastic, &f);
            }
        }
        for sigma in spectra::<D>().filter(|s| exists(&law, s)) {
            let f = rotated(rng, &sigma);
            check_definiteness(rng, &law, plastic, &f);
        }
        assert!(indefinite > 0, "{law:?}: no state needed projection");
    }
}

#[test]
fn projection_clamps_the_eigenvalues_of_the_whole() {
    check_random_states::<3>(54);
    check_random_states::<2>(55);
}

#[test]
fn opposite_and_vanishing_stretches_have_finite_stiffness() {
    let rng = &mut StdRng::seed_from_u64(56);
    for (law, plastic) in laws() {
        for sigma in [[0.6, 0.5, -0.5], [0.5, 0.5, -0.5], [1.0, 0.0, 0.0], [0.0; 3], [1.0, 1e-9, -1e-9]] {
            if exists(&law, &sigma) {
                let f = rotated(rng, &sigma);
                let projected = law.projected_derivative(&f, plastic);
                let finite =
                    projected.spatial(&f).as_flattened().as_flattened().as_flattened().iter().all(|x| x.is_finite());
                assert!(finite && law.energy_and_pk1(&f, plastic).0.is_finite(), "{law:?} at {sigma:?}");
                check_definiteness(rng, &law, plastic, &f);
            }
        }
    }
}

#[test]
fn the_energy_has_no_step_where_stretches_are_extended_or_change_sign() {
    for (law, plastic) in laws() {
        for at in [EXTENSION, 0.0, -EXTENSION] {
            let both = [at - 1e-9, at + 1e-9].map(|s| [1.1, 0.9, s]);
            if both.iter().all(|s| exists(&law, s)) {
                let [below, above] = both.map(|s| law.derivatives(&s, plastic));
                let slope = above.gradient.iter().fold(MODULUS, |m, x| m.max(x.abs()));
                assert!((below.energy - above.energy).abs() < 1e-8 * slope, "{law:?} at {at}");
                assert!(distance(&below.gradient, &above.gradient) < 1e-6 * slope, "{law:?} at {at}");
            }
        }
        // Compression is always resisted, also in flat and inverted states.
        for s in [0.4, 0.15, 0.05, 0.0, -0.2, -0.8].into_iter().filter(|s| exists(&law, &[1.0, 1.0, *s])) {
            assert!(law.derivatives(&[1.0, 1.0, s], plastic).gradient[2] < 0.0, "{law:?} at {s}");
        }
    }
    let rubber = laws().into_iter().find(|(law, _)| matches!(law, Law::NeoHookean(_))).unwrap().0;
    assert_eq!(rubber.energy_and_pk1(&[[1.0, 0.0], [0.0, -0.1]], 0.0).0, f64::INFINITY);
    assert_eq!(rubber.energy_and_pk1(&[[1.0, 0.0], [0.0, 0.0]], 0.0).0, f64::INFINITY);
}

#[test]
fn spatial_stiffness_is_the_derivative_pushed_forward() {
    let seed = 57;
    println!("seed {seed}");
    let rng = &mut StdRng::seed_from_u64(seed);
    for (law, plastic) in laws() {
        // The stress is taken at a trial state; the velocity gradient acts on the state before it.
        let (trial, f) = (rotated(rng, &[1.2, 1.0, 0.7]), rotated(rng, &[1.1, 0.9, 0.8]));
        let tangent = law.projected_derivative(&trial, plastic);
        let k = tangent.spatial(&f);
        for _ in 0..4 {
            let (g, h) = (random::<3>(rng), random::<3>(rng));
            let expected = double_dot(&mul(&g, &f), &tangent.times(&mul(&h, &f)));
            let (mut found, mut swapped) = (0.0, 0.0);
            for (a, b, c, d) in (0..81).map(|n| (n / 27, n / 9 % 3, n / 3 % 3, n % 3)) {
                found += k[a][b][c][d] * g[a][b] * h[c][d];
                swapped += k[a][b][c][d] * g[c][d] * h[a][b];
            }
            assert!((found - expected).abs() < 1e-9 * MODULUS, "{law:?}: {found} {expected}");
            assert!((swapped - expected).abs() < 1e-9 * MODULUS, "{law:?} is not symmetric: {swapped} {expected}");
        }
    }
}

#[test]
fn the_characteristic_stiffness_is_that_at_rest() {
    fn check<const D: usize>() {
        for material in samples().iter().filter(|m| !m.is_fluid()) {
            let law = Law::<f64>::new(material);
            let tangent = law.projected_derivative(&identity::<f64, D>(), initial_plastic_state(material));
            let norm = full(&tangent).norm();
            assert!((law.characteristic::<D>() / norm - 1.0).abs() < 1e-12, "{material:?}: {norm}");
        }
    }
    check::<3>();
    check::<2>();
}

#[test]
fn small_strains_keep_their_digits() {
    // The rotation's entries are rounded and the strain is 1e-6. The energy must match Hooke's to
    // 2e-5 of itself, although ψ is only 1e-12 of the moduli.
    let rng = &mut StdRng::seed_from_u64(58);
    for (law, plastic) in laws() {
        let strain = [2e-6, -1e-6, 3e-6];
        let f = rotated(rng, &strain.map(|e| 1.0 + e));
        let (mu, lambda) = match law {
            Law::Snow(snow) => (snow.hardened(plastic).mu, snow.hardened(plastic).lambda),
            _ => law.moduli(),
        };
        let square: f64 = strain.iter().map(|e| e * e).sum();
        let trace: f64 = strain.iter().sum();
        let hooke = mu * square + 0.5 * lambda * trace * trace;
        let found = law.energy_and_pk1(&f, plastic).0;
        assert!((found / hooke - 1.0).abs() < 2e-5, "{law:?}: {found:e} instead of {hooke:e}");
    }
}
