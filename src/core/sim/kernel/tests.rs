//! Tests of the kernels against direct sums in f64.

use std::f64::consts::PI;

use rand::{Rng, SeedableRng, rngs::StdRng};

use super::*;
use crate::maths::linalg::{identity, mul};

/// The kernel as its paper writes it.
trait Textbook {
    fn value(r: f64) -> f64;
}
impl Textbook for Compact {
    fn value(r: f64) -> f64 {
        if r < 1.0 { 1.0 - r + (2.0 * PI * r).sin() / (2.0 * PI) } else { 0.0 }
    }
}
impl Textbook for Linear {
    fn value(r: f64) -> f64 {
        (1.0 - r).max(0.0)
    }
}
impl Textbook for Quadratic {
    fn value(r: f64) -> f64 {
        if r < 0.5 { 0.75 - r * r } else { 0.5 * (1.5 - r).max(0.0).powi(2) }
    }
}
impl Textbook for Cubic {
    fn value(r: f64) -> f64 {
        if r < 1.0 { 0.5 * r.powi(3) - r * r + 2.0 / 3.0 } else { (2.0 - r).max(0.0).powi(3) / 6.0 }
    }
}

/// Particles anywhere, on nodes, and very close to them.
fn positions() -> Vec<f64> {
    let mut rng = StdRng::seed_from_u64(3);
    let mut x: Vec<f64> = (0..2000).map(|_| rng.random_range(-1.0..5.0)).collect();
    for base in [0.0, 0.25, 0.5, 0.75, 1.0, 3.0] {
        for hair in [0.0, 1e-12, 1e-9, 1e-6, 1e-3] {
            x.extend([base + hair, base - hair]);
        }
    }
    x
}

fn check_axis<K: ShapeFunction<G, W> + Textbook, const G: usize, const W: usize>() {
    for x in positions() {
        let axis = K::axis(x);
        let single = K::axis(x as f32);
        let (mut first, mut slope_moment) = (0.0, 0.0);
        for g in 0..G {
            for k in 0..W {
                let node = (axis.base[g] + k as i32) as f64 + K::SHIFT[g];
                let (w, dw) = (axis.weight[g][k], axis.slope[g][k]);
                assert!((w - K::value((x - node).abs())).abs() < 4e-16 * 4.0, "weight {w} at {x}, node {node}");
                assert!(w >= 0.0 && single.weight[g][k] >= 0.0, "negative weight at {x}");
                assert!((axis.offset[g] + k as f64 - (node - x)).abs() < 1e-15);
                let h = 1e-5;
                let difference = (K::value((x + h - node).abs()) - K::value((x - h - node).abs())) / (2.0 * h);
                let kink = W == 2 && G == 1 && (x - node).abs().min((1.0 - (x - node).abs()).abs()) <= h;
                assert!(kink || (dw - difference).abs() < 2e-5, "slope {dw}, {difference} at {x}, node {node}");
                first += w * node / G as f64;
                slope_moment += dw * node / G as f64;
                assert!((single.weight[g].iter().sum::<f32>() - 1.0).abs() < 2e-7);
            }
            assert!((axis.weight[g].iter().sum::<f64>() - 1.0).abs() < 4e-16, "partition of unity at {x}");
            assert!(axis.slope[g].iter().sum::<f64>().abs() < 1e-15);
        }
        // A linear field is interpolated exactly, and so is its gradient. For the compact kernel
        // this holds for the mean over the grids.
        assert!((first - x).abs() < 2e-15, "½ Σ w x_i = {first} at {x}");
        assert!((slope_moment - 1.0).abs() < 4e-15, "½ Σ dw x_i = {slope_moment} at {x}");
    }
}

#[test]
fn weights_and_slopes_are_the_kernels() {
    check_axis::<Compact, 2, 2>();
    check_axis::<Linear, 1, 2>();
    check_axis::<Quadratic, 1, 3>();
    check_axis::<Cubic, 1, 4>();
}

fn check_moment<K: ShapeFunction<G, W>, const G: usize, const W: usize, const D: usize>(rng: &mut StdRng) {
    for _ in 0..500 {
        let x = [(); D].map(|()| rng.random_range(0.0..4.0));
        let axes = x.map(|x| K::axis(x));
        // D = 1/G Σ_g Σ_i w (x_i − x)(x_i − x)ᵀ, node by node.
        let mut d = [[0.0; D]; D];
        for g in 0..G {
            for node in 0..W.pow(D as u32) {
                let index = |a: usize| node / W.pow(a as u32) % W;
                let w: f64 = (0..D).map(|a| axes[a].weight[g][index(a)]).product();
                for i in 0..D {
                    for k in 0..D {
                        let offset = |a: usize| axes[a].offset[g] + index(a) as f64;
                        d[i][k] += w * offset(i) * offset(k) / G as f64;
                    }
                }
            }
        }
        for i in 0..D {
            for k in 0..D {
                let closed = axes[i].skew * axes[k].skew + if i == k { axes[i].spread } else { 0.0 };
                assert!(
                    (d[i][k] - closed).abs() < 1e-15,
                    "D[{i}][{k}]: sum {}, closed form {closed} at {x:?}",
                    d[i][k]
                );
            }
        }
        let inverse = K::times_inverse_moment(&identity(), &axes.map(|a| a.spread), &axes.map(|a| a.skew));
        let unit = mul(&d, &inverse);
        for i in 0..D {
            for k in 0..D {
                let expected = if i == k { 1.0 } else { 0.0 };
                assert!((unit[i][k] - expected).abs() < 2e-14, "D D⁻¹ = {unit:?} at {x:?}");
            }
        }
    }
}

#[test]
fn the_closed_form_of_the_moment_matrix_is_the_sum_over_nodes() {
    let rng = &mut StdRng::seed_from_u64(4);
    check_moment::<Compact, 2, 2, 3>(rng);
    check_moment::<Compact, 2, 2, 2>(rng);
    check_moment::<Quadratic, 1, 3, 3>(rng);
    check_moment::<Cubic, 1, 4, 3>(rng);
    check_moment::<Linear, 1, 2, 2>(rng);
}

#[test]
fn light_nodes_keep_full_relative_precision() {
    for v in [1e-12, 1e-9, 1e-6, 1e-3, 0.01, 0.1, 0.2, 0.25] {
        // Exact to rounding: the same series in f64, with far more terms.
        let t = (2.0 * PI * v).powi(2);
        let (mut term, mut exact) = (v * t / 6.0, 0.0);
        for k in 0..20 {
            exact += term;
            term *= -t / ((2 * k + 4) * (2 * k + 5)) as f64;
        }
        // The particle lies at v above node 0 of grid +; the far node is 1. Shifted by whole
        // numbers, v would be rounded.
        let axis = Compact::axis::<f64>(0.25 + v);
        let v_rounded = (0.25 + v) - 0.25;
        let scale = (v_rounded / v).powi(3);
        assert!((axis.weight[0][1] / (exact * scale) - 1.0).abs() < 1e-11, "{v}: {} {exact}", axis.weight[0][1]);
    }
}
