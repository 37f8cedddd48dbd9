//! A scene made ready to run, in plain numbers: what stays constant during a run, and the particles
//! at time 0.

use rayon::prelude::*;

use super::collider::Collider;
pub use super::contact::{Contact, ContactKind};
use super::notice::Notice;
use super::particles::{IDENTITY, Particles};
pub use super::settings::{
    CoarseSolve, ContactAt, Implicit, Integrator, Kernel, Method, Norm, OutputField, Plasticity, Precision, Smoother,
    Transfer,
};
use super::source::Source;
use crate::material::initial_plastic_state;
pub use crate::material::parameters::Material;

/// The boundaries of an axis: periodic, or two walls, lower then upper.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Axis {
    Periodic,
    Walls([Contact; 2]),
}

/// A body after sampling.
#[derive(Clone, Debug, PartialEq)]
pub struct Body {
    pub name: String,
    /// Index into [`Setup::materials`].
    pub material: usize,
    /// Its particles at time 0; those of a source come later.
    pub particles: std::ops::Range<usize>,
    /// Initial volume of one particle (m³; 2D: m²).
    pub volume0: f64,
    /// Mass of one particle (kg; 2D: kg/m).
    pub mass: f64,
    /// Its contact with other bodies; none if it sticks to those that have none.
    pub contact: Option<Contact>,
}

/// A scene made ready to run.
#[derive(Clone, Debug)]
pub struct Problem {
    pub setup: Setup,
    /// State at time 0.
    pub particles: Particles,
}

/// What stays constant during a run. It holds no particles, so that it is small and cheap to clone.
#[derive(Clone, Debug)]
pub struct Setup {
    pub name: String,
    /// 2 or 3.
    pub dimension: usize,
    /// Grid origin, `domain.min` (m).
    pub origin: [f64; 3],
    pub dx: f64,
    /// Cells per axis; 1 on z in 2D.
    pub cells: [usize; 3],
    pub axes: [Axis; 3],
    pub gravity: [f64; 3],
    pub materials: Vec<Material>,
    pub bodies: Vec<Body>,
    pub sources: Vec<Source>,
    pub colliders: Vec<Collider>,
    /// Where colliders act; implicit runs know nodes only.
    pub contact_at: ContactAt,
    pub kernel: Kernel,
    pub transfer: Transfer,
    pub precision: Precision,
    /// A particle may move at most this share of dx in a step.
    pub cfl: f64,
    pub max_dt_s: Option<f64>,
    /// Explicit or implicit, never `auto`.
    pub integrator: Integrator,
    /// Why this integrator, in a sentence.
    pub integrator_reason: String,
    pub implicit: Implicit,
    /// What the user should know of the scene.
    pub notices: Vec<Notice>,
    /// Frames after frame 0.
    pub frames: u32,
    /// Simulated time between frames (s).
    pub frame_s: f64,
    pub fields: Vec<OutputField>,
    pub preview_points: usize,
    /// Whether the last state is kept.
    pub keep_state: bool,
    pub seed: u64,
}

impl Setup {
    /// Particles at time 0.
    pub fn initial_particles(&self) -> usize {
        self.bodies.iter().map(|body| body.particles.len()).sum()
    }

    /// Particles at the end of the run, including all that sources emit.
    pub fn total_particles(&self) -> usize {
        self.initial_particles() + self.sources.iter().map(Source::total).sum::<u64>() as usize
    }

    /// Whether explicit frames begin and end with half a step's forces, so that positions and
    /// velocities at frame boundaries are of one time: in between, velocities are half a step ahead.
    /// Without gravity nothing falls, and nothing is staggered.
    pub fn is_staggered(&self) -> bool {
        self.gravity != [0.0; 3]
    }

    /// A position (of the scene's dimension, or in three) in the domain's own period, on periodic
    /// axes.
    pub fn wrapped<const D: usize>(&self, mut x: [f64; D]) -> [f64; D] {
        for a in (0..self.dimension).filter(|&a| self.axes[a] == Axis::Periodic) {
            let (inside, period) = (x[a] - self.origin[a], self.cells[a] as f64 * self.dx);
            // What is inside stays as it is, to the bit.
            if !(0.0..period).contains(&inside) {
                x[a] = self.origin[a] + inside.rem_euclid(period);
            }
        }
        x
    }

    /// The precision on this kind of backend (`cpu` or `gpu`). The implicit integrator on the CPU
    /// always uses f64.
    pub fn precision_on(&self, backend: &str) -> Precision {
        if self.integrator == Integrator::Implicit && backend == "cpu" { Precision::F64 } else { self.precision }
    }

    /// The particles that the sources emit at the start of a frame. Frame 0 begins at time 0. Their
    /// ids follow those of the existing particles.
    pub fn emission(&self, frame: u32) -> Particles {
        let mut new = Particles::default();
        for source in self.sources.iter().filter(|s| s.by_frame.get(frame as usize).is_some_and(|&n| n > 0)) {
            let material = &self.materials[self.bodies[source.body].material];
            let mut x: Vec<[f64; 3]> = source.entering(frame).map(|x| self.wrapped(x)).collect();
            new.x.append(&mut x);
            let count = new.x.len();
            new.v.resize(count, source.velocity);
            new.b.resize(count, [0.0; 9]);
            new.f.resize(count, IDENTITY);
            new.plastic.resize(count, initial_plastic_state(material));
            new.body.resize(count, source.body as u32);
        }
        new
    }
}
