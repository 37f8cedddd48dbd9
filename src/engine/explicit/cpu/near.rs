//! What particles share with their nodes, side by side: transfers are then loops over particles, which are
//! vectorised. Between a tile and these tables nodes are only copied, or added one particle at a time, because
//! particles may have nodes in common.

use super::chunk::{LANES, Lanes};
use super::tile::{Node, Walk};
use gridfall_core::maths::real::Real;

/// A value of every node of a chunk's particles: by grid, by place along the axes, by lane. In two dimensions the
/// first axis has one place.
pub type Near<T, const G: usize, const W: usize> = [[[[[Node<T>; LANES]; W]; W]; W]; G];

/// Index of each particle's lowest node of each grid in a tile.
pub type Starts<const G: usize> = [Lanes<usize>; G];

pub const fn nothing<T: Real, const G: usize, const W: usize>() -> Near<T, G, W> {
    [[[[[[T::ZERO; 4]; LANES]; W]; W]; W]; G]
}

/// The nodes of a tile.
#[inline(always)]
pub fn load<T: Real, const D: usize, const G: usize, const W: usize>(
    tile: &[Node<T>],
    starts: &Starts<G>,
    near: &mut Near<T, G, W>,
) {
    let walk = const { Walk::new(D, G, W) };
    for g in 0..G {
        for l in 0..LANES {
            let nodes = &tile[starts[g][l]..][..walk.extent(W)];
            for i in 0..walk.outer {
                for j in 0..W {
                    for k in 0..W {
                        near[g][i][j][k][l] = nodes[i * walk.outer_stride + j * walk.middle_stride + k];
                    }
                }
            }
        }
    }
}

/// Adds what `count` particles give to their nodes. Compiled apart: as part of functions for the widest vectors it
/// becomes slower, by loads of vectors of which most is then left out.
#[inline(never)]
pub fn add<T: Real, const D: usize, const G: usize, const W: usize>(
    tile: &mut [Node<T>],
    starts: &Starts<G>,
    count: usize,
    near: &Near<T, G, W>,
) {
    let walk = const { Walk::new(D, G, W) };
    for l in 0..count {
        for g in 0..G {
            let nodes = &mut tile[starts[g][l]..][..walk.extent(W)];
            for i in 0..walk.outer {
                for j in 0..W {
                    for k in 0..W {
                        let node = &mut nodes[i * walk.outer_stride + j * walk.middle_stride + k];
                        for c in 0..4 {
                            node[c] += near[g][i][j][k][l][c];
                        }
                    }
                }
            }
        }
    }
}
