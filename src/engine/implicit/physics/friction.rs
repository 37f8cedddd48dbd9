//! Coulomb friction as a dissipative part of the potential, with the normal impulses of a solve
//! without it (lagged, as in Li et al. 2020, "Incremental potential contact", §5).
//!
//! A node pressed with the impulse J on a surface dissipates µ J |u| when it slides at u, smoothed
//! below the speed ε: f(y) = y for y ≥ ε, else −y³/3ε² + y²/ε + ε/3. Applied after the solve
//! instead, as in an explicit step, friction would stop nodes that elasticity has just moved, and
//! strain would grow step by step.

use gridfall_core::maths::linalg::{Matrix, Vector, dot};

/// Sliding by less than this per step (dx) counts as sticking.
pub const STICKING_DX: f64 = 1e-4;

/// Friction of a node.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Drag<const D: usize> {
    /// Index among the nodes of the system.
    pub node: usize,
    /// µ J (N s).
    pub strength: f64,
    /// Of the surface.
    pub normal: Vector<f64, D>,
    /// Of the surface (m/s).
    pub velocity: Vector<f64, D>,
}

impl<const D: usize> Drag<D> {
    /// u (m/s), the sliding of a node that moves at `v`.
    fn sliding(&self, v: &Vector<f64, D>) -> Vector<f64, D> {
        let mut u: Vector<f64, D> = std::array::from_fn(|a| v[a] - self.velocity[a]);
        let across = dot(&u, &self.normal);
        (0..D).for_each(|a| u[a] -= across * self.normal[a]);
        u
    }

    /// µ J f(|u|) (J) of a node at `v` (m/s), for ε = `slow` (m/s).
    pub fn energy(&self, v: &Vector<f64, D>, slow: f64) -> f64 {
        let u = self.sliding(v);
        let y = dot(&u, &u).sqrt();
        self.strength * if y >= slow { y } else { y * y / slow - y * y * y / (3.0 * slow * slow) + slow / 3.0 }
    }

    /// Its derivative (N s).
    pub fn gradient(&self, v: &Vector<f64, D>, slow: f64) -> Vector<f64, D> {
        let u = self.sliding(v);
        let (rate, _) = rates(dot(&u, &u).sqrt(), slow);
        u.map(|u| self.strength * rate * u)
    }

    /// Its second derivative (kg), positive semidefinite.
    pub fn hessian(&self, v: &Vector<f64, D>, slow: f64) -> Matrix<f64, D> {
        let u = self.sliding(v);
        let y = dot(&u, &u).sqrt();
        let (rate, along) = rates(y, slow);
        let mut h = [[0.0; D]; D];
        for a in 0..D {
            for b in 0..D {
                let across = if a == b { 1.0 } else { 0.0 } - self.normal[a] * self.normal[b];
                let forward = if y > 0.0 { u[a] * u[b] / (y * y) } else { 0.0 };
                h[a][b] = self.strength * (rate * across + (along - rate) * forward);
            }
        }
        h
    }
}

/// f′/y and f″.
fn rates(y: f64, slow: f64) -> (f64, f64) {
    if y >= slow { (1.0 / y, 0.0) } else { (2.0 / slow - y / (slow * slow), 2.0 / slow - 2.0 * y / (slow * slow)) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn derivatives_belong_to_the_energy() {
        let drag = Drag { node: 0, strength: 3.0, normal: [0.0, 0.6, 0.8], velocity: [0.1, 0.2, 0.3] };
        for v in [[0.3, -0.4, 0.9], [0.1003, 0.2008, 0.2994], [0.1, 0.2, 0.3]] {
            let (slow, h) = (0.01, 1e-7);
            let (gradient, hessian) = (drag.gradient(&v, slow), drag.hessian(&v, slow));
            for a in 0..3 {
                let (mut ahead, mut behind) = (v, v);
                (ahead[a], behind[a]) = (v[a] + h, v[a] - h);
                let slope = (drag.energy(&ahead, slow) - drag.energy(&behind, slow)) / (2.0 * h);
                assert!((slope - gradient[a]).abs() < 1e-7, "{slope} against {gradient:?}");
                let (ahead, behind) = (drag.gradient(&ahead, slow), drag.gradient(&behind, slow));
                for b in 0..3 {
                    let curvature = (ahead[b] - behind[b]) / (2.0 * h);
                    assert!((curvature - hessian[a][b]).abs() < 1e-2, "{curvature} against {hessian:?}");
                }
            }
            assert!(dot(&gradient, &drag.normal).abs() < 1e-14);
        }
    }
}
