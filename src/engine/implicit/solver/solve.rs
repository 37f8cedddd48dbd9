//! The step's minimisation by the method that the scene names.

use super::admm::alternate;
use super::descent::descend;
use super::hierarchy::Embedding;
use super::lbfgs::QuasiNewton;
use super::newton::{Conditioning, Newton};
use super::objective::{NodeVectors, Objective};
use super::policy::Rules;
use super::tolerance::Tolerance;
use super::turning;
use super::vcycle::Plan;
use crate::contract::Solve;
use gridfall_core::sim::settings::{Implicit, Method};

/// Minimises E from the objective's start. The engine fills in time and length of the step.
pub fn solve<const D: usize>(objective: &mut dyn Objective<D>, settings: &Implicit) -> (NodeVectors<D>, Solve) {
    let plan = Plan::new(settings);
    if settings.method == Method::Newton {
        return turning::solve(objective, settings, &plan);
    }
    let objective: &dyn Objective<D> = objective;
    let (tolerance, rebuild) = (settings.tolerance(), settings.rebuild);
    let characteristic = Tolerance::characteristic(tolerance);
    let rules = Rules { tolerance, with_age: rebuild, after_failure: rebuild };
    let quasi_newton = |plan: Option<Plan>| {
        descend(objective, &mut QuasiNewton::new(plan, rules), characteristic, settings.max_iterations)
    };
    let newton = |conditioning: Conditioning, tolerance: Tolerance| {
        descend(objective, &mut Newton::new(conditioning, tolerance), tolerance, settings.max_iterations)
    };
    match settings.method {
        Method::Newton => unreachable!("done above, because it renews the objective"),
        Method::Hot => quasi_newton(Some(plan)),
        Method::HotQuadratic => quasi_newton(Some(Plan { embedding: Embedding::Quadratic, ..plan })),
        Method::LbfgsGmg => quasi_newton(Some(Plan { geometric: true, ..plan })),
        Method::LbfgsH => quasi_newton(None),
        Method::PnPcg => newton(Conditioning::Jacobi, characteristic),
        Method::PnPcgMf => newton(Conditioning::MatrixFree, characteristic),
        Method::PnPcgSgs => newton(Conditioning::GaussSeidel, characteristic),
        Method::PnMgpcg => newton(Conditioning::Multigrid(plan), characteristic),
        Method::Gast15 => newton(Conditioning::MatrixFree, Tolerance::global(tolerance)),
        Method::Admm => alternate(objective, characteristic, settings.max_iterations),
    }
}
