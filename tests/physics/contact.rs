//! Walls and colliders: sticking, sliding, separation and moving obstacles.

use crate::problems::*;
use gridfall_core::sim::collider::{ALWAYS, Collider, Motion, Primitive, Sdf, SdfOp};
use gridfall_core::sim::particles::IDENTITY;
use gridfall_core::sim::setup::{Axis, Contact, Problem};
use gridfall_engine::explicit::cpu::{CpuEngine, NodeState, stages};
use gridfall_engine::implicit::ImplicitEngine;
use gridfall_engine::{Engine, EngineError, NoControl};
use gridfall_scene::schema::{ContactKind, Kernel};

const DX: f64 = 1.0 / 32.0;
const KERNELS: [Kernel; 4] = [Kernel::Compact, Kernel::Quadratic, Kernel::Cubic, Kernel::Linear];

fn contact(kind: ContactKind, friction: f64) -> Contact {
    Contact { kind, friction }
}

/// A block on the floor, moving along it and into it.
fn block_on_floor(kernel: Kernel, floor: Contact) -> Problem {
    let mut problem = empty(3, [16.0, 12.0, 12.0], DX);
    problem.setup.kernel = kernel;
    problem.setup.axes[2] = Axis::Walls([floor, contact(ContactKind::Separate, 0.0)]);
    let block = in_box([4.0 * DX, 4.0 * DX, 0.0], [8.0 * DX, 8.0 * DX, 3.0 * DX]);
    fill(&mut problem, elastic(1e5, 0.3, 1000.0), 2, block, uniform([1.0, 0.5, -1.0]));
    problem
}

#[test]
fn wall_nodes_obey_their_contact() {
    for kernel in KERNELS {
        for (kind, friction) in [(ContactKind::Sticky, 0.0), (ContactKind::Slip, 0.0), (ContactKind::Separate, 0.2)] {
            let problem = block_on_floor(kernel, contact(kind, friction));
            let mut solver = stages(&problem.setup, problem.particles.clone());
            solver.p2g(1e-4);
            solver.grid_update(1e-4, 0.0, 1e-4);
            let nodes = solver.nodes();
            if kind == ContactKind::Sticky {
                opposite_images(kernel, &nodes);
                continue;
            }
            // For the compact kernel, both nodes of each pair i ± ¼.
            let floor = nodes.iter().filter(|n| n.index[2] <= 0);
            let mut count = 0;
            for n in floor {
                count += 1;
                let free = [0, 1, 2].map(|a| n.momentum[a] / n.mass);
                let v = n.velocity;
                match kind {
                    ContactKind::Sticky => unreachable!("looked at above"),
                    ContactKind::Slip => assert_eq!(v, [free[0], free[1], 0.0]),
                    ContactKind::Separate if free[2] >= 0.0 => assert_eq!(v, free),
                    ContactKind::Separate => {
                        let (speed, before) = (v[0].hypot(v[1]), free[0].hypot(free[1]));
                        assert!((before - speed - 0.2 * -free[2]).abs() < 1e-12 && v[2] == 0.0, "{n:?}");
                    }
                }
            }
            assert!(count > 10, "{kernel:?}: {count} floor nodes");
            for n in nodes.iter().filter(|n| n.index[2] > 0) {
                assert!((0..3).all(|a| (n.velocity[a] - n.momentum[a] / n.mass).abs() < 1e-13));
            }
        }
    }
}

/// Beside a sticky floor a node and its mirror image move oppositely, by equal impulses.
fn opposite_images(kernel: Kernel, nodes: &[NodeState]) {
    let other = |n: &NodeState| if kernel == Kernel::Compact { 1 - n.grid } else { 0 };
    let mut count = 0;
    for n in nodes.iter().filter(|n| n.index[2] < 4) {
        let free = |n: &NodeState| [0, 1, 2].map(|a| n.momentum[a] / n.mass);
        let there = [n.index[0], n.index[1], -n.index[2]];
        match nodes.iter().find(|m| m.index == there && m.grid == other(n)) {
            Some(image) => {
                count += 1;
                for a in 0..3 {
                    assert!((n.velocity[a] + image.velocity[a]).abs() < 1e-14, "{kernel:?}: {n:?} {image:?}");
                    let taken = |n: &NodeState| n.mass * (n.velocity[a] - free(n)[a]);
                    let own = std::ptr::eq(n, image);
                    assert!(own || (taken(n) - taken(image)).abs() < 1e-14, "{kernel:?}: {n:?} {image:?}");
                }
            }
            None => assert!((0..3).all(|a| (n.velocity[a] - free(n)[a]).abs() < 1e-13)),
        }
    }
    assert!(count > 10, "{kernel:?}: {count} nodes with images");
}

#[test]
fn slip_keeps_the_motion_along_the_wall_and_sticky_takes_it() {
    for kernel in [Kernel::Compact, Kernel::Quadratic, Kernel::Cubic] {
        let along = |floor: Contact| {
            let mut problem = block_on_floor(kernel, floor);
            problem.setup.max_dt_s = Some(1e-3);
            let (p, _) = run(&problem, 4);
            let before = momentum(&problem, &problem.particles);
            let after = momentum(&problem, &p);
            [after[0] / before[0], after[1] / before[1]]
        };
        let slip = along(contact(ContactKind::Slip, 0.0));
        assert!(slip.iter().all(|s| (s - 1.0).abs() < 1e-12), "{kernel:?}: slip keeps {slip:?}");
        let separate = along(contact(ContactKind::Separate, 0.0));
        assert!(separate.iter().all(|s| (s - 1.0).abs() < 1e-12), "{kernel:?}: separate keeps {separate:?}");
        let sticky = along(contact(ContactKind::Sticky, 0.0));
        assert!(sticky.iter().all(|s| s.abs() < 0.8), "{kernel:?}: sticky keeps {sticky:?}");
    }
}

/// A block slides down a slope of 24° with friction tan 15°: x = ½ g t² (sin θ − μ cos θ). Gravity
/// is tilted instead of the floor.
#[test]
fn a_block_slides_with_coulomb_friction() {
    let (theta, friction, g) = (24f64.to_radians(), 15f64.to_radians().tan(), 9.81);
    for kernel in [Kernel::Compact, Kernel::Quadratic] {
        let mut problem = empty(2, [40.0, 10.0, 1.0], DX);
        problem.setup.kernel = kernel;
        problem.setup.axes[1] = Axis::Walls([contact(ContactKind::Separate, friction); 2]);
        problem.setup.gravity = [g * theta.sin(), -g * theta.cos(), 0.0];
        let block = in_box([3.0 * DX, 0.0, 0.0], [11.0 * DX, 4.0 * DX, 0.0]);
        fill(&mut problem, elastic(1e6, 0.3, 1000.0), 2, block, uniform([0.0; 3]));
        let mut engine = CpuEngine::new(&problem.setup, problem.particles.clone()).unwrap();
        let frames = 28;
        for _ in 0..frames {
            engine.advance_frame(problem.setup.frame_s, &NoControl).unwrap();
        }
        let t = frames as f64 * problem.setup.frame_s;
        let all = 0..problem.particles.len();
        let moved = centre(&engine.snapshot().unwrap(), all.clone())[0] - centre(&problem.particles, all)[0];
        let expected = 0.5 * g * t * t * (theta.sin() - friction * theta.cos());
        println!(
            "{kernel:?}: {moved:.4} m in {t:.3} s, expected {expected:.4} m ({:+.2}%)",
            100.0 * (moved / expected - 1.0)
        );
        assert!((moved / expected - 1.0).abs() < 0.02, "{kernel:?}: {moved} m, expected {expected} m");
    }
}

fn collider(primitive: Primitive, at: Vec3, contact: Contact, linear_velocity: Vec3) -> Collider {
    // Primitives map x to their own frame by rotation (x − translation).
    let sdf = Sdf { ops: vec![SdfOp::Primitive { primitive, rotation: IDENTITY, translation: at }] };
    let motion = Motion { center: at, linear_velocity, ..Motion::default() };
    Collider { name: "collider".into(), sdf, contact, motion, present_s: ALWAYS, grip: false }
}

#[test]
fn a_moving_collider_pushes_a_body() {
    for kernel in KERNELS {
        let mut problem = empty(3, [24.0, 12.0, 12.0], DX);
        problem.setup.kernel = kernel;
        let middle = 6.0 * DX;
        fill(
            &mut problem,
            elastic(2e4, 0.3, 1000.0),
            2,
            in_ball([10.0 * DX, middle, middle], 3.0 * DX),
            uniform([0.0; 3]),
        );
        let plate = Primitive::Box([2.0 * DX, 5.0 * DX, 5.0 * DX]);
        let v = [0.5, 0.0, 0.0];
        problem.setup.colliders.push(collider(
            plate,
            [4.0 * DX, middle, middle],
            contact(ContactKind::Separate, 0.0),
            v,
        ));
        let (p, _) = run(&problem, 16);
        let all = 0..p.len();
        let speed = p.v.iter().map(|v| v[0]).sum::<f64>() / p.len() as f64;
        let face = 6.0 * DX + 16.0 * problem.setup.frame_s * 0.5;
        let behind = p.x.iter().filter(|x| x[0] < face - 0.5 * DX).count();
        println!("{kernel:?}: body at {:.3} m, plate's face at {face:.3} m, speed {speed:.3} m/s", centre(&p, all)[0]);
        assert!(speed > 0.5, "{kernel:?}: pushed at 0.5 m/s, moves at {speed} m/s");
        assert_eq!(behind, 0, "{kernel:?}: particles inside the plate");
        // By symmetry, and because the body is free along the plate.
        let m = momentum(&problem, &p);
        assert!(m[1].abs().max(m[2].abs()) < 1e-9 * m[0].abs(), "{kernel:?}: {m:?}");
    }
}

#[test]
fn a_sticky_collider_carries_what_it_holds() {
    let mut problem = empty(3, [16.0, 16.0, 16.0], DX);
    let c = [8.0 * DX; 3];
    fill(&mut problem, elastic(1e5, 0.3, 1000.0), 2, in_ball(c, 4.0 * DX), uniform([0.0; 3]));
    let mut core = collider(Primitive::Sphere(2.5 * DX), c, contact(ContactKind::Sticky, 0.0), [0.1, 0.0, -0.05]);
    core.motion.angular_velocity = [0.0, 0.0, 2.0];
    problem.setup.colliders.push(core);
    let (p, _) = run(&problem, 48);
    let t = 48.0 * problem.setup.frame_s;
    let moved = minus(centre(&p, 0..p.len()), centre(&problem.particles, 0..p.len()));
    assert!(norm(minus(moved, [0.1 * t, 0.0, -0.05 * t])) < 0.05 * DX, "{moved:?}");
    // It rotates with the core: 2 rad per second.
    let here = minus(centre(&p, 0..p.len()), [0.0; 3]);
    let (mut sin, mut cos) = (0.0, 0.0);
    for i in 0..p.len() {
        let (a, b) = (minus(problem.particles.x[i], c), minus(p.x[i], here));
        cos += a[0] * b[0] + a[1] * b[1];
        sin += a[0] * b[1] - a[1] * b[0];
    }
    let angle = f64::atan2(sin, cos);
    println!("turned by {angle:.3} rad");
    assert!((angle - 2.0).abs() < 0.1, "{angle}");
}

#[test]
fn colliders_act_in_two_dimensions_and_in_single_precision() {
    let mut problem = empty(2, [16.0, 24.0, 1.0], DX);
    problem.setup.precision = gridfall_scene::schema::Precision::F32;
    problem.setup.gravity = [0.0, -9.81, 0.0];
    problem.setup.max_dt_s = Some(5e-4);
    fill(&mut problem, elastic(5e4, 0.3, 1000.0), 2, in_ball([8.0 * DX, 16.0 * DX, 0.0], 3.0 * DX), uniform([0.0; 3]));
    let floor = Primitive::Box([8.0 * DX, 2.0 * DX, 1.0]);
    problem.setup.colliders.push(collider(
        floor,
        [8.0 * DX, 8.0 * DX, 0.0],
        contact(ContactKind::Separate, 0.3),
        [0.0; 3],
    ));
    let (p, _) = run(&problem, 48);
    let lowest = p.x.iter().map(|x| x[1]).fold(f64::MAX, f64::min);
    println!("lowest particle {lowest:.4} m, floor {:.4} m", 10.0 * DX);
    assert!(lowest > 9.3 * DX && centre(&p, 0..p.len())[1] < 15.0 * DX);
}

#[test]
fn speeds_beyond_all_bounds_are_errors_that_name_the_particle() {
    for speed in [1e16, 1e30, 1e200, f64::INFINITY] {
        let mut problem = block_on_floor(Kernel::Quadratic, contact(ContactKind::Slip, 0.0));
        problem.particles.v[7] = [0.0, 0.0, speed];
        let explicit = CpuEngine::new(&problem.setup, problem.particles.clone()).unwrap();
        let implicit = ImplicitEngine::new(&problem.setup, problem.particles.clone()).unwrap();
        for mut engine in [Box::new(explicit) as Box<dyn Engine>, Box::new(implicit)] {
            let error = engine.advance_frame(problem.setup.frame_s, &NoControl).unwrap_err();
            assert!(matches!(&error, EngineError::Diverged { step: 0, .. }), "{speed}: {error}");
            assert!(error.to_string().contains("particle 7 (body \"body 0\")"), "{speed}: {error}");
        }
    }
}

#[test]
fn leaving_the_domain_is_an_error_that_names_the_particle() {
    let mut problem = block_on_floor(Kernel::Quadratic, contact(ContactKind::Slip, 0.0));
    problem.particles.x[7][2] = -1.3 * DX;
    let mut engine = CpuEngine::new(&problem.setup, problem.particles.clone()).unwrap();
    let error = engine.advance_frame(problem.setup.frame_s, &NoControl).unwrap_err();
    assert!(matches!(&error, EngineError::LeftDomain { step: 1, .. }), "{error}");
    assert!(error.to_string().contains("particle 7 (body \"body 0\")"), "{error}");
}
