//! A valid scene to a [`Problem`]: grid, contacts, sampled bodies with their initial state, colliders.

mod motion;
pub mod solid;
pub mod sources;

use rayon::prelude::*;

use crate::build::motion::colliders;
use crate::build::solid::{sdf, vector3};
use crate::sampling::Lattice;
use crate::schema::{self, Boundary, ContactKind, Material, Sampling, Scene, Shape, Transfer};
use gridfall_core::material::initial_plastic_state;
use gridfall_core::sim::collider::{Sdf, rotate};
use gridfall_core::sim::cost;
use gridfall_core::sim::moments::moment_matrix;
use gridfall_core::sim::particles::{IDENTITY, Particles};
use gridfall_core::sim::setup::{Axis, Body, Contact, Problem, Setup};

/// Cells on each axis, unrounded; 1 on z in 2D.
pub(crate) fn cells(domain: &schema::Domain, dimension: usize) -> [f64; 3] {
    std::array::from_fn(|a| if a < dimension { (domain.max[a] - domain.min[a]) / domain.dx } else { 1.0 })
}

/// Particles per cell of a body, and how many that is along an axis: a whole number on a lattice, any for other points; none
/// if the body's sampling cannot have so many.
pub(crate) fn particles_per_cell(body: &schema::Body, dimension: usize) -> (u32, Option<f64>) {
    let per_cell = body.particles_per_cell.unwrap_or(1 << dimension);
    let root = f64::from(per_cell).powf(1.0 / dimension as f64);
    let whole = root.round() as u32;
    let per_axis = match whole.checked_pow(dimension as u32) == Some(per_cell) {
        true => f64::from(whole),
        false => root,
    };
    let fits = per_axis == f64::from(whole) || body.sampling == Sampling::PoissonDisk || body.shape.is_none();
    (per_cell, (per_cell > 0 && fits).then_some(per_axis))
}

/// The lattice over a body's bounds; where the body is unbounded, up to the domain's walls.
pub(crate) fn lattice(domain: &schema::Domain, per_axis: f64, sdf: &Sdf, dimension: usize) -> Lattice {
    let [mut lower, mut upper] = sdf.bounds();
    for a in 0..dimension {
        if lower[a] == f64::NEG_INFINITY {
            lower[a] = domain.min[a];
        }
        if upper[a] == f64::INFINITY {
            upper[a] = domain.max[a];
        }
    }
    Lattice::over(vector3(&domain.min), domain.dx / per_axis, dimension, [lower, upper])
}

/// Builds the problem. The scene must be valid.
pub(crate) fn build(scene: &Scene) -> Problem {
    let dimension = scene.dimension as usize;
    let materials: Vec<&String> = scene.materials.keys().collect();
    let setup = Setup {
        name: scene.name.clone(),
        dimension,
        origin: vector3(&scene.domain.min),
        dx: scene.domain.dx,
        cells: cells(&scene.domain, dimension).map(|n| n.round() as usize),
        axes: std::array::from_fn(|a| axis(&scene.domain, a, dimension)),
        gravity: scene.gravity.as_deref().map_or([0.0; 3], vector3),
        materials: scene.materials.values().cloned().collect(),
        bodies: Vec::new(),
        sources: Vec::new(),
        colliders: colliders(scene),
        kernel: scene.solver.kernel,
        transfer: scene.solver.transfer,
        precision: scene.solver.precision,
        cfl: scene.solver.cfl,
        max_dt_s: scene.solver.max_dt,
        integrator: scene.solver.integrator,
        integrator_reason: String::new(),
        implicit: scene.solver.implicit,
        frames: sources::frames(scene),
        frame_s: 1.0 / scene.time.frame_rate,
        fields: scene.output.fields.clone(),
        preview_points: scene.output.preview_points as usize,
        seed: scene.seed,
    };
    let mut problem = Problem { setup, particles: Particles::default() };
    let material = |name: &str| materials.iter().position(|known| *known == name).expect("a valid scene");
    for (index, body) in scene.bodies.iter().enumerate() {
        add_body(&mut problem, scene, body, index, material(&body.material));
    }
    for source in &scene.sources {
        let built = sources::build(scene, source, problem.setup.bodies.len());
        let material = material(&source.material);
        let (volume0, none) = (built.spacing.powi(dimension as i32), problem.particles.len());
        let mass = problem.setup.materials[material].density() * volume0;
        problem.setup.bodies.push(Body { name: source.name.clone(), material, particles: none..none, volume0, mass });
        problem.setup.sources.push(built);
    }
    (problem.setup.integrator, problem.setup.integrator_reason) =
        cost::choose(&problem.setup, &problem.particles, scene.solver.integrator);
    problem
}

fn axis(domain: &schema::Domain, a: usize, dimension: usize) -> Axis {
    if a >= dimension {
        return Axis::Walls([Contact { kind: ContactKind::Slip, friction: 0.0 }; 2]);
    }
    let name = ["x", "y", "z"][a];
    if let Some(Boundary::Periodic(_)) = domain.boundary.get(name) {
        return Axis::Periodic;
    }
    let wall = |side: &str| match domain.boundary.get(&format!("{name}{side}")).or(domain.boundary.get(name)) {
        Some(Boundary::Wall(wall)) => Contact { kind: wall.contact, friction: wall.friction },
        _ => Contact { kind: ContactKind::Sticky, friction: 0.0 },
    };
    Axis::Walls([wall("-"), wall("+")])
}

/// Angular velocity as three components; one component turns about z.
pub(crate) fn spin(w: &[f64]) -> [f64; 3] {
    if let [w] = w { [0.0, 0.0, *w] } else { vector3(w) }
}

/// Samples a shape: positions, and the volume of one particle (m^d).
fn fill(problem: &Problem, scene: &Scene, body: &schema::Body, index: usize, shape: &Shape) -> (Vec<[f64; 3]>, f64) {
    let d = problem.setup.dimension;
    let (per_cell, per_axis) = particles_per_cell(body, d);
    let per_axis = per_axis.expect("a valid scene");
    let sdf = sdf(shape, d);
    let points = |per_axis: f64| lattice(&scene.domain, per_axis, &sdf, d).clipped(problem.setup.cells, per_axis);
    let x = points(per_axis).sample(&sdf, body.sampling, scene.seed, index as u64);
    let volume0 = match body.sampling {
        Sampling::Regular | Sampling::Jittered => problem.setup.dx.powi(d as i32) / f64::from(per_cell),
        Sampling::PoissonDisk => points(per_axis.ceil()).volume(&sdf) / x.len().max(1) as f64,
    };
    (x, volume0)
}

/// Adds a body with v_p = v + (Ω + G)(x_p - c) and B_p = (Ω + G) D(x_p), c the centroid of its particles; velocities and deformations
/// of a file are added to that.
fn add_body(problem: &mut Problem, scene: &Scene, body: &schema::Body, index: usize, material: usize) {
    let (d, dx, origin) = (problem.setup.dimension, problem.setup.dx, problem.setup.origin);
    let read = body.points.as_ref().and_then(|points| points.read.as_deref());
    let (x, volume0) = match (&body.shape, read) {
        (Some(shape), _) => fill(problem, scene, body, index, shape),
        (None, Some(read)) => {
            let share = dx.powi(d as i32) / f64::from(particles_per_cell(body, d).0);
            (read.x.clone(), read.volume.unwrap_or(share))
        }
        (None, None) => unreachable!("a valid scene's body has a shape or points"),
    };

    let centroid = mean(&x);
    let velocity = body.velocity.as_deref().map_or([0.0; 3], vector3);
    let c = velocity_gradient(body);
    let own = read.and_then(|read| read.v.as_ref());
    let v: Vec<[f64; 3]> = x
        .par_iter()
        .enumerate()
        .map(|(n, x)| {
            let velocity = own.map_or(velocity, |own| std::array::from_fn(|a| velocity[a] + own[n][a]));
            let turn = rotate(&c, [x[0] - centroid[0], x[1] - centroid[1], x[2] - centroid[2]]);
            [velocity[0] + turn[0], velocity[1] + turn[1], velocity[2] + turn[2]]
        })
        .collect();
    let (kernel, transfer) = (problem.setup.kernel, problem.setup.transfer);
    let b: Vec<[f64; 9]> = x
        .par_iter()
        .map(|x| {
            if transfer == Transfer::Pic || c == [0.0; 9] {
                return [0.0; 9];
            }
            let moments = moment_matrix(kernel, std::array::from_fn(|a| (x[a] - origin[a]) / dx), dx, d);
            std::array::from_fn(|k| (0..3).map(|j| c[3 * (k / 3) + j] * moments[3 * j + k % 3]).sum())
        })
        .collect();

    let material_law = &problem.setup.materials[material];
    let particles = &mut problem.particles;
    let start = particles.len();
    let (d, count) = (problem.setup.dimension, x.len());
    let given = deformation(given_deformation(body), body.j, material_law, d);
    let f = match read.and_then(|read| read.f.as_ref()) {
        Some(f) => f.iter().map(|f| deformation(*f, None, material_law, d)).collect(),
        None => vec![given; count],
    };
    let plastic = vec![initial_plastic_state(material_law); count];
    particles.append(Particles { x, v, b, f, plastic, body: vec![index as u32; count] });
    problem.setup.bodies.push(Body {
        name: body.name.clone(),
        material,
        particles: start..particles.len(),
        volume0,
        mass: material_law.density() * volume0,
    });
}

fn mean(x: &[[f64; 3]]) -> [f64; 3] {
    let n = x.len().max(1) as f64;
    // Relative to the first point, which keeps the digits of bodies far from the origin.
    let first = x.first().copied().unwrap_or_default();
    std::array::from_fn(|a| first[a] + x.iter().map(|x| x[a] - first[a]).sum::<f64>() / n)
}

/// Spin and velocity gradient as one row-major matrix (1/s).
fn velocity_gradient(body: &schema::Body) -> [f64; 9] {
    let w = body.angular_velocity.as_deref().map_or([0.0; 3], spin);
    let mut c = [0.0, -w[2], w[1], w[2], 0.0, -w[0], -w[1], w[0], 0.0];
    for (i, row) in body.velocity_gradient.iter().flatten().enumerate() {
        for (j, value) in row.iter().enumerate() {
            c[3 * i + j] += value;
        }
    }
    c
}

/// The deformation gradient of the document.
fn given_deformation(body: &schema::Body) -> [f64; 9] {
    let mut f = IDENTITY;
    for (i, row) in body.deformation_gradient.iter().flatten().enumerate() {
        for (j, value) in row.iter().enumerate() {
            f[3 * i + j] = *value;
        }
    }
    f
}

/// Initial F, or that of the volume ratio if one is given; a fluid keeps only the volume ratio.
fn deformation(mut f: [f64; 9], j: Option<f64>, material: &Material, dimension: usize) -> [f64; 9] {
    let volume_ratio = match material {
        Material::WeaklyCompressibleFluid(_) => Some(j.unwrap_or(determinant(&f))),
        _ => j,
    };
    if let Some(j) = volume_ratio {
        let stretch = j.powf(1.0 / dimension as f64);
        f = [0.0; 9];
        for a in 0..3 {
            f[4 * a] = if a < dimension { stretch } else { 1.0 };
        }
    }
    f
}

pub(crate) fn determinant(m: &[f64; 9]) -> f64 {
    m[0] * (m[4] * m[8] - m[5] * m[7]) - m[1] * (m[3] * m[8] - m[5] * m[6]) + m[2] * (m[3] * m[7] - m[4] * m[6])
}
