//! How full the room around a particle is: Σ w m_i / (ρ0 Σ w V_i), see
//! [`gridfall_core::sim::volume`].
//!
//! Far from walls and colliders Σ w V_i = dx^d, and the fill costs nothing but the sum of masses that
//! G2P makes anyway. Where bodies of different materials may meet, P2G sums rest volumes too, because
//! mass does not tell them there.

use super::chunk::{Chunk, LANES, Lanes, State, Stencils, matrix};
use super::constants::Constants;
use super::tile::{self, Layout, Walk, index};
use gridfall_core::maths::linalg::det;
use gridfall_core::maths::real::Real;
use gridfall_core::maths::widest::widest;
use gridfall_core::sim::kernel::ShapeFunction;
use gridfall_core::sim::setup::{Axis, Setup};

/// Nodes of the widest tile along an axis.
const WIDEST: usize = tile::width(1, 4);

/// Share of a node's room inside the walls of an axis, per axis that a wall cuts, grid and node of a
/// block's tile.
pub type WallRoom<T, const D: usize> = [Option<[[T; WIDEST]; 2]>; D];

/// What the nodes of a tile hold beside velocities and masses; nothing where nothing is to be known.
#[derive(Clone, Copy, Debug)]
pub struct Around<'a, T, const D: usize> {
    /// Where walls cut nodes.
    pub walls: Option<&'a WallRoom<T, D>>,
    /// Share of each node's room outside colliders, where one does.
    pub room: Option<&'a [T]>,
    /// Rest volume at each node over dx^d, in scenes of several materials.
    pub filled: Option<&'a [T]>,
}

impl<T, const D: usize> Around<'_, T, D> {
    /// Whether the masses alone do not tell the fill.
    pub fn is_special(&self) -> bool {
        self.walls.is_some() || self.room.is_some() || self.filled.is_some()
    }
}

/// The room of a block's nodes, if a wall cuts it.
pub fn wall_room<T: Real, const D: usize>(
    setup: &Setup,
    layout: &Layout,
    block: &[i32; D],
) -> Option<Box<WallRoom<T, D>>> {
    let room: WallRoom<T, D> = std::array::from_fn(|a| {
        if matches!(setup.axes[a], Axis::Periodic) {
            return None;
        }
        let mut shares = [[T::ONE; WIDEST]; 2];
        let mut cut = false;
        for g in 0..layout.grids {
            for k in 0..layout.width {
                let x = (tile::BLOCK * block[a] + layout.lowest[g] + k as i32) as f64 + layout.shift[g];
                let share = layout.inside_walls(&setup.axes[a], setup.cells[a], x);
                cut |= share < 1.0;
                shares[g][k] = T::from_f64(share);
            }
        }
        cut.then_some(shares)
    });
    room.iter().any(Option::is_some).then(|| Box::new(room))
}

widest! {
    /// Adds the rest volumes of a chunk's particles, over dx^d, to the nodes of a tile. What a solid
    /// has lost of its volume is room for others.
    pub fn scatter[T: Real, K: ShapeFunction<G, W>, const D: usize, const G: usize, const W: usize][T, K, D, G, W](
        constants: &Constants<T, D>,
        chunk: &Chunk<T, D>,
        volumes: &mut [T],
    ) {
        let body = &constants.bodies[chunk.body as usize];
        let stencils = Stencils::<T, D, G, W>::new::<K>(&chunk.x);
        for l in 0..chunk.count {
            let kept = match &chunk.state {
                State::Solid { f, .. } if body.relaxation.is_none() => det(&matrix(f, l)).max(T::ZERO).min(T::ONE),
                _ => T::ONE,
            };
            each_node(&constants.layout, &stencils, None, l, |at, w| volumes[at] += w * kept * body.cells);
        }
    }
}

widest! {
    /// Fills near surfaces and of mixed materials, from those of all room and equal materials. Apart from
    /// the loop that gathers, which is to stay as small as it is.
    pub fn beside[T: Real, const D: usize, const G: usize, const W: usize][T, D, G, W](
        layout: &Layout,
        count: usize,
        stencils: &Stencils<T, D, G, W>,
        around: &Around<T, D>,
        fill: &mut Lanes<T>,
    ) {
        if let Some(filled) = around.filled {
            for l in 0..count {
                let mut sum = T::ZERO;
                each_node(layout, stencils, None, l, |at, w| sum += w * filled[at]);
                fill[l] = sum / T::from_i32(G as i32);
            }
        }
        let mut sums = [T::ZERO; LANES];
        match (around.walls, around.room) {
            (None, None) => return,
            (Some(walls), None) => inside_walls(layout, stencils, walls, &mut sums),
            (walls, Some(room)) => {
                for l in 0..count {
                    each_node(layout, stencils, walls, l, |at, w| sums[l] += w * room[at]);
                }
            }
        }
        // A particle behind a surface counts as one on it: half of its room on every axis.
        let least = T::from_f64(0.5f64.powi(D as i32));
        for l in 0..LANES {
            fill[l] = fill[l] / (sums[l] / T::from_i32(G as i32)).max(least);
        }
    }
}

/// Σ w times each node's share inside walls, which is a product over the axes.
#[inline(always)]
fn inside_walls<T: Real, const D: usize, const G: usize, const W: usize>(
    layout: &Layout,
    stencils: &Stencils<T, D, G, W>,
    walls: &WallRoom<T, D>,
    sums: &mut Lanes<T>,
) {
    for g in 0..G {
        let mut product = [T::ONE; LANES];
        for a in 0..D {
            let Some(shares) = &walls[a] else { continue };
            let mut found = [[T::ZERO; LANES]; W];
            for l in 0..LANES {
                let first = (stencils.base[a][g][l] - layout.lowest[g]) as usize;
                for k in 0..W {
                    found[k][l] = shares[g][first + k];
                }
            }
            for l in 0..LANES {
                let mut along = T::ZERO;
                for k in 0..W {
                    along += stencils.weight[a][g][k][l] * found[k][l];
                }
                product[l] *= along;
            }
        }
        for l in 0..LANES {
            sums[l] += product[l];
        }
    }
}

/// Calls `visit` with every node of a particle and its weight, times the node's share inside walls if given.
#[inline(always)]
pub fn each_node<T: Real, const D: usize, const G: usize, const W: usize>(
    layout: &Layout,
    s: &Stencils<T, D, G, W>,
    walls: Option<&WallRoom<T, D>>,
    l: usize,
    mut visit: impl FnMut(usize, T),
) {
    let walk = const { Walk::new(D, G, W) };
    for g in 0..G {
        let mut base = [0; D];
        let mut weights = [[T::ONE; W]; 3];
        for a in 0..D {
            base[a] = s.base[a][g][l];
            let first = (base[a] - layout.lowest[g]) as usize;
            for k in 0..W {
                let shares = walls.and_then(|walls| walls[a].as_ref());
                let share = shares.map_or(T::ONE, |shares| shares[g][first + k]);
                weights[3 - D + a][k] = s.weight[a][g][k][l] * share;
            }
        }
        let start = index::<D, G, W>(g, base, layout.lowest[g]);
        for i in 0..walk.outer {
            for j in 0..W {
                let row = start + i * walk.outer_stride + j * walk.middle_stride;
                let w = weights[0][i] * weights[1][j];
                for k in 0..W {
                    visit(row + k, w * weights[2][k]);
                }
            }
        }
    }
}

/// No correction.
pub fn nothing<T: Real>() -> Lanes<T> {
    [T::ONE; LANES]
}
