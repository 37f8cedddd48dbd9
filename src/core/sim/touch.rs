//! Contact at the particles: springs between particles and the faces of colliders, of the
//! material's own stiffness (docs/NUMERICS.md, "Contact at the particles").
//!
//! A particle of spacing h is pressed where it is nearer than its radius, half of h, to a face:
//! K gap along the normal, K = E/dx h^(d−1). Friction and sticking are springs of the same K that
//! the particle holds on to and carries along. They know where the face is, whatever the cells.

use super::collider::Collider;
use super::contact::{Contact, ContactKind};
use super::particles::Particles;
use super::setup::{Body, ContactAt, Setup};
use super::timestep::moduli;

/// Damping of a particle's spring, as a share of the critical.
pub const DAMPING_RATIO: f64 = 0.1;

/// Share of a particle's spacing at which it stands from a face that it would have gone through.
pub const STANDOFF: f64 = 0.01;

/// Depth, as a share of a particle's spacing, at which a face that only pushes damps in full.
pub const SOFT: f64 = 0.01;

/// Share of its spacing up to which a particle that finds a face there is bonded to it.
pub const BONDED: f64 = 1.01;

/// Least half step of the differences that give a face's normal, in dx: below it they are noise in f32.
pub const LEAST_STEP_DX: f64 = 1.0 / 256.0;

/// The springs of a body's particles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Springs {
    /// N/m; 2D: N/m per metre.
    pub stiffness: f64,
    /// N s/m; 2D: per metre.
    pub damping: f64,
    /// Distance between particles at rest (m).
    pub spacing: f64,
}

impl Springs {
    pub fn of(setup: &Setup, body: &Body) -> Self {
        let material = &setup.materials[body.material];
        let modulus = material.elastic().map_or_else(|| moduli(material).0, |elastic| elastic.youngs_modulus);
        let spacing = body.volume0.powf(1.0 / setup.dimension as f64);
        let stiffness = modulus / setup.dx * spacing.powi(setup.dimension as i32 - 1);
        Self { stiffness, damping: 2.0 * DAMPING_RATIO * (stiffness * body.mass).sqrt(), spacing }
    }

    /// The two terms of the stable step: 1 ≥ a dt² + b dt, for the particle's own mass (1/s², 1/s).
    pub fn bound(&self, mass: f64) -> [f64; 2] {
        let rate = (self.stiffness / mass).sqrt();
        [0.25 * rate * rate, DAMPING_RATIO * rate]
    }
}

/// Whether some collider acts on particles.
pub fn acts(setup: &Setup) -> bool {
    setup.contact_at == ContactAt::Particles && setup.colliders.iter().any(|collider| !collider.grip)
}

/// The springs of each body's particles.
pub fn of_bodies(setup: &Setup) -> Vec<Springs> {
    setup.bodies.iter().map(|body| Springs::of(setup, body)).collect()
}

/// Lets particles that have met no faces yet meet those that are there at `time` (s).
pub fn begin(setup: &Setup, particles: &mut Particles, time: f64) {
    if !acts(setup) {
        particles.touch.clear();
        return;
    }
    let (springs, known) = (of_bodies(setup), particles.touch.len());
    particles.touch.extend(particles.body[known..].iter().map(|body| Touch::new(&springs[*body as usize])));
    meet(setup, particles, known, &springs, time, |_| true);
}

/// Lets all particles meet the faces that are there at `time` (s) and were not `before` (s).
pub fn appear(setup: &Setup, particles: &mut Particles, before: f64, time: f64) {
    if acts(setup) {
        meet(setup, particles, 0, &of_bodies(setup), time, |collider| !collider.is_present(before));
    }
}

/// Lets the particles from the `first` on meet the faces of `some` of the colliders that are there at `time` (s).
fn meet(
    setup: &Setup,
    particles: &mut Particles,
    first: usize,
    springs: &[Springs],
    time: f64,
    some: impl Fn(&Collider) -> bool,
) {
    let there = |collider: &Collider| !collider.grip && collider.is_present(time) && some(collider);
    let colliders: Vec<_> = (1..)
        .zip(&setup.colliders)
        .filter(|(_, collider)| there(collider))
        .map(|(number, collider)| (number, collider.contact, collider.at(time)))
        .collect();
    for (number, contact, placed) in &colliders {
        for id in first..particles.touch.len() {
            let springs = &springs[particles.body[id] as usize];
            let distance = placed.distance(particles.x[id]);
            if distance <= BONDED * springs.spacing {
                particles.touch[id].meet(springs, *number, *contact, distance);
            }
        }
    }
}

/// A face at a particle.
#[derive(Clone, Copy, Debug)]
pub struct Face {
    /// Its collider, counted from 1.
    pub collider: u32,
    pub contact: Contact,
    /// Of the particle (m).
    pub distance: f64,
    /// Unit normal towards the particle.
    pub normal: [f64; 3],
    /// m/s.
    pub velocity: [f64; 3],
}

/// What a particle remembers of contact.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Touch {
    /// Distance from a face below which the particle is pressed (m): half of its spacing, less if it
    /// began nearer, so that bodies that begin in contact begin without force.
    pub radius: f64,
    /// How far the particle has been carried along the surface that it holds on to since its spring
    /// was at rest (m); a sticky surface's spring has all directions.
    pub stretch: [f64; 3],
    /// The collider that it holds on to, counted from 1; 0 for none.
    pub with: u32,
}

impl Touch {
    /// Of a particle far from all faces.
    pub fn new(springs: &Springs) -> Self {
        Self { radius: 0.5 * springs.spacing, stretch: [0.0; 3], with: 0 }
    }

    /// Meets a face that is there without having come: at the start, or when its collider appears.
    /// `collider`: counted from 1; `distance` (m): of the particle.
    pub fn meet(&mut self, springs: &Springs, collider: u32, contact: Contact, distance: f64) {
        if contact.kind != ContactKind::Separate && distance <= BONDED * springs.spacing && self.with == 0 {
            (self.with, self.stretch, self.radius) = (collider, [0.0; 3], distance);
        } else {
            self.radius = self.radius.min(distance);
        }
    }

    /// The force (N; 2D: N/m) of a face on the particle, whose velocity is `v` (m/s).
    pub fn press(&mut self, springs: &Springs, face: &Face, v: &[f64; 3]) -> [f64; 3] {
        let &Springs { stiffness, damping, spacing } = springs;
        let n = &face.normal;
        let relative = minus(v, &face.velocity);
        let (gap, away) = (face.distance - self.radius, dot(&relative, n));
        let held = self.with == face.collider;
        if !held && gap >= 0.0 {
            return [0.0; 3];
        }
        match face.contact.kind {
            ContactKind::Sticky if held || self.with == 0 => {
                if !held {
                    (self.with, self.stretch) = (face.collider, n.map(|n| gap * n));
                }
                std::array::from_fn(|a| -stiffness * self.stretch[a] - damping * relative[a])
            }
            ContactKind::Slip if held && gap > 2.0 * spacing => {
                *self = Self::new(springs);
                [0.0; 3]
            }
            ContactKind::Slip if held || self.with == 0 => {
                self.with = face.collider;
                n.map(|n| (-stiffness * gap - damping * away) * n)
            }
            _ if gap >= 0.0 => {
                (self.with, self.stretch) = (0, [0.0; 3]);
                [0.0; 3]
            }
            _ => {
                // What only just touches is not braked at once: the force has no jump.
                let share = (-gap / (SOFT * spacing)).min(1.0);
                let push = (-stiffness * gap - share * damping * away).max(0.0);
                let rub = self.rub(springs, face, &relative, face.contact.friction * push);
                std::array::from_fn(|a| push * n[a] + rub[a])
            }
        }
    }

    /// Friction of at most `most`: a spring where the particle holds on, elsewhere what slows it.
    fn rub(&mut self, springs: &Springs, face: &Face, relative: &[f64; 3], most: f64) -> [f64; 3] {
        if self.with == 0 {
            (self.with, self.stretch) = (face.collider, [0.0; 3]);
        }
        let held = self.with == face.collider;
        let along = |u: &[f64; 3]| {
            let away = dot(u, &face.normal);
            std::array::from_fn(|a| u[a] - away * face.normal[a])
        };
        let stretch: [f64; 3] = if held { along(&self.stretch) } else { [0.0; 3] };
        let slip: [f64; 3] = along(relative);
        let mut force: [f64; 3] = std::array::from_fn(|a| -springs.stiffness * stretch[a] - springs.damping * slip[a]);
        let size = dot(&force, &force).sqrt();
        if size > most {
            force = force.map(|f| f * most / size);
        }
        if held {
            // Where it slides, the spring is as long as friction stretches it.
            self.stretch = if size > most { force.map(|f| -f / springs.stiffness) } else { stretch };
        }
        force
    }

    /// The particle has left all faces behind by `nearest` (m): what was cut off of its radius grows again.
    pub fn recover(&mut self, springs: &Springs, nearest: f64) {
        if self.with == 0 {
            self.radius = self.radius.max(nearest.min(0.5 * springs.spacing));
        }
    }
}

pub(crate) fn dot(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn minus(a: &[f64; 3], b: &[f64; 3]) -> [f64; 3] {
    std::array::from_fn(|k| a[k] - b[k])
}

#[cfg(test)]
mod tests {
    use super::*;

    const SPRINGS: Springs = Springs { stiffness: 1000.0, damping: 2.0, spacing: 0.1 };

    fn face(kind: ContactKind, friction: f64, distance: f64) -> Face {
        let contact = Contact { kind, friction };
        Face { collider: 1, contact, distance, normal: [0.0, 1.0, 0.0], velocity: [0.0; 3] }
    }

    fn carried(mut touch: Touch, by: [f64; 3]) -> Touch {
        touch.stretch = std::array::from_fn(|a| touch.stretch[a] + by[a]);
        touch
    }

    #[test]
    fn a_face_pushes_and_never_pulls() {
        for away in [-3.0, 0.0, 3.0] {
            let mut touch = Touch::new(&SPRINGS);
            let pressed = touch.press(&SPRINGS, &face(ContactKind::Separate, 0.0, 0.04), &[0.0, away, 0.0]);
            let right = (1000.0 * 0.01 - 2.0 * away).max(0.0);
            assert!(pressed[0] == 0.0 && (pressed[1] - right).abs() < 1e-9 && pressed[1] >= 0.0, "{pressed:?}");
            let apart = touch.press(&SPRINGS, &face(ContactKind::Separate, 0.0, 0.051), &[0.0, away, 0.0]);
            assert_eq!((apart, touch.with), ([0.0; 3], 0));
        }
    }

    #[test]
    fn friction_holds_up_to_its_limit() {
        let (face, rest) = (face(ContactKind::Separate, 0.5, 0.04), [0.0; 3]);
        let mut touch = Touch::new(&SPRINGS);
        touch.press(&SPRINGS, &face, &rest);
        // 10 N press: 5 N of friction are 5 mm of the spring.
        for (by, right) in [(0.003, -3.0), (0.004, -5.0), (-0.001, -4.0), (-0.02, 5.0)] {
            touch = carried(touch, [by, 0.0, 0.0]);
            let force = touch.press(&SPRINGS, &face, &rest);
            assert!((force[0] - right).abs() < 1e-9 && (force[1] - 10.0).abs() < 1e-9, "{by}: {force:?}");
        }
    }

    #[test]
    fn what_begins_in_contact_begins_without_force() {
        for (kind, distance) in [(ContactKind::Sticky, 0.09), (ContactKind::Slip, 0.02), (ContactKind::Separate, 0.02)]
        {
            let mut touch = Touch::new(&SPRINGS);
            let face = face(kind, 0.3, distance);
            touch.meet(&SPRINGS, 1, face.contact, distance);
            assert_eq!(touch.press(&SPRINGS, &face, &[0.0; 3]), [0.0; 3], "{kind:?}");
            assert_eq!(touch.with == 1, kind != ContactKind::Separate);
        }
    }

    #[test]
    fn a_sticky_face_holds_in_all_directions() {
        let mut touch = Touch::new(&SPRINGS);
        let face = face(ContactKind::Sticky, 0.0, 0.05);
        touch.meet(&SPRINGS, 1, face.contact, 0.05);
        touch = carried(touch, [0.01, 0.02, -0.03]);
        let force = touch.press(&SPRINGS, &face, &[0.5, 0.0, 0.0]);
        let right = [-11.0, -20.0, 30.0];
        assert!((0..3).all(|a| (force[a] - right[a]).abs() < 1e-9), "{force:?}");
    }
}
