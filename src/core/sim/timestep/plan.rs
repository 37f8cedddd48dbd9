//! Plans of frames: equal steps within all bounds, from the current state of the particles.

use rayon::prelude::*;

use super::{Bound, SAFETY, body_bounds, demands_at_rest_1_s2};
use crate::material::Law;
use crate::maths::linalg;
use crate::sim::collider::Collider;
use crate::sim::moments::moment_matrix;
use crate::sim::particles::{IDENTITY, Particles};
use crate::sim::setup::{Body, Setup};

/// Share of the bounds at which an engine re-plans within a frame.
pub const REPLAN: f64 = 0.98;

/// A step that turned out too long is followed by one of at most this share of it, so that
/// re-planning always makes progress.
pub const SHRINK: f64 = 0.9;

/// Largest entry of dt ∇v in a step (Sun, Shinar & Schroeder 2020).
pub const MAX_GROWTH: f64 = 0.5;

/// The shortest implicit step (s). If anything moves further than cfl dx in such a step, the scene
/// is at fault.
pub const MIN_IMPLICIT_STEP_S: f64 = 1e-6;

/// Steps beyond which no frame ends.
const MAX_FRAME_STEPS: u64 = 1 << 40;

/// Growth of the demand within a frame beyond which its steps are too long.
pub const REPLAN_DEMAND: f64 = (REPLAN / SAFETY) * (REPLAN / SAFETY);

/// Extremes of the particles that limit the coming steps.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Extremes {
    /// Largest |v_p| (m/s).
    pub speed_m_s: f64,
    /// Largest ‖C_p‖ (Frobenius, 1/s).
    pub affine_rate_1_s: f64,
    /// Largest |v_p| + √d dx ‖C_p‖, which nodes around a particle do not exceed (m/s).
    pub node_speed_m_s: f64,
    /// Largest demand of the materials, 1/dt² at their present deformation, including the safety
    /// factor (1/s²).
    pub demand_1_s2: f64,
}

/// The steps of a frame: `steps` equal steps, because varying steps feed energy into isolated
/// particles (Bai & Schroeder §3.2).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepPlan {
    pub dt_s: f64,
    pub steps: u64,
    /// What kept the step from being longer.
    pub bound: Bound,
}

impl StepPlan {
    /// Why the frame will never end; `None` if it will.
    pub fn endless(&self) -> Option<String> {
        let sound = self.steps <= MAX_FRAME_STEPS && self.dt_s.is_normal();
        (!sound).then(|| format!("the frame would take {:.1e} steps", self.steps as f64))
    }

    /// The same time in steps of at most `dt_s`. Within a frame the step only shrinks.
    pub fn no_longer_than(self, dt_s: f64) -> Self {
        let total_s = self.dt_s * self.steps as f64;
        let steps = self.steps.max((total_s / dt_s * (1.0 - 1e-12)).ceil() as u64);
        Self { dt_s: total_s / steps as f64, steps, ..self }
    }
}

/// Plans `frame_s` seconds in equal steps.
///
/// Particles must not move more than `cfl` dx in a step: dt ≤ cfl dx / (|v| + √d dx ‖C‖) (Sun,
/// Shinar & Schroeder 2020). |v| includes what gravity adds within the frame, and the sum is at
/// least the speed of the fastest collider.
pub fn plan_frame(setup: &Setup, extremes: &Extremes, frame_s: f64) -> StepPlan {
    plan_steps(&limits(setup, extremes, frame_s), frame_s)
}

/// Divides `frame_s` into the fewest equal steps that all limits (s) allow. There must be at least
/// one limit.
pub fn plan_steps(limits: &[(f64, Bound)], frame_s: f64) -> StepPlan {
    let &(dt_max, bound) = limits.iter().min_by(|a, b| a.0.total_cmp(&b.0)).expect("there are limits");
    // A little slack, so that a frame of exactly n steps does not become n + 1.
    let steps = ((frame_s / dt_max) * (1.0 - 1e-12)).ceil().max(1.0) as u64;
    StepPlan { dt_s: frame_s / steps as f64, steps, bound }
}

/// All limits of the step (s) in a frame, with their rules.
pub fn limits(setup: &Setup, extremes: &Extremes, frame_s: f64) -> Vec<(f64, Bound)> {
    let falling = extremes.speed_m_s + norm(&setup.gravity) * frame_s;
    let affine = (setup.dimension as f64).sqrt() * setup.dx * extremes.affine_rate_1_s;
    let speed = (falling + affine).max(max_collider_speed_m_s(setup));
    let bodies = setup.bodies.iter().enumerate();
    let mut limits: Vec<_> = bodies.flat_map(|(index, body)| body_bounds(setup, index, body)).collect();
    let at_rest = limits.iter().map(|limit| limit.0).fold(f64::INFINITY, f64::min);
    let deformed = extremes.demand_1_s2.sqrt().recip();
    // Engines compute the demand in their own precision.
    if deformed < at_rest * (1.0 - 1e-5) {
        limits.push((deformed, Bound::Deformation));
    }
    limits.push((setup.cfl * setup.dx / speed, Bound::ParticleSpeed));
    limits.extend(setup.max_dt_s.map(|dt| (dt, Bound::MaxDt)));
    limits.push((frame_s, Bound::Frame));
    limits
}

/// The time (s) in which nothing crosses more than `cfl` dx: (v + g dt) dt = cfl dx. v is the speed
/// of the fastest particle, `speed_m_s`, or of the fastest collider; g dt is what gravity adds on
/// the way. Infinite at rest without gravity.
pub fn crossing_s(setup: &Setup, speed_m_s: f64) -> f64 {
    let speed = speed_m_s.max(max_collider_speed_m_s(setup));
    positive_root(norm(&setup.gravity), speed, setup.cfl * setup.dx)
}

/// The positive root t of a t² + b t = c, in the form without cancellation.
pub(super) fn positive_root(a: f64, b: f64, c: f64) -> f64 {
    2.0 * c / (b + (b * b + 4.0 * a * c).sqrt())
}

/// The extremes of the particles at time 0.
pub fn initial_extremes(setup: &Setup, particles: &Particles) -> Extremes {
    let (speed_m_s, affine_rate_1_s) = (initial_speed_m_s(setup, particles), initial_affine_rate_1_s(setup, particles));
    Extremes {
        speed_m_s,
        affine_rate_1_s,
        node_speed_m_s: speed_m_s + (setup.dimension as f64).sqrt() * setup.dx * affine_rate_1_s,
        demand_1_s2: initial_demand_1_s2(setup, particles),
    }
}

fn initial_demand_1_s2(setup: &Setup, p: &Particles) -> f64 {
    let laws: Vec<Law<f64>> = setup.materials.iter().map(Law::new).collect();
    let stiffening = |body: &Body, i: usize| {
        let law = &laws[body.material];
        if p.f[i] == IDENTITY {
            return 1.0;
        }
        let ratio = match setup.dimension {
            2 => law.kirchhoff(&linalg::from_row_major::<f64, 2>(&p.f[i]), p.plastic[i]).1,
            _ => law.kirchhoff(&linalg::from_row_major::<f64, 3>(&p.f[i]), p.plastic[i]).1,
        };
        ratio.max(1.0)
    };
    let of_body = |(body, at_rest): (&Body, f64)| {
        at_rest * body.particles.clone().into_par_iter().map(|i| stiffening(body, i)).reduce(|| 1.0, f64::max)
    };
    setup.bodies.iter().zip(demands_at_rest_1_s2(setup)).map(of_body).fold(0.0, f64::max)
}

/// Largest particle speed at time 0 (m/s).
fn initial_speed_m_s(setup: &Setup, particles: &Particles) -> f64 {
    let emitted = setup.sources.iter().map(|source| &source.velocity);
    particles.v.iter().chain(emitted).map(norm).fold(0.0, f64::max)
}

/// Largest ‖C‖ (Frobenius) at time 0 (1/s).
fn initial_affine_rate_1_s(setup: &Setup, particles: &Particles) -> f64 {
    let rate = |(x, b): (&[f64; 3], &[f64; 9])| {
        if *b == [0.0; 9] {
            return 0.0;
        }
        let x = std::array::from_fn(|a| (x[a] - setup.origin[a]) / setup.dx);
        let mut d = moment_matrix(setup.kernel, x, setup.dx, setup.dimension);
        if setup.dimension == 2 {
            d[8] = 1.0;
        }
        let [b, d] = [b, &d].map(linalg::from_row_major::<f64, 3>);
        // D is symmetric: its inverse is its cofactor matrix over its determinant.
        let inverse_times_det = linalg::mul(&b, &linalg::cofactor(&d));
        let det = linalg::det(&d);
        inverse_times_det.iter().flatten().map(|c| (c / det).powi(2)).sum::<f64>().sqrt()
    };
    particles.x.iter().zip(&particles.b).map(rate).filter(|rate| rate.is_finite()).fold(0.0, f64::max)
}

/// Upper bound on the speed (m/s) of any point of a collider inside the domain at any time of the
/// run.
pub fn max_collider_speed_m_s(setup: &Setup) -> f64 {
    let upper: [f64; 3] = std::array::from_fn(|a| setup.origin[a] + setup.cells[a] as f64 * setup.dx);
    let speed = |collider: &Collider| {
        let motion = &collider.motion;
        let [low, high] = collider.sdf.bounds();
        let reach: [f64; 3] = std::array::from_fn(|a| {
            if a >= setup.dimension {
                return 0.0;
            }
            // An unbounded solid matters only up to the walls.
            let low = if low[a].is_finite() { low[a] } else { setup.origin[a] };
            let high = if high[a].is_finite() { high[a] } else { upper[a] };
            (low - motion.center[a]).abs().max((high - motion.center[a]).abs())
        });
        // |ω × r| by components: the component along the axis does not count.
        let turning = |w: &[f64; 3]| {
            let w = w.map(f64::abs);
            let component = |a: usize, b: usize| w[a] * reach[b] + w[b] * reach[a];
            norm(&[component(1, 2), component(2, 0), component(0, 1)])
        };
        motion.velocities().map(|(v, w)| norm(&v) + turning(&w)).fold(0.0, f64::max)
    };
    setup.colliders.iter().map(speed).fold(0.0, f64::max)
}

fn norm(v: &[f64; 3]) -> f64 {
    (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt()
}
