//! The stages of a step: builds its nodes, minimises, moves the particles.

use std::borrow::Cow;
use std::io::{Read, Write};

use crate::contract::{Control, EngineError, Solve, StateError};
use crate::implicit::engine::{Moved, Stepper};
use crate::implicit::physics::discretisation::Discretisation;
use crate::implicit::physics::potential::Potential;
use crate::implicit::physics::state::{BodySetup, State, setups};
use crate::implicit::physics::transfer::grid_to_particles;
use crate::implicit::solver::objective::NodeVectors;
use crate::implicit::solver::solve as minimise;
use crate::state::{get_particles, get_time, put_particles, put_time};
use gridfall_core::sim::particles::Particles;
use gridfall_core::sim::settings::Method;
use gridfall_core::sim::setup::Setup;
use gridfall_core::sim::touch;

/// Particles of a simulation on the CPU, and the step that they are in.
pub struct CpuStepper<const D: usize> {
    setup: Setup,
    bodies: Vec<BodySetup>,
    particles: Particles,
    /// When the particles last met faces that appear (s).
    met_s: Option<f64>,
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
    /// Of friction at the particles (N).
    limits: Vec<f64>,
}

impl<const D: usize> CpuStepper<D> {
    pub fn new(setup: &Setup, particles: Particles) -> Self {
        Self { bodies: setups::<D>(setup), setup: setup.clone(), particles, met_s: None, open: None }
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
        if let Some(before) = self.met_s.replace(time_s) {
            touch::appear(&self.setup, &mut self.particles, before, time_s);
        }
        touch::begin(&self.setup, &mut self.particles, time_s);
        let grid = Discretisation::new(&self.setup, &self.bodies, &self.particles, time_s, dt_s);
        self.open = Some(Step { grid, solution: None, after: None });
        Ok(())
    }

    fn minimise(&mut self, control: &dyn Control) -> Result<Solve, EngineError> {
        let step = self.open.as_ref().expect("a step has begun");
        let mut potential = Potential::new(&self.setup, &self.bodies, &step.grid, control);
        if let Some(Solution { dv, impulses, .. }) = &step.solution {
            potential = potential.with_friction(dv.clone(), impulses);
        }
        let (dv, solve) = minimise(&mut potential, &self.setup.implicit);
        let (_, impulses) = potential.energy_and_forces(&dv);
        let limits = potential.limits().to_vec();
        self.open().solution = Some(Solution { dv, impulses, limits });
        Ok(solve)
    }

    fn revise(&mut self) -> Result<bool, EngineError> {
        let Step { grid, solution, .. } = self.open.as_mut().expect("a step has begun");
        let Solution { dv, impulses, .. } = solution.as_ref().expect("the step has been minimised");
        let released = grid.boundary.release(impulses);
        // Newton's method has renewed friction at the particles itself.
        let rubs = self.setup.implicit.method != Method::Newton && {
            let mut faces = grid.faces(&self.setup);
            faces.renew(&grid.velocities(dv));
            faces.rub()
        };
        Ok(released || rubs || !grid.boundary.drags(impulses).is_empty())
    }

    fn finish(&mut self) -> Result<Moved, EngineError> {
        let Step { grid, solution, .. } = self.open.as_ref().expect("a step has begun");
        let Discretisation { topology, state, boundary, dt, .. } = grid;
        let Solution { dv, impulses, limits } = solution.as_ref().expect("the step has been minimised");
        let velocities = grid.velocities(dv);
        let mut impulses = boundary.reactions(&self.setup, topology.interpolation.shape.share, impulses);
        let (mut after, moves) = grid_to_particles(&self.setup, topology, state, &self.bodies, &velocities, *dt);
        let faces = grid.faces(&self.setup).limited(limits);
        faces.settle(&self.bodies, &mut after, &mut impulses);
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

    fn save(&self, to: &mut dyn Write) -> Result<(), StateError> {
        put_time(to, self.met_s)?;
        Ok(put_particles(to, &self.particles)?)
    }

    fn restore(&mut self, from: &mut dyn Read) -> Result<(), StateError> {
        self.met_s = get_time(from)?;
        self.particles = get_particles(from, self.setup.total_particles(), self.setup.bodies.len())?;
        self.open = None;
        Ok(())
    }
}
