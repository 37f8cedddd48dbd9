//! A particle's nodes, weights and the vectors g that make the velocity gradient: ∇v = share Σ_i
//! v_i g_iᵀ.
//!
//! In the gradient form g = ∂w/∂x; in MLS g = w diag(p)⁻¹ (x_i − x_p − x̄_s), with x̄_s the mean of
//! grid s, and as published g = w D⁻¹ (x_i − x_p). `share` is ½ for the compact
//! kernel's two grids, which both carry the full mass, else 1. All of a step's interpolation is
//! tabulated once, because a solver uses it dozens of times.

use gridfall_core::maths::linalg::{Matrix, Vector, apply, identity};
use gridfall_core::sim::kernel::{Compact, Cubic, Linear, Quadratic, ShapeFunction, times_inverse_diagonal};
use gridfall_core::sim::setup::{Kernel, Transfer};

/// The numbers that describe a kernel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shape {
    pub grids: usize,
    /// Nodes along an axis on each grid.
    pub width: usize,
    /// Position of node 0 of each grid (dx).
    pub shift: [f64; 2],
    /// Share of each grid in the particles' velocities and gradients.
    pub share: f64,
}

/// Interpolation of one particle.
#[derive(Clone, Copy, Debug)]
pub struct Stencil<const D: usize> {
    /// Lowest node on each grid.
    pub base: [[i32; D]; 2],
    /// D⁻¹ (1/m²), for C = B D⁻¹.
    pub inverse_moment: Matrix<f64, D>,
}

/// Writes weights and g vectors (1/m) of a particle at `x` (in units of `dx`) for all nodes, grid
/// by grid, the last axis fastest.
type Tabulate<const D: usize> = fn(&Vector<f64, D>, f64, Transfer, &mut [f64], &mut [Vector<f64, D>]) -> Stencil<D>;

/// A kernel with its form of the gradient.
#[derive(Clone, Copy)]
pub struct Interpolation<const D: usize> {
    pub shape: Shape,
    transfer: Transfer,
    tabulate: Tabulate<D>,
}

impl<const D: usize> Interpolation<D> {
    pub fn new(kernel: Kernel, transfer: Transfer) -> Self {
        let (shape, tabulate): (Shape, Tabulate<D>) = match kernel {
            Kernel::Compact => (shape::<Compact, 2, 2>(), tabulate::<Compact, D, 2, 2>),
            Kernel::Quadratic => (shape::<Quadratic, 1, 3>(), tabulate::<Quadratic, D, 1, 3>),
            Kernel::Cubic => (shape::<Cubic, 1, 4>(), tabulate::<Cubic, D, 1, 4>),
            Kernel::Linear => (shape::<Linear, 1, 2>(), tabulate::<Linear, D, 1, 2>),
        };
        Self { shape, transfer, tabulate }
    }

    /// Nodes of a particle.
    pub fn nodes(&self) -> usize {
        self.shape.grids * self.shape.width.pow(D as u32)
    }

    /// Weights and g vectors (1/m) of a particle at `x` (in units of dx, m) for its
    /// [`Self::nodes`].
    pub fn at(&self, x: &Vector<f64, D>, dx: f64, w: &mut [f64], g: &mut [Vector<f64, D>]) -> Stencil<D> {
        (self.tabulate)(x, dx, self.transfer, w, g)
    }

    /// Index of the `local`-th node of a particle relative to its lowest, and its grid.
    pub fn offset(&self, local: usize) -> (usize, [i32; D]) {
        let (mut rest, n) = (local, self.shape.width);
        let mut offset = [0; D];
        for a in (0..D).rev() {
            offset[a] = (rest % n) as i32;
            rest /= n;
        }
        (rest, offset)
    }
}

fn shape<K: ShapeFunction<G, W>, const G: usize, const W: usize>() -> Shape {
    Shape { grids: G, width: W, shift: [K::SHIFT[0], K::SHIFT[G - 1]], share: 1.0 / G as f64 }
}

fn tabulate<K: ShapeFunction<G, W>, const D: usize, const G: usize, const W: usize>(
    x: &Vector<f64, D>,
    dx: f64,
    transfer: Transfer,
    w: &mut [f64],
    g: &mut [Vector<f64, D>],
) -> Stencil<D> {
    let axes = x.map(|x| K::axis(x));
    let (spread, skew) = (axes.map(|a| a.spread), axes.map(|a| a.skew));
    let inverse_moment = K::times_inverse_moment(&identity::<f64, D>(), &spread, &skew);
    let inverse_spread = times_inverse_diagonal(&identity::<f64, D>(), &spread);
    let mut base = [[0; D]; 2];
    let per_grid = W.pow(D as u32);
    for grid in 0..G {
        base[grid] = axes.map(|a| a.base[grid]);
        for local in 0..per_grid {
            let (mut rest, mut weight) = (local, 1.0);
            let mut at = [0; D];
            for a in (0..D).rev() {
                at[a] = rest % W;
                rest /= W;
                weight *= axes[a].weight[grid][at[a]];
            }
            let slot = grid * per_grid + local;
            w[slot] = weight;
            let offset: Vector<f64, D> = std::array::from_fn(|a| axes[a].offset[grid] + at[a] as f64);
            g[slot] = if transfer.is_centred() {
                let mean = |a: usize| if grid == 0 { skew[a] } else { -skew[a] };
                let arm: Vector<f64, D> = std::array::from_fn(|a| offset[a] - mean(a));
                apply(&inverse_spread, &arm).map(|c| weight * c / dx)
            } else if transfer.is_mls() {
                apply(&inverse_moment, &offset).map(|c| weight * c / dx)
            } else {
                std::array::from_fn(|a| {
                    let others = (0..D).filter(|&b| b != a).map(|b| axes[b].weight[grid][at[b]]);
                    axes[a].slope[grid][at[a]] * others.product::<f64>() / dx
                })
            };
        }
    }
    Stencil { base, inverse_moment: inverse_moment.map(|row| row.map(|c| c / (dx * dx))) }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Affine velocity fields are reproduced with their gradients by every kernel and form.
    #[test]
    fn affine_fields_are_reproduced() {
        let dx = 0.3;
        let (v0, c) = ([1.0, -2.0, 0.5], [[0.1, 0.4, -0.3], [0.0, 0.7, 0.2], [-0.6, 0.3, 0.9]]);
        for kernel in [Kernel::Compact, Kernel::Quadratic, Kernel::Cubic, Kernel::Linear] {
            for transfer in [Transfer::Apic, Transfer::Mls, Transfer::MlsPublished] {
                let interpolation = Interpolation::<3>::new(kernel, transfer);
                let n = interpolation.nodes();
                for x in [[3.1, 4.63, 5.97], [3.26, 4.74, 5.2501], [7.99, 4.24, 5.76]] {
                    let (mut w, mut g) = (vec![0.0; n], vec![[0.0; 3]; n]);
                    let stencil = interpolation.at(&x, dx, &mut w, &mut g);
                    let (mut v, mut grad) = ([0.0; 3], [[0.0; 3]; 3]);
                    for local in 0..n {
                        let (grid, offset) = interpolation.offset(local);
                        let shift = interpolation.shape.shift[grid];
                        let at: [f64; 3] =
                            std::array::from_fn(|a| dx * (f64::from(stencil.base[grid][a] + offset[a]) + shift));
                        let turn = apply(&c, &at);
                        for a in 0..3 {
                            v[a] += interpolation.shape.share * w[local] * (v0[a] + turn[a]);
                            for b in 0..3 {
                                grad[a][b] += interpolation.shape.share * g[local][b] * (v0[a] + turn[a]);
                            }
                        }
                    }
                    let turn = apply(&c, &x.map(|x| x * dx));
                    for a in 0..3 {
                        assert!((v[a] - v0[a] - turn[a]).abs() < 1e-13, "{kernel:?} {transfer:?}: {v:?}");
                        for b in 0..3 {
                            assert!((grad[a][b] - c[a][b]).abs() < 1e-12, "{kernel:?} {transfer:?}: {grad:?}");
                        }
                    }
                }
            }
        }
    }
}
