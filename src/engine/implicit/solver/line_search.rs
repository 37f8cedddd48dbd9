//! Backtracking that still works where energies differ by rounding only.

use super::objective::{NodeVectors, Objective};
use super::verbs::{axpy, dot};

/// Halvings before the search gives up.
const MAX_HALVINGS: u32 = 30;
/// Energies that differ by no more than this fraction count as equal: rounding in sums over
/// thousands of particles amounts to more than a few units.
pub const NOISE: f64 = 16.0 * f64::EPSILON / 2.0;
/// Factor to which the slope must have fallen where energies are equal.
const SLOPE: f64 = 0.8;

/// Where a solver stands.
#[derive(Clone)]
pub struct Point<const D: usize> {
    pub dv: NodeVectors<D>,
    pub energy: f64,
    pub gradient: NodeVectors<D>,
}

impl<const D: usize> Point<D> {
    pub fn new(objective: &dyn Objective<D>, dv: NodeVectors<D>) -> Self {
        let mut gradient = vec![[0.0; D]; dv.len()];
        let energy = objective.energy_and_gradient(&dv, &mut gradient);
        Self { dv, energy, gradient }
    }
}

/// Halves α from 1 until E does not grow, or, where its change is within rounding, until the slope
/// along p has fallen (Hager & Zhang 2005 use the slope for the same reason). Returns the new
/// point, if any, and the halvings.
pub fn search<const D: usize>(
    objective: &dyn Objective<D>,
    from: &Point<D>,
    direction: &NodeVectors<D>,
) -> (Option<Point<D>>, u32) {
    let slope = dot(direction, &from.gradient);
    let mut alpha = 1.0;
    for halvings in 0..=MAX_HALVINGS {
        let mut dv = from.dv.clone();
        axpy(alpha, direction, &mut dv);
        let trial = Point::new(objective, dv);
        let change = trial.energy - from.energy;
        let flat = change <= NOISE * from.energy.abs() && dot(direction, &trial.gradient).abs() <= SLOPE * slope.abs();
        if change <= 0.0 || flat {
            return (Some(trial), halvings);
        }
        alpha *= 0.5;
    }
    (None, MAX_HALVINGS)
}
