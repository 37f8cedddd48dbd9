//! Symmetric block Gauss–Seidel, coloured by blocks of 4^D nodes (HOT §5.1, §6).

use std::ops::Range;

use rayon::prelude::*;

use super::hierarchy::{Nodes, block_key};
use super::krylov::Preconditioner;
use super::objective::NodeVectors;
use super::sparse::{Bsr, row_times};
use super::verbs::inverse;
use gridfall_core::maths::linalg::{Matrix, Vector, apply};
use gridfall_core::maths::real::Real;
use gridfall_core::maths::widest::widest;

/// Nodes of a block along an axis.
const BLOCK: i32 = 4;

/// The order of a sweep. Blocks of one colour are not coupled, so that they can be relaxed in
/// parallel with a result that does not depend on the threads.
pub struct GaussSeidel<T, const D: usize> {
    inverse_diagonal: Vec<Matrix<T, D>>,
    /// Nodes by colour and block.
    order: Vec<u32>,
    /// For every colour, the places of its blocks' nodes in `order`.
    colours: Vec<Vec<Range<usize>>>,
}

/// A colour and one of its blocks.
type Place<const D: usize> = (usize, [i32; D]);

/// Around a periodic axis the last block takes what is left over, and a third colour if their
/// number is odd.
fn place<const D: usize>(nodes: &Nodes<D>, i: usize) -> Place<D> {
    let mut colour = 0;
    let block = std::array::from_fn(|a| {
        let block = nodes.ids[i].index[a].div_euclid(BLOCK);
        let (block, axis_colour) = match nodes.period[a].map(|cells| (cells / BLOCK).max(1)) {
            None => (block, block.rem_euclid(2)),
            Some(blocks) if blocks % 2 == 1 && block >= blocks - 1 => (blocks - 1, 2),
            Some(blocks) => (block.min(blocks - 1), block.min(blocks - 1) % 2),
        };
        colour = 3 * colour + axis_colour as usize;
        block
    });
    (colour, block)
}

impl<T: Real, const D: usize> GaussSeidel<T, D> {
    pub fn new(matrix: &Bsr<T, D>, nodes: &Nodes<D>) -> Self {
        let places: Vec<Place<D>> = (0..matrix.rows()).map(|i| place(nodes, i)).collect();
        let mut order: Vec<u32> = (0..matrix.rows() as u32).collect();
        order.par_sort_unstable_by_key(|&i| (places[i as usize], block_key(&nodes.ids[i as usize])));
        let mut colours: Vec<Vec<Range<usize>>> = Vec::new();
        let mut start = 0;
        for block in order.chunk_by(|&i, &j| places[i as usize] == places[j as usize]) {
            let new = start == 0 || places[order[start - 1] as usize].0 != places[block[0] as usize].0;
            if new {
                colours.push(Vec::new());
            }
            colours.last_mut().expect("the first block is new").push(start..start + block.len());
            start += block.len();
        }
        let uncoupled = |i: usize| {
            let (colour, block) = places[i];
            matrix.row(i).0.iter().all(|&j| places[j as usize].0 != colour || places[j as usize].1 == block)
        };
        assert!((0..matrix.rows()).into_par_iter().all(uncoupled), "blocks of one colour are coupled");
        Self { inverse_diagonal: matrix.diagonal().iter().map(inverse).collect(), order, colours }
    }

    /// Forwards and back.
    pub fn symmetric_sweep(&self, matrix: &Bsr<T, D>, b: &[Vector<T, D>], x: &mut [Vector<T, D>]) {
        assert!(b.len() == self.order.len() && x.len() == self.order.len());
        let x = Shared(x.as_mut_ptr());
        for blocks in &self.colours {
            blocks.par_iter().for_each(|block| relax(self, matrix, &self.order[block.clone()], false, b, &x));
        }
        for blocks in self.colours.iter().rev() {
            blocks.par_iter().for_each(|block| relax(self, matrix, &self.order[block.clone()], true, b, &x));
        }
    }
}

/// The vector that the threads of a sweep write, each at nodes of its own.
struct Shared<T>(*mut T);

// SAFETY: see `relax`, which alone uses it.
unsafe impl<T: Send> Sync for Shared<T> {}

widest! {
    /// x_i += D⁻¹ (b − A x)_i, node by node.
    fn relax[T: Real, const D: usize][T, D](
        sweep: &GaussSeidel<T, D>,
        matrix: &Bsr<T, D>,
        block: &[u32],
        backwards: bool,
        b: &[Vector<T, D>],
        x: &Shared<Vector<T, D>>,
    ) {
        for k in 0..block.len() {
            let i = block[if backwards { block.len() - 1 - k } else { k }] as usize;
            let start = matrix.row_start[i];
            let columns = &matrix.columns[start..matrix.row_start[i + 1]];
            let entries = matrix.blocks[start..].as_flattened().as_flattened();
            // SAFETY: node i is written by this thread alone, and the nodes read are either of the
            // same block or of blocks of other colours, which no thread writes now;
            // `GaussSeidel::new` has checked that. All are in bounds, which `symmetric_sweep` has
            // checked.
            unsafe {
                let product = row_times(columns, entries, |j| *x.0.add(j));
                let step = apply(&sweep.inverse_diagonal[i], &std::array::from_fn(|a| b[i][a] - product[a]));
                let x = &mut *x.0.add(i);
                (0..D).for_each(|a| x[a] += step[a]);
            }
        }
    }
}

/// A symmetric sweep as a preconditioner of conjugate gradients.
pub struct SymmetricGaussSeidel<'a, const D: usize> {
    pub matrix: &'a Bsr<f64, D>,
    pub sweeps: GaussSeidel<f64, D>,
}

impl<const D: usize> Preconditioner<D> for SymmetricGaussSeidel<'_, D> {
    fn apply(&mut self, r: &NodeVectors<D>, z: &mut NodeVectors<D>) -> u32 {
        z.fill([0.0; D]);
        self.sweeps.symmetric_sweep(self.matrix, r, z);
        1
    }
}
