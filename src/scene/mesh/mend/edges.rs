//! The edges of a mesh, with the triangles at each.

use rayon::prelude::*;

use crate::mesh::triangles::TriangleMesh;

/// One side of an edge: a triangle that runs along it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Side {
    /// The edge's vertices, the smaller one first.
    pub edge: [u32; 2],
    pub triangle: u32,
    /// The edge starts at this corner of the triangle.
    pub corner: u8,
    /// Whether the triangle runs from the smaller vertex to the larger one.
    pub forward: bool,
}

/// All sides of all edges, sorted by edge.
pub struct Edges(Vec<Side>);

impl Edges {
    pub fn new(mesh: &TriangleMesh) -> Self {
        let sides_of = |(n, t): (usize, &[u32; 3])| {
            let t = *t;
            (0..3).map(move |k| {
                let (from, to) = (t[k], t[(k + 1) % 3]);
                let edge = [from.min(to), from.max(to)];
                Side { edge, triangle: n as u32, corner: k as u8, forward: from < to }
            })
        };
        let mut sides: Vec<Side> = mesh.triangles.iter().enumerate().flat_map(sides_of).collect();
        sides.par_sort_unstable();
        Self(sides)
    }

    /// The edges, each as its sides.
    pub fn iter(&self) -> impl Iterator<Item = &[Side]> {
        self.0.chunk_by(|a, b| a.edge == b.edge)
    }

    /// The number of open edges, which the triangles there do not run along once in each direction,
    /// and the number of all edges.
    pub fn open(&self) -> (usize, usize) {
        self.iter().fold((0, 0), |(open, all), sides| (open + usize::from(balance(sides) != 0), all + 1))
    }
}

/// How many more triangles run along an edge forwards than backwards.
pub fn balance<'a>(sides: impl IntoIterator<Item = &'a Side>) -> i32 {
    sides.into_iter().map(|side| if side.forward { 1 } else { -1 }).sum()
}
