//! Contact of a step's particles with the faces of colliders, as part of its potential (see
//! [`gridfall_core::sim::touch`] for the springs).
//!
//! A particle ends at x_p + dt v_p, and the collider at its pose there presses on it: φ(x_p + dt v_p)
//! per particle, over the share of a grid. Its force f_p = −∇φ reaches node i as dt w_ip f_p, its
//! stiffness K_p couples nodes i and j by dt² share w_ip w_jp K_p. Friction gives way at limits that
//! stay fixed until they are renewed. There is no damping: implicit Euler damps springs as stiff as
//! the material's within a step.

use rayon::prelude::*;

pub use self::hold::Response;
use self::hold::{Hold, Place};
use super::assembly::AtParticles;
use super::state::State;
use super::topology::Topology;
use crate::implicit::solver::objective::{NodeVectors, Renewed};
use gridfall_core::maths::linalg::{Vector, dot};
use gridfall_core::sim::collider::NORMAL_STEP_DX;
use gridfall_core::sim::setup::Setup;
use gridfall_core::sim::surface::{self, Surface};
use gridfall_core::sim::touch::{self, STANDOFF, Springs, Touch};

mod hold;
mod settling;

/// Distance (dx) from a face, beyond what the face moves, up to which a particle may meet it within a step; it
/// goes no farther than a cell.
const REACH_DX: f64 = 2.0;

/// Part of friction's limit up to which it holds: what has slid is at the limit, but for rounding.
const HOLDS: f64 = 0.999;

/// A particle near faces, at the step's start.
#[derive(Clone, Debug)]
struct Near {
    /// In the order of the state.
    particle: u32,
    /// m.
    x: [f64; 3],
    springs: Springs,
    touch: Touch,
    /// Its faces: of [`Contacts::links`].
    first: u32,
    end: u32,
}

/// Which particles of a step are near which faces.
#[derive(Default)]
pub struct Contacts {
    near: Vec<Near>,
    /// Indices of surfaces, in the order of [`surface::there_before`].
    links: Vec<u32>,
    /// Of each particle, its place in `near`, or `u32::MAX`; empty where nothing is near.
    of: Vec<u32>,
}

impl Contacts {
    /// At the start of a step of `dt` (s) at `time_s`.
    pub fn new<const D: usize>(setup: &Setup, state: &State<D>, time_s: f64, dt: f64) -> Self {
        let surfaces = surface::there_before(setup, time_s, dt);
        if surfaces.is_empty() || state.touch.is_empty() {
            return Self::default();
        }
        let springs = touch::of_bodies(setup);
        let meets = |p: usize| {
            let (x, touch) = (place(&state.x[p]), state.touch[p]);
            let is_near = |surface: &Surface| {
                let carried = surface.carried(x);
                let moved: f64 = (0..3).map(|a| (carried[a] - x[a]).powi(2)).sum::<f64>().sqrt();
                let reach = REACH_DX * setup.dx + moved + surface.before.slack();
                touch.with == surface.number() || surface.before.distance(x) <= reach
            };
            (0..surfaces.len() as u32).filter(|&s| is_near(&surfaces[s as usize])).collect::<Vec<_>>()
        };
        let links: Vec<Vec<u32>> = (0..state.x.len()).into_par_iter().with_min_len(64).map(meets).collect();
        let mut contacts = Self { of: vec![u32::MAX; links.len()], ..Self::default() };
        for (p, links) in links.into_iter().enumerate().filter(|(_, links)| !links.is_empty()) {
            let first = contacts.links.len() as u32;
            contacts.links.extend(links);
            contacts.of[p] = contacts.near.len() as u32;
            contacts.near.push(Near {
                particle: p as u32,
                x: place(&state.x[p]),
                springs: springs[state.body[p] as usize],
                touch: state.touch[p],
                first,
                end: contacts.links.len() as u32,
            });
        }
        contacts
    }
}

fn place<const D: usize>(x: &Vector<f64, D>) -> [f64; 3] {
    let mut place = [0.0; 3];
    place[..D].copy_from_slice(x);
    place
}

/// The faces of a step and what they do to its particles.
pub struct Faces<'a, const D: usize> {
    setup: &'a Setup,
    topology: &'a Topology<D>,
    contacts: &'a Contacts,
    surfaces: Vec<Surface<'a>>,
    /// Limits of friction (N), of each of [`Contacts::links`].
    limits: Vec<f64>,
    grips: Vec<Grip>,
    dt: f64,
}

/// How a face that pushes acts on a particle.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Grip {
    /// Not.
    None,
    /// Friction holds it.
    Holds,
    /// It slides.
    Slides,
}

impl Grip {
    /// Of springs of stiffness `k` (N/m) and friction of at most `limit` (N).
    fn of(place: &Place, k: f64, limit: f64) -> Self {
        let along = place.along();
        match place.gap {
            gap if gap >= 0.0 => Self::None,
            _ if k * dot(&along, &along).sqrt() > limit => Self::Slides,
            _ => Self::Holds,
        }
    }
}

impl<'a, const D: usize> Faces<'a, D> {
    /// Until friction is renewed, what it held before the step holds, and what slid is rubbed as it was then. Where a
    /// body falls freely from the step's start, which is where solvers start, it presses with many times its weight
    /// and slides.
    pub fn new(setup: &'a Setup, topology: &'a Topology<D>, contacts: &'a Contacts, time_s: f64, dt: f64) -> Self {
        let (limits, grips) = (Vec::new(), Vec::new());
        let surfaces = surface::there_before(setup, time_s, dt);
        let mut faces = Self { setup, topology, contacts, surfaces, limits, grips, dt };
        faces.hold_at(true, |_, surface, near| {
            let distance = surface.before.distance(near.x);
            let normal = surface.before.normal(near.x, NORMAL_STEP_DX * setup.dx);
            let held = near.touch.with == surface.number();
            let stretch = if held { near.touch.stretch } else { [0.0; 3] };
            Place { gap: distance - near.touch.radius, normal, stretch }
        });
        faces
    }

    /// The same with these limits of friction, see [`Self::limits`].
    pub fn limited(mut self, limits: &[f64]) -> Self {
        self.limits.copy_from_slice(limits);
        self
    }

    /// The limits of friction (N) of all particles at their faces.
    pub fn limits(&self) -> &[f64] {
        &self.limits
    }

    /// Whether friction acts anywhere.
    pub fn rub(&self) -> bool {
        self.limits.iter().any(|&limit| limit > 0.0)
    }

    /// The stiffness (N/m) of all springs that hold or press, since they were renewed.
    pub fn holding(&self) -> f64 {
        let holds = |near: &Near, (at, surface): (usize, &Surface)| {
            self.grips[at] != Grip::None || matches!(self.hold(surface, near), Hold::Bond | Hold::Rail)
        };
        let of =
            |near: &Near| near.springs.stiffness * self.faces(near).filter(|face| holds(near, *face)).count() as f64;
        self.contacts.near.iter().map(of).sum()
    }

    /// The faces of a particle, with their place among all links.
    fn faces(&self, near: &Near) -> impl Iterator<Item = (usize, &Surface<'a>)> {
        (near.first as usize..near.end as usize).map(|at| (at, &self.surfaces[self.contacts.links[at] as usize]))
    }

    /// Where a particle ends (m), for velocities of the nodes.
    fn end(&self, near: &Near, velocities: &NodeVectors<D>) -> [f64; 3] {
        let p = near.particle as usize;
        let (w, _) = self.topology.stencil(p);
        let step = self.dt * self.topology.interpolation.shape.share;
        let mut x = near.x;
        for (w, &node) in w.iter().zip(self.topology.nodes_of(self.topology.group_of[p] as usize)) {
            (0..D).for_each(|a| x[a] += step * w * velocities[node as usize][a]);
        }
        x
    }

    /// Where a particle that goes to `end` (m) is at a face. One that has gone through is at the plane of the face
    /// where it went in: it stays on the side where it began, however thin the plate.
    fn place(&self, surface: &Surface, near: &Near, end: [f64; 3]) -> Place {
        let &Near { x, springs, touch, .. } = near;
        let through = surface.before.meets(&surface.after, x, end, STANDOFF * springs.spacing);
        let at = through.map_or(end, |share| surface.on_the_way([x, end], share));
        let distance = surface.after.distance(at);
        let normal = surface.normal(at, distance, self.setup.dx);
        let beyond: f64 = (0..3).map(|a| (end[a] - at[a]) * normal[a]).sum();
        let carried = surface.carried(x);
        let held = if touch.with == surface.number() { surface.turned(touch.stretch) } else { [0.0; 3] };
        Place {
            gap: distance + beyond - touch.radius,
            normal,
            stretch: std::array::from_fn(|a| held[a] + end[a] - carried[a]),
        }
    }

    fn hold(&self, surface: &Surface, near: &Near) -> Hold {
        Hold::of(&surface.contact, surface.number(), &near.touch)
    }

    /// The response of one face to a particle that ends at `end` (m).
    fn response(&self, at: usize, surface: &Surface, near: &Near, end: [f64; 3]) -> Response<D> {
        let place = self.place(surface, near, end);
        Response::new(self.hold(surface, near), near.springs.stiffness, &place, self.limits[at])
    }

    /// The responses to the particles near faces, for velocities (m/s) of all nodes.
    pub fn responses(&self, velocities: &NodeVectors<D>) -> Vec<Response<D>> {
        let of = |near: &Near| {
            let (end, mut sum) = (self.end(near, velocities), Response::NONE);
            self.faces(near).for_each(|(at, surface)| sum.add(&self.response(at, surface, near, end)));
            sum
        };
        self.contacts.near.par_iter().with_min_len(32).map(of).collect()
    }

    /// That of a particle, by its place in the state.
    pub fn of<'b>(&self, responses: &'b [Response<D>], particle: usize) -> Option<&'b Response<D>> {
        responses.get(*self.contacts.of.get(particle)? as usize)
    }

    /// Σ φ (J).
    pub fn energy(&self, responses: &[Response<D>]) -> f64 {
        responses.iter().map(|response| response.energy).sum()
    }

    /// dt² share K of the particles (kg).
    pub fn stiffness(&self, responses: &[Response<D>]) -> AtParticles<D> {
        let factor = self.dt * self.dt * self.topology.interpolation.shape.share;
        let blocks = responses.iter().map(|response| response.stiffness.map(|row| row.map(|k| factor * k))).collect();
        AtParticles { of: self.contacts.of.clone(), blocks }
    }

    /// Sets the limits of friction to what presses now, for velocities (m/s) of all nodes.
    pub fn renew(&mut self, velocities: &NodeVectors<D>) -> Renewed {
        let ends: Vec<[f64; 3]> = self.contacts.near.par_iter().map(|near| self.end(near, velocities)).collect();
        self.hold_at(false, |faces, surface, near| {
            let end = ends[faces.contacts.of[near.particle as usize] as usize];
            faces.place(surface, near, end)
        })
    }

    /// Sets the limits of friction to what presses at these places. What holds may do so without limit.
    fn hold_at(&mut self, fast: bool, place: impl Fn(&Self, &Surface, &Near) -> Place + Sync) -> Renewed {
        let of = |near: &Near| {
            let k = near.springs.stiffness;
            let limit = |(_, surface): (usize, &Surface)| match self.hold(surface, near) {
                Hold::Bond | Hold::Rail => (0.0, Grip::None),
                hold @ (Hold::Push(_) | Hold::Arrest) => {
                    let place = place(self, surface, near);
                    let limit = place.limit(hold, k);
                    let holds = fast && limit > 0.0 && Grip::of(&place, k, HOLDS * limit) == Grip::Holds;
                    (if holds { f64::INFINITY } else { limit }, Grip::of(&place, k, limit))
                }
            };
            self.faces(near).map(limit).collect::<Vec<_>>()
        };
        let now: Vec<Vec<(f64, Grip)>> = self.contacts.near.par_iter().with_min_len(32).map(of).collect();
        let (limits, grips): (Vec<f64>, Vec<Grip>) = now.into_iter().flatten().unzip();
        let renewed = match (grips != self.grips, limits != self.limits) {
            (true, _) => Renewed::Contacts,
            (_, true) => Renewed::Forces,
            _ => Renewed::Nothing,
        };
        (self.limits, self.grips) = (limits, grips);
        renewed
    }
}

#[cfg(test)]
mod tests;
