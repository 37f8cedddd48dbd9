//! Deformations as variables of their own, for alternating directions (Fang et al. 2019, "Silly
//! Rubber").

use rayon::prelude::*;

use super::Potential;
use crate::implicit::physics::assembly::{self, AtParticles};
use crate::implicit::solver::objective::{NodeVectors, Objective, Splitting};
use crate::implicit::solver::sparse::Bsr;
use crate::implicit::solver::verbs::inverse;
use gridfall_core::material::{Law, Tensor4};
use gridfall_core::maths::linalg::{Matrix, Vector, apply, det, dot, mul_transpose};
use gridfall_core::maths::svd::svd;

/// Newton steps of a particle's own minimisation, and the part of its stiffness below which the
/// gradient counts as zero.
const STEPS: usize = 30;
const EXACT: f64 = 1e-12;

/// The potential for alternating directions.
pub struct Split<'a, const D: usize>(pub &'a Potential<'a, D>);

impl<const D: usize> Split<'_, D> {
    fn law(&self, p: usize) -> &Law<f64> {
        &self.0.bodies[self.0.step.state.body[p] as usize].law
    }

    /// w (J).
    fn weight(&self, p: usize) -> f64 {
        self.0.bodies[self.0.step.state.body[p] as usize].volume0 * self.law(p).stiffness_at_rest()
    }
}

impl<const D: usize> Splitting<D> for Split<'_, D> {
    fn deformations(&self, dv: &NodeVectors<D>) -> Vec<Matrix<f64, D>> {
        let velocities = self.0.step.velocities(dv);
        let of_group = |group: usize| {
            let mut found = Vec::new();
            self.0.with_values(group, &velocities, |p, local| found.push(self.0.deformed(p, local)));
            found
        };
        let groups = (0..self.0.step.topology.groups()).into_par_iter().with_min_len(8);
        groups.map(of_group).collect::<Vec<_>>().into_iter().flatten().collect()
    }

    fn proximal(&self, targets: &[Matrix<f64, D>]) -> Vec<Matrix<f64, D>> {
        let of_particle = |(p, target): (usize, &Matrix<f64, D>)| {
            let plastic = self.0.step.state.plastic[p];
            proximal(self.law(p), plastic, target)
        };
        targets.par_iter().enumerate().with_min_len(64).map(of_particle).collect()
    }

    fn gradient(&self, dv: &NodeVectors<D>, targets: &[Matrix<f64, D>]) -> NodeVectors<D> {
        let dt = self.0.step.dt;
        let stress = |(p, (f, target)): (usize, (&Matrix<f64, D>, &Matrix<f64, D>))| {
            let factor = dt * self.weight(p);
            let pull = std::array::from_fn(|a| std::array::from_fn(|b| factor * (f[a][b] - target[a][b])));
            mul_transpose(&pull, &self.0.step.state.f[p])
        };
        let stresses: Vec<_> = self.deformations(dv).iter().zip(targets).enumerate().map(stress).collect();
        let velocities = self.0.step.velocities(dv);
        let mut forces = self.0.forces(&velocities, &stresses, &[]);
        self.0.complete(&velocities, &mut forces);
        forces
    }

    fn metric(&self) -> Bsr<f64, D> {
        let potential = self.0;
        let tensor = |p: usize| -> Tensor4<f64, D> {
            let factor = potential.step.dt.powi(2) * self.weight(p) * potential.share();
            let b = mul_transpose(&potential.step.state.f[p], &potential.step.state.f[p]);
            std::array::from_fn(|i| {
                std::array::from_fn(|j| {
                    std::array::from_fn(|k| std::array::from_fn(|l| if i == k { factor * b[j][l] } else { 0.0 }))
                })
            })
        };
        let tensors: Vec<_> = (0..potential.step.state.f.len()).into_par_iter().map(tensor).collect();
        let freedoms = &potential.step.boundary.freedoms;
        let (topology, none) = (&potential.step.topology, AtParticles::default());
        let mut matrix = assembly::assemble(topology, &tensors, &none, &potential.masses, freedoms);
        for (node, block) in potential.resistances(&potential.start()) {
            matrix.add_to_diagonal(node, &potential.projected(node, &block));
        }
        matrix
    }
}

/// argmin of ψ(Z) + ½ k |Z − A|², k the stiffness at rest. Z has A's singular vectors, so that only
/// its singular values are unknown.
fn proximal<const D: usize>(law: &Law<f64>, plastic: f64, target: &Matrix<f64, D>) -> Matrix<f64, D> {
    let k = law.stiffness_at_rest();
    let at = svd(target);
    let value = |z: &Vector<f64, D>| {
        let distance: Vector<f64, D> = std::array::from_fn(|a| z[a] - at.sigma[a]);
        law.derivatives(z, plastic).energy + 0.5 * k * dot(&distance, &distance)
    };
    // Where a law forbids the target, the search starts at rest.
    let mut z = if value(&at.sigma).is_finite() { at.sigma } else { [1.0; D] };
    for _ in 0..STEPS {
        let derivatives = law.derivatives(&z, plastic);
        let gradient: Vector<f64, D> = std::array::from_fn(|a| derivatives.gradient[a] + k * (z[a] - at.sigma[a]));
        if dot(&gradient, &gradient).sqrt() <= EXACT * k {
            break;
        }
        let mut hessian = derivatives.hessian;
        (0..D).for_each(|a| hessian[a][a] += k);
        let newton = if det(&hessian) > 0.0 { apply(&inverse(&hessian), &gradient) } else { gradient.map(|g| g / k) };
        let downhill = if dot(&newton, &gradient) > 0.0 { newton } else { gradient.map(|g| g / k) };
        let here = value(&z);
        let trial =
            |halvings: i32| -> Vector<f64, D> { std::array::from_fn(|a| z[a] - 0.5f64.powi(halvings) * downhill[a]) };
        match (0..STEPS as i32).map(trial).find(|trial| value(trial) <= here) {
            Some(next) if next != z => z = next,
            _ => break,
        }
    }
    let scaled: Matrix<f64, D> = std::array::from_fn(|i| std::array::from_fn(|j| at.u[i][j] * z[j]));
    mul_transpose(&scaled, &at.v)
}
