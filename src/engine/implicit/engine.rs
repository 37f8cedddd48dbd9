//! Frames of an implicit simulation: plans a step, has the device try it, and keeps it or tries a
//! shorter one. Which device, only the [`Stepper`] knows.

use std::borrow::Cow;
use std::io::{Read, Write};

use super::step::{FARTHEST_DX, max_speed_m_s, next_dt_s};
use crate::contract::{Backend, Control, Engine, EngineError, FrameStats, Solve, StateError};
use crate::state::{get_one, put};
use gridfall_core::sim::divergence::{describe, worst};
use gridfall_core::sim::particles::Particles;
use gridfall_core::sim::reaction::{self, Reaction};
use gridfall_core::sim::setup::{Norm, Setup};
use gridfall_core::sim::timestep::MIN_IMPLICIT_STEP_S;

/// The stages of an implicit step on one device. A step is begun, minimised, perhaps revised and
/// minimised once more, and finished; then it is kept, or begun again with the same particles and a
/// shorter length.
pub(crate) trait Stepper {
    fn setup(&self) -> &Setup;

    /// Particles in the simulation.
    fn live(&self) -> usize;

    /// The longest step (s) that the device's numbers allow.
    fn longest_s(&self) -> f64 {
        f64::INFINITY
    }

    /// Starts a step of `dt_s` from `time_s`. `again`: with the particles of the last step, which
    /// was too long.
    fn begin(&mut self, time_s: f64, dt_s: f64, again: bool) -> Result<(), EngineError>;

    /// Minimises the step's objective. Time and length in the result are left to the caller.
    fn minimise(&mut self, control: &dyn Control) -> Result<Solve, EngineError>;

    /// After a first minimisation: releases nodes that separating surfaces pull back, and adds the
    /// friction that the others cause. Returns whether this changed the objective, so that it must
    /// be minimised once more.
    fn revise(&mut self) -> Result<bool, EngineError>;

    /// Moves the particles with the minimiser's velocities.
    fn finish(&mut self) -> Result<Moved, EngineError>;

    /// Makes the particles that [`Self::finish`] moved those that the next step starts from.
    fn keep(&mut self);

    /// Particles at the start of the last step that was begun and not kept.
    fn before(&self) -> Result<Cow<'_, Particles>, EngineError>;

    /// Adds particles behind those that are there.
    fn append(&mut self, particles: Particles) -> Result<(), EngineError>;

    /// Particles at the end of the last step that was kept.
    fn snapshot(&self) -> Result<Particles, EngineError>;

    /// Writes what the next step starts from.
    fn save(&self, to: &mut dyn Write) -> Result<(), StateError>;

    /// Takes over what was saved.
    fn restore(&mut self, from: &mut dyn Read) -> Result<(), StateError>;
}

/// What the particles did in a step.
#[derive(Clone, Debug)]
pub struct Moved {
    /// Largest distance of a particle (dx).
    pub farthest_dx: f64,
    /// Fastest particle (m/s).
    pub max_speed_m_s: f64,
    /// A particle, by id, that is no longer finite.
    pub lost: Option<usize>,
    /// A particle, by id, that left the domain.
    pub outside: Option<usize>,
    /// Impulses that surfaces took.
    pub impulses: Vec<Reaction>,
}

impl Moved {
    /// Whether the step must be tried again with half its length.
    fn is_too_long(&self) -> bool {
        self.lost.is_some() || self.farthest_dx > FARTHEST_DX
    }
}

/// A problem loaded on a device, integrated implicitly.
pub struct ImplicitEngine {
    backend: Backend,
    stepper: Box<dyn Stepper>,
    /// Of the fastest particle (m/s).
    max_speed_m_s: f64,
    step: u64,
    time_s: f64,
}

impl ImplicitEngine {
    /// At time 0, with the speed (m/s) of the fastest particle.
    pub(super) fn of(stepper: Box<dyn Stepper>, backend: Backend, max_speed_m_s: f64) -> Self {
        Self { backend, stepper, max_speed_m_s, step: 0, time_s: 0.0 }
    }

    /// The same engine, described as chosen for `reason`.
    pub fn because(mut self, reason: &str) -> Self {
        self.backend.reason = reason.into();
        self
    }

    /// The same engine at a later time than 0: what moves by the clock is where it is then.
    pub fn at(mut self, time_s: f64) -> Self {
        self.time_s = time_s;
        self
    }

    /// Tries a step of `dt` (s); for `again` see [`Stepper::begin`].
    fn attempt(&mut self, dt: f64, again: bool, control: &dyn Control) -> Result<(Solve, Moved), EngineError> {
        self.stepper.begin(self.time_s, dt, again)?;
        let mut solve = self.stepper.minimise(control)?;
        if self.stepper.revise()? && !control.canceled() {
            solve = both(&solve, self.stepper.minimise(control)?);
        }
        if control.canceled() {
            return Err(EngineError::Canceled);
        }
        (solve.time_s, solve.dt_s) = (self.time_s + dt, dt);
        Ok((solve, self.stepper.finish()?))
    }

    /// Fails if a particle, at its present speed, crosses more than a cell in the shortest step (s).
    /// The solve cannot be trusted to find out: it starts from a state that means nothing.
    fn refuse_too_fast(&self, dt: f64) -> Result<(), EngineError> {
        let (setup, shortest) = (self.stepper.setup(), dt <= MIN_IMPLICIT_STEP_S);
        let cells = self.max_speed_m_s * dt / setup.dx;
        if !shortest || cells <= FARTHEST_DX {
            return Ok(());
        }
        let particles = self.stepper.snapshot()?;
        let (who, speed_m_s, cause) = describe(setup, &particles, worst(&particles));
        let what = format!(
            "{who} moves at {speed_m_s:.3e} m/s, {cells:.1e} cells in the shortest step of {dt:.0e} s; \
             likely cause: {cause}"
        );
        Err(EngineError::Diverged { step: self.step, time_s: self.time_s, what })
    }

    /// A step that does not converge, however short.
    fn unsolved(&self, solve: &Solve) -> EngineError {
        let tolerance = self.stepper.setup().implicit.tolerance();
        let what = format!(
            "the shortest step of {:.0e} s still has an error of {:.1e} of its change of velocity after {} iterations, \
             where the tolerance is {tolerance:.0e}; a larger `solver.implicit.tolerance`, or the integrator \
             `explicit`, may do",
            solve.dt_s, solve.residual, solve.iterations
        );
        EngineError::Diverged { step: self.step, time_s: self.time_s, what }
    }

    /// Why the run ends with a step in which particles did this.
    fn failure(&self, moved: &Moved) -> Result<EngineError, EngineError> {
        let (step, time_s, setup) = (self.step, self.time_s, self.stepper.setup());
        let particles = self.stepper.before()?;
        let named = |id: usize| format!("particle {id} (body \"{}\")", setup.bodies[particles.body[id] as usize].name);
        if moved.is_too_long() {
            let what = match moved.lost {
                Some(id) => {
                    let (who, _, cause) = describe(setup, &particles, id);
                    format!("{who} is no longer finite; likely cause, from the step's start: {cause}")
                }
                None => {
                    let (who, speed_m_s, cause) = describe(setup, &particles, worst(&particles));
                    format!(
                        "a particle moves more than a cell in the shortest step; the fastest at its start is {who} \
                         at {speed_m_s:.3e} m/s; likely cause: speeds grew without bound, or {cause}"
                    )
                }
            };
            return Ok(EngineError::Diverged { step, time_s, what });
        }
        let id = moved.outside.expect("a step that is neither too long nor leads outside is kept");
        let what = format!("{} leaves from {:?} m", named(id), &particles.x[id][..setup.dimension]);
        Ok(EngineError::LeftDomain { step, time_s, what })
    }
}

/// The solve of a step that was minimised twice: the second, with the effort of both.
fn both(first: &Solve, second: Solve) -> Solve {
    Solve {
        iterations: first.iterations + second.iterations,
        inner_iterations: first.inner_iterations + second.inner_iterations,
        halvings: first.halvings + second.halvings,
        ..second
    }
}

impl Engine for ImplicitEngine {
    fn backend(&self) -> &Backend {
        &self.backend
    }

    fn advance_frame(&mut self, frame_s: f64, control: &dyn Control) -> Result<FrameStats, EngineError> {
        if self.stepper.live() == 0 {
            // Sources that have not opened yet.
            self.time_s += frame_s;
            return Ok(FrameStats::default());
        }
        let start_s = self.time_s;
        let mut impulses = vec![Reaction::default(); reaction::surfaces(self.stepper.setup())];
        let mut solves = Vec::new();
        let mut gone_s = 0.0;
        let mut longest_s = f64::INFINITY;
        while gone_s < frame_s {
            if control.canceled() {
                return Err(EngineError::Canceled);
            }
            let remaining_s = frame_s - gone_s;
            let dt = next_dt_s(self.stepper.setup(), self.max_speed_m_s, remaining_s, self.stepper.longest_s())
                .min(longest_s);
            if longest_s.is_infinite() {
                self.refuse_too_fast(dt)?;
            }
            let (solve, moved) = self.attempt(dt, longest_s.is_finite(), control)?;
            let unsolved = !solve.converged && self.stepper.setup().implicit.norm() == Norm::Error;
            if (moved.is_too_long() || unsolved) && dt > MIN_IMPLICIT_STEP_S {
                longest_s = 0.5 * dt;
                continue;
            }
            if moved.is_too_long() || moved.outside.is_some() {
                return Err(self.failure(&moved)?);
            }
            if unsolved {
                return Err(self.unsolved(&solve));
            }
            self.stepper.keep();
            self.max_speed_m_s = moved.max_speed_m_s;
            reaction::add_all(&mut impulses, &moved.impulses);
            solves.push(solve);
            self.step += 1;
            // The last step ends the frame exactly.
            gone_s = if dt == remaining_s { frame_s } else { gone_s + dt };
            self.time_s = start_s + gone_s;
            longest_s = f64::INFINITY;
            control.progress(self.step, self.time_s);
        }
        let steps = solves.len() as u64;
        let reactions = impulses.iter().map(|j| j.times(1.0 / frame_s)).collect();
        Ok(FrameStats { steps, dt_s: frame_s / steps as f64, isolated_reset: 0, reactions, solves })
    }

    fn append(&mut self, particles: Particles) -> Result<(), EngineError> {
        self.max_speed_m_s = self.max_speed_m_s.max(max_speed_m_s(&particles));
        self.stepper.append(particles)
    }

    fn snapshot(&mut self) -> Result<Particles, EngineError> {
        self.stepper.snapshot()
    }

    fn save(&mut self, to: &mut dyn Write) -> Result<(), StateError> {
        put(to, &[self.step])?;
        put(to, &[self.time_s, self.max_speed_m_s])?;
        self.stepper.save(to)
    }

    fn restore(&mut self, from: &mut dyn Read) -> Result<(), StateError> {
        (self.step, self.time_s, self.max_speed_m_s) = (get_one(from)?, get_one(from)?, get_one(from)?);
        self.stepper.restore(from)
    }
}

#[cfg(test)]
mod tests;
