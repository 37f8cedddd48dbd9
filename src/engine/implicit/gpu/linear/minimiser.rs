//! The minimisation of a step: Newton's method, or L-BFGS around one V-cycle (HOT algorithm 3), where
//! the device decides and the host reads one small state per iteration.

use super::hierarchy::Hierarchy;
use super::layout::{self, ACCEPTED, BROKEN, DROPPED, INDEFINITE};
use super::lbfgs::Lbfgs;
use super::newton::{self, Newton};
use crate::contract::{EngineError, Solve};
use crate::gpu::program::{Dispatches, Programs, Tools};
use crate::gpu::{Gpu, Variant};
use crate::implicit::gpu::interface::{Evaluate, System};
use crate::implicit::solver::policy::{Lifetime, Model, Progress, Retreat, Rules};
use gridfall_core::sim::settings::{Implicit, Method};
use gridfall_core::sim::setup::Kernel;

/// Tries of the line search that are recorded at once: nearly always the first succeeds.
const TRIES: u32 = 2;
/// Halvings before a direction is given up: 2⁻²⁴ of it is below rounding.
const MAX_HALVINGS: u32 = 24;
/// Part of E that is rounding of its sum.
const NOISE: f64 = 32.0 * f32::EPSILON as f64;
/// More than any spectrum of a block-scaled matrix needs.
const MAX_STRETCH: f32 = 256.0;

/// Minimises the objectives of one scene's steps, and keeps its device memory from one to the next.
pub struct Minimiser {
    programs: Programs,
    settings: Implicit,
    hierarchy: Option<Hierarchy>,
    lbfgs: Option<Lbfgs>,
    newton: Option<Newton>,
}

impl Minimiser {
    pub fn new(kernel: Kernel, settings: Implicit) -> Self {
        let programs = Programs::new(Variant::of_kernel(kernel));
        Self { programs, settings, hierarchy: None, lbfgs: None, newton: None }
    }

    /// From `system.dv` to the minimum, there. The engine fills in time and length of the step. The
    /// residual is infinite if the objective is not finite at the start. Where rounding keeps the
    /// residual above the tolerance, the result says so: not converged, and the residual that was
    /// reached.
    ///
    /// Errors: [`EngineError::Capacity`] when the hierarchy does not fit the device,
    /// [`EngineError::DeviceLost`].
    pub fn minimise(&mut self, gpu: &Gpu, system: &System, evaluate: &dyn Evaluate) -> Result<Solve, EngineError> {
        let mut solve = Solve { levels: 1, ..Solve::default() };
        if system.rows == 0 {
            solve.converged = true;
            return Ok(solve);
        }
        let tools = Tools { gpu, programs: &self.programs };
        let spare = self.hierarchy.take();
        let hierarchy = self.hierarchy.insert(Hierarchy::new(tools, system, &self.settings, spare)?);
        if self.settings.method == Method::Newton {
            let newton = match self.newton.take() {
                Some(old) if old.stride == system.stride => old,
                _ => Newton::new(tools, system.stride)?,
            };
            let newton = self.newton.insert(newton);
            newton::Run { tools, system, evaluate, hierarchy, newton }.solve(&self.settings, &mut solve)?;
            return Ok(solve);
        }
        let mut lbfgs = match self.lbfgs.take() {
            Some(old) if old.stride == system.stride => old,
            _ => Lbfgs::new(gpu, system.stride)?,
        };
        lbfgs.clear();
        let mut run = Run { tools, system, evaluate, hierarchy, lbfgs };
        let outcome = run.descend(&self.settings, &mut solve);
        self.lbfgs = Some(run.lbfgs);
        outcome?;
        Ok(solve)
    }
}

/// One minimisation.
struct Run<'a> {
    tools: Tools<'a>,
    system: &'a System,
    evaluate: &'a dyn Evaluate,
    hierarchy: &'a Hierarchy,
    lbfgs: Lbfgs,
}

impl Run<'_> {
    fn descend(&mut self, settings: &Implicit, solve: &mut Solve) -> Result<(), EngineError> {
        let residual = |state: &layout::State| (f64::from(state.residual2) / f64::from(self.system.rows)).sqrt();
        let energy = |state: &layout::State| f64::from(state.energy[0]) + f64::from(state.energy[1]);
        solve.levels = self.hierarchy.levels.len() as u32;
        solve.nonzeros = u64::from(self.hierarchy.nonzeros);
        let mut at = self.start()?;
        if at.flags & BROKEN != 0 {
            solve.residual = f64::INFINITY;
            return Ok(());
        }
        solve.residual = residual(&at);
        let mut progress = Progress::new(NOISE, solve.residual);
        // Unlike the CPU, a failed line search strengthens the smoothers without a rebuild first.
        let (tolerance, rebuild) = (settings.tolerance(), settings.rebuild);
        let mut lifetime = Lifetime::new(Rules { tolerance, with_age: rebuild, after_failure: false });
        let mut stretch = 1.0;
        loop {
            solve.converged = solve.residual <= tolerance;
            if solve.converged || solve.iterations >= settings.max_iterations || progress.has_stalled() {
                return Ok(());
            }
            if let Model::New { forget } = lifetime.iterate(solve.residual) {
                self.rebuild()?;
                if forget {
                    self.lbfgs.clear();
                }
            }
            solve.iterations += 1;
            solve.inner_iterations += 1;
            let next = self.iterate()?;
            solve.halvings += next.halvings;
            if next.flags & ACCEPTED == 0 {
                match lifetime.retreat(self.lbfgs.clear(), next.flags & INDEFINITE == 0) {
                    Retreat::Forget => {}
                    Retreat::Rebuild => self.rebuild()?,
                    Retreat::Strengthen if stretch < MAX_STRETCH => {
                        stretch *= 2.0;
                        self.hierarchy.set_stretch(self.tools, stretch);
                        self.hierarchy.polynomials.submit(self.tools.gpu)?;
                    }
                    Retreat::Strengthen | Retreat::GiveUp => return Ok(()),
                }
                continue;
            }
            if next.flags & DROPPED == 0 {
                self.lbfgs.keep();
            }
            solve.residual = residual(&next);
            progress.note(energy(&at), energy(&next), solve.residual);
            at = next;
        }
    }

    /// Evaluates at the start, with the matrices there.
    fn start(&self) -> Result<layout::State, EngineError> {
        let Tools { gpu, .. } = self.tools;
        self.evaluate_with_matrices(Some(&self.lbfgs.adopt(self.tools, self.system, self.hierarchy)))?;
        let (from, to) = (self.system.get("gradient"), self.lbfgs.get("g"));
        gpu.submit(|encoder| encoder.copy_buffer_to_buffer(from, 0, to, 0, None));
        self.state()
    }

    /// Rebuilds the matrices where the minimisation stands.
    fn rebuild(&self) -> Result<(), EngineError> {
        self.evaluate_with_matrices(None)
    }

    fn evaluate_with_matrices(&self, then: Option<&Dispatches>) -> Result<(), EngineError> {
        let (gpu, system) = (self.tools.gpu, self.system);
        system.memory.write(gpu, "control", 0, &[0u32; 4]);
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        encoder.copy_buffer_to_buffer(system.get("dv"), 0, system.get("trial"), 0, None);
        {
            let mut pass = encoder.begin_compute_pass(&Default::default());
            self.evaluate.record(&mut pass);
            self.evaluate.record_hessian(&mut pass);
            self.hierarchy.matrices.record(&mut pass);
            if let Some(program) = then {
                program.record(&mut pass);
            }
        }
        gpu.queue.submit([encoder.finish()]);
        gpu.check()?;
        self.hierarchy.invert_coarsest(gpu)
    }

    /// A direction, a line search along it, and the step.
    fn iterate(&self) -> Result<layout::State, EngineError> {
        let (tools, system, hierarchy, lbfgs) = (self.tools, self.system, self.hierarchy, &self.lbfgs);
        let finest = &hierarchy.levels[0];
        let attempt = lbfgs.attempt(tools, system, hierarchy);
        let judge = lbfgs.judge(tools, system, hierarchy);
        let step = lbfgs.step(tools, system, finest);
        let mut backward = Some(lbfgs.backward(tools, finest));
        let turn = lbfgs.forward(tools, system, hierarchy);
        loop {
            let mut encoder = tools.gpu.device.create_command_encoder(&Default::default());
            {
                let mut pass = encoder.begin_compute_pass(&Default::default());
                if let Some(backward) = backward.take() {
                    backward.record(&mut pass);
                    hierarchy.cycle.record(&mut pass);
                    turn.record(&mut pass);
                }
                for _ in 0..TRIES {
                    attempt.record(&mut pass);
                    self.evaluate.record(&mut pass);
                    judge.record(&mut pass);
                }
                step.record(&mut pass);
            }
            tools.gpu.queue.submit([encoder.finish()]);
            let state = self.state()?;
            if state.flags & (ACCEPTED | INDEFINITE) != 0 || state.halvings >= MAX_HALVINGS {
                return Ok(state);
            }
        }
    }

    fn state(&self) -> Result<layout::State, EngineError> {
        self.lbfgs.state(self.tools.gpu)
    }
}
