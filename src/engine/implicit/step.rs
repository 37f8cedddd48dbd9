//! How long an implicit step may be: the particles' CFL condition alone, because implicit Euler is stable (HOT §7.1).

use gridfall_core::maths::linalg::dot;
use gridfall_core::sim::particles::Particles;
use gridfall_core::sim::setup::Setup;
use gridfall_core::sim::timestep::max_collider_speed_m_s;

/// Shortest step (s).
pub const MIN_DT_S: f64 = 1e-6;

/// A step in which a particle goes farther (dx) is done again at half the length.
pub const FARTHEST_DX: f64 = 1.0;

/// Fastest particle (m/s).
pub fn max_speed_m_s(particles: &Particles) -> f64 {
    particles.v.iter().map(|v| dot(v, v)).fold(0.0, f64::max).sqrt()
}

/// The next step (s) of particles whose fastest moves at `speed_m_s`, with `remaining_s` left of the frame: nothing crosses more than `cfl` dx,
/// with what gravity adds in the step. What is left of a frame goes in one step, or in two equal ones.
pub fn next_dt_s(setup: &Setup, speed_m_s: f64, remaining_s: f64) -> f64 {
    let speed = speed_m_s.max(max_collider_speed_m_s(setup));
    let (way, gravity) = (setup.cfl * setup.dx, dot(&setup.gravity, &setup.gravity).sqrt());
    // The positive root of g dt² + v dt = way, without cancellation; infinite at rest without gravity.
    let dt = 2.0 * way / (speed + (speed * speed + 4.0 * gravity * way).sqrt());
    let dt = dt.min(setup.max_dt_s.unwrap_or(f64::INFINITY)).max(MIN_DT_S);
    if dt >= remaining_s {
        remaining_s
    } else if 2.0 * dt > remaining_s {
        0.5 * remaining_s
    } else {
        dt
    }
}
