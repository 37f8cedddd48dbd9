//! Newton's method for one particle that flows, with the stress and the tangent of `flowing.rs`: is
//! the tangent good enough, and is it definite? The particle is stretched or sheared step by step;
//! the rest of its velocity gradient is free, held by little but its own stress.

use nalgebra::{DMatrix, DVector};

use super::derivative_tests::{MODULUS, laws};
use super::derivatives::Elastic;
use super::flowing_tests::name;
use super::*;
use crate::maths::linalg::{add_scaled, identity, mul, mul_transpose};

/// Stiffness (Pa) of inertia, in steps of a hundred and of ten times that in which a wave crosses a
/// cell.
const INERTIA: [f64; 2] = [1e-4 * MODULUS, 1e-2 * MODULUS];
/// Largest change of the velocity gradient times dt in one iteration. A state of constant stress
/// has no stiffness but inertia's, and a step would lead far out of it.
const LARGEST_CHANGE: f64 = 0.3;
/// Residual (Pa) at the end.
const TOLERANCE: f64 = 1e-9 * MODULUS;

/// A step of one particle. Unknown is dt times the velocity gradient, without its prescribed
/// columns.
struct Step<'a, const D: usize> {
    law: &'a Law<f64>,
    f: Matrix<f64, D>,
    plastic: f64,
    prescribed: [bool; D],
    inertia: f64,
    /// Kirchhoff stress (Pa) from outside, on the free columns.
    load: Matrix<f64, D>,
}

impl<const D: usize> Step<'_, D> {
    fn trial(&self, l: &Matrix<f64, D>) -> Matrix<f64, D> {
        mul(&add_scaled(&identity(), 1.0, l), &self.f)
    }

    /// Force (Pa) on the free entries, 0 on the others.
    fn residual(&self, l: &Matrix<f64, D>) -> Option<DVector<f64>> {
        let pk1 = self.law.flowing_pk1(&self.trial(l), self.plastic)?;
        let force = add_scaled(&mul_transpose(&pk1, &self.f), self.inertia, l);
        let force = add_scaled(&force, -1.0, &self.load);
        Some(DVector::from_fn(D * D, |n, _| if self.prescribed[n % D] { 0.0 } else { force[n / D][n % D] }))
    }

    fn matrix(&self, l: &Matrix<f64, D>) -> DMatrix<f64> {
        let k = self.law.flowing_derivative(&self.trial(l), self.plastic).spatial(&self.f);
        DMatrix::from_fn(D * D, D * D, |m, n| {
            let identity = if m == n { 1.0 } else { 0.0 };
            let fixed = self.prescribed[m % D] || self.prescribed[n % D];
            if fixed { identity } else { k[m / D][m % D][n / D][n % D] + self.inertia * identity }
        })
    }

    /// Newton's iterations until the residual is below the tolerance. The line search needs no
    /// energy: it accepts where the residual along the line has not grown.
    fn solve(&self, l: &mut Matrix<f64, D>) -> usize {
        let mut residual = self.residual(l).unwrap();
        for iteration in 0..100 {
            if residual.norm() < TOLERANCE {
                return iteration;
            }
            let p = self.matrix(l).cholesky().expect("a definite tangent").solve(&-&residual);
            let direction = std::array::from_fn(|a| std::array::from_fn(|b| p[a * D + b]));
            let mut t = (LARGEST_CHANGE / p.amax()).min(1.0);
            (*l, residual) = loop {
                let next = add_scaled(l, t, &direction);
                match self.residual(&next) {
                    Some(found) if p.dot(&found) <= 0.9 * p.dot(&residual).abs() => break (next, found),
                    _ => t *= 0.5,
                }
                assert!(t > 1e-6, "{:?}: no step is accepted from {l:?}", self.law);
            };
        }
        panic!("{:?}: no convergence from {:?}, {}", self.law, self.f, self.plastic)
    }
}

/// The most iterations of a step on a path of 10 steps of dt ∂v_a/∂x_b = `rate`, (a, b) = `entry`.
fn most_iterations<const D: usize>(law: &Law<f64>, plastic: f64, entry: (usize, usize), rate: f64) -> usize {
    let (mut f, mut plastic) = (identity::<f64, D>(), plastic);
    let path = (0..10).map(|_| {
        // Column a too, so that the body cannot turn out of the shear.
        let prescribed = std::array::from_fn(|i| i == entry.0 || i == entry.1);
        let step = Step { law, f, plastic, prescribed, inertia: INERTIA[0], load: [[0.0; D]; D] };
        let mut l = [[0.0; D]; D];
        l[entry.0][entry.1] = rate;
        let iterations = step.solve(&mut l);
        f = step.trial(&l);
        law.return_map(&mut f, &mut plastic);
        iterations
    });
    path.max().unwrap()
}

#[test]
fn newton_converges_in_few_iterations_on_paths_of_flow() {
    for (law, plastic) in laws() {
        let mut most = Vec::new();
        for (entry, rate) in [((0, 0), 0.01), ((0, 0), -0.01), ((0, 0), 0.1), ((0, 0), -0.1), ((0, 1), 0.1)] {
            most.push(most_iterations::<3>(&law, plastic, entry, rate));
            most.push(most_iterations::<2>(&law, plastic, entry, rate));
        }
        // Flow that is not associated converges linearly: see "Flow inside the step" in NUMERICS.md.
        let associated = law.flowing_energy::<3>(&identity(), plastic).is_some();
        let bound = match law {
            _ if associated || matches!(law, Law::VonMises(_)) => 10,
            Law::Snow(_) => 12,
            _ => 35,
        };
        println!("{}, 3D and 2D by path: {most:?}", name(&law));
        assert!(most.iter().all(|&n| n <= bound), "{law:?}: {most:?} iterations");
    }
}

/// The iterations of a step from rest under a pressure (Pa) and a shear stress that only inertia
/// holds once the body flows.
fn driven<const D: usize>(law: &Law<f64>, plastic: f64, shear: f64) -> usize {
    let mut load = scaled_identity(-0.02 * MODULUS);
    load[0][0] += shear;
    load[1][1] -= shear;
    let step = Step { law, f: identity::<f64, D>(), plastic, prescribed: [false; D], inertia: INERTIA[1], load };
    step.solve(&mut [[0.0; D]; D])
}

#[test]
fn newton_converges_in_few_iterations_where_only_inertia_holds_the_flow() {
    for (law, plastic) in laws() {
        // The tangents of fixed corotated laws do not serve larger loads: NUMERICS.md says which.
        let corotated = matches!(law.elastic(plastic), Elastic::FixedCorotated(_)) && law.is_plastic();
        let shear = if corotated { 0.012 } else { 0.015 } * MODULUS;
        let most = [driven::<3>(&law, plastic, shear), driven::<2>(&law, plastic, shear)];
        println!("{}, 3D and 2D driven: {most:?}", name(&law));
        assert!(most.iter().all(|&n| n <= 35), "{law:?}: {most:?} iterations");
    }
}
