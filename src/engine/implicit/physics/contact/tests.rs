//! Contact of a step's particles: its part of the potential against differences, and what surfaces take against
//! what particles lose.

use rand::{Rng, SeedableRng, rngs::StdRng};

use super::*;
use crate::contract::NoControl;
use crate::implicit::physics::discretisation::Discretisation;
use crate::implicit::physics::potential::Potential;
use crate::implicit::physics::state::{BodySetup, setups};
use crate::implicit::physics::transfer::grid_to_particles;
use crate::implicit::solver::objective::Objective;
use gridfall_core::maths::linalg::apply;
use gridfall_core::sim::reaction::{self, Reaction};
use gridfall_core::sim::setup::{ContactAt, Problem};
use gridfall_scene::{self as scene, Limits};

const SEED: u64 = 20261203;
const DT_S: f64 = 0.01;

/// A block that holds on to a sticky plate, lies on a rough one, is pressed by a slanted lid and led by a slip wall,
/// none of which lie on nodes; with random F, v and B.
fn problem(dimension: usize, kernel: &str, random: &mut StdRng) -> Problem {
    let three = |x: &str| if dimension == 3 { x.to_owned() } else { String::new() };
    let json = format!(
        r#"{{ "gridfall": 1, "name": "block", "dimension": {dimension},
        "domain": {{ "min": [0, 0{z}], "max": [0.8, 0.8{one}], "dx": 0.1 }},
        "gravity": [1, -9.81{z}],
        "materials": {{ "m": {{ "model": "fixed-corotated", "density": 1000, "youngs_modulus": 1e5,
          "poissons_ratio": 0.3 }} }},
        "bodies": [ {{ "name": "b", "material": "m", "sampling": "jittered",
            "shape": {{ "box": {{ "min": [0.22, 0.23{two}], "max": [0.58, 0.47{four}] }} }} }} ],
        "colliders": [
          {{ "name": "floor", "contact": "separate", "friction": 0.4,
            "shape": {{ "box": {{ "min": [0.4, 0.1{z}], "max": [0.8, 0.24{one}] }} }},
            "motion": {{ "linear_velocity": [0.1, 1{z}], "angular_velocity": [{spin}], "center": [0.4, 0.2{z}] }} }},
          {{ "name": "shelf", "contact": "sticky",
            "shape": {{ "box": {{ "min": [0, 0.1{z}], "max": [0.3, 0.22{one}] }} }},
            "motion": {{ "linear_velocity": [0.2, 0.1{z}] }} }},
          {{ "name": "rail", "contact": "slip",
            "shape": {{ "box": {{ "min": [0, 0.25{z}], "max": [0.21, 0.8{one}] }} }} }},
          {{ "name": "lid", "contact": "separate", "friction": 0.2,
            "shape": {{ "half-space": {{ "point": [0.5, 0.46{mid}], "normal": [0.3, -1{z}] }} }},
            "motion": {{ "linear_velocity": [0, -1{z}] }} }} ],
        "time": {{ "end": 1, "frame_rate": 10 }},
        "solver": {{ "integrator": "implicit", "kernel": "{kernel}", "transfer": "mls", "precision": "f64" }} }}"#,
        z = three(", 0"),
        one = three(", 0.8"),
        two = three(", 0.2"),
        four = three(", 0.4"),
        mid = three(", 0.3"),
        spin = if dimension == 3 { "0, 0, 0.5" } else { "0.5" },
    );
    let scene = scene::parse(&json).unwrap_or_else(|faults| panic!("{faults:?}"));
    let mut problem = scene::problem(&scene, &Limits::default()).unwrap_or_else(|faults| panic!("{faults:?}"));
    problem.setup.contact_at = ContactAt::Particles;
    let p = &mut problem.particles;
    for i in 0..p.len() {
        for a in 0..dimension {
            p.v[i][a] = random.random_range(-1.0..1.0);
            for b in 0..dimension {
                p.b[i][3 * a + b] = random.random_range(-0.005..0.005);
                p.f[i][3 * a + b] += random.random_range(-0.01..0.01);
            }
        }
    }
    touch::begin(&problem.setup, p, 0.0);
    // Springs that are stretched already.
    for touch in p.touch.iter_mut().filter(|touch| touch.with != 0) {
        (0..dimension).for_each(|a| touch.stretch[a] = random.random_range(-0.01..0.01));
    }
    problem
}

fn every_case(check: impl Fn(&Problem, &str, &mut StdRng), twice: impl Fn(&Problem, &str, &mut StdRng)) {
    println!("seed {SEED}");
    let mut random = StdRng::seed_from_u64(SEED);
    for kernel in ["quadratic", "compact"] {
        check(&problem(2, kernel, &mut random), &format!("2D {kernel}"), &mut random);
        twice(&problem(3, kernel, &mut random), &format!("3D {kernel}"), &mut random);
    }
}

fn step<const D: usize>(problem: &Problem) -> (Vec<BodySetup>, Discretisation<D>) {
    let bodies = setups::<D>(&problem.setup);
    let grid = Discretisation::new(&problem.setup, &bodies, &problem.particles, 0.0, DT_S);
    (bodies, grid)
}

fn random_field<const D: usize>(n: usize, size: f64, random: &mut StdRng) -> NodeVectors<D> {
    (0..n).map(|_| std::array::from_fn(|_| random.random_range(-size..size))).collect()
}

fn moved<const D: usize>(a: &NodeVectors<D>, s: f64, b: &NodeVectors<D>) -> NodeVectors<D> {
    a.iter().zip(b).map(|(a, b)| std::array::from_fn(|k| a[k] + s * b[k])).collect()
}

fn inner<const D: usize>(a: &NodeVectors<D>, b: &NodeVectors<D>) -> f64 {
    a.iter().zip(b).map(|(a, b)| dot(a, b)).sum()
}

/// Σ w of what particles bring, at all nodes.
fn scattered<const D: usize>(
    grid: &Discretisation<D>,
    brought: impl Fn(usize) -> Option<Vector<f64, D>>,
) -> NodeVectors<D> {
    let mut sums = vec![[0.0; D]; grid.nodes.len()];
    for p in 0..grid.state.x.len() {
        let Some(brought) = brought(p) else { continue };
        let nodes = grid.topology.nodes_of(grid.topology.group_of[p] as usize);
        for (w, &node) in grid.topology.stencil(p).0.iter().zip(nodes) {
            (0..D).for_each(|a| sums[node as usize][a] += w * brought[a]);
        }
    }
    sums
}

/// The gradient of the potential along random directions, with and without friction; the stiffness, as matrix, product
/// and diagonal.
fn derivatives<const D: usize>(problem: &Problem, what: &str, random: &mut StdRng) {
    let (bodies, grid) = step::<D>(problem);
    let mut potential = Potential::new(&problem.setup, &bodies, &grid, &NoControl);
    let start = potential.start();
    let n = start.len();
    for friction in [false, true] {
        if friction {
            let (_, impulses) = potential.energy_and_forces(&start);
            potential = potential.with_friction(start.clone(), &impulses);
            assert!(potential.limits().iter().filter(|&&limit| limit > 0.0).count() >= 3, "{what}");
        }
        let (at, p) = (moved(&start, 1.0, &random_field(n, 0.1, random)), random_field(n, 1.0, random));
        let mut gradient = NodeVectors::new();
        potential.energy_and_gradient(&at, &mut gradient);
        let h = 1e-6;
        let slope = (potential.energy(&moved(&at, h, &p)) - potential.energy(&moved(&at, -h, &p))) / (2.0 * h);
        let expected = inner(&gradient, &p);
        assert!((slope - expected).abs() < 1e-6 * expected.abs(), "{what}: {slope} against {expected}");

        let (matrix, product) = (potential.hessian(&at), potential.linearised(&at));
        let (mut with, mut without) = (vec![[0.0; D]; n], NodeVectors::new());
        product.apply(&p, &mut without);
        for i in 0..n {
            for k in matrix.row_start[i]..matrix.row_start[i + 1] {
                (0..D).for_each(|a| with[i][a] += dot(&matrix.blocks[k][a], &p[matrix.columns[k] as usize]));
            }
        }
        let error = moved(&with, -1.0, &without);
        assert!(inner(&error, &error) < 1e-24 * inner(&with, &with), "{what}: {error:?}");
        for (block, diagonal) in matrix.diagonal().iter().zip(product.diagonal()) {
            let size: f64 = block.iter().flatten().map(|x| x.abs()).sum();
            let far = (0..D * D).any(|k| (block[k / D][k % D] - diagonal[k / D][k % D]).abs() > 1e-12 * size);
            assert!(!far, "{what}: {block:?} against {diagonal:?}");
        }
        // What faces add to it is the derivative of what they add to the gradient.
        let faces = grid.faces(&problem.setup).limited(potential.limits());
        let responses = |dv: &NodeVectors<D>| faces.responses(&grid.velocities(dv));
        let forces = |dv: &NodeVectors<D>| {
            let pressed = responses(dv);
            scattered(&grid, |p| faces.of(&pressed, p).map(|r| r.force.map(|f| -DT_S * f)))
        };
        let (ahead, behind) = (forces(&moved(&at, h, &p)), forces(&moved(&at, -h, &p)));
        let change = moved(&ahead, -1.0, &behind).iter().map(|f| f.map(|f| f / (2.0 * h))).collect();
        let points = faces.stiffness(&responses(&at));
        let stiffness = scattered(&grid, |particle| {
            let (mut u, (w, _)) = ([0.0; D], grid.topology.stencil(particle));
            let nodes = grid.topology.nodes_of(grid.topology.group_of[particle] as usize);
            for (w, x) in w.iter().zip(nodes).filter_map(|(w, node)| Some((w, p.get(*node as usize)?))) {
                (0..D).for_each(|a| u[a] += w * x[a]);
            }
            points.get(particle).map(|k| apply(k, &u))
        });
        let error = moved(&change, -1.0, &stiffness);
        let relative = (inner(&error, &error) / inner(&change, &change)).sqrt();
        println!("{what}, friction {friction}: stiffness off by {relative:.1e}");
        assert!(relative < 1e-6, "{what}: {relative}");
    }
}

#[test]
fn gradient_and_stiffness_belong_to_the_energy() {
    every_case(derivatives::<2>, derivatives::<3>);
}

/// Momentum that gravity, faces and nothing else bring; and the moment of a face's force.
fn balance<const D: usize>(problem: &Problem, what: &str, random: &mut StdRng) {
    let (bodies, grid) = step::<D>(problem);
    let potential = Potential::new(&problem.setup, &bodies, &grid, &NoControl);
    let at = moved(&potential.start(), 1.0, &random_field(potential.start().len(), 0.3, random));
    let velocities = grid.velocities(&at);
    let mut faces = grid.faces(&problem.setup);
    faces.renew(&velocities);
    assert!(faces.rub());
    let responses = faces.responses(&velocities);
    let share = grid.topology.interpolation.shape.share;
    // Through the nodes.
    let nodes = scattered(&grid, |p| faces.of(&responses, p).map(|response| response.force.map(|f| DT_S * f)));
    let given: [f64; D] = std::array::from_fn(|a| share * nodes.iter().map(|impulse| impulse[a]).sum::<f64>());
    // As surfaces count it, of particles that go through no face.
    let mut sums = vec![Reaction::default(); reaction::surfaces(&problem.setup)];
    let (mut after, _) = grid_to_particles(&problem.setup, &grid.topology, &grid.state, &bodies, &velocities, DT_S);
    let before: Vec<_> = after.v.clone();
    faces.settle(&bodies, &mut after, &mut sums);
    let stops: [f64; D] = std::array::from_fn(|a| {
        let change = |p: usize| bodies[after.body[p] as usize].mass * (after.v[p][a] - before[p][a]);
        (0..before.len()).map(change).sum()
    });
    let size = sums.iter().flat_map(|sum| sum.force).fold(0.0, |m: f64, f| m.max(f.abs()));
    for a in 0..D {
        let taken: f64 = sums.iter().map(|sum| sum.force[a]).sum();
        let error = (taken + given[a] + stops[a]).abs();
        assert!(error < 1e-12 * size, "{what}: surfaces took {taken}, nodes got {given:?}, stops {stops:?}");
    }
    assert!(sums[reaction::WALLS..].iter().all(|sum| sum.force != [0.0; 3]), "{what}: {sums:?}");
}

#[test]
fn surfaces_take_what_particles_lose() {
    every_case(balance::<2>, balance::<3>);
}
