//! One step's particles, nodes and surfaces: all that its minimisation problem needs.

use super::boundary::Boundary;
use super::contact::{Contacts, Faces};
use super::state::{BodySetup, State, vector};
use super::topology::Topology;
use super::transfer::{Node, particles_to_grid};
use crate::implicit::solver::objective::NodeVectors;
use gridfall_core::sim::particles::Particles;
use gridfall_core::sim::setup::Setup;

/// The grid of a step, and the particles in the order of its groups.
pub struct Discretisation<const D: usize> {
    pub topology: Topology<D>,
    pub state: State<D>,
    /// All nodes; those of the system come first.
    pub nodes: Vec<Node<D>>,
    pub boundary: Boundary<D>,
    contacts: Contacts,
    /// When the step starts (s).
    pub time_s: f64,
    /// Its length (s).
    pub dt: f64,
}

impl<const D: usize> Discretisation<D> {
    /// For a step of `dt` (s) from `time_s`.
    pub fn new(setup: &Setup, bodies: &[BodySetup], particles: &Particles, time_s: f64, dt: f64) -> Self {
        let x: Vec<_> = particles.x.iter().map(vector::<D>).collect();
        let mut topology = Topology::new(setup, &x, setup.dx);
        let state = State::sorted(particles, &topology);
        let mut nodes = particles_to_grid(setup, &topology, &state, bodies);
        let boundary = Boundary::new(setup, &mut topology, &mut nodes, time_s, dt);
        let contacts = Contacts::new(setup, &state, time_s, dt);
        Self { topology, state, nodes, boundary, contacts, time_s, dt }
    }

    /// What colliders do to the particles.
    pub fn faces<'a>(&'a self, setup: &'a Setup) -> Faces<'a, D> {
        Faces::new(setup, &self.topology, &self.contacts, self.time_s, self.dt)
    }

    /// The same particles on a grid of spacing `dx` (m), away from all faces, and where each was in
    /// the order of this one.
    pub fn coarsened(&self, setup: &Setup, bodies: &[BodySetup], dx: f64) -> (Self, Vec<u32>) {
        let mut topology = Topology::new(setup, &self.state.x, dx);
        let state = self.state.permuted(&topology.order);
        let mut nodes = particles_to_grid(setup, &topology, &state, bodies);
        let boundary = Boundary::new(setup, &mut topology, &mut nodes, self.time_s, self.dt);
        let order = topology.order.clone();
        let contacts = Contacts::default();
        (Self { topology, state, nodes, boundary, contacts, time_s: self.time_s, dt: self.dt }, order)
    }

    /// Velocities (m/s) of all nodes at the step's end.
    pub fn velocities(&self, dv: &NodeVectors<D>) -> NodeVectors<D> {
        let mut v = self.boundary.velocities.clone();
        for (i, dv) in dv.iter().enumerate() {
            v[i] = std::array::from_fn(|a| self.nodes[i].velocity[a] + dv[a]);
        }
        v
    }

    /// Nodes of the system.
    pub fn unknowns(&self) -> usize {
        self.boundary.freedoms.len()
    }
}
