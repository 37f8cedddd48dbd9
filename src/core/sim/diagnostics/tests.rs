//! Tests of the diagnostics on states with known values.

use super::*;
use crate::material::parameters::{Elastic, Material};
use crate::sim::collider::{ALWAYS, Collider, Motion, Primitive, Sdf, SdfOp};
use crate::sim::fixture;
use crate::sim::particles::IDENTITY;
use crate::sim::setup::{Axis, Body, Contact, ContactKind, Kernel, Precision, Problem};

/// A cube of 20³ particles of 1 m³ and 2 kg in total, at rest.
fn cube(kernel: Kernel, transfer: Transfer) -> Problem {
    let elastic = Elastic { density: 2.0, youngs_modulus: 100.0, poissons_ratio: 0.25, damping: 0.0 };
    let Problem { mut setup, mut particles } =
        fixture::problem(3, 0.1, vec![Material::FixedCorotated(elastic)], &[(0, [3.0; 3], [4.0; 3])]);
    (setup.cells, setup.axes, setup.gravity) = ([80; 3], [Axis::Periodic; 3], [0.0, 0.0, -10.0]);
    (setup.kernel, setup.transfer, setup.precision) = (kernel, transfer, Precision::F64);
    for (k, x) in particles.x.iter_mut().enumerate() {
        *x = [k % 20, k / 20 % 20, k / 400].map(|i| 3.0 + (i as f64 + 0.5) / 20.0);
    }
    setup.bodies[0] = Body {
        name: "cube".into(),
        material: 0,
        particles: 0..8000,
        volume0: 1.0 / 8000.0,
        mass: 2.0 / 8000.0,
        contact: None,
    };
    Problem { setup, particles }
}

fn measure(problem: &Problem) -> Row {
    Row::measure(
        &problem.setup,
        &problem.particles,
        3,
        0.3,
        &FrameStats { steps: 4, dt_s: 0.025, isolated_reset: 1, reactions: vec![], solves: vec![] },
    )
}

/// Gives every particle the velocity ω × (x − center) and the matching affine state, B = [ω]ₓ D.
fn spin(problem: &mut Problem, omega: [f64; 3], center: [f64; 3]) {
    let [x, y, z] = omega;
    let skew = Matrix3::new(0.0, -z, y, z, 0.0, -x, -y, x, 0.0);
    for p in 0..problem.particles.len() {
        let at = problem.particles.x[p];
        let d = moment_matrix(problem.setup.kernel, at.map(|c| c / problem.setup.dx), problem.setup.dx, 3);
        let b = skew * Matrix3::from_row_slice(&d);
        problem.particles.v[p] = cross(omega, std::array::from_fn(|a| at[a] - center[a]));
        problem.particles.b[p] = std::array::from_fn(|k| b[(k / 3, k % 3)]);
    }
}

fn assert_close(value: f64, expected: f64, what: &str) {
    assert!((value - expected).abs() <= 1e-12 * expected.abs().max(1.0), "{what}: {value} against {expected}");
}

#[test]
fn a_body_at_rest() {
    let row = measure(&cube(Kernel::Compact, Transfer::Mls));
    assert_eq!((row.frame, row.time_s, row.steps, row.dt_s, row.isolated_reset), (3, 0.3, 4, 0.025, 1));
    assert_close(row.mass_kg, 2.0, "mass");
    assert_close(row.gravity_j, 2.0 * 10.0 * 3.5, "m g h of the centre");
    let still = [row.momentum_x, row.angular_momentum_z, row.kinetic_j, row.affine_j, row.strain_j, row.max_speed];
    assert_eq!(still, [0.0; 6]);
    assert_eq!(row.min_J, 1.0);
}

#[test]
fn a_rigid_rotation_has_the_momentum_and_energy_of_its_inertia() {
    // Angular momentum about the origin of a body that spins about its own centre: I ω, including
    // the affine part. Particles carry the inertia of points; each adds that of its kernel, Σ m
    // (tr D − D) per unit of ω.
    let (omega, center) = ([0.3, -0.7, 1.1], [3.5; 3]);
    for kernel in [Kernel::Compact, Kernel::Quadratic, Kernel::Cubic, Kernel::Linear] {
        let mut problem = cube(kernel, Transfer::Apic);
        spin(&mut problem, omega, center);
        let mut inertia = Matrix3::zeros();
        for x in &problem.particles.x {
            let r = nalgebra::Vector3::from_fn(|a, _| x[a] - center[a]);
            let d = moment_matrix(kernel, x.map(|c| c / problem.setup.dx), problem.setup.dx, 3);
            let second = r * r.transpose() + Matrix3::from_row_slice(&d);
            inertia += problem.setup.bodies[0].mass * (Matrix3::identity() * second.trace() - second);
        }
        let expected = inertia * nalgebra::Vector3::from(omega);
        let row = measure(&problem);
        assert_close(row.angular_momentum_x, expected.x, "L_x");
        assert_close(row.angular_momentum_y, expected.y, "L_y");
        assert_close(row.angular_momentum_z, expected.z, "L_z");
        let energy = 0.5 * expected.dot(&nalgebra::Vector3::from(omega));
        assert_close(row.kinetic_j + row.affine_j, energy, "½ ω·I ω");
        assert!(row.affine_j > 0.0);
    }
}

#[test]
fn the_affine_part_of_pic_does_not_count() {
    let mut problem = cube(Kernel::Quadratic, Transfer::Pic);
    spin(&mut problem, [0.0, 0.0, 1.0], [3.5; 3]);
    assert_eq!(measure(&problem).affine_j, 0.0);
}

#[test]
fn stored_energy_of_a_stretch() {
    let mut problem = cube(Kernel::Compact, Transfer::Mls);
    problem.particles.f.iter_mut().for_each(|f| f[0] = 0.9);
    let row = measure(&problem);
    // ψ = µ e² + ½ λ e², with µ = λ = 40 Pa, over 1 m³.
    assert_close(row.strain_j, 1.5 * 40.0 * 0.01, "strain energy");
    assert_close(row.min_J, 0.9, "J");
}

#[test]
fn sums_do_not_depend_on_threads_and_keep_small_terms() {
    let mut problem = cube(Kernel::Compact, Transfer::Mls);
    // Large momenta that cancel, and small ones. Products with this mass are exact.
    problem.setup.bodies[0].mass = 1.0 / 4096.0;
    problem.particles.v.iter_mut().enumerate().for_each(|(p, v)| v[0] = if p % 2 == 0 { 1e12 } else { -1e12 });
    problem.particles.v[5][1] = 1.0;
    problem.particles.v[17][0] += 3.0;
    let row = measure(&problem);
    assert_eq!((row.momentum_x, row.momentum_y), (3.0 / 4096.0, 1.0 / 4096.0));
    for threads in [1, 2, 5] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        assert_eq!(pool.install(|| measure(&problem)), row);
    }
}

#[test]
fn surfaces_have_columns_behind_the_fixed_ones() {
    let Problem { mut setup, particles } =
        fixture::problem(2, 0.125, fixture::solid_and_fluid(), &[(0, [0.25; 3], [0.5; 3])]);
    setup.axes[0] = Axis::Periodic;
    let sphere =
        SdfOp::Primitive { primitive: Primitive::Sphere(0.1), rotation: IDENTITY, translation: [0.5, 0.5, 0.0] };
    setup.colliders.push(Collider {
        name: "a, b".into(),
        sdf: Sdf { ops: vec![sphere] },
        motion: Motion::default(),
        contact: Contact { kind: ContactKind::Slip, friction: 0.0 },
        present_s: ALWAYS,
        grip: false,
    });
    let reactions = (0..7).map(|n| Reaction { force: [f64::from(n); 3], torque: [0.5; 3] }).collect();
    let stats = FrameStats { reactions, ..FrameStats::default() };
    let row = Row::measure(&setup, &particles, 1, 0.1, &stats).csv();
    let header = Row::csv_header(&setup);
    let columns: Vec<(&str, &str)> = header.split(',').zip(row.split(',')).skip(Row::COLUMNS.len()).collect();
    let expected = [
        ("wall_y-.force_x", "2.0"),
        ("wall_y-.force_y", "2.0"),
        ("wall_y-.force_z", "2.0"),
        ("wall_y+.force_x", "3.0"),
        ("wall_y+.force_y", "3.0"),
        ("wall_y+.force_z", "3.0"),
        ("a_ b.force_x", "6.0"),
        ("a_ b.force_y", "6.0"),
        ("a_ b.force_z", "6.0"),
        ("a_ b.torque_x", "0.5"),
        ("a_ b.torque_y", "0.5"),
        ("a_ b.torque_z", "0.5"),
    ];
    assert_eq!(columns, expected);
    assert_eq!(header.split(',').count(), row.split(',').count());
    // Frame 0 has no forces.
    let first = Row::measure(&setup, &particles, 0, 0.0, &FrameStats::default());
    assert_eq!(first.reactions.len(), 3);
    assert!(first.reactions.iter().all(|(_, reaction)| *reaction == Reaction::default()));
}
