//! L-BFGS with a multigrid cycle, or an inexact solve, as initial inverse Hessian (HOT algorithm
//! 3).

use std::collections::VecDeque;

use super::descent::Directions;
use super::krylov::{Inexact, Preconditioner};
use super::line_search::Point;
use super::objective::{NodeVectors, Objective};
use super::policy::{self, Lifetime, Retreat, Rules};
use super::sparse::Bsr;
use super::vcycle::{Plan, VCycle};
use super::verbs::{axpy, dot};

/// Pairs that are kept.
const WINDOW: usize = 8;
struct Pair<const D: usize> {
    s: NodeVectors<D>,
    y: NodeVectors<D>,
    rho: f64,
}

/// The last steps and the changes of the gradient over them.
#[derive(Default)]
pub struct History<const D: usize>(VecDeque<Pair<D>>);

impl<const D: usize> History<D> {
    /// Pairs of negative curvature are dropped.
    pub fn push(&mut self, s: NodeVectors<D>, y: NodeVectors<D>) {
        let curvature = dot(&y, &s);
        if curvature > 0.0 {
            if self.0.len() == WINDOW {
                self.0.pop_front();
            }
            self.0.push_back(Pair { s, y, rho: 1.0 / curvature });
        }
    }

    /// The two-loop recursion (Nocedal & Wright, algorithm 7.4): p = −B ∇E.
    pub fn direction(
        &self,
        gradient: &NodeVectors<D>,
        initial: &mut dyn Preconditioner<D>,
        p: &mut NodeVectors<D>,
    ) -> u32 {
        let mut q: NodeVectors<D> = gradient.iter().map(|g| g.map(|x| -x)).collect();
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
    fn apply(&mut self, r: &NodeVectors<D>, z: &mut NodeVectors<D>) -> u32 {
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
    lifetime: Lifetime,
    /// None where one is to be built.
    model: Option<Model<D>>,
    history: History<D>,
    nonzeros: u64,
}

impl<const D: usize> QuasiNewton<D> {
    pub fn new(plan: Option<Plan>, rules: Rules) -> Self {
        let lifetime = Lifetime::new(rules);
        Self { plan, lifetime, model: None, history: History(VecDeque::new()), nonzeros: 0 }
    }

    fn build(&mut self, objective: &dyn Objective<D>, dv: &NodeVectors<D>) -> Model<D> {
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
    fn direction(&mut self, objective: &dyn Objective<D>, at: &Point<D>, residual: f64, p: &mut NodeVectors<D>) -> u32 {
        if let policy::Model::New { forget } = self.lifetime.iterate(residual) {
            self.model = None;
            if forget {
                self.history.0.clear();
            }
        }
        let mut model = self.model.take().unwrap_or_else(|| self.build(objective, &at.dv));
        let inner = self.history.direction(&at.gradient, &mut model, p);
        self.model = Some(model);
        inner
    }

    fn learn(&mut self, step: NodeVectors<D>, change: NodeVectors<D>) {
        self.history.push(step, change);
    }

    fn retreat(&mut self, descending: bool) -> bool {
        let history = !self.history.0.is_empty();
        self.history.0.clear();
        match self.lifetime.retreat(history, descending) {
            Retreat::Forget => true,
            Retreat::Rebuild => {
                self.model = None;
                true
            }
            Retreat::Strengthen => self.model.as_mut().is_some_and(|model| model.strengthen()),
            Retreat::GiveUp => false,
        }
    }

    fn size(&self) -> (u32, u64) {
        let levels = match &self.model {
            Some(Model::Cycle(cycle)) => cycle.depth(),
            _ => 1,
        };
        (levels, self.nonzeros)
    }
}
