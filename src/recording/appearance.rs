//! The colour scale and the camera focus of a run, fixed at its start so that colours do not
//! flicker and the camera does not move. They are derived from the particles at time 0, which need
//! not be kept afterwards.

use gridfall_core::sim::particles::Particles;
use gridfall_core::sim::setup::Setup;

use crate::picture::{Bounds, focus};

/// The fixed colour scale and camera focus of a run.
#[derive(Clone, Debug)]
pub struct Appearance {
    /// Speed at which a particle has its body's bright colour (m/s).
    pub(crate) full_speed_m_s: f64,
    /// The box that the camera shows.
    pub(crate) focus: Bounds,
}

impl Appearance {
    /// The appearance of a run that starts with these particles.
    pub fn new(setup: &Setup, particles: &Particles) -> Self {
        Self { full_speed_m_s: characteristic_speed_m_s(setup, particles), focus: focus(setup, particles) }
    }
}

/// The larger of twice the initial top speed and the speed of a fall through the domain; 1 m/s if
/// nothing moves.
fn characteristic_speed_m_s(setup: &Setup, particles: &Particles) -> f64 {
    let sources = setup.sources.iter().map(|source| &source.velocity);
    let fastest = particles.v.iter().chain(sources).map(|v| v.iter().map(|c| c * c).sum()).fold(0.0, f64::max);
    let fall: f64 = (0..3).map(|a| 2.0 * setup.gravity[a].abs() * setup.cells[a] as f64 * setup.dx).sum();
    let speed = (4.0 * fastest).max(fall).sqrt();
    if speed > 0.0 { speed } else { 1.0 }
}
