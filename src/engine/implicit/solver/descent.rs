//! The loop that all methods but ADMM share: direction, line search, test.

use super::line_search::{NOISE, Point, search};
use super::objective::{NodeVectors, Objective};
use super::policy::Progress;
use super::tolerance::{Tolerance, residual};
use super::verbs::{difference, dot, project};
use crate::contract::Solve;

/// How the next direction is found.
pub trait Directions<const D: usize> {
    /// −B ∇E with some B ≈ H⁻¹, and the linear solver's iterations; `residual` is that of the point
    /// in the characteristic norm.
    fn direction(&mut self, objective: &dyn Objective<D>, at: &Point<D>, residual: f64, p: &mut NodeVectors<D>) -> u32;

    /// Learns from a step and the gradient's change over it.
    fn learn(&mut self, step: NodeVectors<D>, change: NodeVectors<D>);

    /// After a direction that did not help: makes the next one more cautious, or returns false if
    /// it cannot. `descending` tells whether it pointed downhill.
    fn retreat(&mut self, descending: bool) -> bool;

    /// Levels, and non-zero blocks of the finest matrix.
    fn size(&self) -> (u32, u64);
}

/// Minimises from the objective's start. Where rounding keeps the residual above the tolerance, the
/// loop ends unconverged.
pub fn descend<const D: usize>(
    objective: &dyn Objective<D>,
    directions: &mut dyn Directions<D>,
    tolerance: Tolerance,
    max_iterations: u32,
) -> (NodeVectors<D>, Solve) {
    let projections: Vec<_> = objective.freedoms().iter().map(|freedom| freedom.projection()).collect();
    let mut point = Point::new(objective, objective.start());
    let mut solve = Solve { residual: residual(objective, &point.gradient), levels: 1, ..Solve::default() };
    let mut progress = Progress::new(NOISE, solve.residual);
    let mut p: NodeVectors<D> = vec![[0.0; D]; point.dv.len()];
    loop {
        solve.converged = tolerance.reached(&point.gradient, solve.residual);
        let ended = solve.iterations >= max_iterations || progress.has_stalled();
        if solve.converged || ended || objective.canceled() {
            break;
        }
        solve.iterations += 1;
        solve.inner_iterations += directions.direction(objective, &point, solve.residual, &mut p);
        project(&projections, &mut p);
        let descending = dot(&p, &point.gradient) < 0.0;
        let (found, halvings) = if descending { search(objective, &point, &p) } else { (None, 0) };
        solve.halvings += halvings;
        let Some(next) = found else {
            if directions.retreat(descending) {
                continue;
            }
            break;
        };
        solve.residual = residual(objective, &next.gradient);
        progress.note(point.energy, next.energy, solve.residual);
        directions.learn(difference(&next.dv, &point.dv), difference(&next.gradient, &point.gradient));
        point = next;
    }
    (solve.levels, solve.nonzeros) = directions.size();
    (point.dv, solve)
}
