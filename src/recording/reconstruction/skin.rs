//! The surface of one body.

use rayon::ThreadPoolBuilder;
use splashsurf_lib::mesh::{Mesh3d, TriMesh3d};
use splashsurf_lib::nalgebra::Vector3;
use splashsurf_lib::postprocessing::{par_laplacian_smoothing_inplace, par_laplacian_smoothing_normals_inplace};
use splashsurf_lib::sph_interpolation::SphInterpolator;
use splashsurf_lib::{Parameters, SurfaceReconstruction, reconstruct_surface};

/// Radius of the kernel, edge of the marching cubes: in radii of particles, which are half their spacing.
const SUPPORT: f32 = 4.0;
const CUBE: f32 = 0.75;
/// Share of the density of a whole body where its surface is; with it surfaces enclose what particles do.
const THRESHOLD: f32 = 0.6;
/// Rounds of smoothing, of positions and of normals.
const SMOOTHING: usize = 25;
const NORMALS: usize = 10;
/// So many neighbours, weighted by their distance, make a particle part of a bulk, whose surface is smoothed as a
/// whole.
const BULK: f32 = 13.0;

/// Points of a body.
#[derive(Clone, Debug, Default)]
pub struct Points {
    /// m.
    pub positions: Vec<Vector3<f32>>,
    /// m/s; none, or of all points.
    pub velocities: Vec<Vector3<f32>>,
}

/// Triangles that enclose a body.
#[derive(Clone, Debug, Default)]
pub struct Skin {
    /// m.
    pub positions: Vec<[f32; 3]>,
    /// Outwards, of length 1.
    pub normals: Vec<[f32; 3]>,
    /// m/s; none, or of all vertices.
    pub velocities: Vec<[f32; 3]>,
    /// Counter-clockwise, seen from outside.
    pub triangles: Vec<[u32; 3]>,
}

/// The surface of points at this distance from each other.
///
/// It is made on one thread: on several, the order of vertices and of sums would be that of their scheduling.
pub fn skin(points: &Points, spacing: f32) -> Result<Skin, String> {
    let alone = ThreadPoolBuilder::new().num_threads(1).build().map_err(|error| error.to_string())?;
    alone.install(|| reconstruct(points, spacing))
}

fn reconstruct(points: &Points, spacing: f32) -> Result<Skin, String> {
    let mut parameters = Parameters::new_relative(0.5 * spacing, SUPPORT, CUBE);
    parameters.iso_surface_threshold = THRESHOLD;
    parameters.global_neighborhood_list = true;
    let surface: SurfaceReconstruction<i64, f32> =
        reconstruct_surface(&points.positions, &parameters).map_err(|error| reasons(&error))?;
    let densities = surface.particle_densities.as_deref().ok_or("it has no densities")?;
    let neighbours = surface.particle_neighbors.as_deref().ok_or("it has no neighbours")?;
    let mass = parameters.rest_density * spacing.powi(3);
    let field = SphInterpolator::new(&points.positions, densities, mass, parameters.compact_support_radius);

    let mut mesh = surface.mesh.clone();
    let around = mesh.vertex_vertex_connectivity();
    let weights = weights(points, neighbours, parameters.compact_support_radius);
    let weights = field.interpolate_scalar_quantity(&weights, &mesh.vertices, true);
    let weights: Vec<f32> = weights.into_iter().map(|weight| if weight.is_finite() { weight } else { 0.0 }).collect();
    par_laplacian_smoothing_inplace(&mut mesh, &around, SMOOTHING, 1.0, &weights);
    let mut normals: Vec<Vector3<f32>> =
        mesh.par_vertex_normals().into_iter().map(|normal| normal.into_inner()).collect();
    par_laplacian_smoothing_normals_inplace(&mut normals, &around, NORMALS);
    // On the smallest drops they cancel out, or triangles have no area: there, away from where the density is.
    let lost: Vec<usize> = (0..normals.len()).filter(|k| !normals[*k].iter().all(|c| c.is_finite())).collect();
    let places: Vec<Vector3<f32>> = lost.iter().map(|k| mesh.vertices[*k]).collect();
    for (k, normal) in lost.into_iter().zip(field.interpolate_normals(&places)) {
        normals[k] = normal.into_inner();
    }
    Ok(finished(points, &field, mesh, normals))
}

fn finished(points: &Points, field: &SphInterpolator<f32>, mesh: TriMesh3d<f32>, normals: Vec<Vector3<f32>>) -> Skin {
    let mut skin = Skin::default();
    if !points.velocities.is_empty() {
        let mean = points.velocities.iter().sum::<Vector3<f32>>() / points.velocities.len() as f32;
        let velocities = field.interpolate_vector_quantity(&points.velocities, &mesh.vertices, true);
        // Smoothing may leave a vertex beyond the reach of any particle.
        let known = |v: Vector3<f32>| if v.iter().all(|c| c.is_finite()) { v } else { mean };
        skin.velocities = velocities.into_iter().map(|v| known(v).into()).collect();
    }
    let unit = |normal: Vector3<f32>| normal.try_normalize(1e-6).filter(|n| n.x.is_finite()).unwrap_or_else(Vector3::z);
    skin.normals = normals.into_iter().map(|normal| unit(normal).into()).collect();
    skin.positions = mesh.vertices.iter().map(|x| (*x).into()).collect();
    skin.triangles = mesh.triangles.iter().map(|corners| corners.map(|corner| corner as u32)).collect();
    skin
}

/// How much a particle's surroundings are smoothed, 0 to 1: much in a bulk, little in a thin sheet or a drop.
fn weights(points: &Points, neighbours: &[Vec<usize>], support: f32) -> Vec<f32> {
    let weight = |(k, near): (usize, &Vec<usize>)| {
        let share = |other: &usize| {
            let distance = (points.positions[k] - points.positions[*other]).norm_squared();
            1.0 - (distance / (support * support)).clamp(0.0, 1.0)
        };
        let x = (near.iter().map(share).sum::<f32>() / BULK).clamp(0.0, 1.0);
        // The smootherstep of Perlin (2002).
        x * x * x * (x * (x * 6.0 - 15.0) + 10.0)
    };
    neighbours.iter().enumerate().map(weight).collect()
}

/// An error with its causes.
fn reasons(error: &dyn std::error::Error) -> String {
    let mut text = error.to_string();
    let mut cause = error.source();
    while let Some(error) = cause {
        text += &format!(": {error}");
        cause = error.source();
    }
    text
}

#[cfg(test)]
mod tests;
