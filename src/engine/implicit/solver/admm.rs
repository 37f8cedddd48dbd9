//! Alternating directions (Fang et al. 2019, "Silly Rubber", for elastic materials): particles and
//! nodes take turns, coupled by multipliers.
//!
//! A first-order method: iterations are cheap, but a tight tolerance takes many (HOT §7.3).

use super::krylov::{BlockJacobi, conjugate_gradients};
use super::objective::{NodeVectors, Objective};
use super::policy::STALLED;
use super::tolerance::{Tolerance, residual};
use super::verbs::{axpy, norm};
use crate::contract::Solve;
use gridfall_core::maths::linalg::{Matrix, add_scaled};

/// Factor by which the nodes' linear solve reduces sqrt(rᵀP r).
const REDUCTION: f64 = 0.1;
/// Changes of Δv below this fraction of ‖Δv‖ are rounding.
const NOISE: f64 = 4.0 * f64::EPSILON;

/// Minimises E with multipliers U: Δv to F(Δv) ≈ Z − U, then Z = argmin V0 ψ(Z) + ½ w |Z − F − U|²,
/// U += F − Z. One iteration solves the nodes' linear system once, from where it stands.
pub fn alternate<const D: usize>(
    objective: &dyn Objective<D>,
    tolerance: Tolerance,
    max_iterations: u32,
) -> (NodeVectors<D>, Solve) {
    let splitting = objective.splitting();
    let matrix = splitting.metric();
    let mut jacobi = BlockJacobi::new(&matrix.diagonal());
    let mut dv = objective.start();
    let mut gradient = dv.clone();
    let mut step = dv.clone();
    let mut z = splitting.deformations(&dv);
    let mut u: Vec<Matrix<f64, D>> = vec![[[0.0; D]; D]; z.len()];
    let combine = |a: &[Matrix<f64, D>], s: f64, b: &[Matrix<f64, D>]| -> Vec<Matrix<f64, D>> {
        a.iter().zip(b).map(|(a, b)| add_scaled(a, s, b)).collect()
    };
    let mut solve = Solve { levels: 1, nonzeros: matrix.blocks.len() as u64, ..Solve::default() };
    let mut still = 0;
    loop {
        objective.energy_and_gradient(&dv, &mut gradient);
        solve.residual = residual(objective, &gradient);
        solve.converged = tolerance.reached(&gradient, solve.residual);
        if solve.converged || solve.iterations >= max_iterations || still >= STALLED || objective.canceled() {
            return (dv, solve);
        }
        solve.iterations += 1;
        let f = splitting.deformations(&dv);
        z = splitting.proximal(&combine(&f, 1.0, &u));
        u = combine(&combine(&u, 1.0, &f), -1.0, &z);
        let rest = splitting.gradient(&dv, &combine(&z, -1.0, &u));
        let goal = |start: f64| REDUCTION * REDUCTION * start;
        solve.inner_iterations += conjugate_gradients(&matrix, &mut jacobi, &rest, &mut step, goal);
        axpy(-1.0, &step, &mut dv);
        still = if norm(&step) <= NOISE * norm(&dv) { still + 1 } else { 0 };
    }
}
