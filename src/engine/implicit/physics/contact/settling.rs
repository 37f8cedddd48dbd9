//! The end of a step for particles near faces: none has gone through one, and all remember what they hold on to.

use rayon::prelude::*;

use super::hold::{Hold, Place};
use super::{Faces, Near, place};
use crate::implicit::physics::state::{BodySetup, State, vector};
use gridfall_core::maths::linalg::dot;
use gridfall_core::sim::reaction::{Reaction, WALLS};
use gridfall_core::sim::surface::Surface;
use gridfall_core::sim::touch::{self, STANDOFF, Springs, Touch};

/// Share of the standoff at which a particle that was stopped meets a sheet again; it stands farther from the face
/// that has stopped it.
const AGAIN: f64 = 0.2;

/// Distance, in spacings, at which a slip face loses what it holds.
const LOST: f64 = 2.0;

impl<const D: usize> Faces<'_, D> {
    /// Ends the step that has moved particles to `after`: stops those that went through a face, and all take
    /// note of what they hold on to. Adds what the surfaces took (N s) to `sums`.
    pub fn settle(&self, bodies: &[BodySetup], after: &mut State<D>, sums: &mut [Reaction]) {
        let settled = |near: &Near| {
            let p = near.particle as usize;
            let v = place(&after.v[p]);
            let moved = std::array::from_fn(|a| near.x[a] + self.dt * v[a]);
            let mut taken: Vec<(usize, [f64; 3])> = Vec::new();
            for (at, surface) in self.faces(near) {
                let force = place(&self.response(at, surface, near, moved).force);
                taken.push((surface.index, force.map(|f| -self.dt * f)));
            }
            let mass = bodies[after.body[p] as usize].mass;
            let (end, v) = self.stopped(near, moved, v, mass, &mut taken);
            (p, (end != moved).then_some((end, v)), self.remembered(near, end), taken)
        };
        let settled: Vec<_> = self.contacts.near.par_iter().with_min_len(32).map(settled).collect();
        let springs = touch::of_bodies(self.setup);
        for (p, touch) in after.touch.iter_mut().enumerate().filter(|(p, _)| self.is_far(*p)) {
            *touch = Touch::new(&springs[after.body[p] as usize]);
        }
        for (near, (p, stop, touch, taken)) in self.contacts.near.iter().zip(settled) {
            after.touch[p] = touch;
            if let Some((end, v)) = stop {
                (after.x[p], after.v[p]) = (self.setup.wrapped(vector(&end)), vector(&v));
            }
            for (index, impulse) in taken.into_iter().filter(|(_, impulse)| *impulse != [0.0; 3]) {
                let surface = self.surfaces.iter().find(|s| s.index == index).expect("it has taken something");
                let center = surface.before.motion.center;
                sums[WALLS + index].take(impulse, std::array::from_fn(|a| near.x[a] - center[a]));
            }
        }
    }

    fn is_far(&self, p: usize) -> bool {
        self.contacts.of.get(p).is_none_or(|&near| near == u32::MAX)
    }

    /// Where a particle that would go to `end` (m) with `v` (m/s) does go, and how fast: not through faces. Notes what
    /// they take.
    fn stopped(
        &self,
        near: &Near,
        mut end: [f64; 3],
        mut v: [f64; 3],
        mass: f64,
        taken: &mut Vec<(usize, [f64; 3])>,
    ) -> ([f64; 3], [f64; 3]) {
        let (start, least) = (near.x, STANDOFF * near.springs.spacing);
        let mut stopped = false;
        for (_, surface) in self.faces(near) {
            let Some(share) = surface.before.meets(&surface.after, start, end, least) else { continue };
            end = surface.stop([start, end], share, near.springs.spacing, self.setup.dx);
            stopped = true;
            let n = surface.normal(end, surface.after.distance(end), self.setup.dx);
            let carried = surface.carried(start);
            let relative: [f64; 3] = std::array::from_fn(|a| v[a] - (carried[a] - start[a]) / self.dt);
            let inward = dot(&relative, &n).min(0.0);
            v = std::array::from_fn(|a| v[a] - inward * n[a]);
            taken.push((surface.index, n.map(|n| mass * inward * n)));
        }
        // What slides along a face may slide through a sheet, which has no inside to come back from.
        for (_, surface) in self.faces(near).filter(|(_, surface)| stopped && surface.after.is_sheet()) {
            if let Some(share) = surface.before.meets(&surface.after, start, end, AGAIN * least) {
                end = surface.on_the_way([start, end], share);
            }
        }
        (end, v)
    }

    /// What a particle that ends at `end` (m) remembers.
    fn remembered(&self, near: &Near, end: [f64; 3]) -> Touch {
        let (springs, mut touch) = (&near.springs, near.touch);
        if touch.with != 0 {
            let held = self.faces(near).find(|(_, surface)| surface.number() == touch.with);
            touch = held.map_or(Touch::new(springs), |(_, surface)| self.kept(surface, near, end));
        }
        if touch.with == 0 {
            let free = Near { touch, ..near.clone() };
            let found = self.faces(near).map(|(_, surface)| self.taken_up(surface, &free, end));
            touch = found.into_iter().find(|found| found.with != 0).unwrap_or(touch);
        }
        let nearest = self.faces(near).map(|(_, surface)| surface.after.distance(end)).fold(f64::INFINITY, f64::min);
        touch.recover(springs, nearest);
        touch
    }

    /// What becomes of a particle's hold on a face.
    fn kept(&self, surface: &Surface, near: &Near, end: [f64; 3]) -> Touch {
        let (touch, place) = (near.touch, self.place(surface, near, end));
        match self.hold(surface, near) {
            Hold::Rail if place.gap > LOST * near.springs.spacing => Touch::new(&near.springs),
            Hold::Rail => touch,
            Hold::Push(_) if place.gap >= 0.0 => Touch { with: 0, stretch: [0.0; 3], ..touch },
            hold @ Hold::Push(_) => Touch { stretch: slid(&place, hold, &near.springs), ..touch },
            Hold::Bond | Hold::Arrest => Touch { stretch: place.stretch, ..touch },
        }
    }

    /// What a particle that holds on to nothing remembers of a face.
    fn taken_up(&self, surface: &Surface, near: &Near, end: [f64; 3]) -> Touch {
        let (touch, with, place) = (near.touch, surface.number(), self.place(surface, near, end));
        match self.hold(surface, near) {
            _ if place.gap >= 0.0 => touch,
            Hold::Bond | Hold::Arrest => {
                let along = place.along();
                Touch { with, stretch: std::array::from_fn(|a| along[a] + place.gap * place.normal[a]), ..touch }
            }
            Hold::Rail => Touch { with, ..touch },
            hold @ Hold::Push(_) => Touch { with, stretch: slid(&place, hold, &near.springs), ..touch },
        }
    }
}

/// The stretch along a face where it may slide: no longer than friction stretches its spring.
fn slid(place: &Place, hold: Hold, springs: &Springs) -> [f64; 3] {
    let along = place.along();
    let (size, most) = (dot(&along, &along).sqrt(), place.limit(hold, springs.stiffness) / springs.stiffness);
    if size > most { along.map(|t| t * most / size) } else { along }
}
