//! The step's objective against itself: gradient and Hessian against differences, the matrix
//! against the product without one.

use rand::{Rng, SeedableRng, rngs::StdRng};

use super::{Potential, project};
use crate::contract::NoControl;
use crate::implicit::physics::discretisation::Discretisation;
use crate::implicit::physics::state::{BodySetup, setups};
use crate::implicit::solver::objective::{NodeVectors, Objective};
use crate::implicit::solver::solve;
use crate::implicit::solver::verbs::{difference, norm};
use gridfall_core::maths::linalg::dot;
use gridfall_core::sim::settings::{Implicit, Method};
use gridfall_core::sim::setup::Problem;
use gridfall_scene::{self as scene, Limits};

const SEED: u64 = 20261122;
const DT_S: f64 = 0.01;

/// A slab of two materials on a slip floor and against a slip wall, in the grip of a turning block,
/// with random F, v and B.
fn problem(dimension: usize, kernel: &str, transfer: &str, random: &mut StdRng) -> Problem {
    let three = |x: &str| if dimension == 3 { x.to_owned() } else { String::new() };
    let json = format!(
        r#"{{ "gridfall": 1, "name": "slab", "dimension": {dimension},
        "domain": {{ "min": [0, 0{z}], "max": [0.8, 0.8{one}], "dx": 0.1,
          "boundary": {{ "x-": {{ "contact": "slip" }}, "y-": {{ "contact": "slip" }} }} }},
        "gravity": [1, -9.81{z}],
        "materials": {{ "soft": {{ "model": "fixed-corotated", "density": 1000, "youngs_modulus": 1e5,
          "poissons_ratio": 0.3 }},
                        "stiff": {{ "model": "neo-hookean", "density": 2000, "youngs_modulus": 1e7,
                          "poissons_ratio": 0.4 }} }},
        "bodies": [
          {{ "name": "a", "material": "soft", "sampling": "jittered",
            "shape": {{ "box": {{ "min": [0, 0{two}], "max": [0.2, 0.3{four}] }} }} }},
          {{ "name": "b", "material": "stiff", "sampling": "jittered",
            "shape": {{ "box": {{ "min": [0.2, 0{two}], "max": [0.4, 0.3{four}] }} }} }} ],
        "colliders": [ {{ "name": "grip", "contact": "sticky", "shape": {{ "box": {{ "min": [0, 0.26{z}],
          "max": [0.8, 0.8{one}] }} }},
                          "motion": {{ "angular_velocity": [{spin}], "center": [0.2, 0.3{z}] }} }} ],
        "time": {{ "end": 1, "frame_rate": 10 }},
        "solver": {{ "integrator": "implicit", "kernel": "{kernel}", "transfer": "{transfer}",
          "contact": "nodes", "precision": "f64" }} }}"#,
        z = three(", 0"),
        one = three(", 0.8"),
        two = three(", 0.2"),
        four = three(", 0.4"),
        spin = if dimension == 3 { "0, 0, 0.5" } else { "0.5" },
    );
    let scene = scene::parse(&json).unwrap_or_else(|faults| panic!("{faults:?}"));
    let mut problem = scene::problem(&scene, &Limits::default()).unwrap_or_else(|faults| panic!("{faults:?}"));
    let d = dimension;
    let p = &mut problem.particles;
    for i in 0..p.len() {
        for a in 0..d {
            p.v[i][a] = random.random_range(-1.0..1.0);
            for b in 0..d {
                p.b[i][3 * a + b] = random.random_range(-0.01..0.01);
                p.f[i][3 * a + b] += random.random_range(-0.2..0.2);
            }
        }
    }
    problem
}

/// All that a potential borrows.
struct Step<const D: usize> {
    problem: Problem,
    bodies: Vec<BodySetup>,
    discretisation: Discretisation<D>,
}

impl<const D: usize> Step<D> {
    fn new(problem: Problem) -> Self {
        let bodies = setups::<D>(&problem.setup);
        let discretisation = Discretisation::new(&problem.setup, &bodies, &problem.particles, 0.0, DT_S);
        Self { problem, bodies, discretisation }
    }

    fn potential(&self) -> Potential<'_, D> {
        Potential::new(&self.problem.setup, &self.bodies, &self.discretisation, &NoControl)
    }
}

fn random_field<const D: usize>(potential: &Potential<D>, size: f64, random: &mut StdRng) -> NodeVectors<D> {
    let any = |_| std::array::from_fn(|_| random.random_range(-size..size));
    let mut field: NodeVectors<D> = (0..potential.nodes().len()).map(any).collect();
    project(potential.freedoms(), &mut field);
    field
}

fn inner<const D: usize>(a: &NodeVectors<D>, b: &NodeVectors<D>) -> f64 {
    a.iter().zip(b).map(|(a, b)| dot(a, b)).sum()
}

fn moved<const D: usize>(a: &NodeVectors<D>, s: f64, b: &NodeVectors<D>) -> NodeVectors<D> {
    a.iter().zip(b).map(|(a, b)| std::array::from_fn(|k| a[k] + s * b[k])).collect()
}

fn every_case(check: impl Fn(Problem, &str, &mut StdRng)) {
    println!("seed {SEED}");
    let mut random = StdRng::seed_from_u64(SEED);
    for dimension in [2, 3] {
        for (kernel, transfer) in [
            ("quadratic", "apic"),
            ("quadratic", "mls"),
            ("compact", "apic"),
            ("compact", "mls"),
            ("compact", "mls-published"),
        ] {
            let what = format!("{dimension}D {kernel} {transfer}");
            check(problem(dimension, kernel, transfer, &mut random), &what, &mut random);
        }
    }
}

fn differences<const D: usize>(problem: Problem, what: &str, random: &mut StdRng) {
    let step = Step::<D>::new(problem);
    let potential = step.potential();
    assert!(potential.freedoms().iter().any(|f| f.projection().is_some()), "{what}: nothing slides");
    assert!(potential.nodes().len() < step.discretisation.nodes.len(), "{what}: nothing is held");
    let start = potential.start();
    let (p, q) = (random_field(&potential, 1.0, random), random_field(&potential, 1.0, random));
    let mut gradient = NodeVectors::new();
    potential.energy_and_gradient(&start, &mut gradient);
    let h = 1e-5;
    let slope = (potential.energy(&moved(&start, h, &p)) - potential.energy(&moved(&start, -h, &p))) / (2.0 * h);
    let expected = inner(&gradient, &p);
    assert!((slope - expected).abs() < 1e-6 * expected.abs().max(1.0), "{what}: {slope} against {expected}");

    // The Hessian is projected per particle; where that changed nothing it is the gradient's
    // derivative. Directions that stretch little are: compare where the quadratic forms agree, and
    // demand it of the product and the matrix everywhere.
    let matrix = potential.hessian(&start);
    let product = potential.linearised(&start);
    let (mut without, mut with) = (NodeVectors::new(), vec![[0.0; D]; p.len()]);
    product.apply(&p, &mut without);
    for i in 0..p.len() {
        for k in matrix.row_start[i]..matrix.row_start[i + 1] {
            for a in 0..D {
                with[i][a] += dot(&matrix.blocks[k][a], &p[matrix.columns[k] as usize]);
            }
        }
    }
    let error = inner(&moved(&with, -1.0, &without), &moved(&with, -1.0, &without)).sqrt() / inner(&with, &with).sqrt();
    assert!(error < 1e-12, "{what}: the matrix and the product differ by {error}");
    for (i, block) in product.diagonal().iter().enumerate() {
        let at = (matrix.row_start[i]..matrix.row_start[i + 1]).find(|&k| matrix.columns[k] as usize == i).unwrap();
        let size: f64 = block.iter().flatten().map(|x| x.abs()).sum();
        for a in 0..D {
            for b in 0..D {
                assert!((block[a][b] - matrix.blocks[at][a][b]).abs() < 1e-12 * size, "{what}: diagonal block {i}");
            }
        }
    }
    // Symmetric and positive.
    let mut from_q = NodeVectors::new();
    product.apply(&q, &mut from_q);
    let (qp, pq) = (inner(&q, &without), inner(&p, &from_q));
    assert!((qp - pq).abs() < 1e-12 * inner(&p, &without).abs(), "{what}: {qp} against {pq}");
    assert!(inner(&p, &without) > 0.0 && inner(&q, &from_q) > 0.0);
}

#[test]
fn gradient_matrix_and_product_belong_to_the_energy() {
    every_case(|problem, what, random| match problem.setup.dimension {
        2 => differences::<2>(problem, what, random),
        _ => differences::<3>(problem, what, random),
    });
}

/// At rest nothing is projected, and the matrix is the derivative of the gradient.
#[test]
fn the_matrix_at_rest_is_the_derivative_of_the_gradient() {
    every_case(|mut problem, what, random| {
        problem.particles.f.fill(gridfall_core::sim::particles::IDENTITY);
        problem.particles.v.fill([0.0; 3]);
        problem.particles.b.fill([0.0; 9]);
        problem.setup.gravity = [0.0; 3];
        problem.setup.colliders.clear();
        match problem.setup.dimension {
            2 => derivative::<2>(problem, what, random),
            _ => derivative::<3>(problem, what, random),
        }
    });
}

fn derivative<const D: usize>(problem: Problem, what: &str, random: &mut StdRng) {
    let step = Step::<D>::new(problem);
    let potential = step.potential();
    let (start, p) = (potential.start(), random_field(&potential, 1.0, random));
    let (mut ahead, mut behind, mut product) = (NodeVectors::new(), NodeVectors::new(), NodeVectors::new());
    let h = 1e-5;
    potential.energy_and_gradient(&moved(&start, h, &p), &mut ahead);
    potential.energy_and_gradient(&moved(&start, -h, &p), &mut behind);
    potential.linearised(&start).apply(&p, &mut product);
    let difference = moved(&ahead, -1.0, &behind);
    let error = moved(&difference, -2.0 * h, &product);
    let relative = (inner(&error, &error) / inner(&difference, &difference)).sqrt();
    assert!(relative < 1e-8, "{what}: {relative}");
}

/// Alternating directions reach the minimum that L-BFGS finds, both to their tolerance; with
/// sliding nodes and two laws.
#[test]
fn alternating_directions_find_the_same_minimum() {
    println!("seed {SEED}");
    let mut random = StdRng::seed_from_u64(SEED);
    for kernel in ["quadratic", "compact"] {
        let mut problem = problem(2, kernel, "apic", &mut random);
        for f in &mut problem.particles.f {
            // Less strained, so that the energy is convex there.
            for (k, entry) in f.iter_mut().enumerate() {
                let rest = if k % 4 == 0 { 1.0 } else { 0.0 };
                *entry = rest + 0.1 * (*entry - rest);
            }
        }
        let step = Step::<2>::new(problem);
        let minimise = |method: Method, tolerance: f64| {
            solve(&mut step.potential(), &Implicit { method, tolerance: Some(tolerance), ..Implicit::default() })
        };
        let (expected, reference) = minimise(Method::Hot, 1e-10);
        let (found, solved) = minimise(Method::Admm, 1e-8);
        println!("{kernel}: {reference:?} {solved:?}");
        assert!(reference.converged && solved.converged);
        let error = difference(&found, &expected);
        assert!(norm(&error) < 1e-3 * norm(&expected), "{kernel}: {:e} of {:e}", norm(&error), norm(&expected));
    }
}
