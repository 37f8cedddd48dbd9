//! The affine moment matrix D = ½ Σ_s Σ_i w (x_i - x_p)(x_i - x_p)ᵀ of each kernel, in closed form.

use std::f64::consts::PI;

use super::setup::Kernel;

/// D at a particle (m², row-major; the third row and column are zero in 2D).
///
/// `x` is in units of dx from the grid's origin. Quadratic and cubic: ¼ and ⅓ dx² I (Jiang et al.,
/// "The affine particle-in-cell method"). Linear: diag(u (1 - u)) dx², u the offset in the cell.
/// Compact: D / dx² = diag(p) + s sᵀ with p_a = ½ (w0⁺w1⁺ + w0⁻w1⁻) and s_a = cos(2πx_a) / 2π.
/// CK-MPM inverts a matrix per particle instead; this form is derived from the kernel and tested
/// against the sum.
pub fn moment_matrix(kernel: Kernel, x: [f64; 3], dx: f64, dimension: usize) -> [f64; 9] {
    let mut d = [0.0; 9];
    for a in 0..dimension {
        d[4 * a] = dx
            * dx
            * match kernel {
                Kernel::Quadratic => 0.25,
                Kernel::Cubic => 1.0 / 3.0,
                Kernel::Linear => {
                    let u = x[a] - x[a].floor();
                    u * (1.0 - u)
                }
                Kernel::Compact => {
                    let product = |s: f64| {
                        let u = x[a] - s - (x[a] - s).floor();
                        let w1 = u - (2.0 * PI * u).sin() / (2.0 * PI);
                        w1 * (1.0 - w1)
                    };
                    0.5 * (product(0.25) + product(-0.25))
                }
            };
    }
    if kernel == Kernel::Compact {
        let s = x.map(|x| (2.0 * PI * x).cos() / (2.0 * PI));
        for a in 0..dimension {
            for b in 0..dimension {
                d[3 * a + b] += dx * dx * s[a] * s[b];
            }
        }
    }
    d
}

#[cfg(test)]
mod tests {
    use super::*;

    fn weight(kernel: Kernel, x: f64) -> f64 {
        let r = x.abs();
        match kernel {
            Kernel::Linear => (1.0 - r).max(0.0),
            Kernel::Quadratic if r < 0.5 => 0.75 - r * r,
            Kernel::Quadratic => 0.5 * (1.5 - r).max(0.0).powi(2),
            Kernel::Cubic if r < 1.0 => 0.5 * r.powi(3) - r * r + 2.0 / 3.0,
            Kernel::Cubic => (2.0 - r).max(0.0).powi(3) / 6.0,
            Kernel::Compact if r < 1.0 => 1.0 - r + (2.0 * PI * r).sin() / (2.0 * PI),
            Kernel::Compact => 0.0,
        }
    }

    #[test]
    fn equals_the_sum_over_nodes() {
        let dx = 0.3;
        for kernel in [Kernel::Linear, Kernel::Quadratic, Kernel::Cubic, Kernel::Compact] {
            let offsets: &[f64] = if kernel == Kernel::Compact { &[0.25, -0.25] } else { &[0.0] };
            for x in [[3.1, 4.63, 5.97], [3.5, 4.0, 5.2501], [3.999, 4.25, 5.75]] {
                let mut sum = [0.0; 9];
                for &s in offsets {
                    for node in 0..1000 {
                        let i = [node / 100, node / 10 % 10, node % 10].map(|i| i as f64 + s);
                        let w: f64 = (0..3).map(|a| weight(kernel, x[a] - i[a])).product();
                        for (k, sum) in sum.iter_mut().enumerate() {
                            *sum += w * dx * dx * (i[k / 3] - x[k / 3]) * (i[k % 3] - x[k % 3]) / offsets.len() as f64;
                        }
                    }
                }
                let d = moment_matrix(kernel, x, dx, 3);
                for k in 0..9 {
                    assert!((d[k] - sum[k]).abs() < 1e-15, "{kernel:?} at {x:?}: {d:?} against {sum:?}");
                }
            }
        }
    }
}
