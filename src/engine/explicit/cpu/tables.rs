//! Which grid node an entry of a tile belongs to, and which entries add up to a node.

use rayon::prelude::*;

use super::bin::{pack, unpack};
use super::tile::{BLOCK, Layout};

/// Grid blocks of 4^D nodes on each grid, and their relation to the tiles of particle blocks.
/// Periodic images are folded, whatever the number of cells.
#[derive(Clone, Debug, Default)]
pub struct Tables<const D: usize> {
    /// Field and coordinates of the grid blocks: lowest node / 4.
    pub blocks: Vec<(u32, [i32; D])>,
    pub grids: usize,
    /// Entries of a tile.
    tile: usize,
    /// Node of every entry of every tile.
    slots: Vec<u32>,
    /// Entries of a tile along an axis.
    width: usize,
    /// What adds up to the [`BLOCK`] nodes of row i is `runs[first[i]..first[i + 1]]`, in the order of the tiles.
    first: Vec<u32>,
    runs: Vec<Run>,
}

/// Entries of a tile one after the other that add up to nodes one after the other of a row.
#[derive(Clone, Copy, Debug, Default)]
pub struct Run {
    pub entry: u32,
    /// Place of the first in the row.
    pub at: u8,
    pub count: u8,
}

/// Nodes of a row.
pub const ROW: usize = BLOCK as usize;

/// Per axis, grid and entry along the axis: the node's block and its place in that.
type AxisNodes = Vec<(i32, usize)>;

impl<const D: usize> Tables<D> {
    /// `corners`: field and coordinates of the particle blocks.
    pub fn new(corners: &[(u32, [i32; D])], layout: &Layout, period: &[Option<i32>; D]) -> Self {
        let mut keys: Vec<u64> = corners.par_iter().flat_map_iter(|corner| touched(corner, layout, period)).collect();
        keys.par_sort_unstable();
        keys.dedup();
        let (grids, tile, width) = (layout.grids, layout.tile(D), layout.width);
        let mut slots = vec![0; corners.len() * tile];
        let fill =
            |(slots, corner): (&mut [u32], &(u32, [i32; D]))| node_of_entries(slots, corner, &keys, layout, period);
        slots.par_chunks_exact_mut(tile).zip(corners).for_each(fill);

        let mut tables = Self {
            blocks: keys.iter().map(|&key| unpack(key)).collect(),
            grids,
            tile,
            slots,
            width,
            ..Self::default()
        };
        tables.invert();
        tables
    }

    fn invert(&mut self) {
        let slots = &self.slots;
        let begins = |entry: usize| {
            entry.is_multiple_of(self.width)
                || slots[entry] != slots[entry - 1] + 1
                || (slots[entry] as usize).is_multiple_of(ROW)
        };
        let mut first = vec![0; self.nodes() / ROW + 1];
        for entry in (0..slots.len()).filter(|&entry| begins(entry)) {
            first[slots[entry] as usize / ROW + 1] += 1;
        }
        for row in 1..first.len() {
            first[row] += first[row - 1];
        }
        let mut next = first.clone();
        let mut runs = vec![Run::default(); first[first.len() - 1] as usize];
        let mut run = 0;
        for (entry, &slot) in slots.iter().enumerate() {
            if begins(entry) {
                let next = &mut next[slot as usize / ROW];
                run = *next as usize;
                runs[run] = Run { entry: entry as u32, at: (slot as usize % ROW) as u8, count: 0 };
                *next += 1;
            }
            runs[run].count += 1;
        }
        (self.first, self.runs) = (first, runs);
    }

    /// Nodes of a grid block.
    pub fn block_nodes(&self) -> usize {
        self.grids * (BLOCK as usize).pow(D as u32)
    }

    pub fn nodes(&self) -> usize {
        self.blocks.len() * self.block_nodes()
    }

    /// Nodes of the entries of a tile.
    pub fn tile(&self, tile: usize) -> &[u32] {
        &self.slots[tile * self.tile..(tile + 1) * self.tile]
    }

    /// What of all tiles adds up to the nodes of a row.
    #[inline(always)]
    pub fn runs(&self, row: usize) -> &[Run] {
        &self.runs[self.first[row] as usize..self.first[row + 1] as usize]
    }

    /// Entries of all tiles that add up to a node.
    #[inline]
    pub fn entries(&self, node: usize) -> impl Iterator<Item = usize> {
        let place = (node % ROW) as u32;
        let in_run = move |run: &Run| {
            let offset = place.wrapping_sub(u32::from(run.at));
            (offset < u32::from(run.count)).then(|| (run.entry + offset) as usize)
        };
        self.runs(node / ROW).iter().filter_map(in_run)
    }

    /// The block of a field, if a tile reaches it.
    pub fn block(&self, field: u32, corner: [i32; D]) -> Option<usize> {
        let key = pack(field, corner);
        self.blocks.binary_search_by_key(&key, |&(field, block)| pack(field, block)).ok()
    }

    /// Slot of a field's node, if a tile reaches it.
    pub fn slot(&self, field: u32, grid: usize, node: [i32; D]) -> Option<usize> {
        let found = self.block(field, node.map(|i| i.div_euclid(BLOCK)))?;
        let local = node.iter().fold(grid, |at, i| at * BLOCK as usize + i.rem_euclid(BLOCK) as usize);
        Some(found * self.block_nodes() + local)
    }

    /// Grid and index of a block's local node.
    pub fn node(corner: &[i32; D], local: usize) -> (usize, [i32; D]) {
        let side = BLOCK as usize;
        let place = |a: usize| (local / side.pow((D - 1 - a) as u32) % side) as i32;
        (local / side.pow(D as u32), std::array::from_fn(|a| BLOCK * corner[a] + place(a)))
    }
}

fn axis_nodes(corner: i32, lowest: i32, width: usize, period: Option<i32>) -> AxisNodes {
    let first = BLOCK * corner + lowest;
    let fold = |node: i32| period.map_or(node, |n| node.rem_euclid(n));
    (first..first + width as i32).map(|i| (fold(i).div_euclid(BLOCK), fold(i).rem_euclid(BLOCK) as usize)).collect()
}

/// Keys of the grid blocks that a tile reaches.
fn touched<const D: usize>((field, corner): &(u32, [i32; D]), layout: &Layout, period: &[Option<i32>; D]) -> Vec<u64> {
    let mut reached = vec![[0; D]];
    for a in 0..D {
        let grids = (0..layout.grids).flat_map(|g| axis_nodes(corner[a], layout.lowest[g], layout.width, period[a]));
        let mut along: Vec<i32> = grids.map(|(block, _)| block).collect();
        along.sort_unstable();
        along.dedup();
        let extend = |corner: [i32; D]| {
            along.iter().map(move |&block| {
                let mut next = corner;
                next[a] = block;
                next
            })
        };
        reached = reached.into_iter().flat_map(extend).collect();
    }
    reached.into_iter().map(|block| pack(*field, block)).collect()
}

fn node_of_entries<const D: usize>(
    slots: &mut [u32],
    (field, corner): &(u32, [i32; D]),
    keys: &[u64],
    layout: &Layout,
    period: &[Option<i32>; D],
) {
    let n = layout.width;
    let per_grid = n.pow(D as u32);
    let block_nodes = layout.grids * (BLOCK as usize).pow(D as u32);
    for (g, slots) in slots.chunks_exact_mut(per_grid).enumerate() {
        let axes: [AxisNodes; D] = std::array::from_fn(|a| axis_nodes(corner[a], layout.lowest[g], n, period[a]));
        let mut known = (u64::MAX, 0);
        for (entry, slot) in slots.iter_mut().enumerate() {
            let (mut block, mut local) = ([0; D], g);
            for a in 0..D {
                let (b, place) = axes[a][entry / n.pow((D - 1 - a) as u32) % n];
                block[a] = b;
                local = local * BLOCK as usize + place;
            }
            let key = pack(*field, block);
            if key != known.0 {
                known = (key, keys.binary_search(&key).expect("the blocks that tiles reach are known"));
            }
            *slot = (known.1 * block_nodes + local) as u32;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gridfall_core::sim::kernel::{Compact, Cubic};

    #[test]
    fn entries_and_nodes_are_each_others_inverse() {
        let layout = Layout::of::<Compact, 2, 2>();
        let corners = [(0, [0, 0]), (0, [0, 1]), (1, [0, 1]), (1, [2, 1])];
        let tables = Tables::new(&corners, &layout, &[None, Some(7)]);
        let mut seen = 0;
        for node in 0..tables.nodes() {
            for entry in tables.entries(node) {
                assert_eq!(tables.slots[entry] as usize, node);
                seen += 1;
            }
        }
        assert_eq!(seen, corners.len() * layout.tile(2));
    }

    #[test]
    fn entries_are_the_nodes_where_they_lie() {
        let layout = Layout::of::<Cubic, 1, 4>();
        let (corner, period) = ([-1, 3], Some(14));
        let tables = Tables::new(&[(3, corner)], &layout, &[None, period]);
        for (entry, &slot) in tables.tile(0).iter().enumerate() {
            let slot = slot as usize;
            let (grid, i) = Tables::node(&tables.blocks[slot / tables.block_nodes()].1, slot % tables.block_nodes());
            let expected =
                [(entry / layout.width) as i32 - 4, (entry % layout.width) as i32 + 12].map(|i| i + layout.lowest[0]);
            assert_eq!((grid, i), (0, [expected[0], expected[1].rem_euclid(14)]));
        }
    }
}
