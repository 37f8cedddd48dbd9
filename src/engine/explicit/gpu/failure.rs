//! What a run that failed says of it.

use super::engine::GpuEngine;
use super::layout::{self, Report};
use super::readback;
use crate::contract::EngineError;
use gridfall_core::sim::divergence::describe;

impl GpuEngine {
    pub(super) fn failure(&self, report: &Report, dt_s: f64) -> EngineError {
        let step = self.steps + u64::from(report.step);
        let time_s = self.time_s + f64::from(report.step) * dt_s;
        let id = report.error_particle as usize;
        let (who, cause) = self.suspect(id).unwrap_or_default();
        if report.error & layout::ERROR_DOMAIN != 0 && report.error & layout::ERROR_NAN == 0 {
            return EngineError::LeftDomain { step, time_s, what: who };
        }
        let fault = if report.error & layout::ERROR_NAN != 0 {
            "is no longer finite"
        } else if report.error & layout::ERROR_CFL != 0 {
            "moved more than a cell in one step"
        } else {
            return EngineError::Diverged {
                step,
                time_s,
                what: "a node's mass or momentum passed the fixed-point range; likely cause: speeds grew without bound"
                    .into(),
            };
        };
        EngineError::Diverged {
            step,
            time_s,
            what: format!("{who} {fault}; likely cause, from the frame's start: {cause}"),
        }
    }

    /// A particle's name, and what its state at the frame's start says about a failure.
    fn suspect(&self, id: usize) -> Option<(String, String)> {
        let p = readback::particles(&self.gpu, &self.buffers, &self.layout).ok()?;
        let (who, _, cause) = (id < p.len()).then(|| describe(&self.setup, &p, id))?;
        Some((who, cause))
    }
}
