//! A simulation without its type parameters, and the choice of one for a problem.

use std::io::{self, Read, Write};
use std::ops::Range;

use bytemuck::Pod;

use super::g2p::Moves;
use super::grid_update::NodeState;
use super::simulation::Simulation;
use gridfall_core::maths::real::Real;
use gridfall_core::sim::particles::Particles;
use gridfall_core::sim::reaction::Reaction;
use gridfall_core::sim::setup::{Precision, Setup};
use gridfall_core::sim::timestep::Extremes;

/// What the particles did in a step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Moved {
    /// Largest speed (m/s).
    pub max_speed_m_s: f64,
    /// A particle moved a whole dx, or its velocity is not a number.
    pub diverged: bool,
    /// A particle is more than a cell outside a wall.
    pub outside: bool,
    /// A particle left the nodes of its block: bin before the next p2g.
    pub strayed: bool,
    /// An entry of dt ∇v was larger than a step should change F by.
    pub growing: bool,
    /// Largest demand of the materials after the step (1/s²); 0 unless P2G followed.
    pub demand_1_s2: f64,
    /// Particles reset because they were alone on their nodes; by `g2p` only.
    pub isolated: u64,
}

/// The stages of a step, one at a time. A frame is `start_frame`, `p2g`, then per step
/// `grid_update` and `g2p2g`, in the last one `g2p`.
pub trait Stages: Send {
    /// Replaces all particle states; in sampling order.
    fn load(&mut self, particles: Particles);
    /// Bins, asks particles which side of plates they are on, and takes from the states whatever a run that starts
    /// here would take.
    fn start_frame(&mut self);
    /// Sorts particles into blocks and prepares these blocks' nodes.
    fn bin(&mut self);
    /// Mass, momentum and the impulse of a step's forces to the grid.
    fn p2g(&mut self, dt_s: f64);
    /// Node velocities after forces of `dt_s`, for a motion of `move_s` (s) from `time_s`, or for none;
    /// surfaces stand where they are at its start, and move by their secants. Returns the impulses that they take,
    /// in the order of [`gridfall_core::sim::reaction`].
    fn grid_update(&mut self, dt_s: f64, time_s: f64, move_s: f64) -> Vec<Reaction>;
    /// Moves particles; as the last step of a frame, resets those that are alone on their nodes.
    fn g2p(&mut self, dt_s: f64) -> Moved;
    /// `g2p` at the end of a part of a frame, which resets nothing; `start_frame` and `p2g` follow.
    fn end_part(&mut self, dt_s: f64) -> Moved;
    /// `g2p`, then `p2g` with forces for `next_s`, unless particles strayed.
    fn g2p2g(&mut self, dt_s: f64, next_s: f64) -> Moved;
    /// Particles that there are.
    fn count(&self) -> usize;
    /// Full states of some particles, in sampling order.
    fn read(&self, ids: Range<usize>) -> Particles;
    /// Full states of all particles, in sampling order.
    fn particles(&self) -> Particles {
        self.read(0..self.count())
    }
    /// Writes what a frame starts from.
    fn save(&self, to: &mut dyn Write) -> io::Result<()>;
    /// Takes over what was saved; `start_frame` follows.
    fn restore(&mut self, from: &mut dyn Read) -> io::Result<()>;
    /// All nodes with mass, after `p2g`.
    fn nodes(&self) -> Vec<NodeState>;
    /// What the particles ask of the coming steps.
    fn extremes(&self) -> Extremes;
}

impl<T: Real + Pod, const D: usize> Stages for Simulation<T, D> {
    fn load(&mut self, particles: Particles) {
        Simulation::load(self, particles);
    }
    fn start_frame(&mut self) {
        Simulation::start_frame(self);
    }
    fn bin(&mut self) {
        Simulation::bin(self);
    }
    fn p2g(&mut self, dt_s: f64) {
        Simulation::p2g(self, dt_s);
    }
    fn grid_update(&mut self, dt_s: f64, time_s: f64, move_s: f64) -> Vec<Reaction> {
        Simulation::grid_update(self, dt_s, time_s, move_s)
    }
    fn g2p(&mut self, dt_s: f64) -> Moved {
        Simulation::g2p(self, dt_s).into()
    }
    fn end_part(&mut self, dt_s: f64) -> Moved {
        Simulation::end_part(self, dt_s).into()
    }
    fn g2p2g(&mut self, dt_s: f64, next_s: f64) -> Moved {
        Simulation::g2p2g(self, dt_s, next_s).into()
    }
    fn count(&self) -> usize {
        Simulation::count(self)
    }
    fn read(&self, ids: Range<usize>) -> Particles {
        Simulation::particles(self, ids)
    }
    fn save(&self, to: &mut dyn Write) -> io::Result<()> {
        Simulation::save(self, to)
    }
    fn restore(&mut self, from: &mut dyn Read) -> io::Result<()> {
        Simulation::restore(self, from)
    }
    fn nodes(&self) -> Vec<NodeState> {
        self.grid.nodes(&self.tiles)
    }
    fn extremes(&self) -> Extremes {
        Simulation::extremes(self)
    }
}

impl<T: Real> From<Moves<T>> for Moved {
    fn from(m: Moves<T>) -> Self {
        Self {
            max_speed_m_s: m.speed_squared.to_f64().sqrt(),
            diverged: m.diverged,
            outside: m.outside,
            strayed: m.strayed,
            growing: m.growing,
            demand_1_s2: m.demand.to_f64(),
            isolated: m.isolated,
        }
    }
}

/// The simulation for a problem's dimension and precision, loaded with its particles.
pub fn stages(setup: &Setup, particles: Particles) -> Box<dyn Stages> {
    match (setup.dimension, setup.precision) {
        (2, Precision::F32) => Box::new(Simulation::<f32, 2>::new(setup, particles)),
        (2, Precision::F64) => Box::new(Simulation::<f64, 2>::new(setup, particles)),
        (_, Precision::F32) => Box::new(Simulation::<f32, 3>::new(setup, particles)),
        (_, Precision::F64) => Box::new(Simulation::<f64, 3>::new(setup, particles)),
    }
}
