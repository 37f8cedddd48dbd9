//! Cholesky factorisation of a matrix, or of the part of it that belongs to some of its nodes.
//!
//! Nested dissection keeps the factor small, above all where the graph of the couplings is a sheet, as with
//! weak nodes, which line the surfaces of bodies.
//!
//! Coarse matrices may be singular: where a body's outline is irregular, more coarse nodes than fine ones
//! may lie there, so that some combination of them moves no fine node. A pivot that is nothing but rounding
//! is left out, and what it stands for stays at rest. The solution then is one of many for a right-hand
//! side that has some, as restricted ones have.

use super::hierarchy::Nodes;
use super::objective::NodeVectors;
use super::sparse::Bsr;
use gridfall_core::maths::linalg::{Matrix, Vector};

/// Nodes that are not divided any further.
const LEAF: usize = 16;
/// Pivots below this part of the diagonal are rounding, in f64. Inertia leaves 1e-9 of it and more.
pub const ROUNDING: f64 = 1e-12;
/// Not a place: the node is not among those that are factorised, or has none yet.
const NOWHERE: u32 = u32::MAX;

/// L of A = L Lᵀ by columns of blocks.
pub struct Factor<const D: usize> {
    /// Node at every place of the order.
    order: Vec<u32>,
    /// Column j's entries below the diagonal are `start[j]..start[j + 1]`.
    start: Vec<usize>,
    /// Places, ascending in every column.
    rows: Vec<u32>,
    blocks: Vec<Matrix<f64, D>>,
    /// Inverses of the diagonal blocks, which are lower triangles.
    inverse_diagonal: Vec<Matrix<f64, D>>,
}

impl<const D: usize> Factor<D> {
    /// None if it takes more than so many multiplications. Pivots below the part `rounding` of the diagonal
    /// are left out.
    pub fn new(matrix: &Bsr<f64, D>, nodes: &Nodes<D>, chosen: &[u32], most: f64, rounding: f64) -> Option<Self> {
        let order = dissected(matrix, nodes, chosen);
        let mut place = vec![NOWHERE; matrix.rows()];
        order.iter().enumerate().for_each(|(k, &i)| place[i as usize] = k as u32);
        let (start, rows) = structure(matrix, &order, &place);
        let pairs: f64 = start.windows(2).map(|column| 0.5 * ((column[1] - column[0]) as f64).powi(2)).sum();
        if pairs * D.pow(3) as f64 > most {
            return None;
        }
        let mut blocks = vec![[[0.0; D]; D]; rows.len()];
        let mut diagonal = vec![[[0.0; D]; D]; order.len()];
        for (k, &i) in order.iter().enumerate() {
            let (columns, entries) = matrix.row(i as usize);
            for (&j, block) in columns.iter().zip(entries) {
                // Block (k, column) of the part, if it is in the lower triangle.
                match place[j as usize] {
                    column if column == k as u32 => diagonal[k] = *block,
                    column if column < k as u32 => {
                        let range = start[column as usize]..start[column as usize + 1];
                        let at = rows[range.clone()].binary_search(&(k as u32)).expect("an entry of the factor");
                        blocks[range.start + at] = *block;
                    }
                    _ => {}
                }
            }
        }
        let sizes: Vec<Vector<f64, D>> = diagonal.iter().map(|block| std::array::from_fn(|a| block[a][a])).collect();
        for j in 0..order.len() {
            let inverse = inverse_factor(&diagonal[j], &sizes[j].map(|size| rounding * size));
            diagonal[j] = inverse;
            let (from, to) = (start[j], start[j + 1]);
            let (own, later) = blocks.split_at_mut(to);
            let own = &mut own[from..];
            own.iter_mut().for_each(|block| *block = times_transpose(block, &inverse));
            for (k, left) in own.iter().enumerate() {
                let column = rows[from + k] as usize;
                subtract_product(&mut diagonal[column], left, left);
                // The rows below are among the rows of that column.
                let mut at = start[column];
                for (row, below) in rows[from + k + 1..to].iter().zip(&own[k + 1..]) {
                    while rows[at] != *row {
                        at += 1;
                    }
                    subtract_product(&mut later[at - to], below, left);
                }
            }
        }
        Some(Self { order, start, rows, blocks, inverse_diagonal: diagonal })
    }

    /// The nodes, in order of elimination.
    pub fn nodes(&self) -> &[u32] {
        &self.order
    }

    /// x += A⁻¹ b at the nodes; `b` is in the order of [`Self::nodes`] and is used up.
    pub fn add_solution(&self, b: &mut [Vector<f64, D>], x: &mut NodeVectors<D>) {
        for j in 0..self.order.len() {
            let own = apply_lower(&self.inverse_diagonal[j], &b[j]);
            b[j] = own;
            for (row, block) in self.column(j) {
                let below = &mut b[row];
                (0..D).for_each(|a| (0..D).for_each(|c| below[a] -= block[a][c] * own[c]));
            }
        }
        for j in (0..self.order.len()).rev() {
            let mut own = b[j];
            for (row, block) in self.column(j) {
                let below = b[row];
                (0..D).for_each(|a| (0..D).for_each(|c| own[c] -= block[a][c] * below[a]));
            }
            b[j] = apply_lower_transpose(&self.inverse_diagonal[j], &own);
            let x = &mut x[self.order[j] as usize];
            (0..D).for_each(|a| x[a] += b[j][a]);
        }
    }

    fn column(&self, j: usize) -> impl Iterator<Item = (usize, &Matrix<f64, D>)> {
        let range = self.start[j]..self.start[j + 1];
        self.rows[range.clone()].iter().map(|&row| row as usize).zip(&self.blocks[range])
    }
}

/// Nested dissection: halves across the longest extent, each before what separates them.
fn dissected<const D: usize>(matrix: &Bsr<f64, D>, nodes: &Nodes<D>, chosen: &[u32]) -> Vec<u32> {
    // Quarters of a cell, because the second of two grids lies half a cell below the first.
    let at = |i: u32, a: usize| {
        let id = &nodes.ids[i as usize];
        4 * id.index[a] - 2 * i32::from(id.grid)
    };
    let mut order = Vec::with_capacity(chosen.len());
    let mut side = vec![0u32; matrix.rows()];
    let mut halves = 0;
    let mut open = vec![(chosen.to_vec(), false)];
    while let Some((mut part, is_separator)) = open.pop() {
        let extent = |a: usize| {
            let along = || part.iter().map(|&i| at(i, a));
            along().max().unwrap_or(0) - along().min().unwrap_or(0)
        };
        let axis = (0..D).max_by_key(|&a| extent(a)).expect("an axis");
        if is_separator || part.len() <= LEAF || extent(axis) == 0 {
            order.extend(part);
            continue;
        }
        part.sort_unstable_by_key(|&i| (at(i, axis), i));
        let middle = at(part[part.len() / 2], axis);
        let cut = match part.partition_point(|&i| at(i, axis) < middle) {
            0 => part.partition_point(|&i| at(i, axis) <= middle),
            cut => cut,
        };
        let far = part.split_off(cut);
        halves += 1;
        far.iter().for_each(|&i| side[i as usize] = halves);
        let separates = |i: &u32| matrix.row(*i as usize).0.iter().any(|&j| side[j as usize] == halves);
        let (separator, near): (Vec<u32>, Vec<u32>) = part.into_iter().partition(separates);
        // The last one is taken first.
        open.extend([(separator, true), (far, false), (near, false)]);
    }
    order
}

/// Where the entries of the factor are: a column has those of its own node and of the columns that it is
/// the first entry of.
fn structure<const D: usize>(matrix: &Bsr<f64, D>, order: &[u32], place: &[u32]) -> (Vec<usize>, Vec<u32>) {
    let (mut start, mut rows) = (vec![0], Vec::new());
    let mut children: Vec<Vec<u32>> = vec![Vec::new(); order.len()];
    let mut seen = vec![NOWHERE; order.len()];
    for (j, &i) in order.iter().enumerate() {
        let own = matrix.row(i as usize).0.iter().map(|&other| place[other as usize]);
        let inherited =
            children[j].iter().flat_map(|&c| rows[start[c as usize]..start[c as usize + 1]].iter().copied());
        let mut column: Vec<u32> = own
            .filter(|&k| k != NOWHERE)
            .chain(inherited)
            .filter(|&k| k > j as u32 && std::mem::replace(&mut seen[k as usize], j as u32) != j as u32)
            .collect();
        column.sort_unstable();
        if let Some(&parent) = column.first() {
            children[parent as usize].push(j as u32);
        }
        rows.extend(column);
        start.push(rows.len());
    }
    (start, rows)
}

/// The inverse of the lower triangle L with A = L Lᵀ; without the rows and columns of pivots up to `least`.
fn inverse_factor<const D: usize>(block: &Matrix<f64, D>, least: &Vector<f64, D>) -> Matrix<f64, D> {
    let mut lower = [[0.0; D]; D];
    let mut inverse = [[0.0; D]; D];
    for a in 0..D {
        for b in 0..=a {
            let rest = block[a][b] - (0..b).map(|c| lower[a][c] * lower[b][c]).sum::<f64>();
            if a > b {
                lower[a][b] = rest * inverse[b][b];
            } else if rest > least[a] {
                lower[a][a] = rest.sqrt();
                inverse[a][a] = 1.0 / lower[a][a];
            }
        }
        for b in 0..a {
            inverse[a][b] = -(b..a).map(|c| lower[a][c] * inverse[c][b]).sum::<f64>() * inverse[a][a];
        }
    }
    inverse
}

/// A Bᵀ.
fn times_transpose<const D: usize>(a: &Matrix<f64, D>, b: &Matrix<f64, D>) -> Matrix<f64, D> {
    a.map(|row| b.map(|other| (0..D).map(|k| row[k] * other[k]).sum()))
}

/// C −= A Bᵀ.
fn subtract_product<const D: usize>(c: &mut Matrix<f64, D>, a: &Matrix<f64, D>, b: &Matrix<f64, D>) {
    for i in 0..D {
        for j in 0..D {
            c[i][j] -= (0..D).map(|k| a[i][k] * b[j][k]).sum::<f64>();
        }
    }
}

fn apply_lower<const D: usize>(lower: &Matrix<f64, D>, v: &Vector<f64, D>) -> Vector<f64, D> {
    std::array::from_fn(|a| (0..=a).map(|b| lower[a][b] * v[b]).sum())
}

fn apply_lower_transpose<const D: usize>(lower: &Matrix<f64, D>, v: &Vector<f64, D>) -> Vector<f64, D> {
    std::array::from_fn(|b| (b..D).map(|a| lower[a][b] * v[a]).sum())
}
