//! Cholesky factorisation within an envelope, for the coarsest level.

use super::hierarchy::Nodes;
use super::objective::{NodeId, NodeVectors};
use super::sparse::Bsr;

/// L of A = L Lᵀ by rows, each from its first non-zero on; nodes are in order along the longest
/// axis, which keeps rows short.
pub struct Cholesky<const D: usize> {
    /// Node at every place of the order.
    order: Vec<u32>,
    /// First column of every row.
    first: Vec<usize>,
    /// Where every row starts in `entries`; its last entry is 1 / L_ii.
    start: Vec<usize>,
    entries: Vec<f64>,
}

/// Nodes along their longest axis first.
fn lexicographic<const D: usize>(nodes: &Nodes<D>) -> Vec<u32> {
    let extent = |a: usize| {
        let along = |id: &NodeId<D>| id.index[a];
        nodes.ids.iter().map(along).max().unwrap_or(0) - nodes.ids.iter().map(along).min().unwrap_or(0)
    };
    let mut axes: [usize; D] = std::array::from_fn(|a| a);
    axes.sort_by_key(|&a| -extent(a));
    let mut order: Vec<u32> = (0..nodes.ids.len() as u32).collect();
    order.sort_by_key(|&i| {
        let id = &nodes.ids[i as usize];
        (axes.map(|a| id.index[a]), id.grid)
    });
    order
}

/// First place that each row is coupled to.
fn envelope<const D: usize>(matrix: &Bsr<f64, D>, order: &[u32]) -> Vec<usize> {
    let mut place = vec![0; order.len()];
    order.iter().enumerate().for_each(|(k, &i)| place[i as usize] = k);
    order.iter().map(|&i| matrix.row(i as usize).0.iter().map(|&j| place[j as usize]).min().unwrap_or(0)).collect()
}

impl<const D: usize> Cholesky<D> {
    /// Multiplications that the factorisation takes.
    pub fn cost(matrix: &Bsr<f64, D>, nodes: &Nodes<D>) -> f64 {
        let first = envelope(matrix, &lexicographic(nodes));
        first.iter().enumerate().map(|(k, f)| 0.5 * D as f64 * ((k + 1 - f) as f64 * D as f64).powi(2)).sum()
    }

    /// None if the matrix is not positive definite to working accuracy.
    pub fn new(matrix: &Bsr<f64, D>, nodes: &Nodes<D>) -> Option<Self> {
        let order = lexicographic(nodes);
        let block_first = envelope(matrix, &order);
        let mut place = vec![0; order.len()];
        order.iter().enumerate().for_each(|(k, &i)| place[i as usize] = k);
        let first: Vec<usize> = (0..D * order.len()).map(|row| D * block_first[row / D]).collect();
        let mut start = vec![0];
        first.iter().enumerate().for_each(|(row, f)| start.push(start[row] + row + 1 - f));
        let mut entries = vec![0.0; start[first.len()]];
        for (k, &i) in order.iter().enumerate() {
            let (columns, blocks) = matrix.row(i as usize);
            for (&j, block) in columns.iter().zip(blocks) {
                for (a, b) in (0..D * D).map(|ab| (ab / D, ab % D)) {
                    let (row, column) = (D * k + a, D * place[j as usize] + b);
                    if column <= row {
                        entries[start[row] + column - first[row]] = block[a][b];
                    }
                }
            }
        }
        for row in 0..first.len() {
            let (done, rest) = entries.split_at_mut(start[row]);
            let own = &mut rest[..start[row + 1] - start[row]];
            let f = first[row];
            for column in f..row {
                let from = f.max(first[column]);
                let other = &done[start[column]..start[column + 1]];
                let sum = dot(&own[from - f..column - f], &other[from - first[column]..column - first[column]]);
                own[column - f] = (own[column - f] - sum) * other[column - first[column]];
            }
            let (left, pivot) = own.split_at_mut(row - f);
            let square = pivot[0] - dot(left, left);
            if square.is_nan() || square <= f64::EPSILON * pivot[0].abs() {
                return None;
            }
            pivot[0] = 1.0 / square.sqrt();
        }
        Some(Self { order, first, start, entries })
    }

    /// x = A⁻¹ b.
    pub fn solve(&self, b: &NodeVectors<D>, x: &mut NodeVectors<D>) {
        let mut y: Vec<f64> = self.order.iter().flat_map(|&i| b[i as usize]).collect();
        let row = |i: usize| &self.entries[self.start[i]..self.start[i + 1]];
        for i in 0..y.len() {
            let (row, f) = (row(i), self.first[i]);
            y[i] = (y[i] - dot(&row[..i - f], &y[f..i])) * row[i - f];
        }
        for i in (0..y.len()).rev() {
            let (row, f) = (row(i), self.first[i]);
            y[i] *= row[i - f];
            let (left, right) = y.split_at_mut(i);
            left[f..].iter_mut().zip(row).for_each(|(y, l)| *y -= l * right[0]);
        }
        for (k, &i) in self.order.iter().enumerate() {
            x[i as usize] = std::array::from_fn(|a| y[D * k + a]);
        }
    }
}

/// Eight sums side by side, which become vector registers.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; 8];
    let (a, b) = (a.chunks_exact(8), b.chunks_exact(8));
    let rest: f64 = a.remainder().iter().zip(b.remainder()).map(|(a, b)| a * b).sum();
    for (a, b) in a.zip(b) {
        for l in 0..8 {
            sums[l] += a[l] * b[l];
        }
    }
    sums.iter().sum::<f64>() + rest
}
