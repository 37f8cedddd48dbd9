//! Element tests: one homogeneous element in the tests of a laboratory, by the laws that the engines
//! run, with their return maps and plastic states, in f64.
//!
//! In each step the deformation changes by ΔF, the elastic F becomes ΔF F and returns to the yield
//! surface, and σ = τ/J with the J of the whole deformation. Where a test holds a stress, the stretch
//! that gives it is solved for (`solve`). The axis is y.
//!
//! * **Uniaxial**: F = diag(b, a, b), b such that σ_xx = 0.
//! * **Triaxial**: first F = s I, until the pressure is the confining pressure. Then F = diag(b, s a,
//!   b), b such that σ_xx stays.
//! * **Oedometer**: F = diag(1, a, 1).
//! * **Shear**: F_xy = γ. Under a confining pressure first s I as above, then the height is such that
//!   σ_yy stays and the sides are fixed, as in a direct simple shear apparatus. Without, at constant
//!   volume.
//!
//! Signs are those of the laboratories: uniaxial and shear tests count tension and growth as
//! positive, triaxial and oedometer tests compression. p is a pressure and q = √(3/2) ‖dev σ‖ in all.

mod point;
mod programme;
mod solve;

use super::damping::Damping;
use super::parameters::Material;
use super::principal::{MAX_STRETCH, MIN_STRETCH};
use super::{Law, initial_plastic_state};
use crate::maths::linalg::{Matrix, det, double_dot, identity, mul, mul_transpose, trace};
use crate::maths::svd::svd;
pub use point::Point;
pub use programme::{Programme, Refused, Test, Wishes};
use solve::root;

/// Why a test could not be driven to its end.
#[derive(Clone, Debug, PartialEq)]
pub struct Stuck {
    /// The strain at which it ended.
    pub strain: f64,
    pub reason: &'static str,
}

/// Steps in which the confining pressure comes.
const CONSOLIDATION: usize = 40;

/// Runs a test. The first point is the state before it; there are `steps` more.
pub fn run(material: &Material, programme: &Programme) -> Result<Vec<Point>, Stuck> {
    let mut element = Element::new(material, programme);
    let confined = programme.confining_pressure;
    if confined > 0.0 {
        element.consolidate(confined).ok_or(Stuck { strain: 0.0, reason: "the confining pressure is not reached" })?;
    }
    let start = element.whole;
    let mut points = vec![element.point(programme.test, 0.0, &start)];
    for n in 1..=programme.steps {
        let strain = programme.strain * n as f64 / programme.steps as f64;
        let stuck = || Stuck { strain, reason: "no stretch gives the stress that the test holds" };
        element.advance(programme, &start, strain).ok_or_else(stuck)?;
        let point = element.point(programme.test, strain, &start);
        if !point.values().iter().all(|value| value.is_finite()) {
            return Err(Stuck { strain, reason: "the stress is not finite there" });
        }
        points.push(point);
    }
    Ok(points)
}

/// A homogeneous element and its history.
#[derive(Clone)]
struct Element {
    law: Law<f64>,
    damping: Option<Damping<f64>>,
    /// Time that a step takes (s); 0 where it is slow enough for viscosity not to count.
    dt_s: f64,
    /// The whole deformation, and its elastic part.
    whole: Matrix<f64, 3>,
    elastic: Matrix<f64, 3>,
    plastic: f64,
    /// Σ √(2/3) ‖dev Δε_p‖ and Σ tr Δε_p.
    flown: [f64; 2],
    /// σ (Pa).
    stress: Matrix<f64, 3>,
}

impl Element {
    fn new(material: &Material, programme: &Programme) -> Self {
        let law = Law::new(material);
        let whole = identity();
        let per_step = programme.strain.abs() / programme.steps as f64;
        let dt_s = if programme.rate > 0.0 { per_step / programme.rate } else { 0.0 };
        let plastic = initial_plastic_state(material);
        let stress = law.kirchhoff(&whole, plastic).0;
        Self { law, damping: Damping::of(material), dt_s, whole, elastic: whole, plastic, flown: [0.0; 2], stress }
    }

    /// The element after its deformation has become `to`.
    fn after(&self, to: &Matrix<f64, 3>) -> Self {
        let mut next = self.clone();
        let step = mul(to, &inverse(&self.whole));
        next.whole = *to;
        next.elastic = mul(&step, &self.elastic);
        if self.law.is_plastic() {
            let trial = logarithms(&next.elastic);
            self.law.return_map(&mut next.elastic, &mut next.plastic);
            let after = logarithms(&next.elastic);
            let flow: [f64; 3] = std::array::from_fn(|i| trial[i] - after[i]);
            let volume = flow.iter().sum::<f64>();
            let deviator = flow.map(|e| e - volume / 3.0);
            next.flown[0] += (deviator.iter().map(|e| e * e).sum::<f64>() * 2.0 / 3.0).sqrt();
            next.flown[1] += volume;
        }
        let mut tau = self.law.kirchhoff(&next.elastic, next.plastic).0;
        if self.dt_s > 0.0 {
            let mut grad_v = step.map(|row| row.map(|x| x / self.dt_s));
            (0..3).for_each(|i| grad_v[i][i] -= 1.0 / self.dt_s);
            let viscous = match (&self.law, &self.damping) {
                (Law::WeaklyCompressibleFluid(fluid), _) => fluid.kirchhoff(det(to), 0.0, &grad_v),
                (_, Some(damping)) => damping.kirchhoff(&grad_v),
                _ => [[0.0; 3]; 3],
            };
            (0..3).for_each(|i| (0..3).for_each(|k| tau[i][k] += viscous[i][k]));
        }
        let j = det(to);
        next.stress = tau.map(|row| row.map(|x| x / j));
        next
    }

    /// Presses it from all sides.
    fn consolidate(&mut self, pressure: f64) -> Option<()> {
        // Slowly: what it takes is not of the test.
        let dt_s = std::mem::take(&mut self.dt_s);
        for n in 1..=CONSOLIDATION {
            let wanted = pressure * n as f64 / CONSOLIDATION as f64;
            let at = |s: f64| self.after(&diagonal([s; 3]));
            let tolerance = self.tolerance(pressure);
            let s = root(self.whole[0][0], tolerance, |s| trace(&at(s).stress) / 3.0 + wanted)?;
            *self = at(s);
        }
        self.dt_s = dt_s;
        Some(())
    }

    /// Takes the step to a strain, from `start` where the test began.
    fn advance(&mut self, programme: &Programme, start: &Matrix<f64, 3>, strain: f64) -> Option<()> {
        let held = programme.confining_pressure;
        let tolerance = self.tolerance(held);
        let axial = programme.test.stretch(strain) * start[1][1];
        match programme.test {
            Test::Oedometer => *self = self.after(&diagonal([start[0][0], axial, start[2][2]])),
            Test::Uniaxial | Test::Triaxial => {
                let at = |b: f64| self.after(&diagonal([b, axial, b]));
                // At constant volume to begin with, which is where bodies that flow are.
                let guess = self.whole[0][0] * (self.whole[1][1] / axial).sqrt();
                let b = root(guess, tolerance, |b| at(b).stress[0][0] + held)?;
                *self = at(b);
            }
            Test::Shear => {
                let sheared = |height: f64| {
                    let mut f = diagonal([start[0][0], height, start[2][2]]);
                    f[0][1] = strain * start[1][1];
                    f
                };
                if held > 0.0 {
                    let at = |height: f64| self.after(&sheared(height));
                    let height = root(self.whole[1][1], tolerance, |height| at(height).stress[1][1] + held)?;
                    *self = at(height);
                } else {
                    *self = self.after(&sheared(start[1][1]));
                }
            }
        }
        Some(())
    }

    /// How exactly stresses are held (Pa).
    fn tolerance(&self, held: f64) -> f64 {
        1e-10 * self.law.stiffness_at_rest() + 1e-9 * held
    }
}

fn diagonal(stretches: [f64; 3]) -> Matrix<f64, 3> {
    std::array::from_fn(|i| std::array::from_fn(|k| if i == k { stretches[i] } else { 0.0 }))
}

/// Of a matrix that is diagonal but for row 0, column 1.
fn inverse(f: &Matrix<f64, 3>) -> Matrix<f64, 3> {
    let mut inverse = diagonal([1.0 / f[0][0], 1.0 / f[1][1], 1.0 / f[2][2]]);
    inverse[0][1] = -f[0][1] / (f[0][0] * f[1][1]);
    inverse
}

/// ln σ_i, clamped as laws do.
fn logarithms(f: &Matrix<f64, 3>) -> [f64; 3] {
    svd(f).sigma.map(|s| s.clamp(MIN_STRETCH, MAX_STRETCH).ln())
}

#[cfg(test)]
mod tests;
