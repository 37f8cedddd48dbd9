//! Quasi-Newton with a multigrid cycle, or an inexact solve, as initial inverse Hessian (HOT algorithm 3).

use std::collections::VecDeque;

use super::descent::Directions;
use super::krylov::{Inexact, Preconditioner};
use super::line_search::Point;
use super::objective::{Field, Objective};
use super::sparse::Bsr;
use super::vcycle::{Plan, VCycle};
use super::verbs::{axpy, dot};

/// Pairs that are kept.
const WINDOW: usize = 8;
/// Iterations that the first, the second and each later model of the Hessian serves for; then one is made anew where the solver stands. Where stiff
/// bodies turn, the step's start is strained by far more than its end, so that the Hessian there is a poor guide; soft ones have converged by
/// then. The history goes with the first model, for the same reason; later ones hand it on. Measured: half the iterations of models for 16 where
/// materials of 1e5 and 1e9 Pa meet, and on the twisted bar.
const LIFETIMES: [u32; 3] = [2, 3, 16];

/// Within so many times the tolerance a few iterations will do, and a new model costs as much (measured on the reduced scenes: a fifth less time than 3).
const NEAR: f64 = 100.0;

/// Whether the model, which `replaced` others, has served its `age` out; `excess` is the residual over the tolerance.
pub fn outlived(age: u32, replaced: usize, excess: f64) -> bool {
    let last = LIFETIMES.len() - 1;
    age >= LIFETIMES[last] || (age >= LIFETIMES[replaced.min(last)] && excess > NEAR)
}

struct Pair<const D: usize> {
    s: Field<D>,
    y: Field<D>,
    rho: f64,
}

/// The last steps and the changes of the gradient over them.
#[derive(Default)]
pub struct History<const D: usize>(VecDeque<Pair<D>>);

impl<const D: usize> History<D> {
    /// Pairs of negative curvature are dropped.
    pub fn push(&mut self, s: Field<D>, y: Field<D>) {
        let curvature = dot(&y, &s);
        if curvature > 0.0 {
            if self.0.len() == WINDOW {
                self.0.pop_front();
            }
            self.0.push_back(Pair { s, y, rho: 1.0 / curvature });
        }
    }

    /// The two-loop recursion (Nocedal & Wright, algorithm 7.4): p = −B ∇E.
    pub fn direction(&self, gradient: &Field<D>, initial: &mut dyn Preconditioner<D>, p: &mut Field<D>) -> u32 {
        let mut q: Field<D> = gradient.iter().map(|g| g.map(|x| -x)).collect();
        let mut alphas = Vec::with_capacity(self.0.len());
        for pair in self.0.iter().rev() {
            let alpha = pair.rho * dot(&pair.s, &q);
            axpy(-alpha, &pair.y, &mut q);
            alphas.push(alpha);
        }
        let inner = initial.apply(&q, p);
        for (pair, alpha) in self.0.iter().zip(alphas.into_iter().rev()) {
            let beta = pair.rho * dot(&pair.y, p);
            axpy(alpha - beta, &pair.s, p);
        }
        inner
    }
}

/// A model of the Hessian.
enum Model<const D: usize> {
    Cycle(Box<VCycle<f64, D>>),
    Inexact(Bsr<f64, D>, Inexact<D>),
}

impl<const D: usize> Preconditioner<D> for Model<D> {
    fn apply(&mut self, r: &Field<D>, z: &mut Field<D>) -> u32 {
        match self {
            Self::Cycle(cycle) => cycle.apply(r, z),
            Self::Inexact(matrix, inexact) => inexact.solve(matrix, r, r, z),
        }
    }

    fn strengthen(&mut self) -> bool {
        match self {
            Self::Cycle(cycle) => cycle.strengthen(),
            Self::Inexact(..) => false,
        }
    }
}

/// L-BFGS around a V-cycle, if there is a plan for one, else around conjugate gradients.
pub struct QuasiNewton<const D: usize> {
    plan: Option<Plan>,
    /// The tolerance (ε), if models are made anew within a step.
    rebuild: Option<f64>,
    model: Option<Model<D>>,
    history: History<D>,
    /// Iterations since the model was made, and models before it.
    age: u32,
    replaced: usize,
    nonzeros: u64,
}

impl<const D: usize> QuasiNewton<D> {
    pub fn new(plan: Option<Plan>, rebuild: Option<f64>) -> Self {
        Self { plan, rebuild, model: None, history: History(VecDeque::new()), age: 0, replaced: 0, nonzeros: 0 }
    }

    fn build(&mut self, objective: &dyn Objective<D>, dv: &Field<D>) -> Model<D> {
        let matrix = objective.hessian(dv);
        self.nonzeros = matrix.blocks.len() as u64;
        match &self.plan {
            Some(plan) => Model::Cycle(Box::new(VCycle::new(objective, dv, &matrix, plan))),
            None => {
                let inexact = Inexact::new(&matrix);
                Model::Inexact(matrix, inexact)
            }
        }
    }
}

impl<const D: usize> Directions<D> for QuasiNewton<D> {
    fn direction(&mut self, objective: &dyn Objective<D>, at: &Point<D>, residual: f64, p: &mut Field<D>) -> u32 {
        if self.rebuild.is_some_and(|tolerance| outlived(self.age, self.replaced, residual / tolerance)) {
            if self.replaced == 0 {
                self.history.0.clear();
            }
            (self.model, self.age, self.replaced) = (None, 0, self.replaced + 1);
        }
        self.age += 1;
        let mut model = self.model.take().unwrap_or_else(|| self.build(objective, &at.dv));
        let inner = self.history.direction(&at.gradient, &mut model, p);
        self.model = Some(model);
        inner
    }

    fn learn(&mut self, step: Field<D>, change: Field<D>) {
        self.history.push(step, change);
    }

    fn retreat(&mut self, descending: bool) -> bool {
        if !self.history.0.is_empty() {
            self.history.0.clear();
            return true;
        }
        if self.rebuild.is_some() && self.age > 1 {
            (self.model, self.age, self.replaced) = (None, 0, self.replaced + 1);
            return true;
        }
        !descending && self.model.as_mut().is_some_and(|model| model.strengthen())
    }

    fn size(&self) -> (u32, u64) {
        let levels = match &self.model {
            Some(Model::Cycle(cycle)) => cycle.depth(),
            _ => 1,
        };
        (levels, self.nonzeros)
    }
}
