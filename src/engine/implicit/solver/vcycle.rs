//! One V-cycle as an approximate inverse (HOT algorithm 2).
//!
//! With a fixed coarse solve it is linear, symmetric and positive definite. Matrices and vectors of
//! the cycle are in `T`. f32 would halve the memory traffic, but loses the inertia of rigid motions
//! where dt² E / ρ dx² nears 10⁷: aluminium in steps of 1/24 s then took nine times the iterations.

use super::coarse::Coarsest;
use super::galerkin::galerkin;
use super::hierarchy::{Embedding, Nodes, Prolongation};
use super::krylov::Preconditioner;
use super::objective::{NodeId, NodeVectors, Objective};
use super::smoother::{Room, Smoother, residual};
use super::sparse::Bsr;
use super::verbs::update;
use gridfall_core::maths::linalg::{Matrix, Vector};
use gridfall_core::maths::real::Real;
use gridfall_core::sim::settings::{CoarseSolve, Implicit, Method, Smoother as SmootherKind};

/// Nodes below which no further level pays.
const FEWEST_NODES: usize = 16;
/// Nodes for which a factorisation takes little beside the rest of a step.
const EXACT_NODES: usize = 500;
/// Levels to which a hierarchy goes on by itself.
pub const MOST_LEVELS: u32 = 10;

/// How the hierarchy is built.
#[derive(Clone, Copy, Debug)]
pub struct Plan {
    pub levels: u32,
    /// Whether there are more levels where the coarsest would be too large to be solved exactly.
    pub deep: bool,
    pub embedding: Embedding,
    pub smoother: SmootherKind,
    pub coarse_solve: CoarseSolve,
    /// Coarse matrices by particle quadrature instead of R H P.
    pub geometric: bool,
}

impl Plan {
    /// Galerkin's, with linear embedding.
    pub fn new(settings: &Implicit) -> Self {
        let &Implicit { levels, smoother, coarse_solve, method, .. } = settings;
        Self {
            levels,
            deep: method == Method::Newton,
            embedding: Embedding::Linear,
            smoother,
            coarse_solve,
            geometric: false,
        }
    }
}

/// A level above the coarsest.
struct Level<T, const D: usize> {
    matrix: Bsr<T, D>,
    projections: Vec<Option<Matrix<T, D>>>,
    prolongation: Prolongation<D>,
    smoother: Smoother<T, D>,
    b: Vec<Vector<T, D>>,
    x: Vec<Vector<T, D>>,
    r: Vec<Vector<T, D>>,
    /// The cycle's right-hand side restricted down without smoothing.
    straight: Vec<Vector<T, D>>,
    room: Room<T, D>,
}

/// The hierarchy.
pub struct VCycle<T, const D: usize> {
    levels: Vec<Level<T, D>>,
    coarsest: Coarsest<D>,
    coarse_nodes: usize,
}

impl<T: Real, const D: usize> VCycle<T, D> {
    /// The hierarchy over the Hessian at Δv.
    pub fn new(objective: &dyn Objective<D>, dv: &NodeVectors<D>, finest: &Bsr<f64, D>, plan: &Plan) -> Self {
        let nodes = Nodes { ids: objective.nodes().to_vec(), period: objective.period() };
        let projections = objective.freedoms().iter().map(|freedom| freedom.projection()).collect();
        let by_quadrature = |level: u32| plan.geometric.then(|| objective.coarse_hessian(dv, level));
        Self::over(nodes, projections, finest, plan, &by_quadrature)
    }

    /// The hierarchy over a matrix, and over R H P or what `by_quadrature` gives for a level below.
    pub fn over(
        mut nodes: Nodes<D>,
        mut projections: Vec<Option<Matrix<f64, D>>>,
        finest: &Bsr<f64, D>,
        plan: &Plan,
        by_quadrature: &dyn Fn(u32) -> Option<(Vec<NodeId<D>>, Bsr<f64, D>)>,
    ) -> Self {
        let mut coarser: Option<Bsr<f64, D>> = None;
        let mut levels = Vec::new();
        let goes_on = |depth: u32, nodes: usize| {
            depth < plan.levels && nodes > FEWEST_NODES || plan.deep && depth < MOST_LEVELS && nodes > EXACT_NODES
        };
        while goes_on(levels.len() as u32 + 1, nodes.ids.len()) {
            let matrix = coarser.as_ref().unwrap_or(finest);
            let (coarse_nodes, prolongation, coarse) =
                if let Some((ids, matrix)) = by_quadrature(levels.len() as u32 + 1) {
                    let coarse_nodes = Nodes { ids, period: nodes.coarsen(plan.embedding).0.period };
                    let prolongation = nodes.prolongation(&coarse_nodes, plan.embedding);
                    let free = vec![None; coarse_nodes.ids.len()];
                    (coarse_nodes, prolongation, (matrix, free))
                } else {
                    let (coarse_nodes, prolongation) = nodes.coarsen(plan.embedding);
                    if coarse_nodes.ids.len() == nodes.ids.len() {
                        break;
                    }
                    let coarse = galerkin(matrix, &projections, &prolongation);
                    (coarse_nodes, prolongation, (coarse.matrix, coarse.projections))
                };
            let fine = matrix.cast::<T>();
            let narrow = |s: &Matrix<f64, D>| s.map(|row| row.map(T::from_f64));
            let zeros = vec![[T::ZERO; D]; nodes.ids.len()];
            levels.push(Level {
                smoother: Smoother::new(plan.smoother, &fine, &nodes),
                matrix: fine,
                projections: projections.iter().map(|s| s.as_ref().map(narrow)).collect(),
                prolongation,
                b: zeros.clone(),
                x: zeros.clone(),
                r: zeros.clone(),
                straight: zeros,
                room: Room::default(),
            });
            (nodes, coarser, projections) = (coarse_nodes, Some(coarse.0), coarse.1);
        }
        let coarse_nodes = nodes.ids.len();
        let coarsest = Coarsest::new(plan.coarse_solve, coarser.unwrap_or_else(|| finest.clone()), &nodes);
        Self { levels, coarsest, coarse_nodes }
    }

    /// Levels, the finest and the coarsest included.
    pub fn depth(&self) -> u32 {
        self.levels.len() as u32 + 1
    }

    /// One cycle for the right-hand side of the first level, whose x then holds the result.
    fn cycle(&mut self) {
        let depth = self.levels.len();
        let adaptive = self.coarsest.is_adaptive();
        let mut coarse_b = vec![[T::ZERO; D]; self.coarse_nodes];
        let mut coarse_straight = coarse_b.clone();
        self.levels[0].straight = self.levels[0].b.clone();
        for l in 0..depth {
            let (above, below) = self.levels.split_at_mut(l + 1);
            let level = &mut above[l];
            let (b, straight) = match below.first_mut() {
                Some(next) => (&mut next.b, &mut next.straight),
                None => (&mut coarse_b, &mut coarse_straight),
            };
            level.smoother.smooth(&level.matrix, &level.b, &mut level.x, true, &mut level.room);
            residual(&level.matrix, &level.b, &level.x, &mut level.r);
            level.prolongation.restrict(&level.projections, &mut level.r, b);
            if adaptive {
                level.prolongation.restrict(&level.projections, &mut level.straight, straight);
            }
        }
        let wide = |v: &[Vector<T, D>]| -> NodeVectors<D> { v.iter().map(|v| v.map(|x| x.to_f64())).collect() };
        let mut coarse_x: NodeVectors<D> = vec![[0.0; D]; self.coarse_nodes];
        self.coarsest.solve(&wide(&coarse_b), &wide(&coarse_straight), &mut coarse_x);
        let coarse_x: Vec<Vector<T, D>> = coarse_x.iter().map(|v| v.map(T::from_f64)).collect();
        for l in (0..depth).rev() {
            let (above, below) = self.levels.split_at_mut(l + 1);
            let level = &mut above[l];
            let coarse = below.first().map_or(&coarse_x, |next| &next.x);
            level.prolongation.prolong(&level.projections, coarse, &mut level.r, &mut level.x);
            level.smoother.smooth(&level.matrix, &level.b, &mut level.x, false, &mut level.room);
        }
    }
}

impl<T: Real, const D: usize> Preconditioner<D> for VCycle<T, D> {
    fn apply(&mut self, r: &NodeVectors<D>, z: &mut NodeVectors<D>) -> u32 {
        // f32 also has a short range: the right-hand side is scaled to about 1.
        let largest = r.iter().flatten().fold(0.0f64, |m, x| m.max(x.abs()));
        let scale = if largest > 0.0 { largest } else { 1.0 };
        if self.levels.is_empty() {
            self.coarsest.solve(r, r, z);
            return 1;
        }
        update(&mut self.levels[0].b, r, |b, r| *b = r.map(|x| T::from_f64(x / scale)));
        self.cycle();
        update(z, &self.levels[0].x, |z, x| *z = x.map(|x| scale * x.to_f64()));
        1
    }

    fn strengthen(&mut self) -> bool {
        self.coarsest.strengthen();
        self.levels.iter_mut().filter_map(|level| level.smoother.strengthen().then_some(())).count() > 0
    }
}
