//! Water and sand keep their volume, and free flight is exact whatever the step.

use crate::problems::{self, FREE, centre, elastic, empty, fluid, in_box, minus, momentum, norm, uniform, walls};
use gridfall_core::material::parameters::{Cone, DruckerPrager};
use gridfall_core::maths::linalg::determinant;
use gridfall_core::sim::collider::{ALWAYS, Collider, Motion, Primitive, Sdf, SdfOp};
use gridfall_core::sim::particles::IDENTITY;
use gridfall_core::sim::setup::{Axis, Contact, ContactKind, Kernel, Material, Problem, Transfer};

const KERNELS: [Kernel; 3] = [Kernel::Compact, Kernel::Quadratic, Kernel::Cubic];

/// Water in the lower left part of a box of slip walls: `cells` wide and high, filled up to `fill`.
fn basin(kernel: Kernel, cells: [f64; 2], fill: [f64; 2]) -> Problem {
    let dx = 0.04;
    let mut problem = empty(2, [cells[0], cells[1], 1.0], dx);
    problem.setup.kernel = kernel;
    problem.setup.axes = [walls(ContactKind::Slip); 3];
    problem.setup.gravity = [0.0, -9.81, 0.0];
    let inside = in_box([0.0; 3], [fill[0] * dx, fill[1] * dx, 1.0]);
    problems::fill(&mut problem, fluid(1e5, 0.0), 2, inside, uniform([0.0; 3]));
    problem
}

#[test]
fn still_water_keeps_its_level() {
    for kernel in KERNELS {
        let problem = basin(kernel, [10.0, 14.0], [10.0, 10.0]);
        // The sound of the start, when it takes its own weight, fades slowly.
        let (after, _) = problems::run(&problem, 12 * 48);
        let depth = 0.4;
        // What is above a layer compresses it by p/K − 4.1 (p/K)², and a layer lifts what is above it: a mean of J
        // weighted by the mass above.
        let strain = 9810.0 * depth / 1e5;
        let expected = depth * (1.0 - 2.0 / 3.0 * strain + 2.04 * strain * strain);
        let level = 2.0 * centre(&after, 0..after.len())[1];
        let speed = (after.v.iter().map(|v| norm(*v).powi(2)).sum::<f64>() / after.len() as f64).sqrt();
        println!("{kernel:?}: level {level:.4} of {expected:.4} m, {speed:.4} m/s");
        assert!((level / expected - 1.0).abs() < 0.03, "{kernel:?}: level {level} of {expected}");
        assert!(speed < 0.02 * (9.81 * depth).sqrt(), "{kernel:?}: {speed} m/s");
    }
}

#[test]
fn a_dam_that_breaks_settles_at_its_level() {
    for kernel in KERNELS {
        let problem = basin(kernel, [20.0, 15.0], [10.0, 10.0]);
        let (after, _) = problems::run(&problem, 10 * 48);
        let level = 2.0 * centre(&after, 0..after.len())[1];
        let mut cells = std::collections::BTreeMap::new();
        for x in after.x.iter().filter(|x| x[1] < 0.16) {
            *cells.entry([0, 1].map(|a| (x[a] / 0.04).floor() as i64)).or_insert(0) += 1;
        }
        let fullest = *cells.values().max().unwrap();
        println!("{kernel:?}: level {level:.4} of 0.2 m, {fullest} in the fullest cell");
        // Five cells deep.
        assert!((level / 0.2 - 1.0).abs() < 0.05, "{kernel:?}: level {level}");
        assert!(fullest <= 10, "{kernel:?}: {fullest} particles in a cell of 4");
    }
}

#[test]
fn crowded_water_spreads_and_keeps_its_momentum() {
    for (kernel, dimension) in [(Kernel::Compact, 2), (Kernel::Quadratic, 2), (Kernel::Compact, 3)] {
        let mut problem = empty(dimension, [24.0, 24.0, if dimension == 3 { 24.0 } else { 1.0 }], 1.0 / 24.0);
        problem.setup.kernel = kernel;
        let inside = in_box([0.35, 0.35, if dimension == 3 { 0.35 } else { 0.0 }], [0.65; 3]);
        problems::fill(&mut problem, fluid(1e4, 0.0), 2, &inside, uniform([0.1, 0.2, 0.0]));
        // As much again in the same place.
        let p = &mut problem.particles;
        let n = p.len();
        let again: Vec<_> = p.x.iter().map(|x| [x[0] + 0.003, x[1] + 0.002, x[2]]).collect();
        p.x.extend(again);
        p.v.resize(2 * n, [0.1, 0.2, 0.0]);
        p.b.resize(2 * n, [0.0; 9]);
        p.f.resize(2 * n, IDENTITY);
        p.plastic.resize(2 * n, 0.0);
        p.body.resize(2 * n, 0);
        problem.setup.bodies[0].particles = 0..2 * n;
        let width = |p: &gridfall_core::sim::particles::Particles| {
            let c = centre(p, 0..p.len());
            (p.x.iter().map(|x| norm(minus(*x, c)).powi(2)).sum::<f64>() / p.len() as f64).sqrt()
        };
        let before = momentum(&problem, &problem.particles);
        let (after, _) = problems::run(&problem, 24);
        let grown = width(&after) / width(&problem.particles);
        let scale = norm(before);
        println!("{kernel:?} {dimension}D: {grown:.3} times as wide");
        assert!(grown > 0.8 * 2f64.powf(1.0 / dimension as f64), "{kernel:?} {dimension}D: {grown} times as wide");
        assert!(norm(minus(momentum(&problem, &after), before)) < 1e-11 * scale, "{kernel:?} {dimension}D");
    }
}

#[test]
fn nothing_pushes_a_body_of_water_at_rest() {
    for kernel in KERNELS {
        for transfer in [Transfer::Apic, Transfer::Mls] {
            let mut problem = empty(2, [24.0, 24.0, 1.0], 1.0 / 24.0);
            (problem.setup.kernel, problem.setup.transfer) = (kernel, transfer);
            problem.setup.axes = [FREE; 3];
            let inside = in_box([0.25, 0.25, 0.0], [0.75; 3]);
            problems::fill(&mut problem, fluid(1e5, 0.0), 2, inside, uniform([0.0; 3]));
            let (after, _) = problems::run(&problem, 24);
            let moved = (0..after.len()).map(|i| norm(minus(after.x[i], problem.particles.x[i]))).fold(0.0, f64::max);
            println!("{kernel:?} {transfer:?}: moved {moved:e} m");
            // The compact kernel's weights on a lattice are not quite even: sin terms leave 1e-4 of pressure.
            assert!(moved < 0.05 / 24.0, "{kernel:?} {transfer:?}: moved {moved} m");
        }
    }
}

#[test]
fn water_beside_a_heavy_solid_stays() {
    for kernel in KERNELS {
        let mut problem = empty(2, [24.0, 24.0, 1.0], 1.0 / 24.0);
        problem.setup.kernel = kernel;
        problems::fill(
            &mut problem,
            fluid(1e5, 0.0),
            2,
            in_box([0.25, 0.25, 0.0], [0.5, 0.75, 1.0]),
            uniform([0.0; 3]),
        );
        problems::fill(
            &mut problem,
            elastic(1e6, 0.3, 7800.0),
            2,
            in_box([0.5, 0.25, 0.0], [0.75; 3]),
            uniform([0.0; 3]),
        );
        let (after, _) = problems::run(&problem, 24);
        let moved = (0..after.len()).map(|i| norm(minus(after.x[i], problem.particles.x[i]))).fold(0.0, f64::max);
        println!("{kernel:?}: moved {moved:e} m");
        assert!(moved < 0.1 / 24.0, "{kernel:?}: moved {moved} m");
    }
}

#[test]
fn water_beside_a_collider_stays() {
    for kernel in KERNELS {
        let mut problem = empty(2, [24.0, 24.0, 1.0], 1.0 / 24.0);
        problem.setup.kernel = kernel;
        let ops = vec![SdfOp::Primitive {
            primitive: Primitive::Box([0.25, 0.5, 1.0]),
            rotation: IDENTITY,
            translation: [0.25, 0.5, 0.0],
        }];
        problem.setup.colliders.push(Collider {
            name: "block".into(),
            sdf: Sdf { ops },
            contact: Contact { kind: ContactKind::Slip, friction: 0.0 },
            motion: Motion {
                center: [0.0; 3],
                linear_velocity: [0.0; 3],
                angular_velocity: [0.0; 3],
                keyframes: vec![],
            },
            present_s: ALWAYS,
            grip: false,
        });
        problems::fill(&mut problem, fluid(1e5, 0.0), 2, in_box([0.5, 0.25, 0.0], [0.75; 3]), uniform([0.0; 3]));
        let (after, _) = problems::run(&problem, 24);
        let moved = (0..after.len()).map(|i| norm(minus(after.x[i], problem.particles.x[i]))).fold(0.0, f64::max);
        println!("{kernel:?}: moved {moved:e} m");
        assert!(moved < 0.25 / 24.0, "{kernel:?}: moved {moved} m");
    }
}

#[test]
fn sand_that_flows_keeps_its_area() {
    let dx = 0.01;
    let mut problem = empty(2, [80.0, 30.0, 1.0], dx);
    let floor = Contact { kind: ContactKind::Separate, friction: 0.2679 };
    problem.setup.axes[0] = walls(ContactKind::Slip);
    problem.setup.axes[1] = Axis::Walls([floor; 2]);
    problem.setup.gravity = [0.0, -9.81, 0.0];
    let sand = Material::DruckerPrager(DruckerPrager {
        density: 1600.0,
        youngs_modulus: 1e6,
        poissons_ratio: 0.2,
        friction_angle_degrees: 15.0,
        cohesion: 0.0,
        dilatancy_angle_degrees: 0.0,
        cone: Cone::TriaxialCompression,
    });
    problems::fill(&mut problem, sand, 2, in_box([0.0; 3], [0.1, 0.2, 1.0]), uniform([0.0; 3]));
    let (after, _) = problems::run(&problem, 96);
    let column =
        |c: usize| after.x.iter().filter(move |x| (x[0] / 0.02) as usize == c).map(|x| x[1]).fold(0.0, f64::max);
    let area: f64 = (0..40).map(|c| 0.02 * column(c)).sum();
    println!("area {area:.4} of 0.02 m²");
    assert!((area / 0.02 - 1.0).abs() < 0.05, "area {area}");
}

#[test]
fn free_flight_is_exact_whatever_the_step() {
    let (v, g) = ([0.3, 0.2, 0.4], [0.1, -0.2, -9.81]);
    for material in [fluid(1e4, 0.0), elastic(1e4, 0.3, 1000.0)] {
        for (dimension, max_dt_s) in [(2, None), (3, None), (3, Some(1e-3)), (3, Some(1.7e-4))] {
            let mut problem = empty(dimension, [24.0, 24.0, if dimension == 3 { 24.0 } else { 1.0 }], 1.0 / 24.0);
            problem.setup.gravity = if dimension == 3 { g } else { [g[0], g[2], 0.0] };
            problem.setup.max_dt_s = max_dt_s;
            let g = problem.setup.gravity;
            let v = if dimension == 3 { v } else { [v[0], v[1], 0.0] };
            let inside = in_box([0.4, 0.4, if dimension == 3 { 0.4 } else { 0.0 }], [0.6; 3]);
            problems::fill(&mut problem, material.clone(), 2, inside, uniform(v));
            let (frames, t) = (9, 9.0 / 48.0);
            let (after, steps) = problems::run(&problem, frames);
            let mut error: f64 = 0.0;
            for i in 0..after.len() {
                for a in 0..dimension {
                    let x = problem.particles.x[i][a] + v[a] * t + 0.5 * g[a] * t * t;
                    error = error.max((after.x[i][a] - x).abs()).max((after.v[i][a] - v[a] - g[a] * t).abs());
                }
                error = error.max((determinant(&after.f[i]) - 1.0).abs());
            }
            println!("{dimension}D in {steps} steps: {error:e}");
            assert!(error < 1e-10, "{dimension}D in {steps} steps: {error:e}");
        }
    }
}
