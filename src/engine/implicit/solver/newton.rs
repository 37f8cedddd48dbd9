//! Projected Newton with inexact conjugate gradients (HOT §5.3, §7.1).

use super::descent::Directions;
use super::gauss_seidel::{GaussSeidel, SymmetricGaussSeidel};
use super::hierarchy::Nodes;
use super::krylov::{BlockJacobi, Preconditioner, conjugate_gradients};
use super::line_search::Point;
use super::objective::{LinearOperator, NodeVectors, Objective};
use super::tolerance::Tolerance;
use super::vcycle::{Plan, VCycle};

/// What conjugate gradients are preconditioned with.
#[derive(Clone, Copy, Debug)]
pub enum Conditioning {
    /// The diagonal blocks.
    Jacobi,
    /// The diagonal blocks, and no matrix.
    MatrixFree,
    /// A symmetric coloured Gauss–Seidel sweep.
    GaussSeidel,
    /// A V-cycle of a hierarchy that is rebuilt in every Newton step.
    Multigrid(Plan),
}

pub struct Newton {
    pub conditioning: Conditioning,
    pub tolerance: Tolerance,
    levels: u32,
    nonzeros: u64,
}

impl Newton {
    pub fn new(conditioning: Conditioning, tolerance: Tolerance) -> Self {
        Self { conditioning, tolerance, levels: 1, nonzeros: 0 }
    }

    fn solve<const D: usize>(
        &self,
        objective: &dyn Objective<D>,
        at: &Point<D>,
        operator: &dyn LinearOperator<D>,
        preconditioner: &mut dyn Preconditioner<D>,
        p: &mut NodeVectors<D>,
    ) -> u32 {
        let r: NodeVectors<D> = at.gradient.iter().map(|g| g.map(|x| -x)).collect();
        let goal = |start: f64| start * self.tolerance.reduction(objective, &at.gradient, start).powi(2);
        conjugate_gradients(operator, preconditioner, &r, p, goal)
    }
}

impl<const D: usize> Directions<D> for Newton {
    fn direction(
        &mut self,
        objective: &dyn Objective<D>,
        at: &Point<D>,
        _residual: f64,
        p: &mut NodeVectors<D>,
    ) -> u32 {
        if let Conditioning::MatrixFree = self.conditioning {
            let operator = objective.linearised(&at.dv);
            let mut jacobi = BlockJacobi::new(&operator.diagonal());
            return self.solve(objective, at, &*operator, &mut jacobi, p);
        }
        let matrix = objective.hessian(&at.dv);
        self.nonzeros = matrix.blocks.len() as u64;
        match self.conditioning {
            Conditioning::GaussSeidel => {
                let nodes = Nodes { ids: objective.nodes().to_vec(), period: objective.period() };
                let sweeps = GaussSeidel::new(&matrix, &nodes);
                self.solve(objective, at, &matrix, &mut SymmetricGaussSeidel { matrix: &matrix, sweeps }, p)
            }
            Conditioning::Multigrid(plan) => {
                let mut cycle = VCycle::<f64, D>::new(objective, &at.dv, &matrix, &plan);
                self.levels = cycle.depth();
                self.solve(objective, at, &matrix, &mut cycle, p)
            }
            Conditioning::Jacobi | Conditioning::MatrixFree => {
                let mut jacobi = BlockJacobi::new(&matrix.diagonal());
                self.solve(objective, at, &matrix, &mut jacobi, p)
            }
        }
    }

    fn learn(&mut self, _step: NodeVectors<D>, _change: NodeVectors<D>) {}

    fn retreat(&mut self, _descending: bool) -> bool {
        false
    }

    fn size(&self) -> (u32, u64) {
        (self.levels, self.nonzeros)
    }
}
