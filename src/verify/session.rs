//! A case in progress: its engine, its extent and its results.

use super::Scope;
use super::report::{Curve, Row, Rule};
use super::setup::Scheme;
use gridfall_core::sim::setup::{Kernel, Precision, Problem, Transfer};
use gridfall_engine::choice::Devices;
use gridfall_engine::explicit::cpu::CpuEngine;
use gridfall_engine::explicit::gpu::GpuEngine;
use gridfall_engine::{Engine, EngineError};

/// The engine that a case runs on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Target {
    /// In f64.
    Cpu,
    /// In f32, the only precision of the GPU.
    Gpu,
}

/// How much of a case to run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Extent {
    /// A few variants, coarse: seconds.
    Quick,
    /// Every documented variant: minutes.
    Full,
}

/// A case in progress.
pub struct Session<'a> {
    case: &'static str,
    devices: &'a Devices,
    pub target: Target,
    pub extent: Extent,
    log: &'a (dyn Fn(&str) + Sync),
    pub rows: Vec<Row>,
    pub curves: Vec<Curve>,
}

impl<'a> Session<'a> {
    pub(super) fn new(case: &'static str, target: Target, scope: Scope<'a>) -> Self {
        let Scope { devices, extent, log, .. } = scope;
        Self { case, devices, target, extent, log, rows: Vec::new(), curves: Vec::new() }
    }

    pub fn quick(&self) -> bool {
        self.extent == Extent::Quick
    }

    /// `quick` in a quick run, else `full`.
    pub fn pick<T>(&self, quick: T, full: T) -> T {
        if self.quick() { quick } else { full }
    }

    pub fn precision(&self) -> Precision {
        match self.target {
            Target::Cpu => Precision::F64,
            Target::Gpu => Precision::F32,
        }
    }

    /// `cpu` or `gpu`, for tolerances that depend on the target.
    pub fn on<T>(&self, cpu: T, gpu: T) -> T {
        match self.target {
            Target::Cpu => cpu,
            Target::Gpu => gpu,
        }
    }

    /// All schemes of the target in these dimensions, except the linear kernel, which has no stable
    /// step beside a node.
    pub fn schemes(&self, dimensions: &[usize]) -> Vec<Scheme> {
        let (kernels, transfers): (&[Kernel], &[Transfer]) = match self.target {
            Target::Cpu => {
                (&[Kernel::Quadratic, Kernel::Cubic, Kernel::Compact], &[Transfer::Pic, Transfer::Apic, Transfer::Mls])
            }
            Target::Gpu => (&[Kernel::Quadratic, Kernel::Compact], &[Transfer::Apic, Transfer::Mls]),
        };
        let mut schemes = Vec::new();
        for &dimension in dimensions.iter().filter(|&&d| self.target == Target::Cpu || d == 3) {
            for &kernel in kernels {
                schemes.extend(transfers.iter().map(|&transfer| Scheme { dimension, kernel, transfer }));
            }
        }
        schemes
    }

    /// An engine of the target with the problem loaded.
    pub fn engine(&self, problem: &Problem) -> Result<Box<dyn Engine>, EngineError> {
        match (self.target, self.devices.gpu()) {
            (Target::Cpu, _) => Ok(Box::new(CpuEngine::new(&problem.setup, problem.particles.clone())?)),
            (Target::Gpu, Some(gpu)) => Ok(Box::new(GpuEngine::new(
                gpu.clone(),
                &problem.setup,
                problem.particles.clone(),
                self.devices.reason(),
            )?)),
            (Target::Gpu, None) => Err(EngineError::NoDevice(self.devices.reason().into())),
        }
    }

    fn engine_name(&self) -> &'static str {
        match self.target {
            Target::Cpu => "cpu f64",
            Target::Gpu => "gpu f32",
        }
    }

    /// Reports a value. `tolerance` is a share of `expected` ([`Rule::Relative`]) or in its unit
    /// ([`Rule::Absolute`]).
    pub fn check(
        &mut self,
        variant: impl ToString,
        quantity: &str,
        unit: &'static str,
        (rule, expected, tolerance): (Rule, f64, f64),
        got: f64,
    ) {
        let pass = Row::holds(rule, expected, got, tolerance);
        let variant = variant.to_string();
        let mark = if pass { "ok" } else { "FAILS" };
        (self.log)(&format!("{} {} {variant}: {quantity} {got:.6e} {unit} {mark}", self.case, self.engine_name()));
        self.rows.push(Row {
            case: self.case,
            engine: self.engine_name(),
            variant,
            quantity: quantity.into(),
            unit,
            rule,
            expected,
            got,
            tolerance,
            pass,
            error: None,
        });
    }

    pub fn curve(&mut self, name: impl ToString, columns: Vec<(&str, Vec<f64>)>) {
        let columns = columns.into_iter().map(|(name, values)| (name.to_string(), values)).collect();
        let name = format!("{}-{}-{}", self.case, name.to_string().replace(' ', "-"), self.engine_name());
        self.curves.push(Curve { name: name.replace(' ', "-"), columns });
    }

    /// A simulation that ended in an error although none is expected.
    pub(super) fn failed(&mut self, error: &EngineError) {
        self.check("", "runs to its end", "", (Rule::AtLeast, 1.0, 0.0), f64::NAN);
        self.rows.last_mut().expect("just reported").error = Some(error.to_string());
    }
}
