//! Block compressed sparse rows.

use crate::sim::linalg::{Matrix, add_scaled};

/// A square matrix of D × D blocks. Columns ascend in every row, and every row has its diagonal.
#[derive(Clone, Debug, PartialEq)]
pub struct Bsr<T, const D: usize> {
    /// Row i's entries are `row_start[i]..row_start[i + 1]`.
    pub row_start: Vec<usize>,
    pub columns: Vec<u32>,
    pub blocks: Vec<Matrix<T, D>>,
}

impl<const D: usize> Bsr<f64, D> {
    /// Adds to the diagonal block of a row.
    pub fn add_to_diagonal(&mut self, row: usize, block: &Matrix<f64, D>) {
        let (start, end) = (self.row_start[row], self.row_start[row + 1]);
        let at = start + self.columns[start..end].binary_search(&(row as u32)).expect("a diagonal");
        self.blocks[at] = add_scaled(&self.blocks[at], 1.0, block);
    }
}
