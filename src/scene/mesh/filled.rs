//! The volume that a sampled shape really has.

use gridfall_core::sim::collider::DistanceField;
use rayon::prelude::*;

/// Parts of a lattice cell along an axis, where the surface cuts it.
const PARTS: usize = 4;

/// Volume where the interpolated distance is negative (m³), in 3D.
pub fn filled_volume(field: &DistanceField) -> f64 {
    let [nx, ny, nz] = field.size;
    let cells: Vec<f64> = (0..(ny - 1) * (nz - 1))
        .into_par_iter()
        .map(|row| {
            let (j, k) = (row % (ny - 1), row / (ny - 1));
            (0..nx - 1).map(|i| share(field, [i, j, k])).sum()
        })
        .collect();
    // In a fixed order, so that the sum does not depend on the number of threads.
    cells.iter().sum::<f64>() * field.spacing.powi(3)
}

/// The share of a lattice cell that is inside.
fn share(field: &DistanceField, cell: [usize; 3]) -> f64 {
    let [nx, ny, _] = field.size;
    let corner = |n: usize| -> f64 {
        let at: [usize; 3] = std::array::from_fn(|a| cell[a] + (n >> a & 1));
        f64::from(field.samples[at[0] + nx * (at[1] + ny * at[2])])
    };
    let corners: [f64; 8] = std::array::from_fn(corner);
    let inside = corners.iter().filter(|d| **d < 0.0).count();
    if inside % 8 == 0 {
        return if inside == 0 { 0.0 } else { 1.0 };
    }
    let side = field.spacing / PARTS as f64;
    let part = |n: usize| {
        let at = [n % PARTS, n / PARTS % PARTS, n / (PARTS * PARTS)];
        let u = at.map(|i| (i as f64 + 0.5) / PARTS as f64);
        let weight = |c: usize| (0..3).map(|a| if c >> a & 1 == 1 { u[a] } else { 1.0 - u[a] }).product::<f64>();
        let distance: f64 = (0..8).map(|c| weight(c) * corners[c]).sum();
        // The share of the part behind a plane at this distance, on the average.
        (0.5 - distance / side).clamp(0.0, 1.0)
    };
    (0..PARTS.pow(3)).map(part).sum::<f64>() / PARTS.pow(3) as f64
}
