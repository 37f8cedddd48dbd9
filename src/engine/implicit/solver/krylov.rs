//! Conjugate gradients with a preconditioner that may change from one application to the next.

use super::objective::{LinearOperator, NodeVectors};
use super::verbs::{apply_blocks, axpy, difference, dot, inverse, xpby};
use gridfall_core::maths::linalg::{Matrix, Vector, apply, dot as dot_vectors};
use gridfall_core::maths::real::Real;

/// Iterations after which a linear solve is given up (HOT, authors' code).
pub const MAX_ITERATIONS: u32 = 10_000;

/// z ≈ A⁻¹ r.
pub trait Preconditioner<const D: usize> {
    /// Returns the inner iterations: those of its own linear solver, or 1.
    fn apply(&mut self, r: &NodeVectors<D>, z: &mut NodeVectors<D>) -> u32;

    /// Called when zᵀr ≤ 0: makes the preconditioner more cautious, or returns false if it cannot.
    fn strengthen(&mut self) -> bool {
        false
    }
}

/// The inverses of the diagonal blocks.
pub struct BlockJacobi<T, const D: usize>(pub Vec<Matrix<T, D>>);

impl<T: Real, const D: usize> BlockJacobi<T, D> {
    /// From the diagonal blocks.
    pub fn new(diagonal: &[Matrix<T, D>]) -> Self {
        Self(diagonal.iter().map(inverse).collect())
    }
}

impl<const D: usize> Preconditioner<D> for BlockJacobi<f64, D> {
    fn apply(&mut self, r: &NodeVectors<D>, z: &mut NodeVectors<D>) -> u32 {
        apply_blocks(&self.0, r, z);
        1
    }
}

/// Solves A x = b from x = 0 until zᵀr ≤ goal(z0ᵀb).
pub fn conjugate_gradients<const D: usize>(
    operator: &dyn LinearOperator<D>,
    preconditioner: &mut dyn Preconditioner<D>,
    b: &NodeVectors<D>,
    x: &mut NodeVectors<D>,
    goal: impl Fn(f64) -> f64,
) -> u32 {
    let mut least = None;
    let done = |zr: f64, _: &NodeVectors<D>| zr <= *least.get_or_insert_with(|| goal(zr));
    conjugate_gradients_until(operator, preconditioner, b, x, done)
}

/// Solves A x = b from x = 0 until `done(zᵀr, x)`. β is Polak and Ribière's,
/// zᵀ(r − r_old) / z_oldᵀ r_old, which for a fixed preconditioner is the usual one and keeps the
/// directions conjugate to the last one for any other ("flexible"). Returns the iterations.
pub fn conjugate_gradients_until<const D: usize>(
    operator: &dyn LinearOperator<D>,
    preconditioner: &mut dyn Preconditioner<D>,
    b: &NodeVectors<D>,
    x: &mut NodeVectors<D>,
    mut done: impl FnMut(f64, &NodeVectors<D>) -> bool,
) -> u32 {
    x.fill([0.0; D]);
    let mut r = b.clone();
    let mut z: NodeVectors<D> = vec![[0.0; D]; b.len()];
    precondition(preconditioner, &r, &mut z);
    let mut zr = dot(&z, &r);
    let mut p = z.clone();
    let mut ap: NodeVectors<D> = vec![[0.0; D]; b.len()];
    let mut iterations = 0;
    while zr > 0.0 && !done(zr, x) && iterations < MAX_ITERATIONS {
        operator.apply(&p, &mut ap);
        let pap = dot(&p, &ap);
        if pap.is_nan() || pap <= 0.0 {
            break;
        }
        iterations += 1;
        let alpha = zr / pap;
        axpy(alpha, &p, x);
        let old = r.clone();
        axpy(-alpha, &ap, &mut r);
        precondition(preconditioner, &r, &mut z);
        let beta = dot(&z, &difference(&r, &old)) / zr;
        zr = dot(&z, &r);
        xpby(&z, beta, &mut p);
    }
    iterations
}

/// z with zᵀr > 0, unless the preconditioner cannot give one.
pub fn precondition<const D: usize>(
    preconditioner: &mut dyn Preconditioner<D>,
    r: &NodeVectors<D>,
    z: &mut NodeVectors<D>,
) {
    preconditioner.apply(r, z);
    while dot(z, r) < 0.0 && preconditioner.strengthen() {
        preconditioner.apply(r, z);
    }
}

/// Conjugate gradients with the diagonal blocks, until zᵀr < ¼ of what it is for a given right-hand
/// side (HOT §5.3, authors' code).
pub struct Inexact<const D: usize> {
    jacobi: BlockJacobi<f64, D>,
}

impl<const D: usize> Inexact<D> {
    pub fn new(operator: &dyn LinearOperator<D>) -> Self {
        Self { jacobi: BlockJacobi::new(&operator.diagonal()) }
    }

    /// Solves A x = b to the accuracy that `reference` sets.
    pub fn solve(
        &mut self,
        operator: &dyn LinearOperator<D>,
        b: &NodeVectors<D>,
        reference: &NodeVectors<D>,
        x: &mut NodeVectors<D>,
    ) -> u32 {
        let energy = |v: &Vector<f64, D>, block: &Matrix<f64, D>| dot_vectors(v, &apply(block, v));
        let goal: f64 = 0.25 * reference.iter().zip(&self.jacobi.0).map(|(v, block)| energy(v, block)).sum::<f64>();
        conjugate_gradients(operator, &mut self.jacobi, b, x, |_| goal)
    }
}
