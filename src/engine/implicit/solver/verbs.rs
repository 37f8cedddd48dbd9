//! Vector operations that all solvers share. Sums are taken over chunks of fixed length, so that
//! they do not depend on the number of threads.

use rayon::prelude::*;

use super::objective::NodeVectors;
use gridfall_core::maths::linalg::{Matrix, Vector, apply, cofactor, dot as dot_vectors, transpose};
use gridfall_core::maths::real::Real;

/// Nodes per task of a thread.
const CHUNK: usize = 1024;

/// Σ over nodes, chunk by chunk; `term` gets the number of a chunk's first node and how many there
/// are.
fn sum(nodes: usize, term: impl Fn(usize) -> f64 + Sync) -> f64 {
    let chunk = |c: usize| (c * CHUNK..(c * CHUNK + CHUNK).min(nodes)).map(&term).sum::<f64>();
    let sums: Vec<f64> = (0..nodes.div_ceil(CHUNK)).into_par_iter().map(chunk).collect();
    sums.into_iter().sum()
}

/// aᵀ b.
pub fn dot<const D: usize>(a: &NodeVectors<D>, b: &NodeVectors<D>) -> f64 {
    sum(a.len(), |i| dot_vectors(&a[i], &b[i]))
}

/// ‖a‖₂.
pub fn norm<const D: usize>(a: &NodeVectors<D>) -> f64 {
    dot(a, a).sqrt()
}

/// sqrt(Σ m_i |a_i|²).
pub fn mass_norm<const D: usize>(a: &NodeVectors<D>, masses: &[f64]) -> f64 {
    sum(a.len(), |i| masses[i] * dot_vectors(&a[i], &a[i])).sqrt()
}

/// sqrt(Σ |a_i|² / scale_i² / n) (HOT §5.2).
pub fn scaled_norm<const D: usize>(a: &NodeVectors<D>, scales: &[f64]) -> f64 {
    let n = a.len().max(1) as f64;
    (sum(a.len(), |i| dot_vectors(&a[i], &a[i]) / (scales[i] * scales[i])) / n).sqrt()
}

/// y += α x.
pub fn axpy<T: Real, const D: usize>(alpha: T, x: &[Vector<T, D>], y: &mut [Vector<T, D>]) {
    update(y, x, |y, x| {
        for a in 0..D {
            y[a] += alpha * x[a];
        }
    });
}

/// y ← x + β y.
pub fn xpby<T: Real, const D: usize>(x: &[Vector<T, D>], beta: T, y: &mut [Vector<T, D>]) {
    update(y, x, |y, x| {
        for a in 0..D {
            y[a] = x[a] + beta * y[a];
        }
    });
}

/// a − b.
pub fn difference<const D: usize>(a: &NodeVectors<D>, b: &NodeVectors<D>) -> NodeVectors<D> {
    let mut c = a.clone();
    axpy(-1.0, b, &mut c);
    c
}

/// Changes every node's y by its x.
pub fn update<T: Send, U: Sync>(y: &mut [T], x: &[U], change: impl Fn(&mut T, &U) + Sync) {
    y.par_iter_mut().with_min_len(CHUNK).zip(x).for_each(|(y, x)| change(y, x));
}

/// The inverse of a symmetric positive definite block.
pub fn inverse<T: Real, const D: usize>(block: &Matrix<T, D>) -> Matrix<T, D> {
    let exact = block.map(|row| row.map(|x| x.to_f64()));
    let cofactor = cofactor(&exact);
    let det = dot_vectors(&exact[0], &cofactor[0]);
    transpose(&cofactor).map(|row| row.map(|x| T::from_f64(x / det)))
}

/// Every node's block times its vector.
pub fn apply_blocks<T: Real, const D: usize>(blocks: &[Matrix<T, D>], x: &[Vector<T, D>], y: &mut [Vector<T, D>]) {
    y.par_iter_mut().with_min_len(CHUNK).zip(blocks).zip(x).for_each(|((y, block), x)| *y = apply(block, x));
}

/// x ← S x where a node may only slide.
pub fn project<T: Real, const D: usize>(projections: &[Option<Matrix<T, D>>], x: &mut [Vector<T, D>]) {
    update(x, projections, |x, projection| {
        if let Some(s) = projection {
            *x = apply(s, x);
        }
    });
}
