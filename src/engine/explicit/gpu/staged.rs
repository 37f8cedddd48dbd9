//! A step taken stage by stage.

use super::engine::GpuEngine;
use super::layout;
use super::readback::{self, GridNode};
use crate::contract::{Engine, EngineError};
use gridfall_core::sim::particles::Particles;

/// Dispatches of a frame's last step up to the updated grid.
const UPDATED: usize = 2;

/// One step taken stage by stage, for comparison with the CPU engine's stages.
pub struct Staged<'a> {
    engine: &'a mut GpuEngine,
    dt_s: f64,
}

impl<'a> Staged<'a> {
    /// Transfers the particles to the grid; the nodes carry momentum.
    pub fn p2g(engine: &'a mut GpuEngine, dt_s: f64) -> Result<(Self, Vec<GridNode>), EngineError> {
        engine.start(dt_s);
        let staged = Self { engine, dt_s };
        let nodes = staged.nodes(false)?;
        Ok((staged, nodes))
    }

    /// Updates the grid; the nodes carry velocity.
    pub fn grid_update(&mut self) -> Result<Vec<GridNode>, EngineError> {
        self.engine.write_poses(0, 1, self.dt_s);
        self.engine.submit(self.engine.stages.frame_end[0].iter().take(UPDATED));
        self.nodes(true)
    }

    /// Finishes the step.
    pub fn g2p(self) -> Result<Particles, EngineError> {
        self.engine.submit(self.engine.stages.frame_end[0].iter().skip(UPDATED));
        let report = self.engine.read_report()?;
        if report.halt & layout::HALT_ERROR != 0 {
            return Err(self.engine.failure(&report, self.dt_s));
        }
        self.engine.snapshot()
    }

    fn nodes(&self, updated: bool) -> Result<Vec<GridNode>, EngineError> {
        let e = &self.engine;
        readback::nodes(&e.gpu, &e.buffers, &e.setup, &e.params, 0, updated)
    }
}
