//! The hierarchy of a step (HOT §5): coarse nodes, Galerkin matrices, smoothers, and the V-cycle over them.

use wgpu::Buffer;

use super::kernels::{Kernel, Program, Tools};
use super::lattice::Lattice;
use super::level::{Level, SLOT, buffer, slot};
use super::smoother::{self, Smoothing};
use crate::contract::EngineError;
use crate::explicit::gpu::readback::read;
use crate::implicit::gpu::interface::{System, slots};
use gridfall_core::sim::settings::Implicit;
use gridfall_core::sim::setup;

/// Nodes below which no further level is worth making.
const FEWEST_NODES: u32 = 16;

/// Levels, finest first, and what is done with them.
pub struct Hierarchy {
    pub levels: Vec<Level>,
    /// Blocks of the finest matrix.
    pub nonzeros: u32,
    /// Coarse matrices, inverse diagonals and spectra from the finest matrix.
    pub matrices: Program,
    /// The polynomials once more, after a change of `stretch`.
    pub polynomials: Program,
    /// The finest level's b → x.
    pub cycle: Program,
    /// Which of the finest level's x it is.
    pub result: usize,
    stretch: Buffer,
}

impl Hierarchy {
    /// Counts and links the nodes of every level, with one small read-back. `spare` is an older hierarchy, whose memory is taken over where it
    /// serves. The finest matrix is not looked at before [`Hierarchy::matrices`] runs.
    ///
    /// Errors: [`EngineError::Capacity`] when a level does not fit the device.
    pub fn new(tools: Tools, system: &System, settings: &Implicit, spare: Option<Self>) -> Result<Self, EngineError> {
        let gpu = tools.gpu;
        let (spare_levels, stretch) = match spare {
            Some(old) => (old.levels, old.stretch),
            None => (Vec::new(), buffer(gpu, "stretch", 16)),
        };
        let mut levels = tables(tools, system, settings.levels.max(1), spare_levels)?;
        let (rows, nonzeros) = count(tools, system, &levels)?;
        let enough = |l: &usize| rows[l - 1] <= FEWEST_NODES || rows[*l] == rows[l - 1];
        levels.truncate((1..levels.len()).find(enough).unwrap_or(levels.len()));
        let smoothing = Smoothing { kind: settings.smoother };
        let depth = levels.len();
        for (l, level) in levels.iter_mut().enumerate() {
            if l > 0 {
                level.make_room(gpu, system.kernel, rows[l])?;
            }
            (level.shape.degree, level.shape.range) = smoothing.polynomial(l + 1 == depth);
            level.upload(gpu);
        }
        link(tools, system, &levels)?;
        let (cycle, result) = v_cycle(tools, system, &levels, smoothing);
        let mut polynomials = Program::default();
        levels.iter().for_each(|level| smoother::polynomial(&mut polynomials, tools, level, &stretch));
        let matrices = matrices(tools, system, &levels, &stretch);
        let hierarchy = Self { levels, nonzeros, matrices, polynomials, cycle, result, stretch };
        hierarchy.set_stretch(tools, 1.0);
        Ok(hierarchy)
    }

    /// All spectra are taken for so much wider than they were found.
    pub fn set_stretch(&self, tools: Tools, stretch: f32) {
        tools.gpu.queue.write_buffer(&self.stretch, 0, bytemuck::bytes_of(&stretch));
    }
}

/// Levels with their tables, coarse ones without room for nodes yet.
fn tables(tools: Tools, system: &System, count: u32, spare: Vec<Level>) -> Result<Vec<Level>, EngineError> {
    let grids = if system.kernel == setup::Kernel::Quadratic { 1 } else { 2 };
    let mut lattice = Lattice::of(system, grids);
    let mut spare = spare.into_iter();
    let mut levels = vec![match spare.next() {
        Some(old) if old.shape.stride == system.stride => old.finest_again(system, lattice),
        _ => Level::finest(tools.gpu, system, lattice),
    }];
    for _ in 1..count {
        lattice = lattice.coarser();
        levels.push(match spare.next() {
            Some(old) if old.table.size() >= 4 * lattice.entries() => Level { lattice, ..old },
            _ => Level::table(tools.gpu, lattice)?,
        });
        let level = levels.last_mut().expect("just pushed");
        level.shape = lattice.level(0, level.shape.stride);
    }
    Ok(levels)
}

/// Marks the coarse nodes and counts them. Gives the rows of every level, and the blocks of the finest matrix.
fn count(tools: Tools, system: &System, levels: &[Level]) -> Result<(Vec<u32>, u32), EngineError> {
    let gpu = tools.gpu;
    let totals = buffer(gpu, "totals", SLOT * levels.len() as u64);
    let mut program = Program::default();
    let mut encoder = gpu.device.create_command_encoder(&Default::default());
    levels[0].upload(gpu);
    let bound = [levels[0].uniform.as_entire_binding(), levels[0].columns.as_entire_binding(), slot(&totals, 0)];
    program.push(tools, Kernel::Nonzeros, &bound, levels[0].by_row());
    for (l, pair) in levels.windows(2).enumerate() {
        let (fine, coarse) = (&pair[0], &pair[1]);
        coarse.upload(gpu);
        encoder.clear_buffer(&coarse.table, 0, None);
        if l == 0 {
            let bound = [&fine.uniform, &coarse.uniform, &fine.ids, &coarse.table];
            program.push_whole(tools, Kernel::MarkFine, &bound, fine.by_row());
        } else {
            let groups = fine.lattice.entries().div_ceil(256) as u32;
            let bound = [&fine.uniform, &coarse.uniform, &fine.table, &coarse.table];
            program.push_whole(tools, Kernel::Mark, &bound, [groups.min(32768), groups.div_ceil(32768)]);
        }
        program.push_whole(tools, Kernel::Count, &[&coarse.uniform, &coarse.table, &coarse.sums], coarse.by_part());
        let total = slot(&totals, l as u32 + 1);
        let bound = [coarse.uniform.as_entire_binding(), coarse.sums.as_entire_binding(), total];
        program.push(tools, Kernel::Offsets, &bound, [1, 1]);
    }
    gpu.queue.submit([encoder.finish()]);
    program.submit(gpu)?;
    let words: Vec<u32> = read(gpu, &totals, totals.size() as usize / 4)?;
    let mut rows: Vec<u32> = words.iter().step_by(SLOT as usize / 4).copied().collect();
    let nonzeros = std::mem::replace(&mut rows[0], system.rows);
    Ok((rows, nonzeros))
}

/// Numbers the coarse nodes and ties them to each other.
fn link(tools: Tools, system: &System, levels: &[Level]) -> Result<(), EngineError> {
    let mut program = Program::default();
    let mut encoder = tools.gpu.device.create_command_encoder(&Default::default());
    for pair in levels.windows(2) {
        let (fine, coarse) = (&pair[0], &pair[1]);
        encoder.clear_buffer(&coarse.children, 0, None);
        let bound = [&coarse.uniform, &coarse.sums, &coarse.table, &coarse.ids];
        program.push_whole(tools, Kernel::Number, &bound, coarse.by_part());
        let bound = [&fine.uniform, &coarse.uniform, &fine.ids, &coarse.table, &fine.parents, &coarse.children];
        program.push_whole(tools, Kernel::Link, &bound, fine.by_row());
        let bound = [&coarse.uniform, &coarse.ids, &coarse.table, &coarse.columns];
        program.push_whole(tools, Kernel::Columns, &bound, coarse.by_entry(slots(system.kernel)));
    }
    tools.gpu.queue.submit([encoder.finish()]);
    program.submit(tools.gpu)
}

/// Galerkin products first, so that they see no directions that a coarse block was completed by.
fn matrices(tools: Tools, system: &System, levels: &[Level], stretch: &Buffer) -> Program {
    let mut program = Program::default();
    for pair in levels.windows(2) {
        let (fine, coarse) = (&pair[0], &pair[1]);
        let bound = [
            &fine.uniform,
            &coarse.uniform,
            &coarse.ids,
            &coarse.children,
            &system.freedoms,
            &fine.values,
            &coarse.values,
        ];
        program.push_whole(tools, Kernel::Galerkin, &bound, coarse.by_entry(slots(system.kernel)));
    }
    for level in levels {
        let bound = [&level.uniform, &level.values, &level.inverse];
        program.push_whole(tools, Kernel::Diagonal, &bound, level.by_row());
        smoother::spectrum(&mut program, tools, level);
        smoother::polynomial(&mut program, tools, level, stretch);
    }
    program
}

/// Down and up (HOT algorithm 2): smooth, restrict the residual, correct, smooth. Gives the program, and where the answer lies.
fn v_cycle(tools: Tools, system: &System, levels: &[Level], smoothing: Smoothing) -> (Program, usize) {
    let mut program = Program::default();
    let depth = levels.len();
    let mut at = vec![0; depth];
    smoother::first(&mut program, tools, &levels[0]);
    for l in 0..depth - 1 {
        let (fine, coarse) = (&levels[l], &levels[l + 1]);
        at[l] = smoothing.smooth(&mut program, tools, fine, 0, true);
        let bound = [&fine.uniform, &fine.columns, &fine.values, &fine.b, &fine.x[at[l]], &fine.r];
        program.push_whole(tools, Kernel::Residual, &bound, fine.by_product());
        restrict(&mut program, tools, system, fine, coarse);
    }
    let coarsest = &levels[depth - 1];
    at[depth - 1] = smoother::chebyshev(&mut program, tools, coarsest, 0, 1..coarsest.shape.degree);
    for l in (0..depth - 1).rev() {
        let (fine, coarse) = (&levels[l], &levels[l + 1]);
        let [e, x] = [&coarse.x[at[l + 1]], &fine.x[at[l]]];
        let bound = [&fine.uniform, &coarse.uniform, &fine.parents, &system.freedoms, e, x];
        program.push_whole(tools, Kernel::Prolong, &bound, fine.by_row());
        at[l] = smoothing.smooth(&mut program, tools, fine, at[l], false);
    }
    (program, at[0])
}

/// The finer level's residual to the right-hand side of the coarser, and the first step there.
pub fn restrict(program: &mut Program, tools: Tools, system: &System, fine: &Level, coarse: &Level) {
    let [fine_shape, shape, children, freedoms, r, inverse, b, d, x] = [
        &fine.uniform,
        &coarse.uniform,
        &coarse.children,
        &system.freedoms,
        &fine.r,
        &coarse.inverse,
        &coarse.b,
        &coarse.d,
        &coarse.x[0],
    ]
    .map(|b| b.as_entire_binding());
    let bound = [fine_shape, shape, children, freedoms, r, inverse, slot(&coarse.coefficients, 0), b, d, x];
    program.push(tools, Kernel::Restrict, &bound, coarse.by_row());
}
