//! Newton's method for bodies that turn, on the device; twin of `crate::implicit::solver::turning`.
//! The host decides, and reads a few numbers after every iteration of the linear solve.

use wgpu::Buffer;

use super::hierarchy::Hierarchy;
use super::layout::{BROKEN, Cg, State};
use super::stages::{ADOPT, ATTEMPT, CG_MEASURE, CG_START, CG_STEP, Stage, append};
use crate::contract::{EngineError, Solve};
use crate::gpu::memory::{Memory, Scope, storage};
use crate::gpu::program::{Dispatches, Tools};
use crate::implicit::gpu::interface::{Evaluate, System, sizes};
use crate::implicit::gpu::layout::Tangent;
use crate::implicit::solver::krylov;
use crate::implicit::solver::objective::Renewed;
use crate::implicit::solver::turning::{Aim, MAX_HALVINGS, MAX_ITERATIONS, REDUCTION, SLOPE, UNFELT};
use gridfall_core::sim::settings::Implicit;

/// Relative error of Δv that rounding of F and of ∇E may leave in f32.
const ROUNDING: f64 = 1e-3;

/// Device memory of the method, for systems of one stride.
pub struct Newton {
    pub stride: u32,
    /// `step`, the direction s: Δv goes to Δv − α s; `p_in` and `p_out`, `ap`, `cg` and partial sums
    /// of conjugate gradients; `slopes`, `residuals` and `state` of the line search.
    memory: Memory,
}

impl Newton {
    /// Errors: [`EngineError::Capacity`] when a buffer does not fit the device.
    pub fn new(tools: Tools, stride: u32) -> Result<Self, EngineError> {
        let field = |name| storage(name, 12 * stride as usize);
        let buffers = vec![
            field("step"),
            field("p_in"),
            field("p_out"),
            field("ap"),
            storage("cg", size_of::<Cg>()),
            storage("products", 16 * 256),
            storage("weights", 4 * 256),
            storage("curvatures", 4 * (stride as usize).div_ceil(32)),
            storage("slopes", 1024),
            storage("residuals", 1024),
            storage("state", size_of::<State>()),
        ];
        Ok(Self { stride, memory: Memory::new(tools.gpu, &sizes(buffers, stride))? })
    }
}

/// One solve.
pub struct Run<'a> {
    pub tools: Tools<'a>,
    pub system: &'a System,
    pub evaluate: &'a dyn Evaluate,
    pub hierarchy: &'a Hierarchy,
    pub newton: &'a Newton,
}

impl Run<'_> {
    /// From `system.dv` to the solution, there; as [`super::Minimiser::minimise`].
    pub fn solve(&self, settings: &Implicit, solve: &mut Solve) -> Result<(), EngineError> {
        solve.levels = self.hierarchy.levels.len() as u32;
        solve.nonzeros = u64::from(self.hierarchy.nonzeros);
        let mut aim = Aim::new(settings, Some(ROUNDING));
        let mut at = self.build(Tangent::Turned)?;
        if at.flags & BROKEN != 0 {
            solve.residual = f64::INFINITY;
            return Ok(());
        }
        let mut is_new = true;
        let mut before = f64::INFINITY;
        loop {
            // The model of the iteration before tells whether its step was the last one.
            let mut cg = self.start()?;
            let error = self.error(&cg);
            let sharpness = self.evaluate.sharpness();
            let characteristic = || (f64::from(at.residual2) / f64::from(self.system.rows)).sqrt();
            (solve.residual, solve.converged) = aim.note(error, sharpness, characteristic);
            if solve.converged || solve.iterations >= MAX_ITERATIONS.min(settings.max_iterations) {
                return Ok(());
            }
            if !is_new {
                self.build(if error > before { Tangent::Turned } else { Tangent::Flowing })?;
                cg = self.start()?;
            }
            before = error;
            let left = aim.left(solve.iterations, sharpness);
            solve.iterations += 1;
            let (n, positive) = self.direction(cg, left)?;
            solve.inner_iterations += n;
            // Rounding has made the matrix indefinite: only a shorter step helps.
            if !positive {
                return Ok(());
            }
            let Some((found, halvings)) = self.search()? else { return Ok(()) };
            solve.halvings += halvings;
            at = found;
            let renewed = self.evaluate.renew()?;
            is_new = renewed == Renewed::Contacts;
            if is_new {
                at = self.build(Tangent::Flowing)?;
            } else if renewed == Renewed::Forces {
                at = self.evaluate_at(None)?;
            }
        }
    }

    /// The matrices where the iteration stands, and E and ∇E there.
    fn build(&self, tangent: Tangent) -> Result<State, EngineError> {
        self.evaluate.set_tangent(tangent);
        self.evaluate_at(Some(tangent))
    }

    /// E and ∇E at `dv`, with matrices if there is a tangent.
    fn evaluate_at(&self, tangent: Option<Tangent>) -> Result<State, EngineError> {
        let (gpu, system) = (self.tools.gpu, self.system);
        system.memory.write(gpu, "control", 0, &[0u32; 4]);
        let measure = self.along(ADOPT);
        gpu.submit(|encoder| {
            encoder.copy_buffer_to_buffer(system.get("dv"), 0, system.get("trial"), 0, None);
            let mut pass = encoder.begin_compute_pass(&Default::default());
            self.evaluate.record(&mut pass);
            if tangent.is_some() {
                self.evaluate.record_hessian(&mut pass);
                self.hierarchy.matrices.record(&mut pass);
            }
            measure.record(&mut pass);
        });
        gpu.check()?;
        if tangent.is_some() {
            self.hierarchy.invert_coarsest(gpu)?;
        }
        self.state()
    }

    /// Conjugate gradients before their first direction: z = V ∇E.
    fn start(&self) -> Result<Cg, EngineError> {
        let (start, measure) = (self.linear(CG_START, 0), self.linear(CG_MEASURE, 0));
        self.tools.gpu.pass(|pass| {
            start.record(pass);
            self.hierarchy.cycle.record(pass);
            measure.record(pass);
        });
        self.cg()
    }

    /// √(rᵀ V r) / ‖Δv‖: the error of Δv relative to its size.
    fn error(&self, cg: &Cg) -> f64 {
        match f64::from(cg.zr) {
            square if square > 0.0 => square.sqrt() / self.size(cg),
            0.0 => 0.0,
            _ => f64::INFINITY,
        }
    }

    /// ‖Δv − s‖ that errors are relative to (kg^½ m/s), at least what matters at all.
    fn size(&self, cg: &Cg) -> f64 {
        let [size2, mass, motion2] = [cg.size2, cg.mass, cg.motion2].map(f64::from);
        size2.sqrt().max(self.evaluate.fall_m_s() * mass.sqrt()).max(UNFELT * motion2.sqrt())
    }

    /// Solves A s = ∇E until the error of s is at most the part `left` of ‖Δv − s‖. Gives the iterations,
    /// and whether A and V were positive all the way.
    fn direction(&self, mut cg: Cg, left: f64) -> Result<(u32, bool), EngineError> {
        let gpu = self.tools.gpu;
        let first = f64::from(cg.zr);
        let measure = self.linear(CG_MEASURE, 0);
        let steps = [0, 1].map(|side| self.linear(CG_STEP, side));
        let mut iterations = 0;
        loop {
            let (zr, goal) = (f64::from(cg.zr), left * self.size(&cg));
            let is_done = zr <= REDUCTION * REDUCTION * first && zr <= goal * goal;
            if is_done || zr.is_nan() || zr <= 0.0 || iterations >= krylov::MAX_ITERATIONS {
                return Ok((iterations, zr >= 0.0));
            }
            gpu.pass(|pass| {
                steps[iterations as usize % 2].record(pass);
                self.hierarchy.cycle.record(pass);
                measure.record(pass);
            });
            cg = self.cg()?;
            if cg.pap.is_nan() || cg.pap <= 0.0 {
                return Ok((iterations, false));
            }
            iterations += 1;
        }
    }

    /// Goes along −s, as far as it reaches, and half of that, until ∇E along it is not too far uphill.
    /// Gives where it ends, and the halvings.
    fn search(&self) -> Result<Option<(State, u32)>, EngineError> {
        let (gpu, system, memory) = (self.tools.gpu, self.system, &self.newton.memory);
        gpu.submit(|encoder| {
            encoder.copy_buffer_to_buffer(memory.get("step"), 0, system.get("trial"), 0, None);
        });
        let mut alpha = self.evaluate.reach()?;
        let measure = self.along(ADOPT);
        gpu.pass(|pass| measure.record(pass));
        let slope = f64::from(self.state()?.slope);
        let attempt = self.along(ATTEMPT);
        for halvings in 0..=MAX_HALVINGS {
            memory.write(gpu, "state", 0, &[State { alpha: alpha as f32, ..State::default() }]);
            gpu.pass(|pass| {
                attempt.record(pass);
                self.evaluate.record(pass);
                measure.record(pass);
            });
            let state = self.state()?;
            if state.flags & BROKEN == 0 && f64::from(state.slope) >= -SLOPE * slope {
                gpu.submit(|encoder| {
                    encoder.copy_buffer_to_buffer(system.get("trial"), 0, system.get("dv"), 0, None);
                });
                return Ok(Some((state, halvings)));
            }
            alpha *= 0.5;
        }
        Ok(None)
    }

    fn state(&self) -> Result<State, EngineError> {
        Ok(self.newton.memory.read(self.tools.gpu, "state", 1)?[0])
    }

    fn cg(&self) -> Result<Cg, EngineError> {
        Ok(self.newton.memory.read(self.tools.gpu, "cg", 1)?[0])
    }

    /// Stages of conjugate gradients, with their directions as they are on a side.
    fn linear(&self, stages: &[Stage], side: usize) -> Dispatches {
        let finest = &self.hierarchy.levels[0];
        self.bound(stages, finest.x(self.hierarchy.result), side)
    }

    /// Stages that are about the direction s: `z` is what a line search goes along.
    fn along(&self, stages: &[Stage]) -> Dispatches {
        self.bound(stages, self.newton.memory.get("step"), 0)
    }

    fn bound(&self, stages: &[Stage], z: &Buffer, side: usize) -> Dispatches {
        let (finest, mut list) = (&self.hierarchy.levels[0], Dispatches::default());
        let scope = Scope::default().with("z", z).and_side(&self.newton.memory, side);
        append(&mut list, self.tools, stages, finest, &scope.and(&finest.memory).and(&self.system.memory));
        list
    }
}
