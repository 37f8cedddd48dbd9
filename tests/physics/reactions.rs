//! Forces and torques on walls and colliders: they receive the momentum that the material loses.

use crate::problems::*;
use gridfall_core::sim::collider::{ALWAYS, Collider, Motion, Primitive, Sdf, SdfOp};
use gridfall_core::sim::particles::{IDENTITY, Particles};
use gridfall_core::sim::reaction::{Reaction, WALLS};
use gridfall_core::sim::setup::{Axis, Contact, Problem};
use gridfall_engine::explicit::cpu::CpuEngine;
use gridfall_engine::{Engine, NoControl};
use gridfall_scene::schema::{ContactKind, Kernel, Precision};

const DX: f64 = 1.0 / 32.0;

fn solid(primitive: Primitive, at: Vec3, kind: ContactKind, friction: f64, motion: Motion) -> Collider {
    let sdf = Sdf { ops: vec![SdfOp::Primitive { primitive, rotation: IDENTITY, translation: at }] };
    let contact = Contact { kind, friction };
    let motion = Motion { center: at, ..motion };
    Collider { name: "solid".into(), sdf, contact, motion, present_s: ALWAYS, grip: false }
}

/// Runs frames. Returns the mean reactions over the last `measured` of them.
fn mean(problem: &Problem, settle: usize, measured: usize) -> (Vec<Reaction>, Particles) {
    let mut engine = CpuEngine::new(&problem.setup, problem.particles.clone()).unwrap();
    let mut sums = vec![Reaction::default(); WALLS + problem.setup.colliders.len()];
    for frame in 0..settle + measured {
        let stats = engine.advance_frame(problem.setup.frame_s, &NoControl).unwrap();
        if frame >= settle {
            sums.iter_mut().zip(&stats.reactions).for_each(|(sum, r)| sum.add(&r.times(1.0 / measured as f64)));
        }
    }
    (sums, engine.snapshot().unwrap())
}

/// Momentum changes only by gravity and by what the surfaces take, to rounding.
#[test]
fn surfaces_take_all_the_momentum_that_is_lost() {
    for (dimension, kernel) in [(3, Kernel::Compact), (3, Kernel::Quadratic), (2, Kernel::Compact), (2, Kernel::Cubic)]
    {
        let mut problem = empty(dimension, [12.0, 12.0, 12.0], DX);
        problem.setup.kernel = kernel;
        problem.setup.axes[0] = walls(ContactKind::Slip);
        problem.setup.axes[1] = Axis::Walls([Contact { kind: ContactKind::Separate, friction: 0.3 }; 2]);
        problem.setup.gravity = if dimension == 3 { [1.0, -2.0, -9.0] } else { [1.0, -9.0, 0.0] };
        let middle = if dimension == 3 { 6.0 * DX } else { 0.0 };
        let corner = if dimension == 3 { 2.0 * DX } else { 0.0 };
        let block = in_box([DX, DX, corner], [8.0 * DX, 6.0 * DX, 8.0 * DX]);
        fill(&mut problem, elastic(1e4, 0.3, 1000.0), 2, block, uniform([0.5, -1.0, 0.0]));
        let turning =
            Motion { linear_velocity: [-0.2, 0.0, 0.0], angular_velocity: [0.0, 0.0, 3.0], ..Motion::default() };
        let at = [8.0 * DX, 5.0 * DX, middle];
        problem.setup.colliders.push(solid(Primitive::Sphere(2.3 * DX), at, ContactKind::Separate, 0.4, turning));
        let held = solid(
            Primitive::Sphere(1.3 * DX),
            [3.0 * DX, 4.0 * DX, middle],
            ContactKind::Sticky,
            0.0,
            Motion::default(),
        );
        problem.setup.colliders.push(held);
        let frames = 6;
        let (reactions, after) = mean(&problem, 0, frames);
        let t = frames as f64 * problem.setup.frame_s;
        let (before, after) = (momentum(&problem, &problem.particles), momentum(&problem, &after));
        let m: f64 = (0..problem.particles.len()).map(|i| mass(&problem, &problem.particles, i)).sum();
        let touched = reactions.iter().filter(|r| norm(r.force) > 0.0).count();
        assert!(touched >= 4, "{kernel:?} {dimension}D: only {touched} surfaces were touched");
        for a in 0..dimension {
            let taken: f64 = reactions.iter().map(|r| r.force[a]).sum::<f64>() * t;
            let lost = before[a] + m * problem.setup.gravity[a] * t - after[a];
            assert!((taken - lost).abs() < 1e-11 * m, "{kernel:?} {dimension}D axis {a}: {taken} taken, {lost} lost");
        }
    }
}

/// A spinning core drags a jelly along. The torque on the core opposes its rotation, and the jelly
/// gains the angular momentum that the core gives.
#[test]
fn a_core_that_spins_a_body_up_bears_the_torque() {
    let mut problem = empty(3, [16.0, 16.0, 16.0], DX);
    let c = [8.0 * DX; 3];
    fill(&mut problem, elastic(1e4, 0.3, 1000.0), 2, in_ball(c, 4.0 * DX), uniform([0.0; 3]));
    let spinning = Motion { angular_velocity: [0.0, 0.0, 2.0], ..Motion::default() };
    problem.setup.colliders.push(solid(Primitive::Sphere(2.5 * DX), c, ContactKind::Sticky, 0.0, spinning));
    let frames = 2;
    let (reactions, after) = mean(&problem, 0, frames);
    let torque = reactions[WALLS].torque;
    let (p, l) = (momentum(&problem, &after), angular_momentum(&problem, &after));
    let gained: Vec3 = std::array::from_fn(|a| {
        let (r, s) = ((a + 1) % 3, (a + 2) % 3);
        l[a] - (c[r] * p[s] - c[s] * p[r])
    });
    let given: Vec3 = std::array::from_fn(|a| -torque[a] * frames as f64 * problem.setup.frame_s);
    println!("torque {torque:?}, spin gained {gained:?}, given {given:?}");
    assert!(torque[2] < 0.0);
    assert!((0..3).all(|a| (gained[a] - given[a]).abs() < 1e-11));
}

/// A block at rest on a table weighs m g.
#[test]
fn a_block_at_rest_weighs_what_it_should() {
    for precision in [Precision::F64, Precision::F32] {
        let mut problem = empty(3, [12.0, 12.0, 12.0], DX);
        problem.setup.precision = precision;
        problem.setup.gravity = [0.0, 0.0, -9.81];
        let block = in_box([4.0 * DX, 4.0 * DX, 4.0 * DX], [8.0 * DX, 8.0 * DX, 7.0 * DX]);
        fill(&mut problem, neo_hookean(1e5, 0.3, 1000.0), 2, block, uniform([0.0; 3]));
        let table = Primitive::Box([6.0 * DX, 6.0 * DX, 2.0 * DX]);
        let at = [6.0 * DX, 6.0 * DX, 2.0 * DX];
        problem.setup.colliders.push(solid(table, at, ContactKind::Separate, 0.3, Motion::default()));
        let (reactions, _) = mean(&problem, 12, 36);
        let weight = 9.81 * 1000.0 * 48.0 * DX.powi(3);
        let force = reactions[WALLS].force;
        println!("{precision:?}: {force:?} N on the table, weight {weight} N");
        assert!((force[2] / -weight - 1.0).abs() < 0.02);
        assert!(force[0].abs().max(force[1].abs()) < 0.01 * weight);
        assert!(reactions[..WALLS].iter().all(|r| *r == Reaction::default()));
    }
}

/// The floor under a still column of water carries ρ V g, and opposite walls carry equal forces.
#[test]
fn walls_bear_a_column_of_water() {
    for kernel in [Kernel::Compact, Kernel::Quadratic] {
        let mut problem = empty(2, [8.0, 24.0, 1.0], DX);
        problem.setup.kernel = kernel;
        problem.setup.gravity = [0.0, -9.81, 0.0];
        problem.setup.axes[0] = walls(ContactKind::Slip);
        fill(&mut problem, fluid(1e6, 1.0), 2, in_box([0.0; 3], [8.0 * DX, 16.0 * DX, 0.0]), uniform([0.0; 3]));
        let (reactions, _) = mean(&problem, 24, 48);
        let weight = 1000.0 * 9.81 * 8.0 * 16.0 * DX * DX;
        let floor = reactions[2].force[1];
        let [left, right] = [reactions[0].force[0], reactions[1].force[0]];
        println!("{kernel:?}: floor {:.4} of ρVg, sides {left:.2} and {right:.2} N/m", -floor / weight);
        assert!((floor / -weight - 1.0).abs() < 0.02, "{kernel:?}: {floor} N/m, weight {weight} N/m");
        assert!((left + right).abs() < 0.01 * right, "{kernel:?}: {left} and {right} N/m");
    }
}

#[test]
fn sums_do_not_depend_on_the_number_of_threads() {
    let mut problem = empty(3, [12.0, 12.0, 12.0], DX);
    problem.setup.precision = Precision::F32;
    problem.setup.gravity = [0.0, -1.0, -9.81];
    fill(&mut problem, fluid(1e4, 0.0), 2, in_box([0.0; 3], [8.0 * DX; 3]), uniform([1.0, 0.0, 0.0]));
    let one = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| mean(&problem, 0, 2).0)
    };
    assert_eq!(one(1), one(3));
}
