//! Measurements on the device: time per stage from timestamps, and the copy bandwidth that speeds
//! are compared with.

use std::collections::BTreeMap;
use std::time::Instant;

use super::engine::GpuEngine;
use super::layout;
use super::segment::Course;
use super::stages::STEP;
use crate::contract::EngineError;
use crate::gpu::Gpu;

/// Steps that one profile takes at most: two timestamps a dispatch, 4096 in a query set.
const MAX_STEPS: u64 = 4096 / 2 / STEP.len() as u64 - 1;

/// GPU time of a run of steps.
#[derive(Clone, Debug, Default)]
pub struct Profile {
    pub steps: u64,
    /// Seconds in all steps together, by stage name.
    pub stage_s: BTreeMap<&'static str, f64>,
}

impl GpuEngine {
    /// Runs up to `steps` equal steps of `dt_s` with a timestamp around every dispatch, and brings
    /// the particles home. Where a guard asks for smaller steps it ends early, and the particles stay as they were.
    ///
    /// Passes are separate here, so that the sum is more than an ordinary run takes. `None` without
    /// timestamp support.
    pub fn profile(&mut self, steps: u64, dt_s: f64) -> Result<Option<Profile>, EngineError> {
        let gpu = self.gpu().clone();
        if !gpu.timestamps {
            return Ok(None);
        }
        let steps = steps.clamp(1, MAX_STEPS);
        let course = Course::of(&self.setup, dt_s, steps, 0.0);
        let passes = course.passes();
        self.start(&course);
        self.write_poses(0, passes as usize, dt_s, steps);
        let dispatches: Vec<_> = (0..passes).flat_map(|k| self.stages_of(k, passes)).collect();
        let queries = gpu.device.create_query_set(&wgpu::QuerySetDescriptor {
            label: Some("stages"),
            ty: wgpu::QueryType::Timestamp,
            count: 2 * dispatches.len() as u32,
        });
        let resolved = gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("timestamps"),
            size: 16 * dispatches.len() as u64,
            usage: wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC,
            mapped_at_creation: false,
        });
        gpu.submit(|encoder| {
            for (i, dispatch) in (0u32..).zip(&dispatches) {
                let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                    label: Some(dispatch.name()),
                    timestamp_writes: Some(wgpu::ComputePassTimestampWrites {
                        query_set: &queries,
                        beginning_of_pass_write_index: Some(2 * i),
                        end_of_pass_write_index: Some(2 * i + 1),
                    }),
                });
                self.record(&mut pass, dispatch);
            }
            encoder.resolve_query_set(&queries, 0..2 * dispatches.len() as u32, &resolved, 0);
        });
        let ticks: Vec<u64> = gpu.read(&resolved, 2 * dispatches.len())?;
        let stages: Vec<_> = dispatches.iter().map(|dispatch| dispatch.name()).collect();
        let report = self.read_report()?;
        let guarded = report.finished == 0 && report.error == 0 && report.halt & layout::HALT_BLOCKS == 0;
        let steps = if guarded { u64::from(report.step).max(1) } else { steps };
        if !guarded {
            self.settle(steps, dt_s)?;
        }
        let period_s = f64::from(gpu.queue.get_timestamp_period()) * 1e-9;
        let mut profile = Profile { steps, ..Profile::default() };
        for (pair, stage) in ticks.chunks_exact(2).zip(stages) {
            let name = stage.trim_start_matches("explicit/");
            *profile.stage_s.entry(name).or_default() += pair[1].saturating_sub(pair[0]) as f64 * period_s;
        }
        Ok(Some(profile))
    }
}

/// Bytes read and written a second by a large buffer copy, the best of a few.
pub fn copy_bandwidth(gpu: &Gpu) -> Result<f64, EngineError> {
    let bytes = gpu.limits.max_buffer_size.min(256 << 20);
    let buffer = |label| {
        gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(label),
            size: bytes,
            usage: wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        })
    };
    let (from, to) = (buffer("from"), buffer("to"));
    let repeats = 8;
    let mut best: f64 = 0.0;
    for _ in 0..4 {
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        (0..repeats).for_each(|_| encoder.copy_buffer_to_buffer(&from, 0, &to, 0, bytes));
        let commands = encoder.finish();
        gpu.wait(None)?;
        let begin = Instant::now();
        let submission = gpu.queue.submit([commands]);
        gpu.wait(Some(submission))?;
        best = best.max(2.0 * (repeats * bytes) as f64 / begin.elapsed().as_secs_f64());
    }
    Ok(best)
}
