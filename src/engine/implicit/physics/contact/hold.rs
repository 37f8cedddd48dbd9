//! How a face holds a particle within a step: energy, force and stiffness of its springs.
//!
//! Along the normal ½ K gap², along the face ½ K |t|² with t how far the particle has been carried
//! along it. Friction's spring gives way at a limit that is held fixed, so that it has an energy
//! too: limit · |t| − limit²/2K beyond |t| = limit/K (Huber's).

use gridfall_core::maths::linalg::{Vector, dot};
use gridfall_core::sim::setup::{Contact, ContactKind};
use gridfall_core::sim::touch::Touch;

/// What a face does to a particle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Hold {
    /// Holds it in all directions.
    Bond,
    /// Pushes it, and will hold it in all directions once it is there.
    Arrest,
    /// Holds it along the normal.
    Rail,
    /// Pushes it, with this friction coefficient.
    Push(f64),
}

impl Hold {
    /// Of a face, by the collider's `number`, on a particle that began the step with `touch`.
    pub fn of(contact: &Contact, number: u32, touch: &Touch) -> Self {
        match (contact.kind, touch.with) {
            (ContactKind::Sticky, with) if with == number => Self::Bond,
            (ContactKind::Sticky, 0) => Self::Arrest,
            (ContactKind::Slip, with) if with == number => Self::Rail,
            _ => Self::Push(contact.friction),
        }
    }
}

/// Where a particle is at a face.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// Distance beyond the one at which the face begins to push (m).
    pub gap: f64,
    /// Unit normal towards the particle.
    pub normal: [f64; 3],
    /// How far the particle has been carried since its spring was at rest (m).
    pub stretch: [f64; 3],
}

impl Place {
    /// The part of the stretch along the face.
    pub fn along(&self) -> [f64; 3] {
        let away = dot(&self.stretch, &self.normal);
        std::array::from_fn(|a| self.stretch[a] - away * self.normal[a])
    }

    /// µ times the force (N) that presses: the limit of friction here.
    pub fn limit(&self, hold: Hold, stiffness: f64) -> f64 {
        match hold {
            Hold::Push(friction) => friction * stiffness * (-self.gap).max(0.0),
            _ => 0.0,
        }
    }
}

/// What springs do at a place, in the scene's D dimensions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Response<const D: usize> {
    /// J (2D: J/m).
    pub energy: f64,
    /// On the particle (N; 2D: N/m).
    pub force: Vector<f64, D>,
    /// Minus the force's derivative (N/m), symmetric and positive semidefinite.
    pub stiffness: [[f64; D]; D],
}

impl<const D: usize> Response<D> {
    pub const NONE: Self = Self { energy: 0.0, force: [0.0; D], stiffness: [[0.0; D]; D] };

    /// Of springs of stiffness `k` (N/m), friction giving way at `limit` (N).
    pub fn new(hold: Hold, k: f64, place: &Place, limit: f64) -> Self {
        let mut response = Self::NONE;
        let n: Vector<f64, D> = std::array::from_fn(|a| place.normal[a]);
        let pressed = place.gap < 0.0;
        match hold {
            Hold::Bond => response.pull(k, &std::array::from_fn(|a| place.stretch[a]), |a, b| f64::from(a == b)),
            Hold::Arrest if pressed => {
                let along = place.along();
                response.pull(k, &std::array::from_fn(|a| place.gap * n[a] + along[a]), |a, b| f64::from(a == b));
            }
            Hold::Rail => response.pull(k, &n.map(|n| place.gap * n), |a, b| n[a] * n[b]),
            Hold::Push(_) => {
                if pressed {
                    response.pull(k, &n.map(|n| place.gap * n), |a, b| n[a] * n[b]);
                }
                if limit > 0.0 {
                    let along = place.along();
                    response.rub(k, &std::array::from_fn(|a| along[a]), &n, limit);
                }
            }
            Hold::Arrest => {}
        }
        response
    }

    /// Adds a spring that is longer by `u` than at rest and acts in the directions of a projection.
    fn pull(&mut self, k: f64, u: &Vector<f64, D>, projection: impl Fn(usize, usize) -> f64) {
        self.energy += 0.5 * k * dot(u, u);
        for a in 0..D {
            self.force[a] -= k * u[a];
            (0..D).for_each(|b| self.stiffness[a][b] += k * projection(a, b));
        }
    }

    /// Adds friction's spring, carried by `t` along the face.
    fn rub(&mut self, k: f64, t: &Vector<f64, D>, n: &Vector<f64, D>, limit: f64) {
        let across = |a: usize, b: usize| f64::from(a == b) - n[a] * n[b];
        let size = dot(t, t).sqrt();
        if k * size <= limit {
            return self.pull(k, t, across);
        }
        let forward = t.map(|t| t / size);
        self.energy += limit * size - 0.5 * limit * limit / k;
        for a in 0..D {
            self.force[a] -= limit * forward[a];
            // Sliding on costs nothing, turning aside does.
            (0..D).for_each(|b| self.stiffness[a][b] += limit / size * (across(a, b) - forward[a] * forward[b]));
        }
    }

    pub fn add(&mut self, other: &Self) {
        self.energy += other.energy;
        for a in 0..D {
            self.force[a] += other.force[a];
            (0..D).for_each(|b| self.stiffness[a][b] += other.stiffness[a][b]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gridfall_core::sim::touch::Springs;

    const K: f64 = 1000.0;
    const HOLDS: [Hold; 4] = [Hold::Bond, Hold::Arrest, Hold::Rail, Hold::Push(0.5)];

    /// At a plane through 0, for a particle carried from `anchor` to `x`.
    fn place(x: [f64; 3], anchor: [f64; 3]) -> Place {
        let normal = [0.0, 0.6, 0.8];
        Place { gap: dot(&x, &normal), normal, stretch: std::array::from_fn(|a| x[a] - anchor[a]) }
    }

    #[test]
    fn forces_and_stiffness_are_derivatives_of_the_energy() {
        let anchor = [0.02, 0.01, -0.03];
        for hold in HOLDS {
            for (x, limit) in [
                ([0.04, -0.02, -0.05], 100.0),
                ([0.04, -0.02, -0.05], 7.0),
                ([0.3, 0.02, 0.05], 7.0),
                ([0.3, 0.02, 0.05], 0.0),
            ] {
                let at = |x: [f64; 3]| Response::<3>::new(hold, K, &place(x, anchor), limit);
                let (here, h) = (at(x), 1e-6);
                for a in 0..3 {
                    let (mut ahead, mut behind) = (x, x);
                    (ahead[a], behind[a]) = (x[a] + h, x[a] - h);
                    let (ahead, behind) = (at(ahead), at(behind));
                    let slope = (ahead.energy - behind.energy) / (2.0 * h);
                    assert!((slope + here.force[a]).abs() < 1e-5, "{hold:?}: {slope} against {here:?}");
                    for b in 0..3 {
                        let rate = (ahead.force[b] - behind.force[b]) / (2.0 * h);
                        assert!((rate + here.stiffness[a][b]).abs() < 1e-4 * K, "{hold:?}: {rate} against {here:?}");
                        assert_eq!(here.stiffness[a][b], here.stiffness[b][a]);
                    }
                }
                for u in [[1.0, 2.0, 3.0], [0.0, 0.6, 0.8], [1.0, 0.0, 0.0], [-1.0, 0.8, -0.6]] {
                    let along: [f64; 3] = std::array::from_fn(|a| dot(&here.stiffness[a], &u));
                    assert!(dot(&u, &along) > -1e-9 * K, "{hold:?} {u:?}");
                }
            }
        }
    }

    #[test]
    fn what_pushes_never_pulls() {
        for gap in [-0.03, -1e-9, 0.0, 0.2] {
            let place = Place { gap, normal: [0.0, 1.0, 0.0], stretch: [0.0; 3] };
            for hold in [Hold::Push(0.0), Hold::Arrest] {
                let force = Response::<2>::new(hold, K, &place, 0.0).force;
                assert_eq!(force, [0.0, K * (-gap).max(0.0)], "{hold:?} {gap}");
            }
            assert!((Response::<2>::new(Hold::Rail, K, &place, 0.0).force[1] + K * gap).abs() < 1e-12);
        }
    }

    #[test]
    fn friction_gives_way_at_its_limit() {
        let (hold, normal) = (Hold::Push(0.5), [0.0, 1.0]);
        for (by, right) in [(0.003, -3.0), (-0.004, 4.0), (0.02, -5.0), (-0.2, 5.0)] {
            let place = Place { gap: -0.01, normal: [0.0, 1.0, 0.0], stretch: [by, -0.01, 0.0] };
            let response = Response::<2>::new(hold, K, &place, place.limit(hold, K));
            assert!((response.force[0] - right).abs() < 1e-9 && (response.force[1] - 10.0).abs() < 1e-9, "{by}");
            let slides = f64::abs(by) > 0.005;
            assert_eq!(response.stiffness[0][0], if slides { 0.0 } else { K });
            assert_eq!(dot(&response.stiffness[1], &normal), K);
        }
    }

    #[test]
    fn a_face_holds_by_its_kind_and_by_what_the_particle_holds_on_to() {
        let springs = Springs { stiffness: K, damping: 0.0, spacing: 0.1 };
        let hold = |kind, with| {
            let touch = Touch { with, ..Touch::new(&springs) };
            Hold::of(&Contact { kind, friction: if kind == ContactKind::Separate { 0.4 } else { 0.0 } }, 2, &touch)
        };
        assert_eq!([0, 1, 2].map(|with| hold(ContactKind::Separate, with)), [Hold::Push(0.4); 3]);
        let sticky = [0, 1, 2].map(|with| hold(ContactKind::Sticky, with));
        assert_eq!(sticky, [Hold::Arrest, Hold::Push(0.0), Hold::Bond]);
        assert_eq!([0, 1, 2].map(|with| hold(ContactKind::Slip, with)), [Hold::Push(0.0), Hold::Push(0.0), Hold::Rail]);
    }
}
