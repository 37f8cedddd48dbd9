//! A triangle mesh, and the reason why one cannot be used.

use std::collections::HashMap;

/// Triangles that face outwards, in metres.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TriangleMesh {
    pub vertices: Vec<[f64; 3]>,
    /// Vertex indices, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
    /// The distance between neighbouring numbers of the file's format where the vertices are (m).
    pub resolution: [f64; 3],
}

/// Vertices closer than this fraction of the mesh's extent are merged.
const WELD: f64 = 1e-6;

impl TriangleMesh {
    /// Lower and upper corner; lower > upper without vertices.
    pub fn bounds(&self) -> [[f64; 3]; 2] {
        let mut bounds = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
        for v in &self.vertices {
            for a in 0..3 {
                bounds[0][a] = bounds[0][a].min(v[a]);
                bounds[1][a] = bounds[1][a].max(v[a]);
            }
        }
        bounds
    }

    /// The largest coordinate on each axis, without its sign (m).
    pub fn largest(&self) -> [f64; 3] {
        let [lower, upper] = self.bounds();
        std::array::from_fn(|a| lower[a].abs().max(upper[a].abs()))
    }

    /// Merges vertices that lie together, which formats without shared vertices need. Triangles
    /// that collapse and vertices that no triangle uses are dropped.
    pub fn weld(&mut self) {
        let [lower, upper] = self.bounds();
        let extent = (0..3).map(|a| upper[a] - lower[a]).fold(0.0, f64::max);
        let tolerance = (WELD * extent).max(f64::MIN_POSITIVE);
        // Two vertices within a tolerance of each other always touch a common cell.
        let cell = |v: &[f64; 3], side: f64| v.map(|x| ((x - lower[0]) / (4.0 * tolerance) + side).floor() as i64);
        let close = |a: &[f64; 3], b: &[f64; 3]| (0..3).all(|k| (a[k] - b[k]).abs() <= tolerance);
        let mut cells: HashMap<[i64; 3], Vec<u32>> = HashMap::new();
        let (mut kept, mut known): (Vec<[f64; 3]>, HashMap<[u64; 3], u32>) = Default::default();
        let mut number = |v: &[f64; 3]| -> u32 {
            // Makes 0 of -0.
            let bits = v.map(|x| (x + 0.0).to_bits());
            if let Some(n) = known.get(&bits) {
                return *n;
            }
            let corners = [cell(v, -0.25), cell(v, 0.25)];
            let mut touched: Vec<[i64; 3]> = (0..8).map(|k| std::array::from_fn(|a| corners[k >> a & 1][a])).collect();
            touched.dedup();
            let mut candidates = touched.iter().filter_map(|c| cells.get(c)).flatten();
            let n = candidates.find(|n| close(&kept[**n as usize], v)).copied().unwrap_or_else(|| {
                let n = kept.len() as u32;
                kept.push(*v);
                cells.entry(cell(v, 0.0)).or_default().push(n);
                n
            });
            known.insert(bits, n);
            n
        };
        let vertices = &self.vertices;
        let numbered = self.triangles.iter().map(|t| t.map(|v| number(&vertices[v as usize])));
        let triangles: Vec<[u32; 3]> = numbered.filter(|t| t[0] != t[1] && t[1] != t[2] && t[2] != t[0]).collect();
        (self.vertices, self.triangles) = (kept, triangles);
    }

    /// The corners of triangle `n`.
    pub fn corners(&self, n: usize) -> [[f64; 3]; 3] {
        self.triangles[n].map(|v| self.vertices[v as usize])
    }

    /// The middle of triangle `n`.
    pub fn middle(&self, n: usize) -> [f64; 3] {
        let corners = self.corners(n);
        std::array::from_fn(|a| corners.iter().map(|v| v[a]).sum::<f64>() / 3.0)
    }

    /// The outward normal of triangle `n`, as long as its area (m²).
    pub fn normal(&self, n: usize) -> [f64; 3] {
        let [a, b, c] = self.corners(n);
        cross(sub(b, a), sub(c, a)).map(|x| 0.5 * x)
    }

    /// Area of triangle `n` (m²).
    pub fn area(&self, n: usize) -> f64 {
        let normal = self.normal(n);
        dot(normal, normal).sqrt()
    }

    /// Volume of the cones from `origin` to the given triangles (m³): what they enclose if they are
    /// closed (divergence theorem); negative when they face inwards.
    pub fn volume_of(&self, triangles: impl IntoIterator<Item = u32>, origin: [f64; 3]) -> f64 {
        let cone = |n: u32| {
            let [a, b, c] = self.corners(n as usize).map(|v| sub(v, origin));
            dot(a, cross(b, c)) / 6.0
        };
        triangles.into_iter().map(cone).sum()
    }

    /// The most by which rounding in the file may have changed the volume (m³): all faces move by
    /// half of the resolution.
    pub fn rounding(&self) -> f64 {
        let normals = (0..self.triangles.len()).map(|n| self.normal(n));
        let area = normals.fold([0.0; 3], |sum: [f64; 3], n| std::array::from_fn(|a| sum[a] + n[a].abs()));
        0.5 * dot(area, self.resolution)
    }

    /// Volume of the box around all vertices (m³).
    pub fn box_volume(&self) -> f64 {
        let [lower, upper] = self.bounds();
        (0..3).map(|a| (upper[a] - lower[a]).max(0.0)).product()
    }
}

/// The distance between neighbouring numbers in f32 near `x`.
pub fn f32_spacing(x: f64) -> f64 {
    let x = x.abs() as f32;
    f64::from(x.next_up()) - f64::from(x)
}

pub fn sub(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

pub fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// Why a mesh cannot be used.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MeshError(pub String);

impl MeshError {
    pub fn new(what: impl std::fmt::Display) -> Self {
        Self(what.to_string())
    }
}
