//! What is recorded of a frame boundary: sums of all particles and states of chosen ones. Both are made on the device,
//! behind the frame's last stage. They come home while the next frame is computed, and become numbers of the scene on
//! the thread that wants them.

use std::sync::Arc;

use super::engine::GpuEngine;
use super::layout::{PART, PLAIN, RECORD};
use super::upload::DeviceLayout;
use crate::contract::{EngineError, Pending, View};
use crate::gpu::Gpu;
use crate::gpu::memory::{Arriving, Memory, Scope, Size, Sizes, storage};
use crate::gpu::program::{Dispatch, Tools, Workgroups};
use gridfall_core::sim::diagnostics::{Sums, Totals};
use gridfall_core::sim::excerpt::{Choice, Excerpt};

/// Programs that look at full states.
pub const PROGRAMS: [&str; 2] = ["explicit/measure", "explicit/select"];

/// Buffers and dispatches for views.
pub struct Viewer {
    sums: Memory,
    measure: Dispatch<()>,
    /// Of the last view.
    chosen: Vec<Chosen>,
}

/// A choice on the device.
struct Chosen {
    choice: Choice,
    memory: Memory,
    select: Dispatch<()>,
}

impl Chosen {
    fn is(&self, choice: &Choice) -> bool {
        Arc::ptr_eq(&self.choice.ids, &choice.ids) && self.choice.deformation == choice.deformation
    }
}

/// Numbers of a chosen particle.
fn record(choice: &Choice, layout: &DeviceLayout) -> usize {
    PLAIN + if choice.deformation { layout.channels } else { 0 }
}

fn memory(gpu: &Gpu, buffers: Vec<Size>, load: String) -> Result<Memory, EngineError> {
    Memory::new(gpu, &Sizes { buffers, load, remedy: "record fewer points" })
}

impl GpuEngine {
    /// Asks for the view of the last frame boundary.
    pub(super) fn ask(&mut self, choices: &[Choice]) -> Result<Pending, EngineError> {
        let mut viewer = match self.viewer.take() {
            Some(viewer) => viewer,
            None => self.viewer()?,
        };
        let mut known = std::mem::take(&mut viewer.chosen);
        for choice in choices {
            let at = known.iter().position(|chosen| chosen.is(choice));
            viewer.chosen.push(at.map_or_else(|| self.choose(choice), |at| Ok(known.swap_remove(at)))?);
        }
        let live = self.buffers.live;
        let present = |choice: &Choice| choice.ids.partition_point(|&id| (id as usize) < live);
        let parts = live.div_ceil(PART);
        self.write_params();
        self.gpu.pass(|pass| {
            viewer.measure.record(pass, Workgroups::Folded(parts));
            for Chosen { choice, select, .. } in &viewer.chosen {
                let groups = present(choice).div_ceil(self.gpu.workgroup as usize);
                select.record(pass, Workgroups::Folded(groups));
            }
        });
        let mass = self.population.iter().zip(&self.setup.bodies).map(|(&n, body)| n as f64 * body.mass).sum();
        let sums = self.gpu.request(viewer.sums.get("parts"), 0, (parts.max(1) * RECORD * 8) as u64);
        let records: Vec<_> = viewer
            .chosen
            .iter()
            .map(|Chosen { choice, memory, .. }| {
                let (count, size) = (present(choice), record(choice, &self.layout));
                let arriving = self.gpu.request(memory.get("records"), 0, (count.max(1) * size * 4) as u64);
                (choice.clone(), count, arriving)
            })
            .collect();
        self.viewer = Some(viewer);
        self.gpu.check()?;

        let (gpu, layout) = (self.gpu.clone(), self.layout.clone());
        let (origin, gravity, dx) = (self.setup.origin, self.setup.gravity, self.setup.dx);
        Ok(Pending::new(move || {
            let mut totals = Totals::default();
            totals.add_sums(origin, gravity, &Sums { mass, ..Sums::default() });
            sums.arrive(&gpu, |bytes| {
                let parts = bytes.chunks_exact(RECORD * 8).take(parts);
                parts.for_each(|part| totals.add_sums(origin, gravity, &sums_of(part, dx)));
            })?;
            let excerpt = |(choice, count, arriving): (Choice, usize, Arriving)| {
                arriving.arrive(&gpu, |bytes| excerpt(&choice, count, bytes, &layout))
            };
            Ok(View { totals, excerpts: records.into_iter().map(excerpt).collect::<Result<_, _>>()? })
        }))
    }

    fn viewer(&self) -> Result<Viewer, EngineError> {
        let particles = self.buffers.counts.particles;
        let parts = storage("parts", particles.div_ceil(PART) * RECORD * 8);
        let sums = memory(&self.gpu, vec![parts], format!("{particles} particles"))?;
        let measure = self.dispatch(PROGRAMS[0], &sums);
        Ok(Viewer { sums, measure, chosen: Vec::new() })
    }

    fn choose(&self, choice: &Choice) -> Result<Chosen, EngineError> {
        let (n, size) = (choice.ids.len(), record(choice, &self.layout));
        let buffers = vec![storage("chosen", (2 + n) * 4), storage("records", n.max(1) * size * 4)];
        let memory = memory(&self.gpu, buffers, format!("{n} points"))?;
        memory.write(&self.gpu, "chosen", 0, &[n as u32, (size - PLAIN) as u32]);
        memory.write(&self.gpu, "chosen", 2, &choice.ids);
        let select = self.dispatch(PROGRAMS[1], &memory);
        Ok(Chosen { choice: choice.clone(), memory, select })
    }

    fn dispatch(&self, program: &'static str, own: &Memory) -> Dispatch<()> {
        let tools = Tools { gpu: &self.gpu, programs: &self.programs };
        Dispatch::new(tools, (program, ()), &Scope::of(own).and(self.memory()))
    }
}

/// Values of four bytes.
fn words(bytes: &[u8]) -> impl Iterator<Item = u32> {
    bytes.chunks_exact(4).map(|word| u32::from_ne_bytes(word.try_into().expect("four bytes")))
}

/// A record of `measure` in the scene's units.
fn sums_of(record: &[u8], dx: f64) -> Sums {
    let values: Vec<f64> = words(record).map(|word| f64::from(f32::from_bits(word))).collect();
    let sum = |k: usize| values[2 * k] + values[2 * k + 1];
    Sums {
        mass: 0.0,
        momentum: [0, 1, 2].map(sum),
        spin: [3, 4, 5].map(|k| dx * sum(k)),
        kinetic: sum(6),
        affine: sum(7),
        strain: sum(8),
        gravity_work: dx * sum(9),
        max_speed2: values[20],
        min_j: values[21],
    }
}

/// The first `count` records of `select` in the scene's units.
fn excerpt(choice: &Choice, count: usize, bytes: &[u8], layout: &DeviceLayout) -> Excerpt {
    let size = record(choice, layout);
    let mut excerpt = Excerpt::of(choice);
    let mut values = vec![0; size];
    for bytes in bytes.chunks_exact(4 * size).take(count) {
        values.iter_mut().zip(words(bytes)).for_each(|(value, word)| *value = word);
        let real = |k: usize| f32::from_bits(values[k]);
        let body = values[7];
        excerpt.x.push(layout.scene_position([values[0], values[1], values[2], values[3]]));
        excerpt.v.push([4, 5, 6].map(|k| f64::from(real(k))));
        excerpt.body.push(body);
        if choice.deformation {
            let (f, plastic) = layout.scene_deformation(body, |k| real(PLAIN + k));
            excerpt.f.push(f);
            excerpt.plastic.push(plastic);
        }
    }
    excerpt
}
