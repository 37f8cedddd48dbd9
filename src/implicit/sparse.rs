//! Block compressed sparse rows.

use crate::sim::linalg::Matrix;

/// A square matrix of D × D blocks. Columns ascend in every row, and every row has its diagonal.
#[derive(Clone, Debug, PartialEq)]
pub struct Bsr<T, const D: usize> {
    /// Row i's entries are `row_start[i]..row_start[i + 1]`.
    pub row_start: Vec<usize>,
    pub columns: Vec<u32>,
    pub blocks: Vec<Matrix<T, D>>,
}
