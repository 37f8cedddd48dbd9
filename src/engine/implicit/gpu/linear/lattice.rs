//! Where the nodes of a level can be, known before it is counted.

use super::layout;
use crate::implicit::gpu::interface::System;

/// Threads of a row-wise workgroup of reductions, and the most workgroups that one has.
const REDUCE: u32 = 256;
/// Fewest cells of a periodic axis that is halved.
const FEWEST_CELLS: i32 = 8;

/// Bounds of a level's indices.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lattice {
    pub low: [i32; 3],
    pub extent: [u32; 3],
    /// Cells along periodic axes, otherwise 0.
    pub period: [i32; 3],
    pub grids: u32,
    /// Indices of the finer level over this one's, by axis.
    pub factor: [i32; 3],
}

impl Lattice {
    /// Of the finest level.
    pub fn of(system: &System, grids: u32) -> Self {
        let period = std::array::from_fn(|a| if system.periodic[a] { system.extent[a] as i32 } else { 0 });
        Self { low: system.lowest, extent: system.extent, period, grids, factor: [1; 3] }
    }

    /// An axis is halved unless it is periodic with an odd or very small number of cells.
    pub fn coarser(&self) -> Self {
        let mut coarse = *self;
        for a in 0..3 {
            let cells = self.period[a];
            let halved = cells == 0 || (cells % 2 == 0 && cells >= FEWEST_CELLS);
            coarse.factor[a] = if halved { 2 } else { 1 };
            if halved && cells > 0 {
                coarse.period[a] = cells / 2;
                coarse.extent[a] = self.extent[a] / 2;
            } else if halved {
                let high = (self.low[a] + self.extent[a] as i32).div_euclid(2);
                coarse.low[a] = self.low[a].div_euclid(2);
                coarse.extent[a] = (high - coarse.low[a] + 1) as u32;
            }
        }
        coarse
    }

    fn blocks(&self) -> [u32; 3] {
        self.extent.map(|n| n.div_ceil(4))
    }

    /// Entries of the dense table.
    pub fn entries(&self) -> u64 {
        self.blocks().iter().map(|&n| u64::from(n)).product::<u64>() * u64::from(self.grids) * 64
    }

    /// Parts of 1024 entries that the table is counted in.
    pub fn parts(&self) -> u64 {
        self.entries().div_ceil(1024)
    }

    /// For the shaders.
    pub fn level(&self, rows: u32, stride: u32) -> layout::Level {
        layout::Level {
            low: self.low,
            rows,
            blocks: self.blocks(),
            stride,
            period: self.period,
            grids: self.grids,
            groups: rows.div_ceil(REDUCE).clamp(1, REDUCE),
            factor: self.factor,
            ..layout::Level::default()
        }
    }
}
