//! The solve on the coarsest level.

use super::factor::{Factor, ROUNDING};
use super::hierarchy::Nodes;
use super::krylov::Inexact;
use super::objective::NodeVectors;
use super::smoother::{Chebyshev, Room};
use super::sparse::Bsr;
use gridfall_core::sim::settings::CoarseSolve;

/// Multiplications up to which a factorisation pays.
const FACTORISE: f64 = 3e8;
/// The polynomial that replaces it in larger systems: its degree, and the range of the spectrum
/// that it damps.
const DEGREE: usize = 30;
const RANGE: f64 = 400.0;

/// In f64: the coarsest level is small.
pub struct Coarsest<const D: usize> {
    matrix: Bsr<f64, D>,
    solver: CoarseSolver<D>,
}

enum CoarseSolver<const D: usize> {
    Exact(Factor<D>),
    Polynomial(Chebyshev<f64, D>, Room<f64, D>),
    Adaptive(Inexact<D>),
}

impl<const D: usize> Coarsest<D> {
    pub fn new(kind: CoarseSolve, matrix: Bsr<f64, D>, nodes: &Nodes<D>) -> Self {
        let all: Vec<u32> = (0..matrix.rows() as u32).collect();
        let solver = match kind {
            CoarseSolve::Adaptive => CoarseSolver::Adaptive(Inexact::new(&matrix)),
            CoarseSolve::Fixed => match Factor::new(&matrix, nodes, &all, FACTORISE, ROUNDING) {
                Some(factor) => CoarseSolver::Exact(factor),
                None => CoarseSolver::Polynomial(Chebyshev::new(&matrix, DEGREE, RANGE), Room::default()),
            },
        };
        Self { matrix, solver }
    }

    /// x ≈ A⁻¹ b. `straight` is the cycle's right-hand side restricted down without smoothing, from
    /// which the adaptive solve takes its tolerance.
    pub fn solve(&mut self, b: &NodeVectors<D>, straight: &NodeVectors<D>, x: &mut NodeVectors<D>) {
        match &mut self.solver {
            CoarseSolver::Exact(factor) => {
                let mut b: NodeVectors<D> = factor.nodes().iter().map(|&i| b[i as usize]).collect();
                x.fill([0.0; D]);
                factor.add_solution(&mut b, x);
            }
            CoarseSolver::Polynomial(polynomial, room) => polynomial.smooth(&self.matrix, b, x, true, room),
            CoarseSolver::Adaptive(inexact) => {
                inexact.solve(&self.matrix, b, straight, x);
            }
        }
    }

    /// Whether the solve takes its tolerance from `straight`.
    pub fn is_adaptive(&self) -> bool {
        matches!(self.solver, CoarseSolver::Adaptive(_))
    }

    /// Widens a polynomial's interval.
    pub fn strengthen(&mut self) {
        if let CoarseSolver::Polynomial(polynomial, _) = &mut self.solver {
            polynomial.strengthen();
        }
    }
}
