//! A V-cycle whose finest level has its weak nodes condensed.
//!
//! A node whose stiffness is small beside that of a node it is coupled to follows that one: at the rim of
//! a body it sees few particles, and those from afar; where soft and stiff material meet it touches the
//! stiff one with the edge of its kernel. Such nodes, by some hundreds, move along with strong ones
//! without straining any particle, and by thousands of times as far. Seen from its own diagonal block, a strong node is
//! much stiffer than it is with the weak ones free to follow, so no smoother gets at these modes, and
//! they are too narrow for a coarse grid. So the finest level is smoothed on the Schur complement of the
//! strong nodes, S = H_ss − H_sw H_ww⁻¹ H_ws, with D the diagonal blocks of S: the weak nodes are solved
//! for exactly before every step. The coarse levels are those of the plain cycle.

use nalgebra::{Cholesky, DMatrix};
use rayon::prelude::*;

use super::factor::{Factor, ROUNDING};
use super::galerkin::galerkin;
use super::hierarchy::{Nodes, Prolongation};
use super::krylov::Preconditioner;
use super::objective::{NodeId, NodeVectors, Objective};
use super::smoother::{BOUND, DEGREE, RANGE, coefficients};
use super::sparse::Bsr;
use super::spectrum::largest_eigenvalue;
use super::vcycle::{Plan, VCycle};
use super::verbs::inverse;
use gridfall_core::maths::linalg::{Matrix, Vector, apply, trace};

/// A node is weak beside a neighbour of whose stiffness it has less than this part,
const WEAK: f64 = 0.05;
/// if they share particles that matter: |H_ij| is at least this part of √(|H_ii| |H_jj|). A soft body's
/// nodes beside a stiff one that share soft particles only are not weak.
const COUPLED: f64 = 0.05;
/// and if the stiffness that it has is at least so many times its inertia: else inertia holds what
/// would follow, and nothing is slow.
const HELD: f64 = 1000.0;

/// The hierarchy.
pub struct Condensed<const D: usize> {
    weak: Factor<D>,
    strong: Vec<u32>,
    /// Of the diagonal blocks of S; of no use at weak nodes.
    inverse_diagonal: Vec<Matrix<f64, D>>,
    lambda: f64,
    projections: Vec<Option<Matrix<f64, D>>>,
    prolongation: Prolongation<D>,
    coarse: VCycle<f64, D>,
    /// Right-hand side of the coarse levels, and their answer.
    below: [NodeVectors<D>; 2],
}

impl<const D: usize> Condensed<D> {
    pub fn new(objective: &dyn Objective<D>, matrix: &Bsr<f64, D>, plan: &Plan) -> Self {
        let nodes = Nodes { ids: objective.nodes().to_vec(), period: objective.period() };
        let projections: Vec<_> = objective.freedoms().iter().map(|freedom| freedom.projection()).collect();
        let (coarse_nodes, prolongation) = nodes.coarsen(plan.embedding);
        let below = galerkin(matrix, &projections, &prolongation);
        let zeros = vec![[0.0; D]; coarse_nodes.ids.len()];
        let plan = Plan { levels: plan.levels.saturating_sub(1), ..*plan };
        let coarse = VCycle::over(coarse_nodes, below.projections, &below.matrix, &plan, &|_| None);
        let is_weak = weak_nodes(matrix, objective.masses());
        let which = |weak: bool| (0..matrix.rows() as u32).filter(|&i| is_weak[i as usize] == weak).collect();
        let (strong, chosen): (Vec<u32>, Vec<u32>) = (which(false), which(true));
        let weak = Factor::new(matrix, &nodes, &chosen, f64::INFINITY, ROUNDING).expect("no bound");
        let block = |i: usize| inverse(&condensed_block(matrix, &nodes.ids, &is_weak, i));
        let mut inverse_diagonal = vec![[[0.0; D]; D]; matrix.rows()];
        inverse_diagonal.par_iter_mut().with_min_len(64).enumerate().for_each(|(i, d)| {
            if !is_weak[i] {
                *d = block(i);
            }
        });
        let mut condensed = Self {
            weak,
            strong,
            inverse_diagonal,
            lambda: 0.0,
            projections,
            prolongation,
            coarse,
            below: [zeros.clone(), zeros],
        };
        let product = |x: &[Vector<f64, D>], y: &mut [Vector<f64, D>]| {
            let (mut settled, zeros) = (x.to_vec(), vec![[0.0; D]; x.len()]);
            condensed.settle(matrix, &zeros, &mut settled);
            y.fill([0.0; D]);
            condensed.strong_rows(matrix, &zeros, &settled, |i, r| y[i] = r.map(|x| -x));
        };
        condensed.lambda = largest_eigenvalue(product, &condensed.inverse_diagonal);
        condensed
    }

    /// Levels, the finest and the coarsest included.
    pub fn depth(&self) -> u32 {
        self.coarse.depth() + 1
    }

    /// Solves for the weak nodes, the others as they are.
    fn settle(&self, matrix: &Bsr<f64, D>, b: &NodeVectors<D>, x: &mut NodeVectors<D>) {
        let mut r = matrix.residuals(self.weak.nodes(), b, x);
        self.weak.add_solution(&mut r, x);
    }

    /// Hands over the residuals of the strong nodes.
    fn strong_rows(
        &self,
        matrix: &Bsr<f64, D>,
        b: &NodeVectors<D>,
        x: &NodeVectors<D>,
        mut take: impl FnMut(usize, Vector<f64, D>),
    ) {
        let r = matrix.residuals(&self.strong, b, x);
        self.strong.iter().zip(r).for_each(|(&i, r)| take(i as usize, r));
    }

    /// A Chebyshev polynomial of D⁻¹S, as [`super::smoother::Chebyshev`]'s of D⁻¹A.
    fn smooth(&self, matrix: &Bsr<f64, D>, b: &NodeVectors<D>, x: &mut NodeVectors<D>) {
        let mut step: NodeVectors<D> = vec![[0.0; D]; b.len()];
        for [keep, gain] in coefficients(self.lambda, RANGE, DEGREE) {
            self.settle(matrix, b, x);
            self.strong_rows(matrix, b, x, |i, r| {
                let z = apply(&self.inverse_diagonal[i], &r);
                step[i] = std::array::from_fn(|a| keep * step[i][a] + gain * z[a]);
            });
            for &i in &self.strong {
                (0..D).for_each(|a| x[i as usize][a] += step[i as usize][a]);
            }
        }
        self.settle(matrix, b, x);
    }

    fn cycle(&mut self, matrix: &Bsr<f64, D>, b: &NodeVectors<D>, x: &mut NodeVectors<D>) {
        x.fill([0.0; D]);
        self.smooth(matrix, b, x);
        let mut r: NodeVectors<D> = vec![[0.0; D]; b.len()];
        self.strong_rows(matrix, b, x, |i, residual| r[i] = residual);
        let [coarse_b, coarse_x] = &mut self.below;
        self.prolongation.restrict(&self.projections, &mut r, coarse_b);
        self.coarse.apply(coarse_b, coarse_x);
        self.prolongation.prolong(&self.projections, coarse_x, &mut r, x);
        self.smooth(matrix, b, x);
    }
}

/// Which nodes are weak.
fn weak_nodes<const D: usize>(matrix: &Bsr<f64, D>, masses: &[f64]) -> Vec<bool> {
    let stiffness: Vec<f64> = matrix.diagonal().iter().map(trace).collect();
    let is_weak = |i: usize| {
        let (columns, blocks) = matrix.row(i);
        columns.iter().zip(blocks).any(|(&j, block)| {
            let (own, other) = (stiffness[i], stiffness[j as usize]);
            let square: f64 = block.iter().flatten().map(|x| x * x).sum();
            own < WEAK * other && square > COUPLED * COUPLED * own * other
        })
    };
    let is_weak = |i: usize| stiffness[i] > HELD * D as f64 * masses[i] && is_weak(i);
    (0..matrix.rows()).into_par_iter().map(is_weak).collect()
}

/// The diagonal block of S, as far as weak nodes within a cell decide it: the others move it by little.
fn condensed_block<const D: usize>(
    matrix: &Bsr<f64, D>,
    nodes: &[NodeId<D>],
    is_weak: &[bool],
    i: usize,
) -> Matrix<f64, D> {
    let (columns, blocks) = matrix.row(i);
    let mut own = blocks[columns.binary_search(&(i as u32)).expect("every row has its diagonal")];
    let follows = |j: &u32| is_weak[*j as usize] && are_near(&nodes[i], &nodes[*j as usize]);
    let weak: Vec<u32> = columns.iter().copied().filter(follows).collect();
    if weak.is_empty() {
        return own;
    }
    let Some(factor) = Cholesky::new(dense(matrix, &weak, &weak)) else { return own };
    // H_iw L⁻ᵀ, whose square is what the weak nodes take away.
    let mut coupling = dense(matrix, &weak, &[i as u32]);
    factor.l_dirty().solve_lower_triangular_mut(&mut coupling);
    let taken = coupling.tr_mul(&coupling);
    (0..D).for_each(|a| (0..D).for_each(|b| own[a][b] -= taken[(a, b)]));
    own
}

/// Whether nodes of either grid lie within a cell of each other along every axis.
fn are_near<const D: usize>(a: &NodeId<D>, b: &NodeId<D>) -> bool {
    let shift = 0.5 * (f64::from(b.grid) - f64::from(a.grid));
    (0..D).all(|k| (f64::from(b.index[k] - a.index[k]) - shift).abs() <= 1.0)
}

/// The blocks of some rows and columns.
fn dense<const D: usize>(matrix: &Bsr<f64, D>, rows: &[u32], columns: &[u32]) -> DMatrix<f64> {
    let mut dense = DMatrix::zeros(D * rows.len(), D * columns.len());
    for (row, &i) in rows.iter().enumerate() {
        let (of_row, blocks) = matrix.row(i as usize);
        for (column, j) in columns.iter().enumerate() {
            let Ok(place) = of_row.binary_search(j) else { continue };
            for a in 0..D {
                (0..D).for_each(|b| dense[(D * row + a, D * column + b)] = blocks[place][a][b]);
            }
        }
    }
    dense
}

/// A hierarchy with its matrix, as a preconditioner.
pub struct Cycle<'a, const D: usize> {
    pub matrix: &'a Bsr<f64, D>,
    pub hierarchy: &'a mut Condensed<D>,
}

impl<const D: usize> Preconditioner<D> for Cycle<'_, D> {
    fn apply(&mut self, r: &NodeVectors<D>, z: &mut NodeVectors<D>) -> u32 {
        self.hierarchy.cycle(self.matrix, r, z);
        1
    }

    fn strengthen(&mut self) -> bool {
        self.hierarchy.lambda *= 2.0;
        self.hierarchy.coarse.strengthen() || self.hierarchy.lambda < BOUND
    }
}
