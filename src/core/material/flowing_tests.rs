//! Tests of laws that flow inside an implicit step: stress, energy and tangent.

use rand::{Rng, SeedableRng, rngs::StdRng};

use super::derivative_tests::{MODULUS, distance, exists, full, random, rotated, slope};
use super::parameters::Cone;
use super::principal::Principal;
use super::*;
use crate::maths::linalg::{add_scaled, apply, double_dot, identity, mul, mul_transpose};

/// Every law that can be integrated implicitly, in the plastic states that differ: grains that
/// touch and that are apart, clay and snow before and after hardening. Flow of the last two is
/// associated.
fn states() -> Vec<(Material, f64)> {
    let mut all = Vec::new();
    for material in samples().into_iter().filter(|m| !m.is_fluid()) {
        let plastic: &[f64] = match material {
            Material::DruckerPrager(_) | Material::MohrCoulomb(_) => &[0.0, 0.05],
            Material::Nacc(_) => &[-0.01, -0.1],
            Material::Snow(_) => &[1.0, 0.97],
            _ => &[0.0],
        };
        all.extend(plastic.iter().map(|&plastic| (material.clone(), plastic)));
    }
    for cone in [Cone::TriaxialCompression, Cone::PlaneStrain] {
        let sand =
            samples().into_iter().find_map(|m| if let Material::DruckerPrager(sand) = m { Some(sand) } else { None });
        let mut sand = sand.unwrap();
        (sand.cohesion, sand.dilatancy_angle_degrees, sand.cone) = (2e3, sand.friction_angle_degrees, cone);
        all.push((Material::DruckerPrager(sand), 0.0));
    }
    all
}

fn laws() -> Vec<(Law<f64>, f64)> {
    states().into_iter().map(|(material, plastic)| (Law::new(&material), plastic)).collect()
}

/// Random states at strains on both sides of the yield surfaces, none so flat that it is extended.
fn trials<const D: usize>(rng: &mut StdRng, law: &Law<f64>) -> Vec<Matrix<f64, D>> {
    trials_of(rng, law, &[1e-4, 1e-3, 0.01, 0.1, 0.3])
}

fn trials_of<const D: usize>(rng: &mut StdRng, law: &Law<f64>, sizes: &[f64]) -> Vec<Matrix<f64, D>> {
    let sizes = sizes.iter().copied().cycle().take(200);
    let found: Vec<_> = sizes.map(|size| mul(&rotated(rng, &[1.0; D]), &near_rest(rng, size))).collect();
    found.into_iter().filter(|f| svd(f).sigma[D - 1] > 0.1 && exists(law, &svd(f).sigma)).collect()
}

/// A state near rest; half are also compressed, more or less evenly.
fn near_rest<const D: usize>(rng: &mut StdRng, size: f64) -> Matrix<f64, D> {
    if rng.random() {
        return add_scaled(&identity(), size, &random(rng));
    }
    let uneven = size * rng.random_range(0.0f64..1.0).powi(2);
    add_scaled(&scaled_identity(1.0 - size), uneven, &random(rng))
}

/// The stress that a step ends with, pulled back: τ of the returned state.
fn returned_tau<const D: usize>(law: &Law<f64>, f: &Matrix<f64, D>, plastic: f64) -> (Matrix<f64, D>, bool) {
    let (mut after, mut state) = (*f, plastic);
    law.return_map(&mut after, &mut state);
    (law.kirchhoff(&after, state).0, after != *f)
}

fn check_stress<const D: usize>(seed: u64) {
    println!("seed {seed}");
    let rng = &mut StdRng::seed_from_u64(seed);
    for (law, plastic) in laws() {
        let (mut flown, mut elastic, mut lagged) = (0, 0, 0.0f64);
        for f in trials::<D>(rng, &law) {
            let (tau, moved) = returned_tau(&law, &f, plastic);
            let found = mul_transpose(&law.flowing_pk1(&f, plastic).unwrap(), &f);
            let error = distance(found.as_flattened(), tau.as_flattened());
            let size = tau.iter().flatten().fold(MODULUS, |m, x| m.max(x.abs()));
            assert!(error < 1e-11 * size, "{law:?}: τ off by {error} at {f:?}");
            if moved {
                flown += 1
            } else {
                elastic += 1
            }
            let elastic = mul_transpose(&law.energy_and_pk1(&f, plastic).1, &f);
            lagged = lagged.max(distance(elastic.as_flattened(), tau.as_flattened()));
        }
        // Grains that are apart flow in any state: they move apart or together.
        let apart = law.gained_volume(plastic).is_some_and(|volume| volume > 0.0);
        let both = flown > 20 && (elastic > 10 || apart) && lagged > 1e-2 * MODULUS;
        assert!(both || !law.is_plastic(), "{law:?}: {flown} flow and {elastic} do not, lagged off by {lagged}");
    }
}

#[test]
fn the_stress_is_that_of_the_returned_state() {
    check_stress::<3>(61);
    check_stress::<2>(62);
}

#[test]
fn elastic_laws_keep_their_stress_and_tangent() {
    let rng = &mut StdRng::seed_from_u64(63);
    for (law, plastic) in laws().into_iter().filter(|(law, _)| !law.is_plastic()) {
        for f in trials::<3>(rng, &law) {
            assert_eq!(law.flowing_pk1(&f, plastic), Some(law.energy_and_pk1(&f, plastic).1));
            assert_eq!(law.flowing_derivative(&f, plastic), law.projected_derivative(&f, plastic));
            assert_eq!(law.flowing_energy(&f, plastic), Some(law.energy_and_pk1(&f, plastic).0));
        }
    }
    let rubber = laws().into_iter().find(|(law, _)| matches!(law, Law::NeoHookean(_))).unwrap().0;
    assert_eq!(rubber.flowing_pk1(&[[1.0, 0.0], [0.0, -0.1]], 0.0), None);
    assert_eq!(rubber.flowing_pk1(&[[1.0, 0.0], [0.0, 0.0]], 0.0), None);
}

#[test]
fn stress_turns_with_the_body_and_does_not_see_the_material_turn() {
    let seed = 64;
    println!("seed {seed}");
    let rng = &mut StdRng::seed_from_u64(seed);
    for (law, plastic) in laws() {
        for _ in 0..100 {
            let f: Matrix<f64, 3> = add_scaled(&identity(), 0.5, &random(rng));
            let (turn, rest) = (rotated::<3>(rng, &[1.0; 3]), rotated::<3>(rng, &[1.0; 3]));
            let pk1 = law.flowing_pk1(&f, plastic);
            let turned = law.flowing_pk1(&mul(&mul(&turn, &f), &rest), plastic);
            assert_eq!(pk1.is_some(), turned.is_some());
            if let (Some(pk1), Some(turned)) = (pk1, turned) {
                let error = distance(turned.as_flattened(), mul(&mul(&turn, &pk1), &rest).as_flattened());
                let size = pk1.iter().flatten().fold(MODULUS, |m, x| m.max(x.abs()));
                assert!(error < 1e-9 * size, "{law:?}: off by {error} at {:?}", svd(&f).sigma);
            }
        }
    }
}

#[test]
fn flat_and_inverted_states_push_back_without_a_step() {
    for (law, plastic) in laws().into_iter().filter(|(law, _)| law.is_plastic()) {
        let pk1 = |s: f64| law.flowing_pk1(&[[1.0, 0.0, 0.0], [0.0, 0.9, 0.0], [0.0, 0.0, s]], plastic).unwrap();
        for s in [0.4, 0.15, 0.05, 1e-3, 0.0, -0.02, -0.3, -0.8] {
            assert!(pk1(s)[2][2] < 0.0, "{law:?}: {} at {s}", pk1(s)[2][2]);
        }
        for at in [EXTENSION, 0.0, -0.2] {
            let [below, above] = [at - 1e-9, at + 1e-9].map(pk1);
            let size = pk1(-0.3).iter().flatten().fold(MODULUS, |m, x| m.max(x.abs()));
            assert!(distance(below.as_flattened(), above.as_flattened()) < 1e-6 * size, "{law:?} at {at}");
        }
        for sigma in [[1.0, 1.0, -40.0], [0.5, 0.5, -0.5], [1.0, 0.0, 0.0], [0.0; 3], [300.0, 1.0, 1e-9]] {
            let f = sigma_matrix(&sigma);
            let finite = law.flowing_derivative(&f, plastic).spatial(&f);
            assert!(finite.as_flattened().as_flattened().as_flattened().iter().all(|x| x.is_finite()));
            assert!(law.flowing_pk1(&f, plastic).is_some(), "{law:?} at {sigma:?}");
            let f = f.map(|row| row.map(|x| x as f32));
            assert!(Law::<f32>::flowing_pk1(&single(&law, plastic), &f, plastic as f32).is_some(), "{law:?} {sigma:?}");
        }
    }
}

fn sigma_matrix(sigma: &Vector<f64, 3>) -> Matrix<f64, 3> {
    std::array::from_fn(|i| std::array::from_fn(|j| if i == j { sigma[i] } else { 0.0 }))
}

/// The same law in f32.
fn single(law: &Law<f64>, plastic: f64) -> Law<f32> {
    let same = |(material, state): &(Material, f64)| Law::<f64>::new(material) == *law && *state == plastic;
    Law::new(&states().into_iter().find(same).unwrap().0)
}

/// Derivative of P along g at f, and whether it has none here: a kink of the yield surface.
fn pk1_slope<const D: usize>(
    law: &Law<f64>,
    plastic: f64,
    f: &Matrix<f64, D>,
    g: &Matrix<f64, D>,
) -> (Matrix<f64, D>, bool) {
    let along = |t: f64| law.flowing_pk1(&add_scaled(f, t, g), plastic).unwrap().as_flattened().to_vec();
    let (coarse, fine) = (slope(2e-5, along), slope(1e-5, along));
    let size = fine.iter().fold(MODULUS, |m, x| m.max(x.abs()));
    (std::array::from_fn(|i| std::array::from_fn(|j| fine[i * D + j])), distance(&coarse, &fine) > 1e-7 * size)
}

fn check_energy<const D: usize>(seed: u64) {
    println!("seed {seed}");
    let rng = &mut StdRng::seed_from_u64(seed);
    let (mut laws_with, mut worst) = (0, [0.0f64; 2]);
    for (law, plastic) in laws().into_iter().filter(|(law, _)| law.is_plastic()) {
        if law.flowing_energy::<D>(&identity(), plastic).is_none() {
            continue;
        }
        laws_with += 1;
        let (mut kinks, mut checks) = (0, 0);
        for f in trials::<D>(rng, &law) {
            let (g, pk1) = (random::<D>(rng), law.flowing_pk1(&f, plastic).unwrap());
            let energy = slope(1e-5, |t| vec![law.flowing_energy(&add_scaled(&f, t, &g), plastic).unwrap()]);
            let error = (energy[0] - double_dot(&pk1, &g)).abs() / MODULUS;
            // Across a kink the difference has an error of the order of the step.
            assert!(error < 1e-5, "{law:?}: dψ off by {error} at {:?}", svd(&f).sigma);
            let (expected, kink) = pk1_slope(&law, plastic, &f, &g);
            checks += 1;
            kinks += usize::from(kink);
            if !kink {
                let size = expected.iter().flatten().fold(MODULUS, |m, x| m.max(x.abs()));
                let tangent = law.flowing_tangent(&svd(&f), plastic).times(&g);
                worst[0] = worst[0].max(error);
                worst[1] = worst[1].max(distance(tangent.as_flattened(), expected.as_flattened()) / size);
            }
        }
        assert!(kinks * 10 < checks, "{law:?}: {kinks} of {checks} states at kinks");
    }
    println!("{D}D: {laws_with} laws; energy {:.1e}, tangent {:.1e} of the modulus", worst[0], worst[1]);
    assert!(laws_with >= 5 && worst[0] < 1e-8 && worst[1] < 1e-6, "{worst:?}");
}

#[test]
fn where_there_is_an_energy_stress_and_tangent_are_its_derivatives() {
    check_energy::<3>(65);
    check_energy::<2>(66);
}

/// Checks dP where the axes turn, and measures it along random directions, at strains of 1 % and
/// 2 %: the error relative to dP, its mean by law and its largest value.
fn check_tangent<const D: usize>(seed: u64) {
    println!("seed {seed}");
    let rng = &mut StdRng::seed_from_u64(seed);
    for (law, plastic) in laws().into_iter().filter(|(law, _)| law.is_plastic()) {
        let (mut turning, mut errors) = (0.0f64, Vec::new());
        for f in trials_of::<D>(rng, &law, &[0.01, 0.02]) {
            let at = svd(&f);
            let tangent = law.flowing_tangent(&at, plastic);
            // Without the diagonal in the bases of F, only the axes turn.
            let (all, mut turn) = (random::<D>(rng), random::<D>(rng));
            (0..D).for_each(|i| turn[i][i] = 0.0);
            let turn = mul_transpose(&mul(&at.u, &turn), &at.v);
            for (g, turns) in [(turn, true), (all, false)] {
                let (expected, kink) = pk1_slope(&law, plastic, &f, &g);
                let error = norm(&add_scaled(&tangent.times(&g), -1.0, &expected));
                match (kink, turns) {
                    (true, _) => {}
                    (false, true) => turning = turning.max(error / MODULUS),
                    (false, false) => errors.push(error / norm(&expected).max(1e-2 * MODULUS)),
                }
            }
        }
        assert!(errors.len() > 150, "{law:?}: only {} states", errors.len());
        let mean = errors.iter().sum::<f64>() / errors.len() as f64;
        let worst = errors.iter().fold(0.0f64, |m, &e| m.max(e));
        println!("{D}D, {}: turning {turning:.0e}, mean {mean:.0e}, worst {worst:.2}", name(&law));
        assert!(turning < 1e-6, "{law:?}: turning axes are off by {turning:e}");
        let bounds = match law {
            _ if law.flowing_energy::<D>(&identity(), plastic).is_some() => (1e-7, 1e-6),
            Law::VonMises(_) => (0.02, 2.0),
            Law::Snow(_) => (0.25, 1.5),
            _ => (0.1, 1.0),
        };
        assert!(mean < bounds.0 && worst < bounds.1, "{law:?}: mean error {mean:e}, worst {worst:e}");
    }
}

fn norm<const D: usize>(m: &Matrix<f64, D>) -> f64 {
    double_dot(m, m).sqrt()
}

/// Short, for what tests print.
pub(super) fn name(law: &Law<f64>) -> String {
    format!("{law:?}").split('(').next().unwrap().to_string()
}

#[test]
fn the_tangent_is_exact_where_axes_turn_and_near_elsewhere() {
    check_tangent::<3>(67);
    check_tangent::<2>(68);
}

/// Checks ∂τ_i/∂ε_j before it is made symmetric, along directions in which each law claims it to be
/// exact: all of von Mises; where the radius of the yield surface does not change, of grains (at
/// constant volume without dilatancy, and while a gap between them closes) and of clay (at constant
/// volume); of snow, what an axis that is free or clamped causes along axes like it.
fn check_returned<const D: usize>(seed: u64) {
    println!("seed {seed}");
    let rng = &mut StdRng::seed_from_u64(seed);
    for (law, plastic) in laws().into_iter().filter(|(law, _)| law.is_plastic()) {
        let dilates = match law {
            Law::DruckerPrager(law) => law.slopes(D).dilatancy > 0.0,
            Law::MohrCoulomb(law) if D == 2 => law.sin_dilatancy > 0.0,
            // In 3D its strength depends on the stress between, not only on the pressure.
            Law::MohrCoulomb(_) => continue,
            _ => false,
        };
        let (mut checked, mut flown) = (0, 0);
        for f in trials::<D>(rng, &law) {
            let sigma = svd(&f).sigma;
            let volume = sigma.iter().map(|s| s.ln()).sum::<f64>();
            let closes = law.gained_volume(plastic).is_some_and(|gap| volume < 0.0 && -volume < gap);
            let mut strain: [f64; D] = std::array::from_fn(|_| rng.random_range(-1.0..1.0));
            if !closes && !matches!(law, Law::VonMises(_)) {
                let mean = strain.iter().sum::<f64>() / D as f64;
                strain = strain.map(|e| e - mean);
            }
            let stretched = |t: f64| std::array::from_fn(|i| sigma[i] * (t * strain[i]).exp());
            let returned = |sigma: [f64; D]| law.flow_principal(&sigma, plastic).unwrap();
            let along = |t: f64| returned(stretched(t)).tau.to_vec();
            let (coarse, expected) = (slope(2e-5, along), slope(1e-5, along));
            let tangent = principal!(&law, law => law.returned_tangent(&sigma, plastic), { _ => unreachable!() });
            if distance(&coarse, &expected) > 1e-7 * MODULUS || dilates && !closes {
                continue;
            }
            let error = if let Law::Snow(snow) = &law {
                let clamped = sigma.map(|s| s < snow.least || s > snow.most);
                // One column at a time: which rows are exact depends on it.
                let j = rng.random_range(0..D);
                let column = slope(1e-5, |t| {
                    returned(std::array::from_fn(|i| if i == j { sigma[i] * t.exp() } else { sigma[i] })).tau.to_vec()
                });
                let rows = (0..D).filter(|&i| if clamped[j] { i == j } else { !clamped[i] });
                // Softening is left out.
                rows.map(|i| (tangent[i][j] - if clamped[j] { column[i].max(0.0) } else { column[i] }).abs())
                    .fold(0.0, f64::max)
            } else {
                distance(&apply(&tangent, &strain), &expected)
            };
            let size = tangent.iter().flatten().fold(MODULUS, |m, x| m.max(x.abs()));
            assert!(error < 1e-6 * size, "{law:?}, {plastic}: dτ off by {error} at {sigma:?}");
            checked += 1;
            flown += usize::from(returned(sigma).moved);
        }
        assert!(flown > 20 || dilates && plastic == 0.0, "{law:?}, {plastic}: {flown} of {checked} states flow");
    }
}

#[test]
fn tangents_are_exact_where_the_laws_say_so() {
    check_returned::<3>(73);
    check_returned::<2>(74);
}

fn check_definite<const D: usize>(seed: u64) {
    println!("seed {seed}");
    let rng = &mut StdRng::seed_from_u64(seed);
    for (law, plastic) in laws() {
        for size in [1e-3, 0.03, 0.3, 1.0].into_iter().cycle().take(300) {
            let f: Matrix<f64, D> = near_rest(rng, size);
            if exists(&law, &svd(&f).sigma) {
                let tangent = full(&law.flowing_derivative(&f, plastic));
                let size = tangent.amax().max(MODULUS);
                let skew = (&tangent - tangent.transpose()).amax();
                assert!(skew <= 1e-12 * size, "{law:?}: skew {skew:e} of {size:e} at {:?}", svd(&f).sigma);
                let least = tangent.symmetric_eigen().eigenvalues.min();
                assert!(least >= -1e-12 * size, "{law:?}: eigenvalue {least:e} of {size:e} at {:?}", svd(&f).sigma);
            }
        }
    }
}

#[test]
fn the_tangent_is_symmetric_and_semidefinite_everywhere() {
    check_definite::<3>(69);
    check_definite::<2>(70);
}

fn check_single<const D: usize>(seed: u64) {
    println!("seed {seed}");
    let rng = &mut StdRng::seed_from_u64(seed);
    let wide = |m: &Matrix<f32, D>| m.map(|row| row.map(f64::from));
    for (law, plastic) in laws() {
        let (short, mut worst) = (single(&law, plastic), [0.0f64; 3]);
        for f in trials::<D>(rng, &law) {
            let short_f = f.map(|row| row.map(|x| x as f32));
            let f = wide(&short_f);
            let pk1 = law.flowing_pk1(&f, plastic).unwrap();
            let found = wide(&short.flowing_pk1(&short_f, plastic as f32).unwrap());
            let error = distance(found.as_flattened(), pk1.as_flattened());
            worst[0] = worst[0].max(error / norm(&pk1).max(1e-2 * MODULUS));
            // Strains are rounded to 1e-7, so a modulus from two of them is as good as they differ.
            let sigma = svd(&f).sigma;
            let apart = (1..D).all(|i| sigma[i - 1] - sigma[i] > 1e-3);
            let tangent = law.flowing_derivative(&f, plastic);
            let found = short.flowing_derivative(&short_f, plastic as f32);
            let g = random::<D>(rng).map(|row| row.map(|x| x as f32));
            let error = distance(wide(&found.times(&g)).as_flattened(), tangent.times(&wide(&g)).as_flattened());
            let at = if apart { 1 } else { 2 };
            worst[at] = worst[at].max(error / norm(&tangent.times(&wide(&g))).max(MODULUS));
        }
        let [stress, tangent, near_equal] = worst;
        println!("{D}D, {}: P {stress:.0e}, tangent {tangent:.0e}, at near equal {near_equal:.0e}", name(&law));
        assert!(stress < 2e-4 && tangent < 2e-4 && near_equal < 0.1, "{law:?}: {worst:?}");
    }
}

#[test]
fn single_precision_gives_the_same() {
    check_single::<3>(71);
    check_single::<2>(72);
}
