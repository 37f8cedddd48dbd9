//! A run of equal steps on the device: submitted in chunks without reading back, until it ends or the device has a
//! reason to stop.

use std::collections::VecDeque;
use std::time::Instant;

use super::buffers::CHUNK_STEPS;
use super::engine::GpuEngine;
use super::layout::{self, Report};
use super::readback;
use super::stages::{Placed, Stages};
use super::table;
use crate::contract::{Control, EngineError};
use crate::gpu::program::{Dispatch, Tools};
use gridfall_core::sim::reaction::Reaction;
use gridfall_core::sim::setup::Setup;

/// A chunk of steps should take about this long, so that a cancel is heard soon.
const CHUNK_SECONDS: f64 = 0.1;

/// A run of equal steps.
#[derive(Clone, Copy, Debug)]
pub(super) struct Course {
    pub dt_s: f64,
    pub steps: u64,
    /// Time over which forces act before the first motion.
    pub first_kick_s: f64,
    /// Whether half a step's forces follow the last motion ([`Setup::is_staggered`]).
    pub staggered: bool,
    /// Whether more steps of the same length follow.
    pub part: bool,
}

impl Course {
    /// The first steps of a course, if they are not all. The rest begins with [`Self::of`] or this, its velocities
    /// behind by half a step.
    pub fn first(self, steps: u64) -> Self {
        if steps < self.steps { Self { steps, staggered: false, part: true, ..self } } else { self }
    }

    /// Steps of forces and motion, one after the other.
    pub fn even(dt_s: f64, steps: u64) -> Self {
        Self { dt_s, steps, first_kick_s: dt_s, staggered: false, part: false }
    }

    /// As frames have them. `ahead_s`: time by which velocities are ahead of positions at the start.
    pub fn of(setup: &Setup, dt_s: f64, steps: u64, ahead_s: f64) -> Self {
        match setup.is_staggered() {
            false => Self::even(dt_s, steps),
            true => Self { first_kick_s: 0.5 * dt_s - ahead_s, staggered: true, ..Self::even(dt_s, steps) },
        }
    }

    /// Passes over the grid: one a step, and one for the last forces.
    pub fn passes(&self) -> u64 {
        self.steps + u64::from(self.staggered)
    }
}

/// How a run of equal steps ended.
pub(super) struct Segment {
    /// Steps done.
    pub steps: u64,
    /// Time by which velocities are ahead of positions.
    pub ahead_s: f64,
    pub halt: u32,
    /// Impulses that surfaces took.
    pub impulses: Vec<Reaction>,
}

impl GpuEngine {
    /// Zeroes buffers, named as on a side.
    fn clear(&self, encoder: &mut wgpu::CommandEncoder, side: usize, names: &[&str]) {
        names.iter().for_each(|name| encoder.clear_buffer(self.memory().of_side(name, side), 0, None));
    }

    /// Full states → grid on side 0.
    pub(super) fn start(&mut self, course: &Course) {
        self.set_course(course);
        self.params.first_step = 0;
        self.write_params();
        self.write_poses(0, 1, course.dt_s, 0);
        self.write_report(&Report::frame_start());
        self.gpu.submit(|encoder| {
            self.clear(encoder, 0, &["table_in", "table_out", "grid_in", "grid_out", "bins", "reactions"]);
        });
        self.submit(self.stages.frame_start.iter());
    }

    /// Runs the steps of a course or fewer, until the device has a reason to stop.
    pub(super) fn run_segment(&mut self, course: &Course, control: &dyn Control) -> Result<Segment, EngineError> {
        let Course { dt_s, steps, staggered, .. } = *course;
        self.start(course);
        let mut done = 0;
        loop {
            self.run_passes(done, course, control)?;
            let report = self.read_report()?;
            done = u64::from(report.step);
            if report.error != 0 {
                return Err(self.failure(&report, dt_s));
            }
            if report.halt & layout::HALT_BLOCKS != 0 {
                self.grow(&report, (done % 2) as usize)?;
                if report.started != 0 {
                    self.write_report(&Report { halt: 0, wanted: 0, ..report });
                } else {
                    self.start(course);
                }
                continue;
            }
            if report.finished == 0 {
                // A guard asked for another plan: the pass at hand is complete on the grid, so
                // bring it home as it is. If frames are staggered, forces have then acted for a
                // whole step where half of one was due, unless it was the last pass anyway.
                self.write_report(&Report { halt: 0, ..report });
                self.write_poses(done, 1, dt_s, if staggered { done } else { done + 1 });
                self.submit(self.stages.frame_end[(done % 2) as usize].iter());
                let end = self.read_report()?;
                if end.error != 0 {
                    return Err(self.failure(&end, dt_s));
                }
                self.arrive(&end);
                let ahead_s = match () {
                    _ if !staggered => self.behind_s(course),
                    _ if done < steps => 0.5 * dt_s,
                    _ => 0.0,
                };
                let steps = done + u64::from(!staggered);
                return Ok(Segment { steps, ahead_s, halt: report.halt, impulses: self.impulses()? });
            }
            self.arrive(&report);
            let ahead_s = if staggered { 0.0 } else { self.behind_s(course) };
            return Ok(Segment { steps, ahead_s, halt: 0, impulses: self.impulses()? });
        }
    }

    /// Time by which velocities are ahead of positions, below 0, after a course that is not staggered where frames are.
    fn behind_s(&self, course: &Course) -> f64 {
        if self.setup.is_staggered() { -0.5 * course.dt_s } else { 0.0 }
    }

    fn impulses(&self) -> Result<Vec<Reaction>, EngineError> {
        readback::reactions(&self.gpu, &self.buffers, &self.params)
    }

    /// Submits the passes of a course from `done` on, at most two chunks ahead of the device, and
    /// nothing is read back. A cancel is heard once these are done.
    fn run_passes(&mut self, done: u64, course: &Course, control: &dyn Control) -> Result<(), EngineError> {
        let (dt_s, total) = (course.dt_s, course.passes());
        let mut in_flight: VecDeque<(wgpu::SubmissionIndex, usize)> = VecDeque::new();
        let mut next = done;
        let mut completed = done;
        let mut finished = Instant::now();
        while next < total {
            if control.canceled() {
                self.gpu.wait(None)?;
                return Err(EngineError::Canceled);
            }
            let count = self.chunk.min((total - next) as usize);
            self.write_poses(next, count, dt_s, course.steps);
            let submission = self.submit((next..next + count as u64).flat_map(|k| self.stages_of(k, total)));
            next += count as u64;
            in_flight.push_back((submission, count));
            // One at a time where a step alone may take so long: nobody knows before the first.
            while in_flight.len() > usize::from(self.chunk > 1) {
                let (oldest, count) = in_flight.pop_front().expect("some are in flight");
                self.gpu.wait(Some(oldest))?;
                let per_step = finished.elapsed().as_secs_f64() / count as f64;
                finished = Instant::now();
                self.chunk = ((CHUNK_SECONDS / per_step) as usize).clamp(1, 2 * self.chunk).min(CHUNK_STEPS);
                completed += count as u64;
                let moved = completed.min(course.steps);
                control.progress(self.steps + moved, self.time_s + moved as f64 * dt_s);
            }
        }
        Ok(())
    }

    /// The dispatches of pass `k` of `total`.
    pub(super) fn stages_of(&self, k: u64, total: u64) -> impl Iterator<Item = &Dispatch<Placed>> {
        let lists = if k + 1 == total { &self.stages.frame_end } else { &self.stages.step };
        lists[(k % 2) as usize].iter()
    }

    fn grow(&mut self, report: &Report, side: usize) -> Result<(), EngineError> {
        let old = self.buffers.counts.capacity;
        let mut capacity = (report.needed as usize * 5 / 4 + 64).max(old * 3 / 2);
        let blocks: Vec<u32> = self.gpu.read(self.memory().of_side("blocks_in", side), report.blocks as usize)?;
        let table = loop {
            match table::of_blocks(&blocks, capacity) {
                Some(table) => break table,
                None => capacity *= 2,
            }
        };
        self.buffers.grow(&self.gpu, capacity, side)?;
        self.params.capacity = capacity as u32;
        self.params.table_shift = table::shift(capacity);
        self.write_params();
        let tools = Tools { gpu: &self.gpu, programs: &self.programs };
        self.stages = Stages::new(tools, &self.buffers.memory, &self.setup);
        // The interrupted activation left claims without slots.
        self.gpu.submit(|encoder| self.clear(encoder, side, &["table_out"]));
        self.gpu.queue.write_buffer(self.memory().of_side("table_in", side), 0, bytemuck::cast_slice(&table));
        tracing::debug!(old, capacity, "grid grown");
        Ok(())
    }
}
