//! Block compressed sparse rows.

use nalgebra::DMatrix;
use rayon::prelude::*;

use super::objective::{LinearOperator, NodeVectors};
use gridfall_core::maths::linalg::{Matrix, Vector, add_scaled};
use gridfall_core::maths::real::Real;
use gridfall_core::maths::widest::widest;

/// Rows per task of a thread.
pub const ROWS: usize = 128;

/// A square matrix of D × D blocks. Columns ascend in every row, and every row has its diagonal.
#[derive(Clone, Debug, PartialEq)]
pub struct Bsr<T, const D: usize> {
    /// Row i's entries are `row_start[i]..row_start[i + 1]`.
    pub row_start: Vec<usize>,
    pub columns: Vec<u32>,
    pub blocks: Vec<Matrix<T, D>>,
}

impl<T: Real, const D: usize> Bsr<T, D> {
    /// Rows of blocks.
    pub fn rows(&self) -> usize {
        self.row_start.len() - 1
    }

    /// Columns and blocks of a row.
    pub fn row(&self, i: usize) -> (&[u32], &[Matrix<T, D>]) {
        let range = self.row_start[i]..self.row_start[i + 1];
        (&self.columns[range.clone()], &self.blocks[range])
    }

    /// Diagonal blocks.
    pub fn diagonal(&self) -> Vec<Matrix<T, D>> {
        let block = |i: usize| {
            let (columns, blocks) = self.row(i);
            blocks[columns.binary_search(&(i as u32)).expect("every row has its diagonal")]
        };
        (0..self.rows()).into_par_iter().map(block).collect()
    }

    /// The same matrix in another precision.
    pub fn cast<U: Real>(&self) -> Bsr<U, D> {
        let cast = |block: &Matrix<T, D>| block.map(|row| row.map(|x| U::from_f64(x.to_f64())));
        Bsr {
            row_start: self.row_start.clone(),
            columns: self.columns.clone(),
            blocks: self.blocks.par_iter().with_min_len(4096).map(cast).collect(),
        }
    }

    /// y = A x.
    pub fn multiply(&self, x: &[Vector<T, D>], y: &mut [Vector<T, D>]) {
        y.par_chunks_mut(ROWS).enumerate().for_each(|(chunk, y)| self.multiply_rows(chunk * ROWS, x, y));
    }

    /// The products of the rows from `first` on with x, as many as `y` has places.
    pub fn multiply_rows(&self, first: usize, x: &[Vector<T, D>], y: &mut [Vector<T, D>]) {
        rows_times(self, first, x, y);
    }

    /// b − A x in some rows.
    pub fn residuals(&self, rows: &[u32], b: &[Vector<T, D>], x: &[Vector<T, D>]) -> Vec<Vector<T, D>> {
        let mut r = vec![[T::ZERO; D]; rows.len()];
        let chunks = r.par_chunks_mut(ROWS).zip(rows.par_chunks(ROWS));
        chunks.for_each(|(r, rows)| some_rows_times(self, rows, b, x, r));
        r
    }

    /// All entries, zeros included.
    pub fn to_dense(&self) -> DMatrix<f64> {
        let mut dense = DMatrix::zeros(D * self.rows(), D * self.rows());
        for i in 0..self.rows() {
            let (columns, blocks) = self.row(i);
            for (&j, block) in columns.iter().zip(blocks) {
                for a in 0..D {
                    for b in 0..D {
                        dense[(D * i + a, D * j as usize + b)] += block[a][b].to_f64();
                    }
                }
            }
        }
        dense
    }
}

impl<const D: usize> Bsr<f64, D> {
    /// Adds to the diagonal block of a row.
    pub fn add_to_diagonal(&mut self, row: usize, block: &Matrix<f64, D>) {
        let (start, end) = (self.row_start[row], self.row_start[row + 1]);
        let at = start + self.columns[start..end].binary_search(&(row as u32)).expect("a diagonal");
        self.blocks[at] = add_scaled(&self.blocks[at], 1.0, block);
    }
}

impl<const D: usize> LinearOperator<D> for Bsr<f64, D> {
    fn apply(&self, x: &NodeVectors<D>, y: &mut NodeVectors<D>) {
        self.multiply(x, y);
    }

    fn diagonal(&self) -> Vec<Matrix<f64, D>> {
        self.diagonal()
    }
}

widest! {
    fn rows_times[T: Real, const D: usize][T, D](
        matrix: &Bsr<T, D>,
        first: usize,
        x: &[Vector<T, D>],
        y: &mut [Vector<T, D>],
    ) {
        for (i, y) in y.iter_mut().enumerate() {
            let (start, end) = (matrix.row_start[first + i], matrix.row_start[first + i + 1]);
            *y = row_times(&matrix.columns[start..end], matrix.blocks[start..].as_flattened().as_flattened(), |j| x[j]);
        }
    }
}

widest! {
    fn some_rows_times[T: Real, const D: usize][T, D](
        matrix: &Bsr<T, D>,
        rows: &[u32],
        b: &[Vector<T, D>],
        x: &[Vector<T, D>],
        r: &mut [Vector<T, D>],
    ) {
        for (&i, r) in rows.iter().zip(r) {
            let i = i as usize;
            let (start, end) = (matrix.row_start[i], matrix.row_start[i + 1]);
            let entries = matrix.blocks[start..].as_flattened().as_flattened();
            let product = row_times(&matrix.columns[start..end], entries, |j| x[j]);
            *r = std::array::from_fn(|a| b[i][a] - product[a]);
        }
    }
}

/// Σ blocks x over the columns of a row; `entries` may extend to the end of the matrix. A block's
/// row is taken as four lanes, of which those past D are multiplied by zero.
#[inline(always)]
pub fn row_times<T: Real, const D: usize>(
    columns: &[u32],
    entries: &[T],
    x: impl Fn(usize) -> Vector<T, D>,
) -> Vector<T, D> {
    let window = (D - 1) * D + 4;
    let mut sums = [[T::ZERO; 4]; D];
    for (k, &j) in columns.iter().enumerate() {
        let x = x(j as usize);
        if let Some(block) = entries.get(k * D * D..k * D * D + window) {
            let mut lanes = [T::ZERO; 4];
            lanes[..D].copy_from_slice(&x);
            for a in 0..D {
                for l in 0..4 {
                    sums[a][l] += block[a * D + l] * lanes[l];
                }
            }
        } else {
            for a in 0..D {
                for l in 0..D {
                    sums[a][l] += entries[k * D * D + a * D + l] * x[l];
                }
            }
        }
    }
    sums.map(|lanes| lanes[..D].iter().copied().sum())
}
