//! Conforming sampling: points in layers parallel to the surface, half a spacing, one and a half, …
//! below it.
//!
//! The lattice cuts a curved surface into facets, and a body stands and rolls on the facets. Points
//! of a layer all have the same depth instead.
//!
//! 1. `seeds` puts as many points into each layer, and into each part of it, as its volume is worth.
//!    Far below the layers, these are the points of the lattice.
//! 2. `relax` moves each point of a layer to the layer's depth, and pushes points apart. Points
//!    between the layers and the undisturbed lattice move freely.
//!
//! Where the solid is too thin for a layer, its points move freely as well. All that is asked of the
//! solid is its signed distance, so one method serves all shapes. The points depend on the solid,
//! the lattice, the seed and the body alone.

mod neighbours;
mod relax;
mod seeds;
#[cfg(test)]
mod tests;

use gridfall_core::sim::collider::{FLAT_HALF_EXTENT, Primitive, Sdf, SdfOp};
use gridfall_core::sim::particles::IDENTITY;

use super::{Block, FINER, Lattice, halves_above, points};

/// Layers parallel to the surface.
const LAYERS: usize = 3;

/// Spacings below the layers in which points move, to make the layers and the lattice meet.
const BETWEEN: f64 = 2.0;

/// Depth (spacings) that some point must have, for a solid to take a layer. Half a spacing is
/// needed; a search at every `FINER`th part of the spacing may miss the deepest point by half of that.
const LEAST_DEPTH: f64 = 0.5 - 0.5 / FINER as f64;

/// A solid on a lattice.
struct Solid {
    sdf: Sdf,
    lattice: Lattice,
}

/// Points in the layers of a solid, and the volume (m^d) that they share.
pub fn fill(lattice: &Lattice, sdf: &Sdf, seed: u64, body: u64) -> (Vec<[f64; 3]>, f64) {
    let solid = Solid::new(lattice, sdf);
    let mut seeds = seeds::scatter(&solid, seed, body);
    relax::relax(&solid, &mut seeds);
    (seeds.x, seeds.volume)
}

/// Whether the solid is thick enough for a layer somewhere.
pub fn is_thick(lattice: &Lattice, sdf: &Sdf) -> bool {
    let solid = Solid::new(lattice, sdf);
    solid.reaches(&lattice.range, LEAST_DEPTH * lattice.spacing)
}

impl Solid {
    /// The part of a solid inside the bounds of the lattice, whose faces count as surfaces.
    fn new(lattice: &Lattice, sdf: &Sdf) -> Self {
        let (mut sdf, d) = (sdf.clone(), lattice.dimension);
        let ([lower, upper], [solid_lower, solid_upper]) = (lattice.bounds(), sdf.bounds());
        if (0..d).any(|a| solid_lower[a] < lower[a] || solid_upper[a] > upper[a]) {
            let half = |a: usize| if a < d { 0.5 * (upper[a] - lower[a]) } else { FLAT_HALF_EXTENT };
            let center = |a: usize| if a < d { 0.5 * (upper[a] + lower[a]) } else { 0.0 };
            let primitive = Primitive::Box(std::array::from_fn(half));
            let translation = std::array::from_fn(center);
            sdf.ops.push(SdfOp::Primitive { primitive, rotation: IDENTITY, translation });
            sdf.ops.push(SdfOp::Intersection);
        }
        Self { sdf, lattice: lattice.clone() }
    }

    /// Distance to the surface (m), positive inside.
    fn depth(&self, x: [f64; 3]) -> f64 {
        -self.sdf.distance(x)
    }

    /// By how much the depth may change between the centre of a block and its other points (m).
    fn reach(&self, block: &Block) -> f64 {
        let extent = |a: usize| (block[a].end - block[a].start) as f64;
        let diagonal = (0..self.lattice.dimension).map(|a| extent(a) * extent(a)).sum::<f64>().sqrt();
        0.5 * self.lattice.spacing * diagonal + self.sdf.slack()
    }

    fn center(&self, block: &Block) -> [f64; 3] {
        let half = |a: usize| 0.5 * (block[a].end - block[a].start) as f64;
        self.lattice.point(std::array::from_fn(|a| block[a].start), std::array::from_fn(half))
    }

    /// Whether a block has a point of the given depth, as far as `FINER` points a spacing tell.
    fn reaches(&self, block: &Block, depth: f64) -> bool {
        let at_center = self.depth(self.center(block));
        if points(block) == 0 || at_center + self.reach(block) < depth {
            return false;
        }
        at_center >= depth
            || match halves_above(block, 1) {
                Some((low, high)) => self.reaches(&low, depth) || self.reaches(&high, depth),
                None => self.fine([block[0].start, block[1].start, block[2].start]).any(|x| self.depth(x) >= depth),
            }
    }

    /// `FINER`^d points in the cell of a lattice point, evenly spaced.
    fn fine(&self, cell: [i64; 3]) -> impl Iterator<Item = [f64; 3]> {
        let d = self.lattice.dimension as u32;
        (0..FINER.pow(d)).map(move |k| {
            let offset = |a: usize| ((k / FINER.pow(a as u32) % FINER) as f64 + 0.5) / FINER as f64;
            self.lattice.point(cell, std::array::from_fn(offset))
        })
    }
}
