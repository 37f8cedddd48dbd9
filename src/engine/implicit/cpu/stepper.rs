//! The stages of a step: builds its nodes, minimises, moves the particles.

use std::borrow::Cow;

use crate::contract::{Control, EngineError, Solve};
use crate::implicit::engine::{Moved, Stepper};
use crate::implicit::physics::discretisation::Discretisation;
use crate::implicit::physics::potential::Potential;
use crate::implicit::physics::state::{BodySetup, State, setups};
use crate::implicit::physics::transfer::grid_to_particles;
use crate::implicit::solver::objective::NodeVectors;
use crate::implicit::solver::solve as minimise;
use gridfall_core::sim::particles::Particles;
use gridfall_core::sim::setup::Setup;

/// Particles of a simulation on the CPU, and the step that they are in.
pub struct CpuStepper<const D: usize> {
    setup: Setup,
    bodies: Vec<BodySetup>,
    particles: Particles,
    open: Option<Step<D>>,
}

/// A step that has begun.
struct Step<const D: usize> {
    grid: Discretisation<D>,
    solution: Option<Solution<D>>,
    /// Particles at the end.
    after: Option<State<D>>,
}

/// What came of a minimisation.
struct Solution<const D: usize> {
    dv: NodeVectors<D>,
    /// ∇E there (kg m/s) of all nodes, before projection and without friction.
    impulses: NodeVectors<D>,
}

impl<const D: usize> CpuStepper<D> {
    pub fn new(setup: &Setup, particles: Particles) -> Self {
        Self { bodies: setups::<D>(setup), setup: setup.clone(), particles, open: None }
    }

    fn open(&mut self) -> &mut Step<D> {
        self.open.as_mut().expect("a step has begun")
    }
}

impl<const D: usize> Stepper for CpuStepper<D> {
    fn setup(&self) -> &Setup {
        &self.setup
    }

    fn live(&self) -> usize {
        self.particles.len()
    }

    fn begin(&mut self, time_s: f64, dt_s: f64, _again: bool) -> Result<(), EngineError> {
        let grid = Discretisation::new(&self.setup, &self.bodies, &self.particles, time_s, dt_s);
        self.open = Some(Step { grid, solution: None, after: None });
        Ok(())
    }

    fn minimise(&mut self, control: &dyn Control) -> Result<Solve, EngineError> {
        let step = self.open.as_ref().expect("a step has begun");
        let mut potential = Potential::new(&self.setup, &self.bodies, &step.grid, control);
        if let Some(Solution { dv, impulses }) = &step.solution {
            potential = potential.with_friction(dv.clone(), impulses);
        }
        let (dv, solve) = minimise(&potential, &self.setup.implicit);
        let (_, impulses) = potential.energy_and_forces(&dv);
        self.open().solution = Some(Solution { dv, impulses });
        Ok(solve)
    }

    fn revise(&mut self) -> Result<bool, EngineError> {
        let Step { grid, solution, .. } = self.open();
        let Solution { impulses, .. } = solution.as_ref().expect("the step has been minimised");
        let released = grid.boundary.release(impulses);
        Ok(released || !grid.boundary.drags(impulses).is_empty())
    }

    fn finish(&mut self) -> Result<Moved, EngineError> {
        let Step { grid, solution, .. } = self.open.as_ref().expect("a step has begun");
        let Discretisation { topology, state, boundary, dt, .. } = grid;
        let Solution { dv, impulses } = solution.as_ref().expect("the step has been minimised");
        let velocities = grid.velocities(dv);
        let impulses = boundary.reactions(&self.setup, topology.interpolation.shape.share, impulses);
        let (after, moves) = grid_to_particles(&self.setup, topology, state, &self.bodies, &velocities, *dt);
        let id = |p: usize| topology.order[p] as usize;
        let moved = Moved {
            farthest_dx: moves.farthest_dx,
            max_speed_m_s: moves.max_speed_m_s,
            lost: moves.lost.map(id),
            outside: moves.outside.map(id),
            impulses,
        };
        self.open().after = Some(after);
        Ok(moved)
    }

    fn keep(&mut self) {
        let step = self.open.take().expect("a step has begun");
        step.after.expect("the step has been finished").store(&step.grid.topology, &mut self.particles);
    }

    fn before(&self) -> Result<Cow<'_, Particles>, EngineError> {
        Ok(Cow::Borrowed(&self.particles))
    }

    fn append(&mut self, particles: Particles) -> Result<(), EngineError> {
        self.particles.append(particles);
        Ok(())
    }

    fn snapshot(&self) -> Result<Particles, EngineError> {
        Ok(self.particles.clone())
    }
}
