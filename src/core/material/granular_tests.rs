//! Tests of Mohr–Coulomb and of the cones of Drucker–Prager: strength against the friction angle,
//! returns against a minimisation, dilatancy, opening.

use nalgebra::{Matrix3, Vector3};
use rand::{Rng, SeedableRng, rngs::StdRng};

use super::parameters::{self, Cone};
use super::principal::Principal;
use super::*;
use crate::maths::linalg::Vector;

const ELASTIC: Elastic = Elastic { density: 1000.0, youngs_modulus: 1e6, poissons_ratio: 0.3, damping: 0.0 };

fn soil(friction_angle_degrees: f64, cohesion: f64, dilatancy_angle_degrees: f64) -> MohrCoulomb<f64> {
    let Elastic { density, youngs_modulus, poissons_ratio, .. } = ELASTIC;
    let material = parameters::MohrCoulomb {
        density,
        youngs_modulus,
        poissons_ratio,
        friction_angle_degrees,
        cohesion,
        dilatancy_angle_degrees,
    };
    MohrCoulomb::new(&material, &ELASTIC)
}

fn cone(friction_angle_degrees: f64, cohesion: f64, dilatancy_angle_degrees: f64, cone: Cone) -> DruckerPrager<f64> {
    let Elastic { density, youngs_modulus, poissons_ratio, .. } = ELASTIC;
    let material = parameters::DruckerPrager {
        density,
        youngs_modulus,
        poissons_ratio,
        friction_angle_degrees,
        cohesion,
        dilatancy_angle_degrees,
        cone,
    };
    DruckerPrager::new(&material, &ELASTIC)
}

/// Strain whose Hencky stress this is.
fn strain_of<const D: usize>(tau: Vector<f64, D>) -> Vector<f64, D> {
    let (mu, lambda) = lame(&ELASTIC);
    let trace = tau.iter().sum::<f64>() / (D as f64 * lambda + 2.0 * mu);
    tau.map(|t| (t - lambda * trace) / (2.0 * mu))
}

/// Stress after a return from a trial stress.
fn returned<const D: usize>(law: &impl Principal<f64>, tau: Vector<f64, D>) -> Vector<f64, D> {
    let trial = strain_of(tau).map(f64::exp);
    let (sigma, _) = law.return_map(&trial, 0.0).unwrap_or((trial, 0.0));
    law.kirchhoff(&sigma, 0.0)
}

/// The principal stress at which a test breaks: the strain of one axis grows by `rate`, and `held`
/// says which others keep their stress (true) or their strain.
fn broken(law: &impl Principal<f64>, pressure: f64, rate: [f64; 3], held: [bool; 3]) -> [f64; 3] {
    let (mu, lambda) = lame(&ELASTIC);
    let mut strain = strain_of([-pressure; 3]);
    let mut tau = [-pressure; 3];
    for _ in 0..20_000 {
        (0..3).for_each(|i| strain[i] += rate[i]);
        // The returned stress, with the held stresses restored by Newton's iteration on the elastic
        // moduli, which is exact once nothing flows any more.
        for _ in 0..60 {
            let trial = strain.map(f64::exp);
            let after = law.return_map(&trial, 0.0).map_or(trial, |(sigma, _)| sigma);
            tau = law.kirchhoff(&after, 0.0);
            let off: [f64; 3] = std::array::from_fn(|i| if held[i] { -pressure - tau[i] } else { 0.0 });
            if off.iter().all(|x| x.abs() < 1e-9 * pressure) {
                break;
            }
            (0..3).for_each(|i| strain[i] += off[i] / (2.0 * mu + lambda));
        }
        let trial = strain.map(f64::exp);
        if let Some((sigma, _)) = law.return_map(&trial, 0.0) {
            strain = sigma.map(f64::ln);
        }
    }
    tau
}

#[test]
fn the_angle_of_mohr_coulomb_holds_in_every_stress_state() {
    for phi in [5.0f64, 30.0, 45.0] {
        for (cohesion, psi) in [(0.0, 0.0), (0.0, phi), (1e3, 0.0), (1e3, 0.5 * phi)] {
            let law = soil(phi, cohesion, psi);
            let sin = phi.to_radians().sin();
            // K of Rankine: σ_3 = K σ_1 − 2 c √K, with tension positive.
            let k = (1.0 + sin) / (1.0 - sin);
            // Compression of one axis, of two, and something between them.
            for shape in [[1.0, 1.0, -2.0], [2.0, -1.0, -1.0], [1.0, 0.0, -1.0], [1.0, 0.2, -1.2]] {
                let [a, b, c] = returned(&law, shape.map(|s: f64| -2e4 + 1e5 * s));
                let most = a.max(b).max(c);
                let least = a.min(b).min(c);
                let expected = k * most - 2.0 * cohesion * k.sqrt();
                assert!((least - expected).abs() < 1e-12 * 3e5, "φ {phi}, c {cohesion}, ψ {psi}: {a} {b} {c}");
            }
        }
    }
}

#[test]
fn tests_on_samples_break_at_the_friction_angle() {
    let kp = 3.0;
    let ratio = |tau: [f64; 3]| {
        let (most, least) = tau.iter().fold((f64::MIN, f64::MAX), |(m, l), &t| (m.max(t), l.min(t)));
        least / most
    };
    let compression = |law: &dyn Fn([f64; 3], [bool; 3]) -> [f64; 3]| law([0.0, 0.0, -1e-5], [true, true, false]);
    let extension = |law: &dyn Fn([f64; 3], [bool; 3]) -> [f64; 3]| law([0.0, 0.0, 1e-5], [true, true, false]);
    let plane = |law: &dyn Fn([f64; 3], [bool; 3]) -> [f64; 3]| law([0.0, 0.0, -1e-5], [true, false, false]);
    let mohr = soil(30.0, 0.0, 0.0);
    let mohr = |rate, held| broken(&mohr, 1e4, rate, held);
    for found in [ratio(compression(&mohr)), ratio(extension(&mohr)), ratio(plane(&mohr))] {
        assert!((found / kp - 1.0).abs() < 1e-6, "{found}");
    }
    // Each cone is right in the state that names it.
    let published = cone(30.0, 0.0, 0.0, Cone::TriaxialCompression);
    let published = |rate, held| broken(&published, 1e4, rate, held);
    assert!((ratio(compression(&published)) / kp - 1.0).abs() < 1e-6);
    let (stretched, flat) = (ratio(extension(&published)), ratio(plane(&published)));
    assert!((stretched / 7.0 - 1.0).abs() < 1e-6, "{stretched} in extension");
    assert!((flat - 5.51).abs() < 0.05, "{flat} in plane strain");
    for psi in [0.0, 15.0, 30.0] {
        let matched = cone(30.0, 0.0, psi, Cone::PlaneStrain);
        let matched = |rate, held| broken(&matched, 1e4, rate, held);
        let flat = ratio(plane(&matched));
        assert!((flat / kp - 1.0).abs() < 1e-4, "{flat} at ψ {psi}");
    }
    // In two dimensions.
    for psi in [0.0, 15.0, 30.0] {
        let tau = returned(&cone(30.0, 0.0, psi, Cone::PlaneStrain), [-1e4, -8e4]);
        assert!((tau[1] / tau[0] / kp - 1.0).abs() < 1e-9, "{tau:?}");
        let soil = returned(&soil(30.0, 0.0, psi), [-1e4, -8e4]);
        assert!((soil[0] - tau[0]).abs() < 1e-6 && (soil[1] - tau[1]).abs() < 1e-6, "{soil:?} {tau:?}");
    }
    let tau = returned(&cone(30.0, 0.0, 0.0, Cone::TriaxialCompression), [-1e4, -8e4]);
    assert!((tau[1] / tau[0] - 2.717).abs() < 1e-3, "{tau:?}");
}

#[test]
fn cohesion_is_the_strength_without_pressure() {
    let (c, phi) = (2e3, 30f64.to_radians());
    let cases = [
        ("Mohr–Coulomb", returned(&soil(30.0, c, 0.0), [3e4, 0.0, -3e4])),
        ("Tresca", returned(&soil(0.0, c, 0.0), [3e4, 0.0, -3e4])),
        ("cone", returned(&cone(30.0, c, 0.0, Cone::PlaneStrain), [3e4, 0.0, -3e4])),
        ("cone without friction", returned(&cone(0.0, c, 0.0, Cone::PlaneStrain), [3e4, 0.0, -3e4])),
    ];
    for (name, tau) in cases {
        let cos = if name == "Tresca" || name.ends_with("friction") { 1.0 } else { phi.cos() };
        assert!((tau[0] - tau[2] - 2.0 * c * cos).abs() < 1e-6 * c, "{name}: {tau:?}");
        assert!(tau[1].abs() < 1e-6 * c, "{name}: {tau:?}");
    }
    // The tip, c cot φ; without friction there is none.
    let tip = c / phi.tan();
    for tau in [
        returned(&soil(30.0, c, 0.0), [5e4; 3]),
        returned(&soil(30.0, c, 20.0), [6e4, 5e4, 5e4]),
        returned(&cone(30.0, c, 0.0, Cone::TriaxialCompression), [5e4; 3]),
        returned(&cone(30.0, c, 20.0, Cone::PlaneStrain), [6e4, 5e4, 5e4]),
    ] {
        assert!(tau.iter().all(|t| (t - tip).abs() < 1e-6 * tip), "{tau:?}, tip {tip}");
    }
    let tau = returned(&soil(30.0, c, 0.0), [5e4; 2]);
    assert!(tau.iter().all(|t| (t - tip).abs() < 1e-6 * tip), "{tau:?}, tip {tip}");
    let held = [5e4; 3];
    assert_eq!(soil(0.0, c, 0.0).return_map(&strain_of(held).map(f64::exp), 0.0), None);
    // Without either, a body opens like sand.
    let loose = soil(0.0, 0.0, 0.0).return_map(&[1.1, 1.0, 1.0], 0.0);
    assert_eq!(loose, Some(([1.0; 3], 1.1f64.ln())));
}

/// The nearest point of the surface in the energy of the difference: the KKT points of every set of
/// active planes, of which there are at most three.
fn nearest(law: &MohrCoulomb<f64>, trial: [f64; 3]) -> [f64; 3] {
    let (mu, lambda) = lame(&ELASTIC);
    let moduli = Matrix3::from_element(lambda) + Matrix3::identity() * (2.0 * mu);
    let compliance = moduli.try_inverse().unwrap();
    let (sin, strength) = (law.sin_friction, law.strength * mu);
    let planes: Vec<Vector3<f64>> = (0..3)
        .flat_map(|i| (0..3).filter(move |&j| j != i).map(move |j| (i, j)))
        .map(|(i, j)| {
            let mut n = Vector3::zeros();
            (n[i], n[j]) = (1.0 + sin, -(1.0 - sin));
            n
        })
        .collect();
    let start = Vector3::from(trial);
    let allowed = |tau: &Vector3<f64>| planes.iter().all(|n| n.dot(tau) <= 2.0 * strength + 1e-6);
    let mut best = (f64::INFINITY, start);
    let mut consider = |tau: Vector3<f64>| {
        let distance = (tau - start).dot(&(compliance * (tau - start)));
        if allowed(&tau) && distance < best.0 {
            best = (distance, tau);
        }
    };
    consider(start);
    for set in 1u32..64 {
        let active: Vec<_> = (0..6).filter(|k| set >> k & 1 == 1).map(|k| planes[k]).collect();
        let n = active.len();
        if n > 3 {
            continue;
        }
        // τ = trial − D N x with Nᵀ τ = 2 c cos φ.
        let normals = nalgebra::DMatrix::from_fn(3, n, |r, c| active[c][r]);
        let moduli = nalgebra::DMatrix::from_fn(3, 3, |r, c| moduli[(r, c)]);
        let gap = nalgebra::DVector::from_fn(n, |k, _| active[k].dot(&start) - 2.0 * strength);
        let system = normals.transpose() * &moduli * &normals;
        if let Some(x) = system.lu().solve(&gap) {
            let step = moduli * normals * x;
            consider(start - Vector3::new(step[0], step[1], step[2]));
        }
    }
    best.1.into()
}

#[test]
fn associated_returns_are_the_nearest_points() {
    let seed = 61;
    println!("seed {seed}");
    let rng = &mut StdRng::seed_from_u64(seed);
    let mut places = [0; 4];
    for (phi, cohesion) in [(30.0, 2e3), (10.0, 5e3), (40.0, 1e3)] {
        let law = soil(phi, cohesion, phi);
        for _ in 0..2000 {
            let centre = rng.random_range(-3e4..2e4);
            let trial: [f64; 3] = std::array::from_fn(|_| centre + rng.random_range(-3e4..3e4));
            let (found, expected) = (returned(&law, trial), nearest(&law, trial));
            let off = (0..3).map(|i| (found[i] - expected[i]).abs()).fold(0.0, f64::max);
            assert!(off < 1e-6 * 3e4, "φ {phi}: {found:?}, nearest {expected:?}, trial {trial:?}");
            let mut sorted = found;
            sorted.sort_by(f64::total_cmp);
            let equal = usize::from(sorted[1] - sorted[0] < 1e-6) + 2 * usize::from(sorted[2] - sorted[1] < 1e-6);
            places[equal] += 1;
        }
    }
    println!("planes, edges, tips: {places:?}");
    assert!(places.iter().all(|&n| n > 100), "some part of the surface is not tested: {places:?}");
}

#[test]
fn returns_do_not_depend_on_the_order_of_the_axes_and_are_continuous() {
    let seed = 62;
    println!("seed {seed}");
    let rng = &mut StdRng::seed_from_u64(seed);
    for law in [soil(30.0, 0.0, 0.0), soil(35.0, 1e3, 10.0), soil(0.0, 2e3, 0.0), soil(25.0, 2e3, 25.0)] {
        for _ in 0..2000 {
            let centre = rng.random_range(-0.05..0.02);
            let strain: [f64; 3] = std::array::from_fn(|_| centre + rng.random_range(-0.05..0.05));
            let mapped = |strain: [f64; 3]| {
                let trial = strain.map(f64::exp);
                law.return_map(&trial, 0.0).unwrap_or((trial, 0.0))
            };
            let (sigma, opening) = mapped(strain);
            for order in [[1, 0, 2], [2, 1, 0], [1, 2, 0]] {
                let (turned, same) = mapped(order.map(|i| strain[i]));
                let off = (0..3).map(|i| (turned[i] - sigma[order[i]]).abs()).fold(0.0, f64::max);
                assert!(off < 1e-14 && (same - opening).abs() < 1e-14, "{strain:?}: {sigma:?}, {turned:?}");
            }
            // A small change of the trial state makes a small change of the result: also over the
            // boundaries of planes, edges and tip.
            let nudge: [f64; 3] = std::array::from_fn(|_| rng.random_range(-1e-3..1e-3));
            let mut last = (sigma, opening);
            for step in 1..=100 {
                let next = mapped(std::array::from_fn(|i| strain[i] + nudge[i] * f64::from(step) / 100.0));
                let off = (0..3).map(|i| (next.0[i] - last.0[i]).abs()).fold((next.1 - last.1).abs(), f64::max);
                assert!(off < 2e-4, "jump of {off} from {strain:?}");
                last = next;
            }
        }
    }
}

#[test]
fn flow_dilates_by_the_dilatancy_angle() {
    let sin = 12f64.to_radians().sin();
    let check = |before: [f64; 3], after: [f64; 3], what: &str| {
        // Plane strain: all flow is on the first and the last axis.
        let flow: [f64; 3] = std::array::from_fn(|i| before[i] - after[i].ln());
        let share = flow.iter().sum::<f64>() / (flow[0] - flow[2]);
        assert!((share - sin).abs() < 1e-9, "{what}: sin ψ {share}, expected {sin}");
    };
    let strain = strain_of([-1e4, -4e4, -8e4]);
    let trial = strain.map(f64::exp);
    check(strain, soil(30.0, 0.0, 12.0).return_map(&trial, 0.0).unwrap().0, "Mohr–Coulomb");
    // The cone, from a trial state with the stress across at which all flow is in the plane.
    let law = cone(30.0, 0.0, 12.0, Cone::PlaneStrain);
    let slope = law.slopes(3).dilatancy;
    let root = (2.0 - 3.0 * slope * slope).sqrt();
    let unit = [0.5 * (slope + root), -slope, 0.5 * (slope - root)];
    let strain = unit.map(|u| 0.04 * u - 0.01);
    check(strain, law.return_map(&strain.map(f64::exp), 0.0).unwrap().0, "cone");
    // Grains that are apart do not dilate: the opening is all that there was.
    for law in [soil(30.0, 0.0, 12.0), soil(30.0, 0.0, 0.0)] {
        let (sigma, opening) = law.return_map(&[1.02, 1.0, 0.97], 0.1).unwrap();
        assert!(sigma == [1.0; 3] && (opening - 0.1 - (1.02f64 * 0.97).ln()).abs() < 1e-15, "{sigma:?} {opening}");
    }
}

#[test]
fn a_cohesive_body_that_opened_does_not_pull_itself_together() {
    for law in [Law::MohrCoulomb(soil(30.0, 2e3, 0.0)), Law::DruckerPrager(cone(30.0, 2e3, 0.0, Cone::PlaneStrain))] {
        let stretch = |size: f64| [[size, 0.0, 0.0], [0.0, size, 0.0], [0.0, 0.0, size]];
        let pressure = |f: &Matrix<f64, 3>, opening: f64| -law.kirchhoff(f, opening).0[0][0];
        let (mut f, mut opening) = (stretch(1.1), 0.0);
        law.return_map(&mut f, &mut opening);
        assert!(opening > 0.2 && pressure(&f, opening) < -3e3);
        // Let go: the tension goes elastically; then the opening closes without pressure.
        let gained = opening;
        let elastic = det(&f).ln() / 3.0;
        f = f.map(|row| row.map(|x| x * (-elastic).exp()));
        law.return_map(&mut f, &mut opening);
        assert!(opening == gained && pressure(&f, opening).abs() < 1e-6);
        f = f.map(|row| row.map(|x| x * 0.98));
        law.return_map(&mut f, &mut opening);
        assert!((opening - gained - 3.0 * 0.98f64.ln()).abs() < 1e-12 && pressure(&f, opening).abs() < 1e-6);
    }
}
