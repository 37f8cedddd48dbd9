//! Problems built by hand for physics tests, and sums over their particles.

use gridfall_core::material::parameters::{Elastic, Fluid};
use gridfall_core::maths::linalg::{Matrix, apply, mul_transpose};
use gridfall_core::sim::moments::moment_matrix;
use gridfall_core::sim::particles::{IDENTITY, Particles};
use gridfall_core::sim::setup::{Axis, Body, Contact, ContactAt, Problem, Setup};
use gridfall_core::sim::setup::{ContactKind, Implicit, Integrator, Kernel, Material, Precision, Transfer};
use gridfall_engine::explicit::cpu::CpuEngine;
use gridfall_engine::{Engine, NoControl};

pub type Vec3 = [f64; 3];

pub const FREE: Axis = walls(ContactKind::Separate);

pub const fn walls(kind: ContactKind) -> Axis {
    Axis::Walls([Contact { kind, friction: 0.0 }; 2])
}

pub fn elastic(youngs_modulus: f64, poissons_ratio: f64, density: f64) -> Material {
    Material::FixedCorotated(Elastic { density, youngs_modulus, poissons_ratio, damping: 0.0 })
}

pub fn neo_hookean(youngs_modulus: f64, poissons_ratio: f64, density: f64) -> Material {
    Material::NeoHookean(Elastic { density, youngs_modulus, poissons_ratio, damping: 0.0 })
}

pub fn fluid(bulk_modulus: f64, viscosity: f64) -> Material {
    Material::WeaklyCompressibleFluid(Fluid { density: 1000.0, bulk_modulus, gamma: 7.15, viscosity })
}

fn density(material: &Material) -> f64 {
    material.density()
}

/// A problem without bodies: f64, compact, MLS, no gravity, all walls separating.
pub fn empty(dimension: usize, cells: Vec3, dx: f64) -> Problem {
    let setup = Setup {
        name: "test".into(),
        dimension,
        origin: [0.0; 3],
        dx,
        cells: cells.map(|c| c as usize),
        axes: [FREE; 3],
        gravity: [0.0; 3],
        materials: Vec::new(),
        bodies: Vec::new(),
        sources: Vec::new(),
        colliders: Vec::new(),
        kernel: Kernel::Compact,
        transfer: Transfer::Mls,
        contact_at: ContactAt::Particles,
        precision: Precision::F64,
        cfl: 0.5,
        max_dt_s: None,
        integrator: Integrator::Explicit,
        integrator_reason: String::new(),
        notices: Vec::new(),
        implicit: Implicit::default(),
        frames: 1,
        frame_s: 1.0 / 48.0,
        fields: Vec::new(),
        preview_points: 1000,
        keep_state: false,
        seed: 1,
    };
    Problem { setup, particles: Particles::default() }
}

/// Fills the cells for which `inside` holds with `per_axis`^d particles each. The velocity field's
/// value and gradient give v and B.
pub fn fill(
    problem: &mut Problem,
    material: Material,
    per_axis: usize,
    inside: impl Fn(Vec3) -> bool,
    velocity: impl Fn(Vec3) -> (Vec3, Matrix<f64, 3>),
) {
    let (d, dx) = (problem.setup.dimension, problem.setup.dx);
    let first = problem.particles.len();
    let spacing = dx / per_axis as f64;
    let along = |a: usize| if a < d { problem.setup.cells[a] * per_axis } else { 1 };
    for i in 0..along(0) {
        for j in 0..along(1) {
            for k in 0..along(2) {
                let mut x = [i, j, k].map(|i| (i as f64 + 0.5) * spacing);
                if d == 2 {
                    x[2] = 0.0;
                }
                let x: Vec3 = std::array::from_fn(|a| x[a] + problem.setup.origin[a]);
                if !inside(x) {
                    continue;
                }
                let (v, c) = velocity(x);
                let units = std::array::from_fn(|a| (x[a] - problem.setup.origin[a]) / dx);
                let moment = moment_matrix(problem.setup.kernel, units, dx, d);
                let b = mul_transpose(&c, &std::array::from_fn(|r| std::array::from_fn(|s| moment[3 * s + r])));
                let p = &mut problem.particles;
                p.x.push(x);
                p.v.push(v);
                let pic = problem.setup.transfer == Transfer::Pic;
                p.b.push(if pic { [0.0; 9] } else { std::array::from_fn(|n| b[n / 3][n % 3]) });
                p.f.push(IDENTITY);
                p.plastic.push(0.0);
                p.body.push(problem.setup.bodies.len() as u32);
            }
        }
    }
    let volume0 = spacing.powi(d as i32);
    problem.setup.bodies.push(Body {
        name: format!("body {}", problem.setup.bodies.len()),
        material: problem.setup.materials.len(),
        particles: first..problem.particles.len(),
        volume0,
        mass: density(&material) * volume0,
        contact: None,
    });
    problem.setup.materials.push(material);
    assert!(problem.particles.len() > first, "a body without particles");
}

/// A uniform velocity field.
pub fn uniform(v: Vec3) -> impl Fn(Vec3) -> (Vec3, Matrix<f64, 3>) {
    move |_| (v, [[0.0; 3]; 3])
}

/// v + G (x − center).
pub fn linear(v: Vec3, gradient: Matrix<f64, 3>, center: Vec3) -> impl Fn(Vec3) -> (Vec3, Matrix<f64, 3>) {
    move |x| {
        let offset = std::array::from_fn(|a| x[a] - center[a]);
        let turn = apply(&gradient, &offset);
        (std::array::from_fn(|a| v[a] + turn[a]), gradient)
    }
}

pub fn in_box(min: Vec3, max: Vec3) -> impl Fn(Vec3) -> bool {
    move |x| (0..3).all(|a| x[a] >= min[a] && x[a] <= max[a])
}

pub fn in_ball(center: Vec3, radius: f64) -> impl Fn(Vec3) -> bool {
    move |x| (0..3).map(|a| (x[a] - center[a]).powi(2)).sum::<f64>() <= radius * radius
}

/// Runs `frames` frames on the CPU and returns the final states and the steps taken.
pub fn run(problem: &Problem, frames: usize) -> (Particles, u64) {
    let mut engine = CpuEngine::new(&problem.setup, problem.particles.clone()).unwrap();
    let mut steps = 0;
    for _ in 0..frames {
        steps += engine.advance_frame(problem.setup.frame_s, &NoControl).unwrap().steps;
    }
    (engine.snapshot().unwrap(), steps)
}

pub fn mass(problem: &Problem, p: &Particles, i: usize) -> f64 {
    problem.setup.bodies[p.body[i] as usize].mass
}

/// Σ m v.
pub fn momentum(problem: &Problem, p: &Particles) -> Vec3 {
    let mut total = [0.0; 3];
    for i in 0..p.len() {
        for a in 0..3 {
            total[a] += mass(problem, p, i) * p.v[i][a];
        }
    }
    total
}

/// Σ m (x × v + the spin of B) about the origin.
pub fn angular_momentum(problem: &Problem, p: &Particles) -> Vec3 {
    let mut total = [0.0; 3];
    for i in 0..p.len() {
        let (m, x, v, b) = (mass(problem, p, i), p.x[i], p.v[i], p.b[i]);
        for a in 0..3 {
            let (r, s) = ((a + 1) % 3, (a + 2) % 3);
            total[a] += m * (x[r] * v[s] - x[s] * v[r] + b[3 * s + r] - b[3 * r + s]);
        }
    }
    total
}

pub fn norm(v: Vec3) -> f64 {
    v.iter().map(|c| c * c).sum::<f64>().sqrt()
}

pub fn minus(a: Vec3, b: Vec3) -> Vec3 {
    std::array::from_fn(|k| a[k] - b[k])
}

/// Mean position of a range of particles.
pub fn centre(p: &Particles, range: std::ops::Range<usize>) -> Vec3 {
    let n = range.len() as f64;
    let mut sum = [0.0; 3];
    for i in range {
        for a in 0..3 {
            sum[a] += p.x[i][a] / n;
        }
    }
    sum
}
