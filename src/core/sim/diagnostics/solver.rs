//! Diagnostics of implicit steps.

use super::Value;
use super::columns;
use crate::sim::stats::Solve;

columns! {
/// One step of the implicit integrator. The field names are the columns of the CSV, the keys of the
/// JSON and the fields of the protobuf.
SolverRow {
    /// Number of the step in the run, from 1.
    step: u64,
    /// Frame that the step belongs to.
    frame: u64,
    /// Simulated time at the step's end (s).
    time_s: f64,
    /// Length of the step (s).
    dt_s: f64,
    /// Outer iterations: Newton or quasi-Newton steps.
    iterations: u32,
    /// Iterations of the linear solvers inside the outer iterations; a V-cycle counts as one.
    inner_iterations: u32,
    /// What is left at the step's end, in the norm of the tolerance: the estimated error of the change
    /// of velocity relative to its size, or the residual in the characteristic norm (HOT §5.2). At
    /// most the tolerance when converged.
    residual: f64,
    /// Halvings of the line search.
    halvings: u32,
    /// Levels of the hierarchy; 1 without one.
    levels: u32,
    /// Non-zero blocks of the finest matrix; 0 without a matrix.
    nonzeros: u64,
    /// Whether the residual reached the tolerance.
    converged: bool,
}
}

impl SolverRow {
    /// The steps of a frame; `done` steps came before.
    pub fn of_frame(frame: u64, done: u64, solves: &[Solve]) -> Vec<Self> {
        let row = |(solve, step): (&Solve, u64)| Self {
            step,
            frame,
            time_s: solve.time_s,
            dt_s: solve.dt_s,
            iterations: solve.iterations,
            inner_iterations: solve.inner_iterations,
            residual: solve.residual,
            halvings: solve.halvings,
            levels: solve.levels,
            nonzeros: solve.nonzeros,
            converged: solve.converged,
        };
        solves.iter().zip(done + 1..).map(row).collect()
    }

    /// The header line of the CSV, without line end.
    pub fn csv_header() -> String {
        Self::COLUMNS.join(",")
    }

    /// The row as a line of CSV, without line end.
    pub fn csv(&self) -> String {
        self.values().map(Value::csv).join(",")
    }
}
