//! Why a run may have diverged: what the state of the offending particle says, and what helps.

use super::particles::Particles;
use super::setup::{Material, Setup};
use crate::material::Law;
use crate::maths::linalg::{determinant, from_row_major};
use crate::maths::svd::svd;

/// J below which a material was too soft for its load.
const CRUSHED: f64 = 0.2;
/// Stretch above which a solid has in effect come apart.
const TORN: f64 = 5.0;

/// The offending particle in its last known state.
#[derive(Clone, Copy, Debug)]
pub struct Suspect {
    /// Index into the problem's bodies.
    pub body: usize,
    /// Deformation gradient, row-major.
    pub f: [f64; 9],
    /// m/s.
    pub speed_m_s: f64,
}

/// The particle that a failing run is blamed on: the first one whose velocity is not a number, or the
/// fastest. There must be particles.
pub fn worst(particles: &Particles) -> usize {
    let speed_squared = |i: usize| particles.v[i].iter().map(|c| c * c).sum::<f64>();
    let lost = (0..particles.len()).find(|&i| !speed_squared(i).is_finite());
    let fastest = || (0..particles.len()).max_by(|&a, &b| speed_squared(a).total_cmp(&speed_squared(b)));
    lost.or_else(fastest).expect("there are particles")
}

/// What `particle` of `particles` is called, how fast it is (m/s), and the likely cause of a failure
/// that it is blamed for.
pub fn describe(setup: &Setup, particles: &Particles, particle: usize) -> (String, f64, String) {
    let body = particles.body[particle] as usize;
    let speed_m_s = particles.v[particle].iter().map(|c| c * c).sum::<f64>().sqrt();
    let cause = likely_cause(setup, &Suspect { body, f: particles.f[particle], speed_m_s });
    (format!("particle {particle} (body \"{}\")", setup.bodies[body].name), speed_m_s, cause)
}

/// What to say of a frame that will never end for this reason.
pub fn endless(setup: &Setup, particles: &Particles, reason: &str) -> String {
    let (who, speed_m_s, cause) = describe(setup, particles, worst(particles));
    format!("{reason}: {who} moves at {speed_m_s:.3e} m/s; likely cause: {cause}")
}

/// The likely cause and its remedy, in a sentence.
pub fn likely_cause(setup: &Setup, suspect: &Suspect) -> String {
    let body = &setup.bodies[suspect.body];
    let material = &setup.materials[body.material];
    let j = determinant(&suspect.f);
    let wave_m_s = (Law::<f64>::new(material).stiffness_at_rest() * body.volume0 / body.mass).sqrt();
    let stretch = svd(&from_row_major::<f64, 3>(&suspect.f)).sigma[0];
    if !j.is_finite() {
        return "its deformation is no longer a number; lower solver.cfl or solver.max_dt".into();
    }
    if matches!(material, Material::NeoHookean(_)) && j <= 0.05 {
        return format!(
            "it was turned inside out (J = {j:.3}), where the neo-Hookean law has no stress; take fixed-corotated, \
             a higher youngs_modulus or a smaller dx"
        );
    }
    if suspect.speed_m_s > wave_m_s {
        return format!(
            "it moves faster than sound in its material ({:.3e} m/s against {wave_m_s:.3e} m/s), which makes a \
             shock; raise the modulus, lower the speed, or raise particles_per_cell",
            suspect.speed_m_s
        );
    }
    if j < CRUSHED {
        return format!(
            "it was crushed to J = {j:.3}; raise the modulus, or lower the load or the speed of what hits it"
        );
    }
    if !material.is_fluid() && stretch > TORN {
        return format!(
            "it was stretched {stretch:.1} times, further than a body's particles hold together; raise the modulus \
             or particles_per_cell, or take a law that yields"
        );
    }
    "no strain or speed stands out: a particle at the edge of a body or alone on its nodes; lower solver.cfl or \
     solver.max_dt, or raise particles_per_cell"
        .into()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sim::fixture;

    #[test]
    fn each_state_has_its_cause() {
        let blocks = [(0, [0.375; 3], [0.625; 3]), (1, [0.375, 0.375, 0.75], [0.625, 0.625, 0.875])];
        let setup = fixture::problem(3, 0.125, fixture::solid_and_fluid(), &blocks).setup;
        let stretched = |body, x: f64, speed_m_s| {
            let f = [x, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
            likely_cause(&setup, &Suspect { body, f, speed_m_s })
        };
        assert!(stretched(0, -0.5, 1.0).contains("inside out"));
        assert!(stretched(0, 1.0, 100.0).contains("faster than sound"));
        assert!(stretched(0, 0.1, 1.0).contains("crushed to J = 0.100"));
        assert!(stretched(0, 8.0, 1.0).contains("stretched 8.0 times"));
        assert!(stretched(1, 8.0, 1.0).contains("alone on its nodes"));
        assert!(stretched(0, f64::NAN, 1.0).contains("no longer a number"));
    }
}
