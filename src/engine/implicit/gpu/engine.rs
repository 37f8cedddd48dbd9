//! Frames of an implicit simulation on the device: plan a step, sort, minimise, move the particles.

use std::sync::Arc;

use super::linear::Minimiser;
use super::step::{Moved, Stepper};
use crate::contract::{Backend, Control, Engine, EngineError, FrameStats, Solve};
use crate::gpu::device::Gpu;
use crate::implicit::step::FARTHEST_DX;
use crate::implicit::step::{MIN_DT_S, max_speed_m_s, next_dt_s};
use gridfall_core::sim::divergence::{Suspect, likely_cause};
use gridfall_core::sim::particles::Particles;
use gridfall_core::sim::reaction::{self, Reaction};
use gridfall_core::sim::settings::{CoarseSolve, Method};
use gridfall_core::sim::setup::{Axis, Setup};

/// Fewest cells along a periodic axis: no node may be its own neighbour's neighbour from both sides.
const LEAST_PERIOD: usize = 8;

/// An implicit simulation on a GPU.
pub struct GpuImplicitEngine {
    gpu: Arc<Gpu>,
    stepper: Stepper,
    minimiser: Minimiser,
    backend: Backend,
    time_s: f64,
    step: u64,
    /// Of the fastest particle (m/s).
    max_speed: f64,
}

/// Whether the engine can run a problem at all; the reason if not.
pub fn supports(setup: &Setup) -> Result<(), String> {
    crate::explicit::gpu::supports(setup)?;
    if setup.implicit.method != Method::Hot {
        return Err("the GPU engine has the implicit method hot".into());
    }
    if setup.implicit.coarse_solve != CoarseSolve::Fixed {
        return Err("the GPU engine has the coarse solve fixed".into());
    }
    if setup.materials.iter().any(|material| material.is_fluid()) {
        return Err("fluids are integrated explicitly".into());
    }
    let short = |a: usize| setup.axes[a] == Axis::Periodic && setup.cells[a] < LEAST_PERIOD;
    if (0..3).any(short) {
        return Err(format!("the GPU's implicit engine needs {LEAST_PERIOD} cells along a periodic axis"));
    }
    Ok(())
}

/// What came of a step.
enum Attempt {
    Done(Solve, Vec<Reaction>),
    /// A particle went too far, or is no longer finite (its id).
    TooLong(Option<usize>),
}

impl GpuImplicitEngine {
    /// Loads a problem at time 0. `reason` says why this device was chosen.
    ///
    /// Errors: unsupported scenes, capacity, a lost device.
    pub fn new(gpu: Arc<Gpu>, setup: &Setup, particles: Particles, reason: &str) -> Result<Self, EngineError> {
        supports(setup).map_err(EngineError::Unsupported)?;
        Ok(Self {
            backend: gpu.backend(reason),
            stepper: Stepper::new(gpu.clone(), setup, &particles)?,
            minimiser: Minimiser::new(setup.kernel, setup.implicit),
            gpu,
            time_s: 0.0,
            step: 0,
            max_speed: max_speed_m_s(&particles),
        })
    }

    /// A step of `dt` (s); `again`, of the same particles as the last, which was too long.
    fn attempt(&mut self, dt: f64, again: bool) -> Result<Attempt, EngineError> {
        self.stepper.begin(self.time_s, dt, again)?;
        self.stepper.avoid_forbidden_start()?;
        let mut solve = self.minimise()?;
        if self.stepper.revise()? {
            let before = solve;
            solve = self.minimise()?;
            solve.iterations += before.iterations;
            solve.inner_iterations += before.inner_iterations;
            solve.halvings += before.halvings;
        }
        (solve.time_s, solve.dt_s) = (self.time_s + dt, dt);
        let Moved { farthest_dx, max_speed_m_s, lost, outside, impulses } = self.stepper.finish()?;
        if lost.is_some() || farthest_dx > FARTHEST_DX {
            return Ok(Attempt::TooLong(lost));
        }
        if let Some(id) = outside {
            let what = format!("particle {id} (body \"{}\")", self.stepper.body_name(id));
            return Err(EngineError::LeftDomain { step: self.step, time_s: self.time_s, what });
        }
        self.max_speed = max_speed_m_s;
        Ok(Attempt::Done(solve, impulses))
    }

    fn minimise(&mut self) -> Result<Solve, EngineError> {
        self.minimiser.minimise(&self.gpu, self.stepper.equations(), &self.stepper)
    }

    /// `particle`: the one that is no longer finite; `None` if one moves too far however short the step.
    fn failure(&self, particle: Option<usize>) -> Result<EngineError, EngineError> {
        let what = match particle {
            Some(id) => {
                let (f, speed_m_s) = self.stepper.before(id)?;
                let body = self.stepper.body(id);
                let cause = likely_cause(&self.stepper.setup, &Suspect { body, f, speed_m_s });
                let name = self.stepper.body_name(id);
                format!(
                    "particle {id} (body \"{name}\") is no longer finite; likely cause, from the step's start: {cause}"
                )
            }
            None => {
                "a particle moves more than a cell in the shortest step; likely cause: speeds grew before bound".into()
            }
        };
        Ok(EngineError::Diverged { step: self.step, time_s: self.time_s, what })
    }
}

impl Engine for GpuImplicitEngine {
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
        let mut impulses = vec![Reaction::default(); reaction::surfaces(&self.stepper.setup)];
        let mut solves = Vec::new();
        let mut gone_s = 0.0;
        let mut longest_s = f64::INFINITY;
        while gone_s < frame_s {
            if control.canceled() {
                return Err(EngineError::Canceled);
            }
            let remaining_s = frame_s - gone_s;
            let dt = next_dt_s(&self.stepper.setup, self.max_speed, remaining_s).min(longest_s);
            match self.attempt(dt, longest_s.is_finite())? {
                Attempt::Done(solve, taken) => {
                    reaction::add_all(&mut impulses, &taken);
                    solves.push(solve);
                    self.step += 1;
                    // The last step ends the frame exactly.
                    gone_s = if dt == remaining_s { frame_s } else { gone_s + dt };
                    self.time_s = start_s + gone_s;
                    longest_s = f64::INFINITY;
                    control.progress(self.step, self.time_s);
                }
                Attempt::TooLong(_) if dt > MIN_DT_S => longest_s = 0.5 * dt,
                Attempt::TooLong(particle) => return Err(self.failure(particle)?),
            }
        }
        let steps = solves.len() as u64;
        let reactions = impulses.iter().map(|j| j.times(1.0 / frame_s)).collect();
        Ok(FrameStats { steps, dt_s: frame_s / steps as f64, isolated_reset: 0, reactions, solves })
    }

    fn append(&mut self, particles: Particles) -> Result<(), EngineError> {
        self.max_speed = self.max_speed.max(max_speed_m_s(&particles));
        self.stepper.append(&particles)
    }

    fn snapshot(&mut self) -> Result<Particles, EngineError> {
        self.stepper.snapshot()
    }
}
