//! How long an implicit step may be: the particles' CFL condition alone, because implicit Euler is
//! stable (HOT §7.1).

use gridfall_core::maths::linalg::dot;
use gridfall_core::sim::particles::Particles;
use gridfall_core::sim::setup::Setup;
use gridfall_core::sim::timestep::{MIN_IMPLICIT_STEP_S, crossing_s};

/// A step in which a particle goes farther (dx) is repeated with half its length.
pub const FARTHEST_DX: f64 = 1.0;

/// Fastest particle (m/s).
pub fn max_speed_m_s(particles: &Particles) -> f64 {
    particles.v.iter().map(|v| dot(v, v)).fold(0.0, f64::max).sqrt()
}

/// The next step (s) of particles whose fastest moves at `speed_m_s`, with `remaining_s` left of
/// the frame: what [`crossing_s`], `max_dt` and the device (`longest_s`) allow. What is left of a
/// frame goes in one step, or in two equal ones.
pub fn next_dt_s(setup: &Setup, speed_m_s: f64, remaining_s: f64, longest_s: f64) -> f64 {
    let longest = setup.max_dt_s.unwrap_or(f64::INFINITY).min(longest_s);
    let dt = crossing_s(setup, speed_m_s).min(longest).max(MIN_IMPLICIT_STEP_S);
    if dt >= remaining_s {
        remaining_s
    } else if 2.0 * dt > remaining_s {
        0.5 * remaining_s
    } else {
        dt
    }
}
