//! Triangle meshes of signed distance fields: surface nets (Gibson 1998), with one vertex for each
//! cell that the surface crosses.

use rayon::prelude::*;

/// A closed surface.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    pub vertices: Vec<[f64; 3]>,
    /// Vertex indices, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
}

/// Meshes the zero surface of `distance` in a box with `resolution` cells along its longest side.
///
/// The box is a boundary too: parts of the solid outside it are cut off, and the cut is closed.
pub fn mesh(distance: impl Fn([f64; 3]) -> f64 + Sync, lower: [f64; 3], upper: [f64; 3], resolution: usize) -> Mesh {
    let extent: [f64; 3] = std::array::from_fn(|a| upper[a] - lower[a]);
    let h = extent.into_iter().fold(0.0, f64::max) / resolution as f64;
    // One ring of samples outside the box on every side, so that the cut is closed.
    let n: [usize; 3] = std::array::from_fn(|a| (extent[a] / h).ceil() as usize + 3);
    let at = |i: [usize; 3]| -> [f64; 3] { std::array::from_fn(|a| lower[a] + (i[a] as f64 - 1.0) * h) };
    let index = |i: [usize; 3]| (i[2] * n[1] + i[1]) * n[0] + i[0];
    let unindex = |k: usize| [k % n[0], k / n[0] % n[1], k / (n[0] * n[1])];
    let cut = |x: [f64; 3]| (0..3).map(|a| (lower[a] - x[a]).max(x[a] - upper[a])).fold(f64::NEG_INFINITY, f64::max);
    let samples: Vec<f64> = (0..n[0] * n[1] * n[2])
        .into_par_iter()
        .map(|k| {
            let x = at(unindex(k));
            distance(x).max(cut(x))
        })
        .collect();

    let mut mesh = Mesh::default();
    let mut vertex_of = vec![u32::MAX; samples.len()];
    for k in 0..samples.len() {
        let i = unindex(k);
        if (0..3).any(|a| i[a] + 1 == n[a]) {
            continue;
        }
        if let Some(offset) = crossing(|corner| samples[index(std::array::from_fn(|a| i[a] + corner[a]))]) {
            vertex_of[k] = mesh.vertices.len() as u32;
            let x = at(i);
            mesh.vertices.push(std::array::from_fn(|a| x[a] + h * offset[a]));
        }
    }
    for k in 0..samples.len() {
        let i = unindex(k);
        for a in 0..3 {
            let (b, c) = ((a + 1) % 3, (a + 2) % 3);
            if i[a] + 1 >= n[a] || i[b] == 0 || i[c] == 0 {
                continue;
            }
            let mut end = i;
            end[a] += 1;
            let (start_inside, end_inside) = (samples[k] < 0.0, samples[index(end)] < 0.0);
            if start_inside == end_inside {
                continue;
            }
            // The four cells around the edge, counter-clockwise about axis a.
            let cell = |db: usize, dc: usize| {
                let mut j = i;
                j[b] -= db;
                j[c] -= dc;
                vertex_of[index(j)]
            };
            let [p, q, r, s] = [cell(1, 1), cell(0, 1), cell(0, 0), cell(1, 0)];
            mesh.triangles.extend(if start_inside { [[p, q, r], [p, r, s]] } else { [[p, r, q], [p, s, r]] });
        }
    }
    mesh
}

/// Mean of the points where the surface crosses a unit cell's edges; `None` if it crosses none.
fn crossing(sample: impl Fn([usize; 3]) -> f64) -> Option<[f64; 3]> {
    let mut sum = [0.0; 3];
    let mut count = 0.0;
    for a in 0..3 {
        for (u, w) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
            let mut corner = [0; 3];
            (corner[(a + 1) % 3], corner[(a + 2) % 3]) = (u, w);
            let start = sample(corner);
            corner[a] = 1;
            let end = sample(corner);
            if (start < 0.0) != (end < 0.0) {
                corner[a] = 0;
                (0..3).for_each(|k| sum[k] += corner[k] as f64);
                sum[a] += start / (start - end);
                count += 1.0;
            }
        }
    }
    (count > 0.0).then(|| sum.map(|s| s / count))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Volume by the divergence theorem; positive only if the triangles face outwards.
    fn volume(mesh: &Mesh) -> f64 {
        let v = |k: u32| mesh.vertices[k as usize];
        let triple = |[a, b, c]: [[f64; 3]; 3]| {
            a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2]) + a[2] * (b[0] * c[1] - b[1] * c[0])
        };
        mesh.triangles.iter().map(|t| triple(t.map(v)) / 6.0).sum()
    }

    #[test]
    fn a_torus_has_its_volume_and_its_hole() {
        let torus = |x: [f64; 3]| ((x[0].hypot(x[1]) - 1.0).powi(2) + x[2] * x[2]).sqrt() - 0.3;
        let mesh = mesh(torus, [-1.3, -1.3, -0.3], [1.3, 1.3, 0.3], 64);
        let exact = 2.0 * std::f64::consts::PI.powi(2) * 0.09;
        assert!((volume(&mesh) / exact - 1.0).abs() < 0.02, "{} against {exact}", volume(&mesh));
        // The Euler characteristic of a torus is 0: V - E + F with E = 3F/2.
        assert_eq!(mesh.vertices.len() * 2, mesh.triangles.len());
        assert!(mesh.vertices.iter().all(|&v| torus(v).abs() < 0.01));
    }

    #[test]
    fn a_half_space_is_closed_at_the_box() {
        let mesh = mesh(|x| x[2] - 0.5, [0.0; 3], [2.0, 1.0, 1.0], 40);
        assert!((volume(&mesh) - 1.0).abs() < 0.08, "{}", volume(&mesh));
    }
}
