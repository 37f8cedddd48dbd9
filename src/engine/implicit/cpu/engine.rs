//! Frames of an implicit simulation on the CPU, in f64: plan a step, build its nodes, minimise, move the particles.

use crate::contract::{Backend, Control, Engine, EngineError, FrameStats, Solve};
use crate::implicit::physics::discretisation::Discretisation;
use crate::implicit::physics::potential::Potential;
use crate::implicit::physics::state::{BodySetup, setups};
use crate::implicit::physics::transfer::grid_to_particles;
use crate::implicit::solver::solve as minimise;
use crate::implicit::step::{FARTHEST_DX, MIN_DT_S, max_speed_m_s, next_dt_s};
use gridfall_core::sim::divergence::{Suspect, likely_cause};
use gridfall_core::sim::particles::Particles;
use gridfall_core::sim::reaction::{self, Reaction};
use gridfall_core::sim::setup::Setup;

/// A problem loaded on the CPU, integrated implicitly.
pub struct ImplicitEngine {
    backend: Backend,
    setup: Setup,
    bodies: Vec<BodySetup>,
    particles: Particles,
    step: u64,
    time_s: f64,
}

/// A step that can be kept.
struct Step {
    particles: Particles,
    reactions: Vec<Reaction>,
    solve: Solve,
}

/// What came of a step.
enum Attempt {
    Done(Box<Step>),
    /// Too long: a particle went too far, or is no longer finite (its index).
    TooLong(Option<usize>),
    /// A particle, by index, left the domain.
    Outside(usize),
    Canceled,
}

impl ImplicitEngine {
    /// Loads the problem at time 0. Errors: [`EngineError::Capacity`] beyond 2³² places of nodes.
    pub fn new(setup: &Setup, particles: Particles) -> Result<Self, EngineError> {
        let total = setup.total_particles();
        if total > (u32::MAX / 64) as usize {
            return Err(EngineError::Capacity(format!("{total} particles; the implicit engine counts to 2^26")));
        }
        if setup.bodies.iter().any(|body| setup.materials[body.material].is_fluid()) {
            return Err(EngineError::Unsupported("fluids are integrated explicitly".into()));
        }
        Ok(Self {
            backend: Backend::this_cpu("the implicit solver runs every scene on the CPU"),
            bodies: match setup.dimension {
                2 => setups::<2>(setup),
                _ => setups::<3>(setup),
            },
            particles,
            setup: setup.clone(),
            step: 0,
            time_s: 0.0,
        })
    }

    /// The same engine, described as chosen for `reason`.
    pub fn because(mut self, reason: &str) -> Self {
        self.backend.reason = reason.into();
        self
    }

    /// The same engine, at a later time than 0: what moves by the clock is where it is then.
    pub fn at(mut self, time_s: f64) -> Self {
        self.time_s = time_s;
        self
    }

    fn attempt(&self, dt: f64, control: &dyn Control) -> Attempt {
        match self.setup.dimension {
            2 => self.attempt_in::<2>(dt, control),
            _ => self.attempt_in::<3>(dt, control),
        }
    }

    fn attempt_in<const D: usize>(&self, dt: f64, control: &dyn Control) -> Attempt {
        let (setup, bodies) = (&self.setup, &self.bodies);
        let mut step = Discretisation::<D>::new(setup, bodies, &self.particles, self.time_s, dt);
        let mut potential = Potential::new(setup, bodies, &step, control);
        let (mut dv, mut solve) = minimise(&potential, &setup.implicit);
        let (_, mut impulses) = potential.energy_and_forces(&dv);
        // Once more with the surfaces that turned out to pull let go, and with the friction that the others cause.
        let released = step.boundary.release(&impulses);
        potential = Potential::new(setup, bodies, &step, control).with_friction(dv.clone());
        if (released || potential.has_friction()) && !control.canceled() {
            let before = solve;
            (dv, solve) = minimise(&potential, &setup.implicit);
            solve.iterations += before.iterations;
            solve.inner_iterations += before.inner_iterations;
            solve.halvings += before.halvings;
            (_, impulses) = potential.energy_and_forces(&dv);
        }
        if control.canceled() {
            return Attempt::Canceled;
        }
        let velocities = potential.velocities(&dv);
        let Discretisation { topology, state, boundary, .. } = &step;
        let reactions = boundary.reactions(setup, topology.interpolation.shape.share, &impulses);
        let (after, moves) = grid_to_particles(setup, topology, state, bodies, &velocities, dt);
        let id = |p: usize| topology.order[p] as usize;
        if moves.lost.is_some() || moves.farthest_dx > FARTHEST_DX {
            return Attempt::TooLong(moves.lost.map(id));
        }
        if let Some(p) = moves.outside {
            return Attempt::Outside(id(p));
        }
        let mut particles = self.particles.clone();
        after.store(topology, &mut particles);
        (solve.time_s, solve.dt_s) = (self.time_s + dt, dt);
        Attempt::Done(Box::new(Step { particles, reactions, solve }))
    }

    fn lost(&self, particle: usize) -> EngineError {
        let (p, setup) = (&self.particles, &self.setup);
        let body = p.body[particle] as usize;
        let speed_m_s = p.v[particle].iter().map(|c| c * c).sum::<f64>().sqrt();
        let cause = likely_cause(setup, &Suspect { body, f: p.f[particle], speed_m_s });
        let name = &setup.bodies[body].name;
        let what = format!("particle {particle} (body \"{name}\") is no longer finite; likely cause: {cause}");
        EngineError::Diverged { step: self.step, time_s: self.time_s, what }
    }
}

impl Engine for ImplicitEngine {
    fn backend(&self) -> &Backend {
        &self.backend
    }

    fn advance_frame(&mut self, frame_s: f64, control: &dyn Control) -> Result<FrameStats, EngineError> {
        let start_s = self.time_s;
        let mut impulses = vec![Reaction::default(); reaction::surfaces(&self.setup)];
        let mut solves = Vec::new();
        if self.particles.is_empty() {
            // Sources that have not opened yet.
            self.time_s += frame_s;
            return Ok(FrameStats::default());
        }
        let mut gone_s = 0.0;
        let mut longest_s = f64::INFINITY;
        while gone_s < frame_s {
            if control.canceled() {
                return Err(EngineError::Canceled);
            }
            let remaining_s = frame_s - gone_s;
            let dt = next_dt_s(&self.setup, max_speed_m_s(&self.particles), remaining_s).min(longest_s);
            match self.attempt(dt, control) {
                Attempt::Done(step) => {
                    self.particles = step.particles;
                    reaction::add_all(&mut impulses, &step.reactions);
                    solves.push(step.solve);
                    self.step += 1;
                    // The last step ends the frame exactly.
                    gone_s = if dt == remaining_s { frame_s } else { gone_s + dt };
                    self.time_s = start_s + gone_s;
                    longest_s = f64::INFINITY;
                    control.progress(self.step, self.time_s);
                }
                Attempt::TooLong(_) if dt > MIN_DT_S => longest_s = 0.5 * dt,
                Attempt::TooLong(particle) => return Err(self.lost(particle.unwrap_or(0))),
                Attempt::Outside(particle) => {
                    let name = &self.setup.bodies[self.particles.body[particle] as usize].name;
                    let x = &self.particles.x[particle][..self.setup.dimension];
                    let what = format!("particle {particle} (body \"{name}\") leaves from {x:?} m");
                    return Err(EngineError::LeftDomain { step: self.step, time_s: self.time_s, what });
                }
                Attempt::Canceled => return Err(EngineError::Canceled),
            }
        }
        let steps = solves.len() as u64;
        let reactions = impulses.iter().map(|j| j.times(1.0 / frame_s)).collect();
        Ok(FrameStats { steps, dt_s: frame_s / steps as f64, isolated_reset: 0, reactions, solves })
    }

    fn append(&mut self, particles: Particles) -> Result<(), EngineError> {
        self.particles.append(particles);
        Ok(())
    }

    fn snapshot(&mut self) -> Result<Particles, EngineError> {
        Ok(self.particles.clone())
    }
}
