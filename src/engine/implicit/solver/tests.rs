//! The multigrid hierarchy and the solvers on small bodies.

use nalgebra::DMatrix;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::coarse::Coarsest;
use super::condensed::{Condensed, Cycle};
use super::factor::{Factor, ROUNDING};
use super::fixture::{Body, Recipe};
use super::galerkin::galerkin;
use super::gauss_seidel::{GaussSeidel, SymmetricGaussSeidel};
use super::hierarchy::{Embedding, Nodes, Prolongation};
use super::krylov::{BlockJacobi, Preconditioner, conjugate_gradients};
use super::objective::{NodeId, NodeVectors, Objective};
use super::solve::solve;
use super::sparse::Bsr;
use super::tolerance::residual;
use super::vcycle::{Plan, VCycle};
use super::verbs::{difference, dot, norm};
use gridfall_core::maths::linalg::Matrix;
use gridfall_core::sim::settings::{CoarseSolve, Implicit, Method, Smoother};

const SOLID: Recipe<3> =
    Recipe { cells: [10, 5, 6], youngs: [1e5, 1e9], dual: false, sliding: true, period: [None; 3], seed: 11 };
const FLAT: Recipe<2> =
    Recipe { cells: [18, 12], youngs: [1e5, 1e9], dual: false, sliding: true, period: [None; 2], seed: 12 };

/// P as a dense matrix.
fn dense_prolongation<const D: usize>(
    prolongation: &Prolongation<D>,
    projections: &[Option<Matrix<f64, D>>],
) -> DMatrix<f64> {
    let mut p = DMatrix::zeros(D * prolongation.parents.rows(), D * prolongation.children.rows());
    for i in 0..prolongation.parents.rows() {
        for (j, w) in prolongation.parents.row(i) {
            for a in 0..D {
                for b in 0..D {
                    let s = projections[i].map_or(if a == b { 1.0 } else { 0.0 }, |s| s[a][b]);
                    p[(D * i + a, D * j + b)] += w as f64 * s;
                }
            }
        }
    }
    p
}

fn random_field<const D: usize>(nodes: usize, seed: u64) -> NodeVectors<D> {
    println!("seed {seed}");
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    (0..nodes).map(|_| std::array::from_fn(|_| rng.random_range(-1.0..1.0))).collect()
}

fn projections<const D: usize>(body: &Body<D>) -> Vec<Option<Matrix<f64, D>>> {
    body.freedoms().iter().map(|freedom| freedom.projection()).collect()
}

fn nodes<const D: usize>(body: &Body<D>) -> Nodes<D> {
    Nodes { ids: body.nodes().to_vec(), period: body.period() }
}

/// R H P against the dense product on two successive levels, sliding nodes and completed blocks
/// included.
fn check_galerkin<const D: usize>(recipe: Recipe<D>, embedding: Embedding) {
    let body = Body::new(recipe);
    let mut nodes = nodes(&body);
    let mut projections = projections(&body);
    let mut matrix = body.hessian(&body.start());
    for _ in 0..2 {
        let (coarse_nodes, prolongation) = nodes.coarsen(embedding);
        assert!(coarse_nodes.ids.len() < nodes.ids.len());
        let coarse = galerkin(&matrix, &projections, &prolongation);
        let p = dense_prolongation(&prolongation, &projections);
        let mut expected = p.transpose() * matrix.to_dense() * &p;
        for (j, s) in coarse.projections.iter().enumerate() {
            if let Some(s) = s {
                let block = expected.view((D * j, D * j), (D, D)).into_owned();
                let largest = block.symmetric_eigenvalues().max();
                for (a, b) in (0..D * D).map(|ab| (ab / D, ab % D)) {
                    expected[(D * j + a, D * j + b)] += largest * (if a == b { 1.0 } else { 0.0 } - s[a][b]);
                }
            }
        }
        let error = (coarse.matrix.to_dense() - &expected).amax() / expected.amax();
        assert!(error < 1e-13, "error {error:e}");
        if D == 3 && recipe.sliding {
            assert!(coarse.projections.iter().any(|s| s.is_some()), "no coarse node slides");
        }
        for block in coarse.matrix.diagonal() {
            let eigenvalues = DMatrix::from_fn(D, D, |a, b| block[a][b]).symmetric_eigenvalues();
            assert!(eigenvalues.min() > 1e-9 * eigenvalues.max(), "{eigenvalues}");
        }
        (nodes, projections, matrix) = (coarse_nodes, coarse.projections, coarse.matrix);
    }
}

#[test]
fn galerkin_is_the_dense_triple_product() {
    for embedding in [Embedding::Linear, Embedding::Quadratic] {
        check_galerkin(SOLID, embedding);
        check_galerkin(FLAT, embedding);
        check_galerkin(Recipe { dual: true, cells: [8, 4, 5], ..SOLID }, embedding);
        check_galerkin(Recipe { period: [Some(12), None], cells: [12, 8], sliding: false, ..FLAT }, embedding);
    }
}

#[test]
fn products_are_the_dense_ones() {
    let body = Body::new(SOLID);
    let matrix = body.hessian(&body.start());
    let x = random_field::<3>(matrix.rows(), 1);
    let mut y = x.clone();
    matrix.multiply(&x, &mut y);
    let dense = matrix.to_dense();
    let expected = &dense * DMatrix::from_column_slice(3 * x.len(), 1, x.as_flattened());
    let error = y.as_flattened().iter().zip(expected.iter()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(error < 1e-13 * expected.amax(), "{error:e}");
    let mut narrow: Vec<[f32; 3]> = vec![[0.0; 3]; x.len()];
    matrix.cast::<f32>().multiply(&x.iter().map(|v| v.map(|x| x as f32)).collect::<Vec<_>>(), &mut narrow);
    let error =
        narrow.as_flattened().iter().zip(expected.iter()).map(|(a, b)| (*a as f64 - b).abs()).fold(0.0, f64::max);
    assert!(error < 1e-5 * expected.amax(), "{error:e}");
    let diagonal = matrix.diagonal();
    assert!((0..3 * x.len()).all(|k| diagonal[k / 3][k % 3][k % 3] == dense[(k, k)]));
}

/// Restriction is the transpose of prolongation: Xᵀ (R r) = (P X)ᵀ r.
#[test]
fn restriction_is_prolongation_transposed() {
    let body = Body::new(SOLID);
    let projections = projections(&body);
    let (coarse, prolongation) = nodes(&body).coarsen(Embedding::Linear);
    let (mut r, x) = (random_field::<3>(projections.len(), 2), random_field::<3>(coarse.ids.len(), 3));
    let mut prolonged: NodeVectors<3> = vec![[0.0; 3]; r.len()];
    prolongation.prolong(&projections, &x, &mut r.clone(), &mut prolonged);
    let right = dot(&prolonged, &r);
    let mut restricted = x.clone();
    prolongation.restrict(&projections, &mut r, &mut restricted);
    let left = dot(&x, &restricted);
    assert!((left - right).abs() < 1e-12 * norm(&x) * norm(&restricted), "{left} {right}");
}

/// The operator as a dense matrix, by its columns.
fn dense_operator<const D: usize>(operator: &mut dyn Preconditioner<D>, nodes: usize) -> DMatrix<f64> {
    let mut dense = DMatrix::zeros(D * nodes, D * nodes);
    for k in 0..D * nodes {
        let mut unit: NodeVectors<D> = vec![[0.0; D]; nodes];
        unit[k / D][k % D] = 1.0;
        let mut column = unit.clone();
        operator.apply(&unit, &mut column);
        dense.set_column(k, &nalgebra::DVector::from_column_slice(column.as_flattened()));
    }
    dense
}

/// Largest difference across the diagonal of a matrix that is scaled to a diagonal of ones.
fn asymmetry(matrix: &DMatrix<f64>) -> f64 {
    let n = matrix.nrows();
    let entry = |i: usize, j: usize| (matrix[(i, j)] - matrix[(j, i)]).abs() / (matrix[(i, i)] * matrix[(j, j)]).sqrt();
    (0..n).flat_map(|i| (0..i).map(move |j| (i, j))).map(|(i, j)| entry(i, j)).fold(0.0, f64::max)
}

fn plan(smoother: Smoother, coarse_solve: CoarseSolve) -> Plan {
    Plan::new(&Implicit { smoother, coarse_solve, ..Implicit::default() })
}

/// With a fixed coarse solve the cycle is symmetric and positive definite, also in directions in
/// which sliding nodes may move.
#[test]
fn cycle_is_symmetric_and_positive_definite() {
    let body = Body::new(Recipe { cells: [5, 3, 3], ..SOLID });
    let dv = body.start();
    let matrix = body.hessian(&dv);
    for smoother in [Smoother::Chebyshev, Smoother::GaussSeidel] {
        let mut cycle = VCycle::<f64, 3>::new(&body, &dv, &matrix, &plan(smoother, CoarseSolve::Fixed));
        assert_eq!(cycle.depth(), 3);
        let dense = dense_operator(&mut cycle, matrix.rows());
        assert!(asymmetry(&dense) < 1e-12, "{smoother:?}: {:e}", asymmetry(&dense));
        let eigenvalues = (0.5 * (&dense + dense.transpose())).symmetric_eigenvalues();
        assert!(eigenvalues.min() > 0.0, "{smoother:?}: {:e}", eigenvalues.min());
    }
    // The published coarse solve stops at a tolerance, so that the cycle is not even linear; the
    // test above would see it.
    let adaptive = plan(Smoother::GaussSeidel, CoarseSolve::Adaptive);
    let mut cycle = VCycle::<f64, 3>::new(&body, &dv, &matrix, &adaptive);
    assert!(asymmetry(&dense_operator(&mut cycle, matrix.rows())) > 1e-9);
}

/// A forward sweep alone is no symmetric operator: the planted error that the test of symmetry must
/// catch.
#[test]
fn symmetric_sweeps_are_symmetric_and_others_are_not() {
    let body = Body::new(Recipe { cells: [5, 3, 3], ..SOLID });
    let mut matrix = body.hessian(&body.start());
    let sweeps = GaussSeidel::new(&matrix, &nodes(&body));
    let dense = dense_operator(&mut SymmetricGaussSeidel { matrix: &matrix, sweeps }, matrix.rows());
    assert!(asymmetry(&dense) < 1e-12, "{:e}", asymmetry(&dense));
    // One block changed on one side of the diagonal only.
    let size = |k: &usize| matrix.blocks[*k][0][0].abs();
    let row = |k: &usize| matrix.row_start.partition_point(|start| start <= k) - 1;
    let beside = (0..matrix.blocks.len()).filter(|k| matrix.columns[*k] as usize != row(k));
    let planted = beside.max_by(|k, l| size(k).total_cmp(&size(l))).unwrap();
    matrix.blocks[planted][0][0] *= 1.01;
    let sweeps = GaussSeidel::new(&matrix, &nodes(&body));
    let dense = dense_operator(&mut SymmetricGaussSeidel { matrix: &matrix, sweeps }, matrix.rows());
    assert!(asymmetry(&dense) > 1e-9, "{:e}", asymmetry(&dense));
}

fn iterations<const D: usize>(
    matrix: &Bsr<f64, D>,
    b: &NodeVectors<D>,
    preconditioner: &mut dyn Preconditioner<D>,
) -> u32 {
    let mut x = b.clone();
    conjugate_gradients(matrix, preconditioner, b, &mut x, |start| 1e-8 * start)
}

#[test]
fn cycle_takes_a_fifth_of_jacobis_iterations() {
    let body = Body::new(Recipe { cells: [12, 5, 6], ..SOLID });
    let dv = body.start();
    let matrix = body.hessian(&dv);
    let b = random_field::<3>(matrix.rows(), 5);
    let jacobi = iterations(&matrix, &b, &mut BlockJacobi::new(&matrix.diagonal()));
    for (smoother, coarse_solve) in
        [(Smoother::Chebyshev, CoarseSolve::Fixed), (Smoother::GaussSeidel, CoarseSolve::Adaptive)]
    {
        let mut cycle = VCycle::<f32, 3>::new(&body, &dv, &matrix, &plan(smoother, coarse_solve));
        let multigrid = iterations(&matrix, &b, &mut cycle);
        println!("{smoother:?} {coarse_solve:?}: {multigrid}, Jacobi {jacobi}");
        assert!(5 * multigrid <= jacobi, "{smoother:?}: {multigrid} against {jacobi}");
    }
}

/// Solutions for some of the nodes against those of the dense matrix, whose entries are changed by `planted`.
fn factor_error<const D: usize>(recipe: Recipe<D>, planted: f64) -> f64 {
    let body = Body::new(recipe);
    let matrix = body.hessian(&body.start());
    let chosen: Vec<u32> = (0..matrix.rows() as u32).filter(|i| i % 7 < 4).collect();
    let factor = Factor::new(&matrix, &nodes(&body), &chosen, f64::INFINITY, ROUNDING).unwrap();
    let mut order = factor.nodes().to_vec();
    let places: Vec<usize> = order.iter().flat_map(|&i| (0..D).map(move |a| D * i as usize + a)).collect();
    let dense = matrix.to_dense().select_rows(&places).select_columns(&places);
    let mut b = random_field::<D>(order.len(), 21);
    let mut expected = nalgebra::DVector::from_column_slice(b.as_flattened());
    (dense * (1.0 + planted)).cholesky().unwrap().solve_mut(&mut expected);
    let mut x: NodeVectors<D> = vec![[0.0; D]; matrix.rows()];
    factor.add_solution(&mut b, &mut x);
    let found = places.iter().map(|&k| x[k / D][k % D]);
    let error = found.zip(expected.iter()).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max) / expected.amax();
    order.sort_unstable();
    assert_eq!(order, chosen);
    error
}

#[test]
fn factor_solves_for_some_of_the_nodes() {
    for error in [
        factor_error(Recipe { youngs: [1e5, 1e6], ..SOLID }, 0.0),
        factor_error(Recipe { youngs: [1e5, 1e6], dual: true, cells: [8, 4, 5], ..SOLID }, 0.0),
        factor_error(FLAT, 0.0),
        factor_error(Recipe { period: [Some(12), None], cells: [12, 8], sliding: false, ..FLAT }, 0.0),
    ] {
        assert!(error < 1e-8, "{error:e}");
    }
    assert!(factor_error(FLAT, 1e-6) > 1e-8);
}

/// A coarse matrix is singular where more coarse nodes than fine ones lie, as at a body's irregular rim.
/// What moves fine nodes is solved for all the same: the rigid motions of stiff bodies depend on it.
#[test]
fn singular_coarse_matrices_are_solved() {
    let body = Body::new(Recipe { cells: [5, 4, 4], youngs: [1e10, 1e10], sliding: false, ..SOLID });
    let (fine, matrix) = (nodes(&body), body.hessian(&body.start()));
    // Beside a fine node that stands alone, eight coarse ones.
    let ids: Vec<_> = (0..8).map(|k| fine.ids[0].index.map(|i| i / 2 + 1000 + (k & 1))).collect();
    let ids = ids.iter().zip(0..8).map(|(at, k)| [at[0], at[1] + (k >> 1 & 1), at[2] + (k >> 2)]);
    let ids: Vec<_> = fine.ids.iter().copied().chain(ids.map(|index| NodeId { grid: 0, index })).collect();
    let n = fine.ids.len() as u32;
    let mut singular = matrix.clone();
    for _ in 0..8 {
        singular.columns.extend(n..n + 8);
        singular.blocks.extend([[[2.0, 1.0, 0.0], [1.0, 3.0, 0.0], [0.0, 0.0, 1.0]]; 8]);
        singular.row_start.push(singular.columns.len());
    }
    let expected = random_field::<3>(singular.rows(), 23);
    let mut b = expected.clone();
    singular.multiply(&expected, &mut b);
    let (mut x, mut again) = (expected.clone(), b.clone());
    let nodes = Nodes { ids, period: fine.period };
    Coarsest::new(CoarseSolve::Fixed, singular.clone(), &nodes).solve(&b, &b, &mut x);
    singular.multiply(&x, &mut again);
    let error = norm(&difference(&again, &b)) / norm(&b);
    assert!(error < 1e-8, "{error:e}");
}

fn condensed<const D: usize>(body: &Body<D>, matrix: &Bsr<f64, D>) -> Condensed<D> {
    Condensed::new(body, matrix, &plan(Smoother::Chebyshev, CoarseSolve::Fixed))
}

#[test]
fn condensed_cycle_is_symmetric_and_positive_definite() {
    let body = Body::new(Recipe { cells: [5, 3, 3], youngs: [1e5, 1e7], ..SOLID });
    let matrix = body.hessian(&body.start());
    let mut hierarchy = condensed(&body, &matrix);
    let dense = dense_operator(&mut Cycle { matrix: &matrix, hierarchy: &mut hierarchy }, matrix.rows());
    assert!(asymmetry(&dense) < 1e-9, "{:e}", asymmetry(&dense));
    let eigenvalues = (0.5 * (&dense + dense.transpose())).symmetric_eigenvalues();
    assert!(eigenvalues.min() > 0.0, "{:e}", eigenvalues.min());
}

/// On one grid stiffness does not matter, nor where it ends. On two it still does, by far less than to
/// the plain cycle.
#[test]
fn condensed_cycles_do_not_grow_with_stiffness() {
    for dual in [false, true] {
        let count = |youngs: [f64; 2]| {
            let body = Body::new(Recipe { cells: [12, 5, 6], youngs, dual, sliding: false, ..SOLID });
            let matrix = body.hessian(&body.start());
            let b = random_field::<3>(matrix.rows(), 22);
            let mut hierarchy = condensed(&body, &matrix);
            let condensed = iterations(&matrix, &b, &mut Cycle { matrix: &matrix, hierarchy: &mut hierarchy });
            let plan = plan(Smoother::Chebyshev, CoarseSolve::Fixed);
            let mut plain = VCycle::<f64, 3>::new(&body, &body.start(), &matrix, &plan);
            let plain = iterations(&matrix, &b, &mut plain);
            println!("dual {dual}, {youngs:?} Pa: {condensed}, plain {plain}");
            [condensed, plain]
        };
        let [soft, _] = count([1e5, 1e5]);
        for youngs in [[1e10, 1e10], [1e5, 1e10]] {
            let [stiff, plain] = count(youngs);
            assert!(10 * stiff <= plain, "{stiff} against {plain}");
            assert!(dual || 2 * stiff <= 3 * soft, "{stiff} against {soft}");
        }
    }
}

const METHODS: [Method; 9] = [
    Method::Hot,
    Method::HotQuadratic,
    Method::PnPcg,
    Method::PnPcgMf,
    Method::PnPcgSgs,
    Method::PnMgpcg,
    Method::LbfgsH,
    Method::LbfgsGmg,
    Method::Gast15,
];

/// All methods find the same minimiser.
#[test]
fn methods_agree() {
    let mut body = Body::new(Recipe { cells: [8, 4, 4], youngs: [1e5, 1e7], ..SOLID });
    let settings =
        |method: Method, tolerance: f64| Implicit { method, tolerance: Some(tolerance), ..Implicit::default() };
    let reference = solve(&mut body, &settings(Method::PnMgpcg, 1e-12));
    println!("reference {:?}", reference.1);
    for method in METHODS {
        let (dv, solved) = solve(&mut body, &settings(method, 1e-10));
        let error = norm(&difference(&dv, &reference.0)) / norm(&reference.0);
        println!("{method:?}: error {error:.1e}, {solved:?}");
        let mut gradient = dv.clone();
        body.energy_and_gradient(&dv, &mut gradient);
        assert!(solved.converged, "{method:?}: {solved:?}");
        assert_eq!(solved.residual, residual(&body, &gradient), "{method:?}");
        assert!(error < 1e-3, "{method:?}: {error:e}");
    }
}

/// The same bits on one thread and on two.
#[test]
fn threads_do_not_change_the_result() {
    for method in [Method::Hot, Method::PnPcgSgs] {
        for smoother in [Smoother::Chebyshev, Smoother::GaussSeidel] {
            let settings = Implicit { method, smoother, ..Implicit::default() };
            let run = |threads: usize| {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                let mut body = Body::new(Recipe { cells: [9, 4, 5], youngs: [1e5, 1e6], ..SOLID });
                pool.install(|| solve(&mut body, &settings))
            };
            assert_eq!(run(1), run(2), "{method:?}, {smoother:?}");
        }
    }
}
