//! Interpolation kernels: which nodes a particle touches, with what weights, and the affine moment
//! matrix in closed form.
//!
//! All lengths are in units of dx. A kernel is a product over the axes. The single-grid kernels
//! have nodes at whole numbers. The compact kernel (CK-MPM, §4) interpolates from two grids s = ±1
//! with nodes at i + s/4. Both grids carry the full mass and momentum, so particles receive the
//! mean over the grids.

use crate::maths::linalg::{Matrix, Vector, add_scaled, apply, dot};
use crate::maths::real::Real;

/// Nodes and weights of a particle along one axis: `G` grids of `W` nodes each.
#[derive(Clone, Copy, Debug)]
pub struct Axis<T, const G: usize, const W: usize> {
    /// Lowest node touched.
    pub base: [i32; G],
    /// Position of that node relative to the particle; the next ones follow at distance 1.
    pub offset: [T; G],
    pub weight: [[T; W]; G],
    /// d weight / d x_p.
    pub slope: [[T; W]; G],
    /// This axis's part of the moment matrix: D = diag(spread) + skew skewᵀ.
    pub spread: T,
    /// Mean of x_i − x_p over the first grid's nodes, Σ w (x_i − x_p). The second grid has its
    /// negative; a single grid has none.
    pub skew: T,
}

/// The shape function of a kernel, fixed at compile time: `G` grids with `W` nodes per axis and
/// grid.
pub trait ShapeFunction<const G: usize, const W: usize>: Send + Sync + 'static {
    /// Node i of grid g lies at `i + SHIFT[g]`.
    const SHIFT: [f64; G];
    /// Particles at [c + CELL, c + 1 + CELL) touch the same nodes (for the compact kernel: nearly).
    const CELL: f64;
    /// Whether D = diag(spread), without a skew part.
    const DIAGONAL: bool;

    fn axis<T: Real>(x: T) -> Axis<T, G, W>;

    /// ∫ of a node's weight over the positions above −y, dx: how much of it lies inside a wall that the
    /// node is y inside of. For y ≤ 0; above, 1 − that of −y.
    fn tail(y: f64) -> f64;

    /// The share of a node's room that is inside a plane wall which it lies y inside of (dx; negative behind the wall).
    fn inside(y: f64) -> f64 {
        if y <= 0.0 { Self::tail(y) } else { 1.0 - Self::tail(-y) }
    }

    /// m D⁻¹ for D = diag(spread) + skew skewᵀ, by Sherman and Morrison:
    /// D⁻¹ = diag(1/p) − q qᵀ/(1 + s·q), q = s/p, with p the spread and s the skew.
    #[inline(always)]
    fn times_inverse_moment<T: Real, const D: usize>(
        m: &Matrix<T, D>,
        spread: &Vector<T, D>,
        skew: &Vector<T, D>,
    ) -> Matrix<T, D> {
        let c = times_inverse_diagonal(m, spread);
        if Self::DIAGONAL {
            return c;
        }
        let mut q = *skew;
        for k in 0..D {
            q[k] = skew[k] / spread[k];
        }
        let along = apply(m, &q);
        let factor = T::ONE / (T::ONE + dot(skew, &q));
        let mut outer = c;
        for i in 0..D {
            for k in 0..D {
                outer[i][k] = along[i] * q[k];
            }
        }
        add_scaled(&c, -factor, &outer)
    }
}

/// m diag(p)⁻¹. With p the spread, this is the inverse of the moments about each grid's own mean,
/// Σ w (x_i − x_p − x̄)(x_i − x_p − x̄)ᵀ, which have no skew part.
#[inline(always)]
pub fn times_inverse_diagonal<T: Real, const D: usize>(m: &Matrix<T, D>, p: &Vector<T, D>) -> Matrix<T, D> {
    let mut c = *m;
    for k in 0..D {
        // Only the linear kernel's spread can vanish, on a grid line, and m vanishes there too.
        let inverse = T::ONE / p[k].max(T::TINY);
        for i in 0..D {
            c[i][k] = m[i][k] * inverse;
        }
    }
    c
}

/// K(x) = 1 − |x| + sin(2π|x|)/2π on |x| < 1, on the dual grid (CK-MPM, eq. 8).
pub struct Compact;
/// Hat function.
pub struct Linear;
/// Quadratic B-spline.
pub struct Quadratic;
/// Cubic B-spline.
pub struct Cubic;

/// (−1)^k 3! / (2k+3)!: x − sin x = x³/6 Σ c_k x^2k.
const SINE: [f64; 11] = series(3);
/// (−1)^k 2! / (2k+2)!: 1 − cos x = x²/2 Σ c_k x^2k.
const COSINE: [f64; 11] = series(2);

const fn series(first: u32) -> [f64; 11] {
    let mut c = [1.0; 11];
    let mut k = 1;
    while k < 11 {
        let n = first + 2 * k as u32;
        c[k] = -c[k - 1] / (n * (n - 1)) as f64;
        k += 1;
    }
    c
}

/// Σ c_k t^k for t ≤ (π/2)², to rounding of T. The truncation error is below 1e-8 after 6 terms and
/// below 1e-19 after 11.
#[inline(always)]
fn sum<T: Real>(c: &[f64; 11], t: T) -> T {
    let terms = if T::EPSILON.to_f64() > 1e-10 { 6 } else { 11 };
    let mut p = T::from_f64(c[terms - 1]);
    for k in (0..terms - 1).rev() {
        p = p * t + T::from_f64(c[k]);
    }
    p
}

impl ShapeFunction<2, 2> for Compact {
    const SHIFT: [f64; 2] = [0.25, -0.25];
    const CELL: f64 = 0.0;
    const DIAGONAL: bool = false;

    fn tail(y: f64) -> f64 {
        let a = y.abs().min(1.0);
        let turn = 2.0 * std::f64::consts::PI;
        0.5 - a + 0.5 * a * a - (1.0 - (turn * a).cos()) / (turn * turn)
    }

    /// One polynomial serves both grids without cancellation. Near the kernel's edge the weight is
    /// K ≈ (2π²/3) v³. There the textbook form is rounding noise of either sign, and this one keeps
    /// full relative precision.
    ///
    /// With u± = frac(x ∓ ¼) and v = min(u, 1 − u), the far node's weight is
    /// g(v) = v − sin(2πv)/2π, the near node's 1 − g(v) and the size of the slope
    /// h(v) = 1 − cos 2πv. Since v⁺ + v⁻ = ½, with a = min(v⁺, v⁻) ≤ ¼ the other grid has
    /// g(½ − a) = ½ − 2a + g(a) and h(½ − a) = 2 − h(a). s = cos(2πx)/2π = ∓(v⁺ − g(v⁺)).
    #[inline(always)]
    fn axis<T: Real>(x: T) -> Axis<T, 2, 2> {
        let mut base = [0; 2];
        let (mut u, mut v) = ([T::ZERO; 2], [T::ZERO; 2]);
        for g in 0..2 {
            let shifted = x - T::from_f64(Self::SHIFT[g]);
            let node = shifted.floor();
            base[g] = node.to_i32();
            u[g] = shifted - node;
            v[g] = u[g].min(T::ONE - u[g]);
        }
        let a = v[0].min(v[1]);
        let t = a * a * T::from_f64(4.0 * std::f64::consts::PI * std::f64::consts::PI);
        let g_near = a * t * T::from_f64(1.0 / 6.0) * sum(&SINE, t);
        let h_near = T::HALF * t * sum(&COSINE, t);
        let g_far = (T::HALF - T::TWO * a) + g_near;
        let h_far = T::TWO - h_near;

        let (mut weight, mut slope) = ([[T::ZERO; 2]; 2], [[T::ZERO; 2]; 2]);
        let mut spread = T::ZERO;
        let mut far = [T::ZERO; 2];
        for g in 0..2 {
            let nearest = v[g] <= v[1 - g];
            let small = if nearest { g_near } else { g_far };
            let steep = if nearest { h_near } else { h_far };
            let large = T::ONE - small;
            let lower_is_near = u[g] <= T::HALF;
            weight[g] = if lower_is_near { [large, small] } else { [small, large] };
            slope[g] = [-steep, steep];
            spread += T::HALF * small * large;
            far[g] = small;
        }
        let s = v[0] - far[0];
        let skew = if u[0] <= T::HALF { -s } else { s };
        Axis { base, offset: [-u[0], -u[1]], weight, slope, spread, skew }
    }
}

impl ShapeFunction<1, 2> for Linear {
    const SHIFT: [f64; 1] = [0.0];
    const CELL: f64 = 0.0;
    const DIAGONAL: bool = true;

    fn tail(y: f64) -> f64 {
        0.5 * (1.0 + y).max(0.0).powi(2)
    }

    #[inline(always)]
    fn axis<T: Real>(x: T) -> Axis<T, 1, 2> {
        let node = x.floor();
        let u = x - node;
        let rest = T::ONE - u;
        Axis {
            base: [node.to_i32()],
            offset: [-u],
            weight: [[rest, u]],
            slope: [[-T::ONE, T::ONE]],
            spread: u * rest,
            skew: T::ZERO,
        }
    }
}

impl ShapeFunction<1, 3> for Quadratic {
    const SHIFT: [f64; 1] = [0.0];
    const CELL: f64 = 0.5;
    const DIAGONAL: bool = true;

    fn tail(y: f64) -> f64 {
        if y <= -0.5 { (1.5 + y).max(0.0).powi(3) / 6.0 } else { 0.5 + 0.75 * y - y * y * y / 3.0 }
    }

    #[inline(always)]
    fn axis<T: Real>(x: T) -> Axis<T, 1, 3> {
        let node = (x - T::HALF).floor();
        // Distance from the middle node, in [-½, ½).
        let r = (x - node) - T::ONE;
        let (left, right) = (T::HALF - r, T::HALF + r);
        let weight = [T::HALF * left * left, T::from_f64(0.75) - r * r, T::HALF * right * right];
        Axis {
            base: [node.to_i32()],
            offset: [node - x],
            weight: [weight],
            slope: [[-left, -T::TWO * r, right]],
            spread: T::from_f64(0.25),
            skew: T::ZERO,
        }
    }
}

impl ShapeFunction<1, 4> for Cubic {
    const SHIFT: [f64; 1] = [0.0];
    const CELL: f64 = 0.0;
    const DIAGONAL: bool = true;

    fn tail(y: f64) -> f64 {
        if y <= -1.0 {
            (2.0 + y).max(0.0).powi(4) / 24.0
        } else {
            0.5 + (2.0 / 3.0) * y - y * y * y / 3.0 - y.powi(4) / 8.0
        }
    }

    #[inline(always)]
    fn axis<T: Real>(x: T) -> Axis<T, 1, 4> {
        let node = x.floor();
        let u = x - node;
        let r = T::ONE - u;
        let (sixth, half, c) = (T::from_f64(1.0 / 6.0), T::HALF, T::from_f64(1.5));
        let inner = |u: T| (half * u - T::ONE) * u * u + T::from_f64(2.0 / 3.0);
        Axis {
            base: [node.to_i32() - 1],
            offset: [-(u + T::ONE)],
            weight: [[sixth * r * r * r, inner(u), inner(r), sixth * u * u * u]],
            slope: [[-half * r * r, (c * u - T::TWO) * u, -(c * r - T::TWO) * r, half * u * u]],
            spread: T::from_f64(1.0 / 3.0),
            skew: T::ZERO,
        }
    }
}

#[cfg(test)]
mod tests;
