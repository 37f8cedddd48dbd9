//! Tests of the constitutive laws: stress against energy, rotation, limits.

use rand::{Rng, SeedableRng, rngs::StdRng};

use super::parameters::Fluid;
use super::*;
use crate::maths::linalg::{Matrix, add_scaled, identity, mul, mul_transpose, trace};
use crate::maths::svd::svd;

const ELASTIC: Elastic = Elastic { density: 1000.0, youngs_modulus: 1e5, poissons_ratio: 0.3, damping: 0.0 };
const FLUID: Fluid = Fluid { density: 1000.0, bulk_modulus: 5e4, gamma: 7.15, viscosity: 0.1 };

fn random<const D: usize>(rng: &mut StdRng) -> Matrix<f64, D> {
    let mut m = identity();
    for x in m.iter_mut().flatten() {
        *x = rng.random_range(-1.0..1.0);
    }
    m
}

/// Random rotations of the given singular values.
fn deformation<const D: usize>(rng: &mut StdRng, sigma: [f64; D]) -> Matrix<f64, D> {
    let mut stretch = identity();
    for i in 0..D {
        stretch[i][i] = sigma[i];
    }
    mul_transpose(&mul(&svd(&random(rng)).u, &stretch), &svd(&random(rng)).u)
}

/// Checks that dψ((I + ε G) F)/dε at 0 is τ : G, for every G.
fn check_stress<const D: usize>(
    rng: &mut StdRng,
    f: &Matrix<f64, D>,
    energy: impl Fn(&Matrix<f64, D>) -> f64,
    tau: &Matrix<f64, D>,
    modulus: f64,
) {
    for _ in 0..4 {
        let g = random(rng);
        let at = |step: f64| energy(&mul(&add_scaled(&identity(), step, &g), f));
        // Fourth-order central differences.
        let h = 1e-3;
        let slope = (8.0 * (at(h) - at(-h)) - (at(2.0 * h) - at(-2.0 * h))) / (12.0 * h);
        let expected = crate::maths::linalg::double_dot(tau, &g);
        assert!((slope - expected).abs() < 1e-7 * modulus, "slope {slope}, stress {expected} at F = {f:?}, G = {g:?}");
    }
    let skew = tau.iter().enumerate().flat_map(|(i, row)| row.iter().enumerate().map(move |(k, t)| (i, k, t)));
    for (i, k, t) in skew {
        assert!((t - tau[k][i]).abs() < 1e-10 * modulus, "τ is not symmetric: {tau:?}");
    }
}

fn check_elastic<const D: usize>(rng: &mut StdRng, spectra: &[[f64; D]]) {
    let (fcr, neo) = (FixedCorotated::<f64>::new(&ELASTIC), NeoHookean::<f64>::new(&ELASTIC));
    for sigma in spectra {
        for _ in 0..50 {
            let f = deformation(rng, *sigma);
            check_stress(rng, &f, |f| fcr.energy(f), &fcr.kirchhoff(&f), ELASTIC.youngs_modulus);
            if det(&f) > 0.0 {
                check_stress(rng, &f, |f| neo.energy(f), &neo.kirchhoff(&f), ELASTIC.youngs_modulus);
            }
        }
    }
}

#[test]
fn elastic_stress_is_the_energys_derivative() {
    let seed = 11;
    println!("seed {seed}");
    let rng = &mut StdRng::seed_from_u64(seed);
    let spectra = [[1.0, 1.0, 1.0], [1.3, 1.0, 0.8], [2.0, 1.1, 0.4], [1.2, 0.9, -0.5], [0.6, 0.5, 0.4]];
    check_elastic::<3>(rng, &spectra);
    check_elastic::<2>(rng, &spectra.map(|s| [s[0], s[2]]));
}

#[test]
fn fluid_pressure_is_the_energys_derivative() {
    let rng = &mut StdRng::seed_from_u64(12);
    for gamma in [7.15, 7.0, 1.0] {
        let law = WeaklyCompressibleFluid::<f64>::new(&Fluid { gamma, ..FLUID });
        assert_eq!((law.pressure(1.0), law.energy(1.0)), (0.0, 0.0));
        for j in [0.9, 0.99, 1.0, 1.01, 1.2] {
            let f = deformation(rng, [1.1, 1.0, j / 1.1]);
            let tau = law.kirchhoff(det(&f), law.pressure(det(&f)), &[[0.0; 3]; 3]);
            check_stress(rng, &f, |f| law.energy(det(f)), &tau, FLUID.bulk_modulus);
        }
        // The bulk modulus is the slope at rest.
        let slope = (law.pressure(1.0 - 1e-6) - law.pressure(1.0 + 1e-6)) / 2e-6;
        assert!((slope / FLUID.bulk_modulus - 1.0).abs() < 1e-9, "{slope}");
    }
}

#[test]
fn viscous_stress_follows_the_rate_of_strain() {
    let law = WeaklyCompressibleFluid::<f64>::new(&FLUID);
    let tau = law.kirchhoff(1.0, 0.0, &[[0.0, 3.0], [1.0, 0.0]]);
    assert_eq!(tau, [[0.0, 4.0 * FLUID.viscosity], [4.0 * FLUID.viscosity, 0.0]]);
    let spin = law.kirchhoff(1.0, 0.0, &[[0.0, 3.0], [-3.0, 0.0]]);
    assert_eq!(spin, [[0.0; 2]; 2]);
}

#[test]
fn rotation_costs_nothing_and_turns_the_stress() {
    let rng = &mut StdRng::seed_from_u64(13);
    let (fcr, neo) = (FixedCorotated::<f64>::new(&ELASTIC), NeoHookean::<f64>::new(&ELASTIC));
    for _ in 0..100 {
        let (f, q) = (deformation(rng, [1.2, 1.0, 0.7]), svd(&random::<3>(rng)).u);
        let turned = mul(&q, &f);
        for (energy, energy_turned, tau, tau_turned) in [
            (fcr.energy(&f), fcr.energy(&turned), fcr.kirchhoff(&f), fcr.kirchhoff(&turned)),
            (neo.energy(&f), neo.energy(&turned), neo.kirchhoff(&f), neo.kirchhoff(&turned)),
        ] {
            assert!((energy - energy_turned).abs() < 1e-10 * energy);
            let expected = mul_transpose(&mul(&q, &tau), &q);
            let error = add_scaled(&expected, -1.0, &tau_turned);
            assert!(error.iter().flatten().all(|e| e.abs() < 1e-8), "{error:?}");
        }
        assert!(fcr.energy(&q).abs() < 1e-9 && neo.energy(&q).abs() < 1e-9);
    }
}

#[test]
fn small_strains_obey_hookes_law() {
    let (mu, lambda) = lame(&ELASTIC);
    let strain = [[2e-7, 1e-7, 0.0], [1e-7, -1e-7, 3e-7], [0.0, 3e-7, 5e-7]];
    let f = add_scaled(&identity(), 1.0, &strain);
    for tau in [FixedCorotated::<f64>::new(&ELASTIC).kirchhoff(&f), NeoHookean::<f64>::new(&ELASTIC).kirchhoff(&f)] {
        for i in 0..3 {
            for k in 0..3 {
                let hooke = 2.0 * mu * strain[i][k] + if i == k { lambda * trace(&strain) } else { 0.0 };
                assert!((tau[i][k] - hooke).abs() < 1e-6, "τ[{i}][{k}] = {}, Hooke {hooke}", tau[i][k]);
            }
        }
    }
}

#[test]
fn plane_strain_is_the_three_dimensional_law_with_unit_stretch_across() {
    let rng = &mut StdRng::seed_from_u64(14);
    let f = deformation(rng, [1.3, 0.8]);
    let flat = to_row_major(&f, 1.0);
    let elastic = Material::NeoHookean(ELASTIC);
    let law = NeoHookean::<f64>::new(&ELASTIC);
    assert!((energy_density(&elastic, 2, &flat, 0.0) - law.energy(&f)).abs() < 1e-9);
    let (tau, tau_flat) = (law.kirchhoff(&f), kirchhoff(&elastic, 2, &flat, 0.0));
    for i in 0..2 {
        for k in 0..2 {
            assert!((tau[i][k] - tau_flat[3 * i + k]).abs() < 1e-9);
        }
    }
    let fcr = Material::FixedCorotated(ELASTIC);
    let law = FixedCorotated::<f64>::new(&ELASTIC);
    assert!((energy_density(&fcr, 2, &flat, 0.0) - law.energy(&f)).abs() < 1e-9);
    assert!((kirchhoff(&fcr, 2, &flat, 0.0)[1] - law.kirchhoff(&f)[0][1]).abs() < 1e-9);
}

#[test]
fn the_enums_functions_agree_with_the_laws() {
    let fluid = Material::WeaklyCompressibleFluid(FLUID);
    let law = WeaklyCompressibleFluid::<f64>::new(&FLUID);
    let root = 0.95f64.sqrt();
    let f = [root, 0.0, 0.0, 0.0, root, 0.0, 0.0, 0.0, 1.0];
    assert!((energy_density(&fluid, 3, &f, 0.0) - law.energy(0.95)).abs() < 1e-9);
    let sigma = cauchy(&fluid, 3, &f, 0.0);
    for (k, value) in sigma.iter().enumerate() {
        let expected = if k % 4 == 0 { -law.pressure(0.95) } else { 0.0 };
        assert!((value - expected).abs() < 1e-8, "{sigma:?}");
    }
}
