//! The bodies of a valid scene: their particles, sampled or from files, and the initial state.

use gridfall_core::material::initial_plastic_state;
use gridfall_core::sim::collider::{Sdf, rotate};
use gridfall_core::sim::moments::moment_matrix;
use gridfall_core::sim::particles::{IDENTITY, Particles};
use gridfall_core::sim::setup::{Body, Contact, Problem, Setup};
use rayon::prelude::*;

use crate::grid::{lattice, particles_per_axis, particles_per_cell, periodic};
use crate::resolve::Resolved;
use crate::schema::{self, Material, Sampling, Scene, Transfer};
use crate::shape;
use crate::vectors::{determinant, matrix3, spin, vector3};

/// Samples the shape `sdf` of body number `index`: positions, and the volume of one particle (m^d).
fn fill(setup: &Setup, scene: &Scene, index: usize, sdf: &Sdf) -> (Vec<[f64; 3]>, f64) {
    let (d, body) = (setup.dimension, &scene.bodies[index]);
    let per_cell = particles_per_cell(body.particles_per_cell, d);
    let per_axis = particles_per_axis(body, d).expect("a valid scene");
    let points = |per_axis: f64| {
        lattice(&scene.domain, per_axis, sdf, d).clipped(setup.cells, per_axis, periodic(&scene.domain, d))
    };
    let lattice = points(per_axis);
    let share = |volume: f64, x: &[[f64; 3]]| volume / x.len().max(1) as f64;
    if body.sampling == Sampling::Conforming {
        let (x, volume) = lattice.layers(sdf, scene.seed, index as u64);
        let volume0 = share(volume, &x);
        return (x, volume0);
    }
    let x = lattice.sample(sdf, body.sampling, scene.seed, index as u64);
    let volume0 = match body.sampling {
        Sampling::PoissonDisk => share(points(per_axis.ceil()).volume(sdf), &x),
        _ => setup.dx.powi(d as i32) / f64::from(per_cell),
    };
    (x, volume0)
}

/// Adds body number `index` of the scene: v_p = v + (Ω + G)(x_p - c) and B_p = (Ω + G) D(x_p),
/// where c is the centroid of its particles. Velocities of a file are added to that; deformations
/// of a file replace the scene's.
pub fn add_body(problem: &mut Problem, scene: &Scene, resolved: &Resolved, index: usize, material: usize) {
    let Problem { setup, particles } = problem;
    let body = &scene.bodies[index];
    let (d, dx, origin) = (setup.dimension, setup.dx, setup.origin);
    let read = resolved.points.get(&format!("/bodies/{index}/points"));
    let (x, volume0) = match (&body.shape, read) {
        (Some(shape), _) => {
            let sdf = shape::sdf(shape, &format!("/bodies/{index}/shape"), &resolved.fields, d);
            fill(setup, scene, index, &sdf)
        }
        (None, Some(read)) => {
            let share = dx.powi(d as i32) / f64::from(particles_per_cell(body.particles_per_cell, d));
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
    let (kernel, transfer) = (setup.kernel, setup.transfer);
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

    let x: Vec<[f64; 3]> = x.into_iter().map(|x| setup.wrapped(x)).collect();
    let given = body.deformation_gradient.as_deref().map_or(IDENTITY, matrix3);
    let material_law = &setup.materials[material];
    let (start, count) = (particles.len(), x.len());
    let f = match read.and_then(|read| read.f.as_ref()) {
        Some(f) => f.iter().map(|f| deformation(*f, None, material_law, d)).collect(),
        None => vec![deformation(given, body.j, material_law, d); count],
    };
    let plastic = vec![initial_plastic_state(material_law); count];
    particles.append(Particles { x, v, b, f, plastic, body: vec![index as u32; count], touch: Vec::new() });
    setup.bodies.push(Body {
        name: body.name.clone(),
        material,
        particles: start..particles.len(),
        volume0,
        mass: material_law.density() * volume0,
        contact: body.contact.map(|kind| Contact { kind, friction: body.friction }),
    });
}

fn mean(x: &[[f64; 3]]) -> [f64; 3] {
    let n = x.len().max(1) as f64;
    // Relative to the first point, so that bodies far from the origin lose no digits.
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

/// The initial F, or a uniform stretch if a volume ratio is given. A fluid keeps only the volume
/// ratio.
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
