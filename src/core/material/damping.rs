//! Damping in proportion to stiffness (Kelvin and Voigt; the β of Rayleigh's damping): beside the law's stress acts a
//! viscous Kirchhoff stress τ_v = t_d (2μ D + λ tr D I), D = sym ∇v, with the moduli at rest and the damping time t_d.
//!
//! For small strains it is t_d times the rate of the elastic stress. So every elastic mode of angular frequency ω
//! decays by itself, with the share ζ = ω t_d/2 of the critical damping. Rigid motions have no D and are not damped,
//! and its power τ_v : D = t_d (2μ D : D + λ (tr D)²) is that of an elastic energy, never below 0.

use super::lame;
use super::parameters::Material;
use crate::maths::linalg::{Matrix, trace};
use crate::maths::real::Real;

/// Viscosities of a damped solid (Pa s).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Damping<T> {
    /// t_d μ.
    pub mu: T,
    /// t_d λ.
    pub lambda: T,
}

impl<T: Real> Damping<T> {
    /// `None` for a material without damping.
    pub fn of(material: &Material) -> Option<Self> {
        let elastic = material.elastic().filter(|elastic| elastic.damping != 0.0)?;
        let (mu, lambda) = lame(&elastic);
        Some(Self { mu: T::from_f64(elastic.damping * mu), lambda: T::from_f64(elastic.damping * lambda) })
    }

    /// τ_v (Pa) at a velocity gradient (1/s).
    #[inline(always)]
    pub fn kirchhoff<const D: usize>(&self, grad_v: &Matrix<T, D>) -> Matrix<T, D> {
        let pressure = self.lambda * trace(grad_v);
        let mut tau = *grad_v;
        for i in 0..D {
            for k in 0..D {
                tau[i][k] = self.mu * (grad_v[i][k] + grad_v[k][i]);
            }
            tau[i][i] += pressure;
        }
        tau
    }
}

#[cfg(test)]
mod tests {
    use rand::{Rng, SeedableRng, rngs::StdRng};

    use super::super::{Law, samples};
    use super::*;
    use crate::maths::linalg::{add_scaled, double_dot, identity};

    fn damped(dimension: usize) -> Vec<(Material, f64)> {
        let with = |material: Material| {
            let mut json = serde_json::to_value(&material).unwrap();
            json.as_object_mut()?.get_mut("damping").map(|t_d| *t_d = 0.02.into())?;
            Some((serde_json::from_value(json).unwrap(), 0.02))
        };
        let all: Vec<_> = samples().into_iter().filter_map(with).collect();
        assert!(all.len() >= 5, "{dimension}D: fixed corotated, neo-Hookean, Hencky, von Mises twice");
        all
    }

    fn random<const D: usize>(rng: &mut StdRng) -> Matrix<f64, D> {
        std::array::from_fn(|_| std::array::from_fn(|_| rng.random_range(-1.0..1.0)))
    }

    /// τ_v is t_d times the rate at which the law's own stress grows from rest.
    fn is_the_rate_of_stress<const D: usize>(rng: &mut StdRng) {
        for (material, t_d) in damped(D) {
            let (law, damping) = (Law::<f64>::new(&material), Damping::of(&material).unwrap());
            for _ in 0..20 {
                let (grad_v, h) = (random::<D>(rng), 1e-5);
                let at = |h: f64| law.kirchhoff(&add_scaled(&identity(), h, &grad_v), 0.0).0;
                let (plus, minus, tau) = (at(h), at(-h), damping.kirchhoff(&grad_v));
                for (i, k) in (0..D).flat_map(|i| (0..D).map(move |k| (i, k))) {
                    let rate = t_d * (plus[i][k] - minus[i][k]) / (2.0 * h);
                    let error = (rate - tau[i][k]).abs() / (t_d * law.stiffness_at_rest());
                    assert!(error < 1e-8, "{material:?}: {} for {rate}", tau[i][k]);
                }
            }
        }
    }

    #[test]
    fn the_viscous_stress_is_the_rate_of_the_elastic_one() {
        let seed = 61;
        println!("seed {seed}");
        let rng = &mut StdRng::seed_from_u64(seed);
        is_the_rate_of_stress::<2>(rng);
        is_the_rate_of_stress::<3>(rng);
    }

    #[test]
    fn it_takes_energy_from_every_strain_rate_and_none_from_spin() {
        let seed = 62;
        println!("seed {seed}");
        let rng = &mut StdRng::seed_from_u64(seed);
        // Down to Poisson's ratios near -1, where λ is far below 0.
        for poissons_ratio in [-0.99, -0.5, 0.0, 0.3, 0.4999] {
            let json = serde_json::json!({ "model": "neo-hookean", "density": 1, "youngs_modulus": 1,
                "poissons_ratio": poissons_ratio, "damping": 1 });
            let damping = Damping::<f64>::of(&serde_json::from_value(json).unwrap()).unwrap();
            for _ in 0..200 {
                let grad_v = random::<3>(rng);
                let power = double_dot(&damping.kirchhoff(&grad_v), &grad_v);
                assert!(power > 0.0, "{power} at {poissons_ratio}");
                let mut spin = grad_v;
                for (i, k) in (0..3).flat_map(|i| (0..3).map(move |k| (i, k))) {
                    spin[i][k] = grad_v[i][k] - grad_v[k][i];
                }
                assert!(damping.kirchhoff(&spin).iter().flatten().all(|&t| t == 0.0));
            }
        }
    }

    #[test]
    fn materials_without_damping_have_none() {
        assert!(samples().iter().filter(|material| material.damping() == 0.0).count() > 10);
        for material in samples().into_iter().chain(damped(3).into_iter().map(|(material, _)| material)) {
            assert_eq!(Damping::<f64>::of(&material).is_some(), material.damping() > 0.0);
        }
    }
}
