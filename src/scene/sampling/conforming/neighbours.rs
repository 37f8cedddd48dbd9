//! Which points are near one another: points sorted by cells of a regular grid.

use std::ops::Range;

use rayon::prelude::*;

/// Indices of a cell on each axis.
type Index = [i64; 3];

/// Points by cells.
pub struct Cells {
    /// Numbers of the points, those of a cell in a row.
    order: Vec<u32>,
    /// The cells that have points, in ascending order, and where their points are in `order`.
    cells: Vec<(Index, Range<usize>)>,
}

impl Cells {
    /// Sorts points by cells that are `width` wide (m).
    pub fn new(x: &[[f64; 3]], width: f64) -> Self {
        let index = |x: &[f64; 3]| x.map(|x| (x / width).floor() as i64);
        let mut sorted: Vec<(Index, u32)> = x.par_iter().zip(0..x.len() as u32).map(|(x, n)| (index(x), n)).collect();
        sorted.par_sort_unstable();
        let mut cells: Vec<(Index, Range<usize>)> = Vec::new();
        for (n, (index, _)) in sorted.iter().enumerate() {
            match cells.last_mut() {
                Some((last, range)) if last == index => range.end = n + 1,
                _ => cells.push((*index, n..n + 1)),
            }
        }
        Self { order: sorted.into_iter().map(|(_, n)| n).collect(), cells }
    }

    /// For each cell, in parallel: its points and those of the cells around it. The results follow one
    /// another in the order of the cells.
    pub fn map<T: Send, I: IntoIterator<Item = T>>(&self, each: impl Fn(&[u32], &[u32]) -> I + Sync) -> Vec<T> {
        let work = |(index, range): &(Index, Range<usize>)| {
            let mut around = Vec::new();
            // Rows of cells along the last axis lie together.
            for k in 0..9 {
                let row = |along: i64| [index[0] + k / 3 - 1, index[1] + k % 3 - 1, index[2] + along];
                let start = self.cells.partition_point(|(cell, _)| *cell < row(-1));
                let cells = self.cells[start..].iter().take_while(|(cell, _)| *cell <= row(1));
                cells.for_each(|(_, range)| around.extend_from_slice(&self.order[range.clone()]));
            }
            each(&self.order[range.clone()], &around)
        };
        self.cells.par_iter().flat_map_iter(work).collect()
    }
}
