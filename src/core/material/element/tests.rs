//! Element tests against closed forms.

use super::*;
use crate::material::parameters::{Cone, DruckerPrager, Elastic, Elasticity, Fluid, MohrCoulomb, Nacc, Snow, VonMises};
use crate::material::{lame, samples};

const E: f64 = 1e6;
const NU: f64 = 0.3;

fn elastic() -> Elastic {
    Elastic { density: 1000.0, youngs_modulus: E, poissons_ratio: NU, damping: 0.0 }
}

fn metal(yield_stress: f64) -> Material {
    let elasticity = Elasticity::Hencky;
    let (density, youngs_modulus, poissons_ratio) = (1000.0, E, NU);
    Material::VonMises(VonMises { density, youngs_modulus, poissons_ratio, yield_stress, elasticity, damping: 0.0 })
}

fn soil(friction_angle_degrees: f64, cohesion: f64, dilatancy_angle_degrees: f64) -> Material {
    Material::MohrCoulomb(MohrCoulomb {
        density: 1000.0,
        youngs_modulus: E,
        poissons_ratio: NU,
        friction_angle_degrees,
        cohesion,
        dilatancy_angle_degrees,
    })
}

fn programme(test: Test, strain: f64, confining_pressure: f64) -> Programme {
    Programme { test, strain, confining_pressure, steps: 100, rate: 0.0 }
}

fn curve(material: &Material, test: Test, strain: f64, confining_pressure: f64) -> Vec<Point> {
    run(material, &programme(test, strain, confining_pressure))
        .unwrap_or_else(|stuck| panic!("{material:?}: {stuck:?}"))
}

fn last(material: &Material, test: Test, strain: f64, confining_pressure: f64) -> Point {
    *curve(material, test, strain, confining_pressure).last().unwrap()
}

/// Asserts that two numbers agree to a share of the second.
#[track_caller]
fn close(value: f64, expected: f64, share: f64) {
    assert!((value - expected).abs() <= share * expected.abs(), "{value} for {expected}");
}

#[test]
fn slopes_at_small_strain_are_the_moduli() {
    let (mu, lambda) = lame(&elastic());
    for material in samples().into_iter().filter(|m| m.is_elastic()) {
        let moduli = lame(&material.elastic().unwrap());
        let young = material.elastic().unwrap().youngs_modulus;
        let nu = material.elastic().unwrap().poissons_ratio;
        let h = 1e-6;
        let uniaxial = last(&material, Test::Uniaxial, h, 0.0);
        close(uniaxial.axial_stress / h, young, 1e-4);
        close(uniaxial.volumetric_strain / h, 1.0 - 2.0 * nu, 1e-4);
        let pressed = last(&material, Test::Oedometer, h, 0.0);
        close(pressed.axial_stress / h, moduli.1 + 2.0 * moduli.0, 1e-4);
        close(pressed.lateral_stress / pressed.axial_stress, nu / (1.0 - nu), 1e-4);
        close(last(&material, Test::Shear, h, 0.0).shear_stress / h, moduli.0, 1e-4);
        let confined = last(&material, Test::Triaxial, h, 1e-4 * young);
        close(confined.q / h, young, 2e-3);
        close(confined.lateral_stress, 1e-4 * young, 1e-5);
    }
    close(mu * (3.0 * lambda + 2.0 * mu) / (lambda + mu), E, 1e-12);
}

#[test]
fn a_neo_hookean_bar_is_stretched_as_its_closed_form_says() {
    // λ ln J + μ (b² − 1) = 0 at the sides, σ = (μ (a² − 1) + λ ln J)/J along the axis.
    let (mu, lambda) = lame(&elastic());
    for point in curve(&Material::NeoHookean(elastic()), Test::Uniaxial, 2.0, 0.0).iter().skip(1) {
        let a = 1.0 + point.strain;
        let (mut low, mut high) = (0.1f64, 1.0f64);
        for _ in 0..200 {
            let b = 0.5 * (low + high);
            if mu * (b * b - 1.0) + lambda * (a * b * b).ln() > 0.0 { high = b } else { low = b }
        }
        let j = a * low * low;
        close(point.volume_ratio, j, 1e-8);
        close(point.axial_stress, (mu * (a * a - 1.0) + lambda * j.ln()) / j, 1e-7);
        close(point.nominal_stress, point.axial_stress * low * low, 1e-8);
        assert!(point.lateral_stress.abs() < 1e-9 * E);
    }
    // Nearly incompressible: σ = μ (a² − 1/a).
    let stiff = Elastic { poissons_ratio: 0.49999, ..elastic() };
    let (mu, _) = lame(&stiff);
    close(last(&Material::NeoHookean(stiff), Test::Uniaxial, 1.0, 0.0).axial_stress, mu * 3.5, 1e-3);
}

#[test]
fn metal_yields_at_its_yield_stress() {
    let y = 2e3;
    let point = last(&metal(y), Test::Uniaxial, 0.05, 0.0);
    // The Kirchhoff stress is bounded; J differs from 1 by what is elastic.
    close(point.axial_stress * point.volume_ratio, y, 1e-6);
    close(point.q * point.volume_ratio, y, 1e-6);
    close(point.plastic_strain, 1.05f64.ln() - y / E, 1e-3);
    let sheared = last(&metal(y), Test::Shear, 0.02, 0.0);
    close(sheared.q, y, 1e-6);
    close(sheared.shear_stress, y / 3f64.sqrt(), 1e-3);
    // Before, it is elastic.
    let points = curve(&metal(y), Test::Uniaxial, 4e-3, 0.0);
    close(points[25].axial_stress, E * 1e-3, 2e-3);
    assert_eq!(points[49].plastic_strain, 0.0);
    assert!(points[52].plastic_strain > 0.0);
    // Pressure changes nothing.
    close(last(&metal(y), Test::Triaxial, 0.05, 5e3).q, y, 0.02);
}

#[test]
fn soil_fails_at_its_angle_and_dilates_by_its_own() {
    for (phi, cohesion, psi) in [(30.0, 0.0, 0.0), (35.0, 0.0, 10.0), (20.0, 500.0, 0.0), (0.0, 800.0, 0.0)] {
        let pressure = 2e3;
        let point = last(&soil(phi, cohesion, psi), Test::Triaxial, 0.1, pressure);
        let sin = f64::to_radians(phi).sin();
        let cos = f64::to_radians(phi).cos();
        // τ_1 − τ_3 = 2 c cos φ + (τ_1 + τ_3) sin φ in Kirchhoff stresses.
        let c = cohesion / point.volume_ratio;
        let expected = (2.0 * pressure * sin + 2.0 * c * cos) / (1.0 - sin);
        close(point.q, expected, 1e-4);
        // Between two points of flow dε_v/dε_1 = −2 sin ψ/(1 − sin ψ), in logarithmic strains.
        let points = curve(&soil(phi, cohesion, psi), Test::Triaxial, 0.1, pressure);
        let (a, b) = (points[80], points[100]);
        let volume = (b.volume_ratio / a.volume_ratio).ln();
        let axial = ((1.0 - b.strain) / (1.0 - a.strain)).ln();
        let sin_psi = f64::to_radians(psi).sin();
        let expected = -2.0 * sin_psi / (1.0 - sin_psi);
        assert!((volume / axial - expected).abs() < 0.01, "{} for {expected}", volume / axial);
    }
}

#[test]
fn a_plane_that_shears_at_constant_volume_carries_the_sine_of_its_angle() {
    // tan β = sin φ cos ψ/(1 − sin φ sin ψ) (Davis 1968).
    for (phi, psi) in [(30.0f64, 0.0f64), (35.0, 10.0), (30.0, 30.0)] {
        let point = last(&soil(phi, 0.0, psi), Test::Shear, 0.1, 1e3);
        let (phi, psi) = (phi.to_radians(), psi.to_radians());
        close(-point.axial_stress, 1e3, 1e-6);
        close(point.shear_stress / 1e3, phi.sin() * psi.cos() / (1.0 - phi.sin() * psi.sin()), 0.01);
    }
}

#[test]
fn a_cone_is_matched_in_triaxial_compression() {
    let cone = |cone| {
        Material::DruckerPrager(DruckerPrager {
            density: 1000.0,
            youngs_modulus: E,
            poissons_ratio: NU,
            friction_angle_degrees: 30.0,
            cohesion: 0.0,
            dilatancy_angle_degrees: 0.0,
            cone,
        })
    };
    // 3 : 1 at 30°.
    close(last(&cone(Cone::TriaxialCompression), Test::Triaxial, 0.1, 1e3).axial_stress, 3e3, 1e-4);
    // α = g sin φ with g = √2/3: q = √(3/2) α 3p, p = (σ_1 + 2 σ_3)/3.
    let alpha = 2f64.sqrt() / 3.0 * 0.5;
    let k = 1.5f64.sqrt() * alpha;
    close(last(&cone(Cone::PlaneStrain), Test::Triaxial, 0.1, 1e3).q, 3e3 * k / (1.0 - k), 1e-4);
}

#[test]
fn an_oedometer_of_sand_has_the_pressures_of_its_angle() {
    // Elastic K0 = ν/(1 − ν) = 0.43 is above (1 − sin φ)/(1 + sin φ) at 40° … and below it at 20°.
    let ratio = |phi: f64| {
        let point = last(&soil(phi, 0.0, 0.0), Test::Oedometer, 0.02, 0.0);
        point.lateral_stress / point.axial_stress
    };
    close(ratio(20.0), (1.0 - 20f64.to_radians().sin()) / (1.0 + 20f64.to_radians().sin()), 1e-6);
    assert!((ratio(40.0) - NU / (1.0 - NU)).abs() < 0.02, "{}", ratio(40.0));
}

#[test]
fn clay_follows_its_ellipse_and_hardens() {
    let clay =
        Nacc { density: 1000.0, youngs_modulus: E, poissons_ratio: NU, m: 1.2, beta: 0.0, xi: 5.0, alpha0: -0.01 };
    let (mu, lambda) = lame(&Material::Nacc(clay.clone()).elastic().unwrap());
    let kappa = lambda + 2.0 * mu / 3.0;
    for pressure in [5e3, 2e4] {
        let points = curve(&Material::Nacc(clay.clone()), Test::Triaxial, 0.3, pressure);
        for point in points.iter().skip(50) {
            // The law's p and q are of the Kirchhoff stress.
            let (p, q) = (point.p * point.volume_ratio, point.q * point.volume_ratio);
            let p0 = kappa * (1e-5 + (clay.xi * (-point.plastic_state).max(0.0)).sinh());
            let y = q * q + clay.m * clay.m * p * (p - p0);
            // The state hardens after the return, so it lies a little inside.
            assert!(y.abs() < 0.05 * clay.m * clay.m * p0 * p0, "{y:e} at {point:?}");
        }
    }
}

#[test]
fn liquids_have_pressure_and_viscosity() {
    let fluid = Fluid { density: 1000.0, bulk_modulus: 1e6, gamma: 7.15, viscosity: 0.5 };
    let material = Material::WeaklyCompressibleFluid(fluid);
    let point = last(&material, Test::Oedometer, 0.01, 0.0);
    close(point.p, 1e6 / 7.15 * (0.99f64.powf(-7.15) - 1.0), 1e-9);
    assert!(point.q < 1e-9 * point.p);
    let slow = last(&material, Test::Shear, 0.5, 0.0);
    assert!(slow.shear_stress.abs() < 1e-9);
    let stirred = Programme { rate: 3.0, ..programme(Test::Shear, 0.5, 0.0) };
    close(run(&material, &stirred).unwrap().last().unwrap().shear_stress, 1.5, 1e-9);
    let drop = last(&material, Test::Uniaxial, 0.5, 0.0);
    close(drop.volume_ratio, 1.0, 1e-6);
}

#[test]
fn snow_hardens_under_pressure_and_breaks_under_tension() {
    let (density, youngs_modulus, poissons_ratio) = (400.0, 1.4e5, 0.2);
    let (critical_compression, critical_stretch, hardening) = (0.025, 0.0075, 10.0);
    let snow = Snow { density, youngs_modulus, poissons_ratio, critical_compression, critical_stretch, hardening };
    let points = curve(&Material::Snow(snow), Test::Oedometer, 0.2, 0.0);
    let last = points.last().unwrap();
    close(last.plastic_state, 0.8 / 0.975, 1e-9);
    let slope = |a: usize| (points[a + 1].axial_stress - points[a].axial_stress) / 0.002;
    assert!(slope(95) > 2.0 * slope(20), "{} after {}", slope(95), slope(20));
}

#[test]
fn every_law_does_every_test() {
    for material in samples() {
        for test in Test::ALL {
            let usual = Programme::usual(&material, test);
            let points = run(&material, &usual).unwrap_or_else(|stuck| panic!("{material:?}, {test:?}: {stuck:?}"));
            assert_eq!(points.len(), usual.steps + 1);
            let end = points.last().unwrap();
            close(end.strain, usual.strain, 1e-12);
            let held = if test == Test::Shear { -end.axial_stress } else { end.lateral_stress };
            if usual.confining_pressure > 0.0 {
                close(held, usual.confining_pressure, 1e-4);
            }
        }
    }
}
