//! Colliders that act on particles, over a step: where each is before it and after it (see [`super::touch`]).

use super::collider::{Collider, NORMAL_STEP_DX, Placed, rotate, rotate_back};
use super::setup::{Contact, ContactAt, Setup};
use super::touch::{Face, LEAST_STEP_DX, STANDOFF};

/// A collider that acts on particles, before a step and after it.
pub struct Surface<'a> {
    /// Among the scene's colliders.
    pub index: usize,
    pub contact: Contact,
    pub before: Placed<'a>,
    pub after: Placed<'a>,
    /// It was not there before the step.
    pub appears: bool,
    /// Of the step (s).
    dt: f64,
}

/// Those that are there at the end of the step of `dt` (s) that ends at `time` (s).
pub fn there_after(setup: &Setup, time: f64, dt: f64) -> Vec<Surface<'_>> {
    surfaces(setup, time, [time - dt, time], dt)
}

/// Those that are there at the start of the step of `dt` (s) that starts at `time` (s).
pub fn there_before(setup: &Setup, time: f64, dt: f64) -> Vec<Surface<'_>> {
    surfaces(setup, time, [time, time + dt], dt)
}

/// Those that are there at `time` (s), over a step of `dt` (s) from one time to another.
fn surfaces(setup: &Setup, time: f64, step: [f64; 2], dt: f64) -> Vec<Surface<'_>> {
    if setup.contact_at == ContactAt::Nodes {
        return Vec::new();
    }
    let acting = setup.colliders.iter().enumerate().filter(|(_, c)| !c.grip && c.is_present(time));
    acting.map(|(index, collider)| Surface::new(index, collider, step, dt)).collect()
}

impl<'a> Surface<'a> {
    /// The collider of this index over a step of `dt` (s) from one time to another (s).
    fn new(index: usize, collider: &'a Collider, [start, end]: [f64; 2], dt: f64) -> Self {
        Self {
            index,
            contact: collider.contact,
            before: collider.at(start),
            after: collider.at(end),
            appears: !collider.is_present(start),
            dt,
        }
    }

    /// The number by which a particle's [`super::touch::Touch`] names the collider.
    pub fn number(&self) -> u32 {
        self.index as u32 + 1
    }

    /// A point (m) that moves with the collider, after the step.
    pub fn carried(&self, x: [f64; 3]) -> [f64; 3] {
        self.after.motion.pose.to_space(self.before.motion.pose.to_start(x))
    }

    /// A direction that turns with the collider, after the step.
    pub fn turned(&self, u: [f64; 3]) -> [f64; 3] {
        rotate(&self.after.motion.pose.rotation, rotate_back(&self.before.motion.pose.rotation, u))
    }

    /// The point after a share of the way from `start`, seen from the collider, to `end`.
    pub fn on_the_way(&self, [start, end]: [[f64; 3]; 2], share: f64) -> [f64; 3] {
        let carried = self.carried(start);
        std::array::from_fn(|a| carried[a] + share * (end[a] - carried[a]))
    }

    /// Outward unit normal at `x` (m), whose distance is given, after the step. On thin plates the differences
    /// stay on the side of `x`.
    pub fn normal(&self, x: [f64; 3], distance: f64, dx: f64) -> [f64; 3] {
        let step = NORMAL_STEP_DX * dx;
        self.after.normal(x, if distance > 0.0 { (0.5 * distance).clamp(LEAST_STEP_DX * dx, step) } else { step })
    }

    /// The face at a particle at `x` (m), after the step; `distance` is the particle's.
    pub fn face(&self, x: [f64; 3], distance: f64, dx: f64) -> Face {
        Face {
            collider: self.number(),
            contact: self.contact,
            distance,
            normal: self.normal(x, distance, dx),
            velocity: self.arrival(x),
        }
    }

    /// The velocity (m/s) with which what the collider has at `x` got there: the secant of its path.
    fn arrival(&self, x: [f64; 3]) -> [f64; 3] {
        if self.dt == 0.0 {
            return self.after.velocity_at(x);
        }
        let from = self.before.motion.pose.to_space(self.after.motion.pose.to_start(x));
        std::array::from_fn(|a| (x[a] - from[a]) / self.dt)
    }

    /// Where a particle of this `spacing` (m) ends that meets the face after a `share` of its way from `start`
    /// to `end`: it slides along the face.
    pub fn stop(&self, [start, end]: [[f64; 3]; 2], share: f64, spacing: f64, dx: f64) -> [f64; 3] {
        let at = self.on_the_way([start, end], share);
        let n = self.normal(at, self.after.distance(at), dx);
        let inward = (0..3).map(|a| (end[a] - at[a]) * n[a]).sum::<f64>().min(0.0);
        let along: [f64; 3] = std::array::from_fn(|a| end[a] - inward * n[a]);
        if self.after.distance(along) < 0.25 * STANDOFF * spacing { at } else { along }
    }
}
