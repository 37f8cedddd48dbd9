//! Coarse matrices, H¹ = R H P (HOT eq. 6).
//!
//! Gathered: a thread computes a coarse row from the rows of its children, first Σ_i w_Ii H_ij over
//! the fine columns that these touch, then over the parents of the columns. Particles are not
//! involved.

use rayon::prelude::*;

use super::hierarchy::Prolongation;
use super::sparse::Bsr;
use gridfall_core::maths::linalg::{Matrix, mul, scaled_identity};

/// Coarse rows per task of a thread.
const ROWS: usize = 32;

/// A sum of blocks per column, for few of many columns at once.
struct Accumulator<const D: usize> {
    /// Places of the columns' sums, counted from `base`; smaller numbers are left over from earlier
    /// rows.
    place: Vec<u32>,
    base: u32,
    columns: Vec<u32>,
    sums: Vec<Matrix<f64, D>>,
}

impl<const D: usize> Accumulator<D> {
    fn new(columns: usize) -> Self {
        Self { place: vec![0; columns], base: 1, columns: Vec::new(), sums: Vec::new() }
    }

    fn clear(&mut self) {
        match self.base.checked_add(self.columns.len() as u32) {
            Some(base) if base < u32::MAX / 2 => self.base = base,
            _ => (self.place.fill(0), self.base = 1).1,
        }
        self.columns.clear();
        self.sums.clear();
    }

    #[inline(always)]
    fn add(&mut self, column: u32, weight: f64, block: &Matrix<f64, D>) {
        let place = &mut self.place[column as usize];
        if *place < self.base {
            *place = self.base + self.columns.len() as u32;
            self.columns.push(column);
            self.sums.push([[0.0; D]; D]);
        }
        let sum = &mut self.sums[(*place - self.base) as usize];
        for a in 0..D {
            for b in 0..D {
                sum[a][b] += weight * block[a][b];
            }
        }
    }
}

/// A coarse matrix and the projections of the coarse nodes.
pub struct Coarse<const D: usize> {
    pub matrix: Bsr<f64, D>,
    /// S of the coarse nodes that are reached through sliding nodes only and therefore lack
    /// directions.
    pub projections: Vec<Option<Matrix<f64, D>>>,
}

/// R H P for P = S w. Rows and columns of `fine` are projected already, but for its diagonal
/// blocks, which were completed. The same is done to the coarse blocks: directions that no child
/// can move in get the block's largest eigenvalue.
pub fn galerkin<const D: usize>(
    fine: &Bsr<f64, D>,
    projections: &[Option<Matrix<f64, D>>],
    prolongation: &Prolongation<D>,
) -> Coarse<D> {
    let coarse_nodes = prolongation.children.rows();
    let starts: Vec<usize> = (0..coarse_nodes).step_by(ROWS).collect();
    let chunks: Vec<_> = starts
        .into_par_iter()
        .map_init(
            || (Accumulator::<D>::new(fine.rows()), Accumulator::<D>::new(coarse_nodes)),
            |(over_fine, over_coarse), start| {
                let mut rows = Vec::new();
                for row in start..(start + ROWS).min(coarse_nodes) {
                    gather_row(fine, projections, prolongation, row, over_fine, over_coarse);
                    let mut order: Vec<u32> = (0..over_coarse.columns.len() as u32).collect();
                    order.sort_unstable_by_key(|&k| over_coarse.columns[k as usize]);
                    let entry = |k: u32| (over_coarse.columns[k as usize], over_coarse.sums[k as usize]);
                    let entries: Vec<(u32, Matrix<f64, D>)> = order.into_iter().map(entry).collect();
                    let slides = prolongation.children.row(row).all(|(i, _)| projections[i].is_some());
                    rows.push((entries, slides));
                }
                rows
            },
        )
        .collect();

    let mut matrix = Bsr { row_start: vec![0], columns: Vec::new(), blocks: Vec::new() };
    let mut coarse_projections = Vec::with_capacity(coarse_nodes);
    for (row, (entries, slides)) in chunks.into_iter().flatten().enumerate() {
        let projection = slides.then(|| {
            let diagonal = entries.iter().find(|(column, _)| *column as usize == row).expect("a row has its diagonal");
            range_projection(&diagonal.1)
        });
        let projection = projection.flatten();
        for (column, mut block) in entries {
            if let (Some((s, largest)), true) = (&projection, column as usize == row) {
                block = completed(&block, s, *largest);
            }
            matrix.columns.push(column);
            matrix.blocks.push(block);
        }
        matrix.row_start.push(matrix.columns.len());
        coarse_projections.push(projection.map(|(s, _)| s));
    }
    Coarse { matrix, projections: coarse_projections }
}

fn gather_row<const D: usize>(
    fine: &Bsr<f64, D>,
    projections: &[Option<Matrix<f64, D>>],
    prolongation: &Prolongation<D>,
    row: usize,
    over_fine: &mut Accumulator<D>,
    over_coarse: &mut Accumulator<D>,
) {
    over_fine.clear();
    for (i, weight) in prolongation.children.row(row) {
        let (columns, blocks) = fine.row(i);
        for (&j, block) in columns.iter().zip(blocks) {
            over_fine.add(j, weight as f64, block);
        }
        if let Some(s) = &projections[i] {
            // The completion of the diagonal block is not part of the operator.
            let diagonal = &blocks[columns.binary_search(&(i as u32)).expect("every row has its diagonal")];
            let projected = mul(s, &mul(diagonal, s));
            let mut excess = *diagonal;
            (0..D).for_each(|a| (0..D).for_each(|b| excess[a][b] -= projected[a][b]));
            over_fine.add(i as u32, -weight as f64, &excess);
        }
    }
    over_coarse.clear();
    for (j, sum) in over_fine.columns.iter().zip(&over_fine.sums) {
        for (parent, weight) in prolongation.parents.row(*j as usize) {
            over_coarse.add(parent as u32, weight as f64, sum);
        }
    }
}

/// Eigenvalues below this part of the largest count as zero.
const SINGULAR: f64 = 1e-10;

/// The projection onto a block's range and its largest eigenvalue; none if it is regular.
fn range_projection<const D: usize>(block: &Matrix<f64, D>) -> Option<(Matrix<f64, D>, f64)> {
    let eigen = nalgebra::DMatrix::from_fn(D, D, |a, b| 0.5 * (block[a][b] + block[b][a])).symmetric_eigen();
    let largest = eigen.eigenvalues.max();
    if eigen.eigenvalues.min() > SINGULAR * largest {
        return None;
    }
    let mut s = [[0.0; D]; D];
    for (vector, value) in eigen.eigenvectors.column_iter().zip(&eigen.eigenvalues) {
        if *value > SINGULAR * largest {
            (0..D).for_each(|a| (0..D).for_each(|b| s[a][b] += vector[a] * vector[b]));
        }
    }
    Some((s, largest))
}

/// S B S + λ (I − S).
fn completed<const D: usize>(block: &Matrix<f64, D>, s: &Matrix<f64, D>, lambda: f64) -> Matrix<f64, D> {
    let mut completed = mul(s, &mul(block, s));
    let identity = scaled_identity::<f64, D>(1.0);
    (0..D).for_each(|a| (0..D).for_each(|b| completed[a][b] += lambda * (identity[a][b] - s[a][b])));
    completed
}
