//! Frames: plan equal steps, run the stages, notice what goes wrong.

use std::io::{Read, Write};

use super::stages::{Moved, Stages, stages};
use crate::contract::{Backend, Control, Engine, EngineError, FrameStats, StateError};
use crate::state::{get_one, put};
use gridfall_core::sim::divergence;
use gridfall_core::sim::particles::Particles;
use gridfall_core::sim::reaction::{self, Reaction};
use gridfall_core::sim::setup::{Axis, Setup};
use gridfall_core::sim::side;
use gridfall_core::sim::timestep::{Extremes, REPLAN_DEMAND, SHRINK, StepPlan, plan_frame};

/// A problem loaded on the CPU.
pub struct CpuEngine {
    backend: Backend,
    setup: Setup,
    /// Whether particles have sides, see [`side`].
    sided: bool,
    stages: Box<dyn Stages>,
    particles: usize,
    step: u64,
    time_s: f64,
}

impl CpuEngine {
    /// Loads the problem at time 0. Errors: [`EngineError::Capacity`] beyond 2³² particles or 2²¹
    /// cells along an axis.
    pub fn new(setup: &Setup, particles: Particles) -> Result<Self, EngineError> {
        let total = setup.total_particles();
        if u32::try_from(total).is_err() {
            return Err(EngineError::Capacity(format!("{total} particles; this engine counts to 2^32 - 1")));
        }
        if let Some(cells) = setup.cells.iter().find(|&&cells| cells > 1 << 21) {
            return Err(EngineError::Capacity(format!("{cells} cells along an axis; this engine counts to 2^21")));
        }
        Ok(Self {
            backend: Backend::this_cpu("the CPU engine runs every scene"),
            setup: setup.clone(),
            sided: side::acts(setup),
            particles: particles.len(),
            stages: stages(setup, particles),
            step: 0,
            time_s: 0.0,
        })
    }

    /// The same engine, described as chosen for `reason`.
    pub fn because(mut self, reason: &str) -> Self {
        self.backend.reason = reason.into();
        self
    }

    /// Fails if the run cannot go on from the step just done.
    fn check(&self, moved: &Moved) -> Result<(), EngineError> {
        let (step, time_s) = (self.step, self.time_s);
        if moved.diverged {
            return Err(EngineError::Diverged { step, time_s, what: self.diverged() });
        }
        if moved.outside {
            return Err(EngineError::LeftDomain { step, time_s, what: self.outside() });
        }
        Ok(())
    }

    fn refuse_endless(&self, plan: &StepPlan) -> Result<(), EngineError> {
        let Some(reason) = plan.endless() else { return Ok(()) };
        let what = divergence::endless(&self.setup, &self.stages.particles(), &reason);
        Err(EngineError::Diverged { step: self.step, time_s: self.time_s, what })
    }

    fn diverged(&self) -> String {
        let p = self.stages.particles();
        let (who, speed_m_s, cause) = divergence::describe(&self.setup, &p, divergence::worst(&p));
        let fault = if speed_m_s.is_finite() {
            format!("moved a whole cell in one step at {speed_m_s:.3e} m/s")
        } else {
            "has a velocity that is not a number".into()
        };
        format!("{who} {fault}; likely cause: {cause}")
    }

    fn outside(&self) -> String {
        let (p, setup) = (self.stages.particles(), &self.setup);
        let out = |i: usize, a: usize| {
            let x = (p.x[i][a] - setup.origin[a]) / setup.dx;
            matches!(setup.axes[a], Axis::Walls(_)) && !(-1.0..=setup.cells[a] as f64 + 1.0).contains(&x)
        };
        let i = (0..p.len()).find(|&i| (0..setup.dimension).any(|a| out(i, a))).unwrap_or(0);
        let body = &setup.bodies[p.body[i] as usize].name;
        format!("particle {i} (body \"{body}\") is at {:?} m", &p.x[i][..setup.dimension])
    }
}

impl Engine for CpuEngine {
    fn backend(&self) -> &Backend {
        &self.backend
    }

    fn advance_frame(&mut self, frame_s: f64, control: &dyn Control) -> Result<FrameStats, EngineError> {
        if self.particles == 0 {
            // Sources that have not opened yet.
            self.time_s += frame_s;
            return Ok(FrameStats::default());
        }
        let (start_s, first_step) = (self.time_s, self.step);
        self.stages.start_frame();
        let extremes = self.stages.extremes();
        let mut plan = plan_frame(&self.setup, &extremes, frame_s);
        self.refuse_endless(&plan)?;
        let mut isolated_reset = 0;
        let mut from_s = start_s;
        let mut done = 0;
        let mut impulses = vec![Reaction::default(); reaction::surfaces(&self.setup)];
        let staggered = self.setup.is_staggered();
        let sided = self.sided;
        // Steps until particles are asked again which side of plates they are on.
        let mut until_asked = side::steps_between(&self.setup, extremes.node_speed_m_s, plan.dt_s);
        // The time over which forces act before the coming motion.
        let mut kick_s = if staggered { 0.5 * plan.dt_s } else { plan.dt_s };
        self.stages.p2g(kick_s);
        loop {
            if control.canceled() {
                return Err(EngineError::Canceled);
            }
            reaction::add_all(&mut impulses, &self.stages.grid_update(kick_s, self.time_s, plan.dt_s));
            done += 1;
            let last = done == plan.steps;
            kick_s = if last && staggered { 0.5 * plan.dt_s } else { plan.dt_s };
            until_asked = until_asked.saturating_sub(1);
            let part = sided && !last && until_asked == 0;
            let moved = match () {
                _ if last && !staggered => self.stages.g2p(plan.dt_s),
                _ if part => self.stages.end_part(plan.dt_s),
                _ => self.stages.g2p2g(plan.dt_s, kick_s),
            };
            self.step += 1;
            self.time_s = if last { start_s + frame_s } else { from_s + done as f64 * plan.dt_s };
            self.check(&moved)?;
            control.progress(self.step, self.time_s);
            isolated_reset += moved.isolated;
            if last {
                if staggered {
                    if moved.strayed {
                        self.stages.bin();
                        self.stages.p2g(kick_s);
                    }
                    reaction::add_all(&mut impulses, &self.stages.grid_update(kick_s, self.time_s, 0.0));
                    let moved = self.stages.g2p(0.0);
                    self.check(&moved)?;
                    isolated_reset += moved.isolated;
                }
                break;
            }
            // Faster or stiffer than planned for: what remains of the frame in smaller equal steps.
            let too_long = moved.max_speed_m_s * plan.dt_s > self.setup.cfl * self.setup.dx
                || moved.growing
                || moved.demand_1_s2 * plan.dt_s * plan.dt_s > REPLAN_DEMAND;
            let asked = part || sided && too_long;
            let extremes = if too_long || asked { self.stages.extremes() } else { Extremes::default() };
            if too_long {
                from_s = self.time_s;
                let longest = plan_frame(&self.setup, &extremes, start_s + frame_s - from_s);
                let before_s = plan.dt_s;
                plan = longest.no_longer_than(SHRINK * before_s);
                self.refuse_endless(&plan)?;
                done = 0;
                kick_s = if staggered { 0.5 * (before_s + plan.dt_s) } else { plan.dt_s };
            }
            if asked {
                until_asked = side::steps_between(&self.setup, extremes.node_speed_m_s, plan.dt_s);
                // As the GPU does it: a part of the frame begins.
                self.stages.start_frame();
            } else if too_long || moved.strayed {
                self.stages.bin();
            }
            if asked || too_long || moved.strayed {
                self.stages.p2g(kick_s);
            }
        }
        let steps = self.step - first_step;
        let reactions = impulses.iter().map(|j| j.times(1.0 / frame_s)).collect();
        Ok(FrameStats { steps, dt_s: frame_s / steps as f64, isolated_reset, reactions, solves: Vec::new() })
    }

    fn append(&mut self, particles: Particles) -> Result<(), EngineError> {
        let mut all = self.stages.particles();
        all.append(particles);
        self.particles = all.len();
        self.stages.load(all);
        Ok(())
    }

    fn snapshot(&mut self) -> Result<Particles, EngineError> {
        Ok(self.stages.particles())
    }

    fn save(&mut self, to: &mut dyn Write) -> Result<(), StateError> {
        put(to, &[self.step])?;
        put(to, &[self.time_s])?;
        Ok(self.stages.save(to)?)
    }

    fn restore(&mut self, from: &mut dyn Read) -> Result<(), StateError> {
        (self.step, self.time_s) = (get_one(from)?, get_one(from)?);
        self.stages.restore(from)?;
        self.particles = self.stages.count();
        Ok(())
    }

    fn visit(&mut self, part: usize, take: &mut dyn FnMut(usize, Particles)) -> Result<(), EngineError> {
        let count = self.stages.count();
        for first in (0..count).step_by(part) {
            take(first, self.stages.read(first..count.min(first + part)));
        }
        Ok(())
    }
}
