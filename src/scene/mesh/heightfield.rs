//! A heightfield as a closed mesh: the solid between a flat base and a surface over a rectangle.

use super::triangles::TriangleMesh;

/// The solid below `heights` (m, along z), which are evenly spaced over the rectangle from `min` to
/// `max`: `heights[j][i]` with i along x and j along y. Each cell of the surface is two triangles,
/// cut from (i, j) to (i + 1, j + 1). None if lengths or values make no solid.
pub fn solid(min: &[f64], max: &[f64], base: f64, heights: &[Vec<f64>]) -> Option<TriangleMesh> {
    let columns = heights.first().map_or(0, Vec::len);
    let even = heights.iter().all(|row| row.len() == columns && row.iter().all(|h| *h >= base && h.is_finite()));
    let sides = min.len() == 2 && max.len() == 2 && (0..2).all(|a| min[a] < max[a] && (max[a] - min[a]).is_finite());
    (even && sides && heights.len() >= 2 && columns >= 2 && base.is_finite())
        .then(|| build([min[0], min[1]], [max[0], max[1]], base, heights))
}

fn build(min: [f64; 2], max: [f64; 2], base: f64, heights: &[Vec<f64>]) -> TriangleMesh {
    let (rows, columns) = (heights.len(), heights[0].len());
    let along = |a: usize, k: usize, n: usize| min[a] + (max[a] - min[a]) * k as f64 / (n - 1) as f64;
    let mut mesh = TriangleMesh::default();
    for level in [false, true] {
        for j in 0..rows {
            for i in 0..columns {
                let z = if level { heights[j][i] } else { base };
                mesh.vertices.push([along(0, i, columns), along(1, j, rows), z]);
            }
        }
    }
    let vertex = |level: usize, i: usize, j: usize| ((level * rows + j) * columns + i) as u32;
    for j in 0..rows - 1 {
        for i in 0..columns - 1 {
            for level in [0, 1] {
                let [a, b, c, d] = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)].map(|(i, j)| vertex(level, i, j));
                let faces = [[a, b, c], [a, c, d]];
                mesh.triangles.extend(if level == 1 { faces } else { faces.map(|[a, b, c]| [a, c, b]) });
            }
        }
    }
    // The walls follow the rim, counter-clockwise seen from above.
    let rim = (0..columns - 1).map(|i| (i, 0)).chain((0..rows - 1).map(|j| (columns - 1, j)));
    let back = (1..columns).rev().map(|i| (i, rows - 1)).chain((1..rows).rev().map(|j| (0, j)));
    let rim: Vec<(usize, usize)> = rim.chain(back).collect();
    for (n, &(i, j)) in rim.iter().enumerate() {
        let (k, l) = rim[(n + 1) % rim.len()];
        let [a, b, c, d] = [vertex(0, i, j), vertex(0, k, l), vertex(1, k, l), vertex(1, i, j)];
        mesh.triangles.extend([[a, b, c], [a, c, d]]);
    }
    mesh
}

/// The 2D solid below a row of heights from `min` to `max`, as a mesh so deep along z that its ends
/// do not affect its section at z = 0. None if lengths or values make no solid.
pub fn section(min: &[f64], max: &[f64], base: f64, heights: &[Vec<f64>]) -> Option<TriangleMesh> {
    let ([min], [max], [heights]) = (min, max, heights) else { return None };
    let (low, high) = heights.iter().fold((base, base), |(low, high), h| (low.min(*h), high.max(*h)));
    let depth = 4.0 * ((max - min) + (high - low));
    let mut mesh = solid(&[*min, -depth], &[*max, depth], base, &[heights.clone(), heights.clone()])?;
    // Height lies along y in 2D; the turn keeps the orientation.
    for v in &mut mesh.vertices {
        *v = [v[0], v[2], -v[1]];
    }
    Some(mesh)
}
