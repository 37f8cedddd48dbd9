//! Steps taken stage by stage.

use super::bookkeeping::{self, Bookkeeping};
use super::engine::GpuEngine;
use super::readback::{self, GridNode};
use super::segment::Course;
use crate::contract::{Engine, EngineError};
use gridfall_core::sim::particles::Particles;
use gridfall_core::sim::side;

/// Steps taken stage by stage, for comparison with the CPU engine's stages.
pub struct Staged<'a> {
    engine: &'a mut GpuEngine,
    dt_s: f64,
    /// Fused steps so far.
    steps: u64,
}

impl<'a> Staged<'a> {
    /// Transfers the particles to the grid; the nodes carry momentum.
    pub fn p2g(engine: &'a mut GpuEngine, dt_s: f64) -> Result<(Self, Vec<GridNode>), EngineError> {
        // Forces and motions of whole steps.
        engine.start(&Course::even(dt_s, u64::from(u32::MAX)));
        let staged = Self { engine, dt_s, steps: 0 };
        let nodes = staged.nodes(false)?;
        Ok((staged, nodes))
    }

    /// Takes a whole step, from one transfer to the grid to the next.
    pub fn g2p2g(&mut self) -> Result<(), EngineError> {
        self.engine.write_poses(self.steps, 1, self.dt_s, u64::MAX);
        self.engine.submit(self.engine.stages.step[self.side()].iter());
        self.steps += 1;
        self.check()
    }

    /// Blocks, bins and work after the last transfer to the grid.
    pub fn bookkeeping(&self) -> Result<Bookkeeping, EngineError> {
        let e = &self.engine;
        bookkeeping::read(&e.gpu, &e.buffers, &e.params, self.side())
    }

    /// Updates the grid; the nodes carry velocity.
    pub fn grid_update(&mut self) -> Result<Vec<GridNode>, EngineError> {
        self.engine.write_poses(self.steps, 1, self.dt_s, u64::MAX);
        self.engine.submit(self.engine.stages.frame_end[self.side()].iter().take(self.updated()));
        self.nodes(true)
    }

    /// Finishes the step.
    pub fn g2p(self) -> Result<Particles, EngineError> {
        self.engine.submit(self.engine.stages.frame_end[self.side()].iter().skip(self.updated()));
        self.check()?;
        self.engine.snapshot()
    }

    /// Dispatches of a frame's last step up to the updated grid.
    fn updated(&self) -> usize {
        1 + usize::from(side::layers(&self.engine.setup) > 1)
    }

    /// The side of the grid that was filled last.
    fn side(&self) -> usize {
        (self.steps % 2) as usize
    }

    fn check(&self) -> Result<(), EngineError> {
        let report = self.engine.read_report()?;
        if report.error != 0 {
            return Err(self.engine.failure(&report, self.dt_s));
        }
        Ok(())
    }

    fn nodes(&self, updated: bool) -> Result<Vec<GridNode>, EngineError> {
        let e = &self.engine;
        readback::nodes(&e.gpu, &e.buffers, &e.setup, &e.params, self.side(), updated)
    }
}
