//! Smoothers of the V-cycle: fixed, linear and symmetric, so that the cycle is a preconditioner.

use rayon::prelude::*;

use super::gauss_seidel::GaussSeidel;
use super::hierarchy::Nodes;
use super::sparse::{Bsr, ROWS};
use super::spectrum::largest_eigenvalue;
use super::verbs::{inverse, update};
use gridfall_core::maths::linalg::{Matrix, Vector, apply};
use gridfall_core::maths::real::Real;
use gridfall_core::sim::settings;

/// Degree of the smoother's polynomial, and the range of the spectrum that it damps, [λ / RANGE,
/// λ]. Measured: degree 4 over λ/30 takes a third less time per cycle, but twice the cycles where
/// materials of 1e5 and 1e9 Pa meet.
pub const DEGREE: usize = 8;
pub const RANGE: f64 = 100.0;
/// Above the largest eigenvalue of any D⁻¹A with the largest possible number of blocks per row.
pub const BOUND: f64 = 1e3;

pub enum Smoother<T, const D: usize> {
    Chebyshev(Chebyshev<T, D>),
    GaussSeidel(GaussSeidel<T, D>),
}

impl<T: Real, const D: usize> Smoother<T, D> {
    pub fn new(kind: settings::Smoother, matrix: &Bsr<T, D>, nodes: &Nodes<D>) -> Self {
        match kind {
            settings::Smoother::Chebyshev => Self::Chebyshev(Chebyshev::new(matrix, DEGREE, RANGE)),
            settings::Smoother::GaussSeidel => Self::GaussSeidel(GaussSeidel::new(matrix, nodes)),
        }
    }

    /// Brings x nearer to A⁻¹ b; `from_zero`: from x = 0, whatever `x` holds.
    pub fn smooth(
        &self,
        matrix: &Bsr<T, D>,
        b: &[Vector<T, D>],
        x: &mut Vec<Vector<T, D>>,
        from_zero: bool,
        room: &mut Room<T, D>,
    ) {
        match self {
            Self::Chebyshev(polynomial) => polynomial.smooth(matrix, b, x, from_zero, room),
            Self::GaussSeidel(sweeps) => {
                if from_zero {
                    x.fill([T::ZERO; D]);
                }
                sweeps.symmetric_sweep(matrix, b, x);
            }
        }
    }

    /// Widens a polynomial's interval; false if there is none or it is wide enough.
    pub fn strengthen(&mut self) -> bool {
        match self {
            Self::Chebyshev(polynomial) => polynomial.strengthen(),
            Self::GaussSeidel(_) => false,
        }
    }
}

/// Memory for a level's intermediate vectors.
#[derive(Default)]
pub struct Room<T, const D: usize> {
    step: Vec<Vector<T, D>>,
    next: Vec<Vector<T, D>>,
}

/// The factors of the last step and of D⁻¹ r in each step of a Chebyshev polynomial that damps [λ / range,
/// λ]: the three-term recurrence of Saad, "Iterative Methods for Sparse Linear Systems", algorithm 12.1.
pub fn coefficients(lambda: f64, range: f64, degree: usize) -> impl Iterator<Item = [f64; 2]> {
    let (theta, delta) = (0.5 * lambda * (1.0 + 1.0 / range), 0.5 * lambda * (1.0 - 1.0 / range));
    let mut rho = delta / theta;
    (0..degree).map(move |k| {
        if k == 0 {
            return [0.0, 1.0 / theta];
        }
        let old = rho;
        rho = 1.0 / (2.0 * theta / delta - old);
        [rho * old, 2.0 * rho / delta]
    })
}

/// A Chebyshev polynomial of D⁻¹A, D the diagonal blocks (Adams, Brezina, Hu & Tuminaro 2003).
pub struct Chebyshev<T, const D: usize> {
    inverse_diagonal: Vec<Matrix<T, D>>,
    degree: usize,
    range: f64,
    lambda: f64,
}

impl<T: Real, const D: usize> Chebyshev<T, D> {
    /// Damps the spectrum's part in [λ / range, λ].
    pub fn new(matrix: &Bsr<T, D>, degree: usize, range: f64) -> Self {
        let inverse_diagonal: Vec<_> = matrix.diagonal().iter().map(inverse).collect();
        let lambda = largest_eigenvalue(|x, y| matrix.multiply(x, y), &inverse_diagonal);
        Self { inverse_diagonal, degree, range, lambda }
    }

    /// Doubles λ; false once λ exceeds every possible spectrum.
    pub fn strengthen(&mut self) -> bool {
        self.lambda *= 2.0;
        self.lambda < BOUND
    }

    /// One pass over the matrix per degree.
    pub fn smooth(
        &self,
        matrix: &Bsr<T, D>,
        b: &[Vector<T, D>],
        x: &mut Vec<Vector<T, D>>,
        from_zero: bool,
        room: &mut Room<T, D>,
    ) {
        room.step.resize(b.len(), [T::ZERO; D]);
        room.next.resize(b.len(), [T::ZERO; D]);
        for (k, [keep, gain]) in coefficients(self.lambda, self.range, self.degree).enumerate() {
            if k == 0 && from_zero {
                self.first_step(T::from_f64(gain), b, &mut room.step);
                x.copy_from_slice(&room.step);
            } else {
                self.step(matrix, [T::from_f64(keep), T::from_f64(gain)], b, x, room);
                std::mem::swap(x, &mut room.next);
            }
        }
    }

    /// d = gain D⁻¹ b.
    fn first_step(&self, gain: T, b: &[Vector<T, D>], step: &mut [Vector<T, D>]) {
        step.par_iter_mut().with_min_len(1024).zip(&self.inverse_diagonal).zip(b).for_each(|((step, block), b)| {
            *step = apply(block, b).map(|z| gain * z);
        });
    }

    /// d ← keep d + gain D⁻¹ (b − A x), next = x + d.
    fn step(
        &self,
        matrix: &Bsr<T, D>,
        [keep, gain]: [T; 2],
        b: &[Vector<T, D>],
        x: &[Vector<T, D>],
        room: &mut Room<T, D>,
    ) {
        let keep = |d: T| if keep == T::ZERO { T::ZERO } else { keep * d };
        room.step.par_chunks_mut(ROWS).zip(room.next.par_chunks_mut(ROWS)).enumerate().for_each(|(c, (step, next))| {
            let mut products = [[T::ZERO; D]; ROWS];
            let first = c * ROWS;
            matrix.multiply_rows(first, x, &mut products[..step.len()]);
            for (k, (step, next)) in step.iter_mut().zip(next).enumerate() {
                let i = first + k;
                let residual = std::array::from_fn(|a| b[i][a] - products[k][a]);
                let z = apply(&self.inverse_diagonal[i], &residual);
                *step = std::array::from_fn(|a| keep(step[a]) + gain * z[a]);
                *next = std::array::from_fn(|a| x[i][a] + step[a]);
            }
        });
    }
}

/// r = b − A x.
pub fn residual<T: Real, const D: usize>(
    matrix: &Bsr<T, D>,
    b: &[Vector<T, D>],
    x: &[Vector<T, D>],
    r: &mut [Vector<T, D>],
) {
    matrix.multiply(x, r);
    update(r, b, |r, b| *r = std::array::from_fn(|a| b[a] - r[a]));
}
