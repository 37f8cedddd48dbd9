//! Newton's method for bodies that turn: a new Hessian in every iteration, of particles that are
//! turned to where they are and stretched as at the step's start ([`Objective::tangent`]), solved by
//! conjugate gradients around a V-cycle until the error of Δv is small (docs/NUMERICS.md, "Implicit
//! steps in which stiff bodies turn"). What has no energy is renewed with every iteration.

use super::condensed::{Condensed, Cycle};
use super::krylov::{conjugate_gradients_until, precondition};
use super::objective::{NodeVectors, Objective, Renewed};
use super::sparse::Bsr;
use super::tolerance::residual as characteristic;
use super::vcycle::Plan;
use super::verbs::{axpy, dot, mass_norm, project};
use crate::contract::Solve;
use gridfall_core::sim::settings::{Implicit, Norm};

/// Iterations after which a step is given up.
pub const MAX_ITERATIONS: u32 = 40;
/// Halvings before a direction is given up.
pub const MAX_HALVINGS: u32 = 12;
/// Part of the slope at a direction's start to which it may have risen at its end, uphill.
pub const SLOPE: f64 = 0.9;
/// By how much a linear solve reduces its own error at least.
pub const REDUCTION: f64 = 0.1;
/// Error that the first iteration aims at, and the factor by which it falls with every further one:
/// what a Hessian taken from the start has left when its equations are solved exactly.
const COARSEST: f64 = 1e-2;
const GAIN: f64 = 1e-2;
/// Part of the error aimed at that a linear solve may leave.
const LEFT: f64 = 0.3;
/// Error aimed at where the tolerance is of another norm.
const FINEST: f64 = 1e-9;
/// Iterations without a smaller error after which rounding is all that is left, if the error is at
/// most what rounding leaves.
const STALLED: u32 = 3;
const ROUNDING: f64 = 1e-7;

/// Part of the nodes' velocities below which a change of them is rounding.
pub const UNFELT: f64 = 1e-6;

/// When a step has converged, and how well an iteration's linear equations are solved.
pub struct Aim {
    norm: Norm,
    tolerance: f64,
    /// Error that rounding may leave, and the least that an iteration aims at in another norm.
    rounding: f64,
    finest: f64,
    least: f64,
    stalled: u32,
}

impl Aim {
    /// In f64, or in f32 where rounding leaves `rounding`.
    pub fn new(settings: &Implicit, rounding: Option<f64>) -> Self {
        Self {
            norm: settings.norm(),
            tolerance: settings.tolerance(),
            rounding: rounding.unwrap_or(ROUNDING),
            finest: rounding.unwrap_or(FINEST),
            least: f64::INFINITY,
            stalled: 0,
        }
    }

    /// Notes where an iteration stands: the residual in the tolerance's norm, of the relative error
    /// of Δv or else what `characteristic` gives, and whether it is small enough.
    pub fn note(&mut self, error: f64, sharpness: f64, characteristic: impl FnOnce() -> f64) -> (f64, bool) {
        let residual = if self.norm == Norm::Error { error / sharpness } else { characteristic() };
        self.stalled = if error < self.least { 0 } else { self.stalled + 1 };
        self.least = self.least.min(error);
        (residual, residual <= self.tolerance || (self.stalled >= STALLED && self.least <= self.rounding))
    }

    /// Part of ‖Δv‖ that the linear solve of an iteration, counted from 0, may leave as its error.
    pub fn left(&self, iteration: u32, sharpness: f64) -> f64 {
        let wanted = if self.norm == Norm::Error { self.tolerance * sharpness } else { self.finest };
        LEFT * wanted.max(COARSEST * GAIN.powi(iteration as i32))
    }
}

/// Where the minimisation stands.
struct State<const D: usize> {
    dv: NodeVectors<D>,
    /// −∇E (kg m/s), projected.
    r: NodeVectors<D>,
    allowed: bool,
}

impl<const D: usize> State<D> {
    fn new(objective: &dyn Objective<D>, dv: NodeVectors<D>) -> Self {
        let mut r: NodeVectors<D> = vec![[0.0; D]; dv.len()];
        let energy = objective.energy_and_gradient(&dv, &mut r);
        r.iter_mut().for_each(|r| *r = r.map(|x| -x));
        Self { dv, r, allowed: energy.is_finite() }
    }
}

/// Solves a step's equations from the objective's start.
pub fn solve<const D: usize>(
    objective: &mut dyn Objective<D>,
    settings: &Implicit,
    plan: &Plan,
) -> (NodeVectors<D>, Solve) {
    let mut aim = Aim::new(settings, None);
    let projections: Vec<_> = objective.freedoms().iter().map(|freedom| freedom.projection()).collect();
    let mut at = State::new(objective, objective.start());
    let mut model = Model::new(objective, &at.dv, true, plan);
    let mut is_new = true;
    let mut solve = Solve::default();
    let mut before = f64::INFINITY;
    loop {
        // The model of the iteration before tells whether its step was the last one, if it still is one.
        let error = model.error(objective, &at);
        let sharpness = objective.sharpness();
        (solve.residual, solve.converged) = aim.note(error, sharpness, || characteristic(objective, &at.r));
        let ended = solve.iterations >= MAX_ITERATIONS.min(settings.max_iterations);
        if solve.converged || ended || objective.canceled() {
            break;
        }
        if !is_new {
            model = Model::new(objective, &at.dv, error > before, plan);
        }
        before = error;
        let left = aim.left(solve.iterations, sharpness);
        solve.iterations += 1;
        let (mut p, inner) = model.solve(objective, &at, left);
        solve.inner_iterations += inner;
        project(&projections, &mut p);
        let (found, halvings) = search(objective, &at, &p);
        solve.halvings += halvings;
        match found {
            Some(found) => at = found,
            None => break,
        }
        let renewed = objective.renew(&at.dv);
        if renewed > Renewed::Nothing {
            at = State::new(objective, at.dv);
        }
        is_new = renewed == Renewed::Contacts;
        if is_new {
            model = Model::new(objective, &at.dv, false, plan);
        }
    }
    (solve.levels, solve.nonzeros) = (model.hierarchy.depth(), model.matrix.blocks.len() as u64);
    (at.dv, solve)
}

/// The Hessian of an iteration, and its approximate inverse.
struct Model<const D: usize> {
    matrix: Bsr<f64, D>,
    hierarchy: Condensed<D>,
}

impl<const D: usize> Model<D> {
    fn new(objective: &dyn Objective<D>, dv: &NodeVectors<D>, elastic: bool, plan: &Plan) -> Self {
        let matrix = objective.tangent(dv, elastic);
        let hierarchy = Condensed::new(objective, &matrix, plan);
        Self { matrix, hierarchy }
    }

    /// V: a cycle.
    fn inverse(&mut self) -> Cycle<'_, D> {
        Cycle { matrix: &self.matrix, hierarchy: &mut self.hierarchy }
    }

    /// √(rᵀ V r) / ‖Δv‖: the error of Δv relative to its size. With V = H⁻¹ the former is the error in
    /// the norm of H, which is at least that in the norm of the masses.
    fn error(&mut self, objective: &dyn Objective<D>, at: &State<D>) -> f64 {
        let mut z: NodeVectors<D> = vec![[0.0; D]; at.dv.len()];
        precondition(&mut self.inverse(), &at.r, &mut z);
        match dot(&at.r, &z) {
            square if square > 0.0 => square.sqrt() / size(objective, &at.dv),
            _ if at.r.iter().flatten().all(|r| *r == 0.0) => 0.0,
            _ => f64::INFINITY,
        }
    }

    /// −H⁻¹ ∇E, until its own error is at most the part `left` of ‖Δv‖, and the iterations.
    fn solve(&mut self, objective: &dyn Objective<D>, at: &State<D>, left: f64) -> (NodeVectors<D>, u32) {
        let mut p: NodeVectors<D> = vec![[0.0; D]; at.dv.len()];
        let mut start = None;
        let done = |zr: f64, p: &NodeVectors<D>| {
            let start = *start.get_or_insert(zr);
            let goal = left * size(objective, &sum(&at.dv, 1.0, p));
            zr <= REDUCTION * REDUCTION * start && zr <= goal * goal
        };
        let mut inverse = self.inverse();
        let inner = conjugate_gradients_until(inverse.matrix, &mut inverse, &at.r, &mut p, done);
        (p, inner)
    }
}

/// a + α b.
fn sum<const D: usize>(a: &NodeVectors<D>, alpha: f64, b: &NodeVectors<D>) -> NodeVectors<D> {
    let mut c = a.clone();
    axpy(alpha, b, &mut c);
    c
}

/// ‖Δv‖ that errors are relative to (kg^½ m/s).
fn size<const D: usize>(objective: &dyn Objective<D>, dv: &NodeVectors<D>) -> f64 {
    mass_norm(dv, objective.masses()).max(objective.least_change())
}

/// Halves α, from 1 or as far as a direction reaches, until ∇E along p is not too far uphill. A
/// direction may end downhill: it was too short then. No energy is compared, so forces that have none
/// may act, and rounding does not matter.
fn search<const D: usize>(
    objective: &dyn Objective<D>,
    from: &State<D>,
    p: &NodeVectors<D>,
) -> (Option<State<D>>, u32) {
    let slope = dot(p, &from.r);
    let mut alpha = objective.reach(p);
    for halvings in 0..=MAX_HALVINGS {
        let trial = State::new(objective, sum(&from.dv, alpha, p));
        if trial.allowed && dot(p, &trial.r) >= -SLOPE * slope {
            return (Some(trial), halvings);
        }
        alpha *= 0.5;
    }
    (None, MAX_HALVINGS)
}
