//! The hierarchy of a step (HOT §5): coarse nodes, Galerkin matrices, smoothers, and the V-cycle
//! over them.

use super::coarse;
use super::lattice::Lattice;
use super::level::{Level, between};
use super::smoother::{self, Smoothing};
use super::stages::{
    COUNT, COUNT_FIRST, DIAGONAL, GALERKIN, LINK, NONZEROS, PROLONG, RESIDUAL, RESTRICT, append, append_between,
};
use crate::contract::EngineError;
use crate::gpu::Gpu;
use crate::gpu::memory::{Memory, SLOT, slot, storage};
use crate::gpu::program::{Dispatches, Tools};
use crate::implicit::gpu::interface::{System, sizes};
use crate::implicit::solver::vcycle::MOST_LEVELS;
use gridfall_core::sim::settings::{Implicit, Method};
use gridfall_core::sim::setup;

/// Nodes below which no further level is worth making.
const FEWEST_NODES: u32 = 16;

/// Levels, finest first, and what is done with them.
pub struct Hierarchy {
    pub levels: Vec<Level>,
    /// Blocks of the finest matrix.
    pub nonzeros: u32,
    /// Coarse matrices, inverse diagonals and spectra from the finest matrix;
    /// [`Hierarchy::invert_coarsest`] is due once they are submitted.
    pub matrices: Dispatches,
    /// The polynomials once more, after a change of `stretch`.
    pub polynomials: Dispatches,
    /// The finest level's b → x.
    pub cycle: Dispatches,
    /// Which of the finest level's x it is.
    pub result: usize,
    /// Whether the coarsest level is solved exactly.
    exact: bool,
    /// `stretch`: what all spectra are taken to be wider by than they were found; the coarsest level's
    /// `solution`.
    pub memory: Memory,
}

impl Hierarchy {
    /// Counts and links the nodes of every level, with one small read-back. `spare` is an older
    /// hierarchy, whose memory is taken over. The finest matrix is not looked at before
    /// [`Hierarchy::matrices`] runs. Newton's method goes on until a level can be solved exactly.
    ///
    /// Errors: [`EngineError::Capacity`] when a level does not fit the device.
    pub fn new(tools: Tools, system: &System, settings: &Implicit, spare: Option<Self>) -> Result<Self, EngineError> {
        let gpu = tools.gpu;
        let (spare_levels, memory) = match spare {
            Some(old) => (old.levels, old.memory),
            None => (Vec::new(), Memory::new(gpu, &sizes(vec![storage("stretch", 4), coarse::room()], 1))?),
        };
        let wanted = settings.levels.max(1);
        let most = if settings.method == Method::Newton { wanted.max(MOST_LEVELS) } else { wanted };
        let mut levels = tables(tools, system, most, spare_levels)?;
        let (rows, nonzeros) = count(tools, system, &levels)?;
        let least = |l: usize| if (l as u32) < wanted { FEWEST_NODES } else { coarse::MOST_NODES };
        let enough = |l: &usize| rows[l - 1] <= least(*l) || rows[*l] == rows[l - 1];
        levels.truncate((1..levels.len()).find(enough).unwrap_or(levels.len()));
        let smoothing = Smoothing { kind: settings.smoother };
        let depth = levels.len();
        let exact = rows[depth - 1] <= coarse::MOST_NODES;
        for (l, level) in levels.iter_mut().enumerate() {
            if l > 0 {
                level.make_room(gpu, system.kernel, rows[l])?;
            }
            let coarsest = l + 1 == depth;
            (level.shape.degree, level.shape.range) =
                if coarsest && exact { (0, 1.0) } else { smoothing.polynomial(coarsest) };
            level.upload(gpu);
        }
        link(tools, system, &levels)?;
        let (cycle, result) = v_cycle(tools, system, &levels, smoothing, exact.then_some(&memory))?;
        let mut polynomials = Dispatches::default();
        levels.iter().for_each(|level| smoother::polynomial(&mut polynomials, tools, level, &memory));
        let matrices = matrices(tools, system, &levels, &memory);
        let hierarchy = Self { levels, nonzeros, matrices, polynomials, cycle, result, exact, memory };
        hierarchy.set_stretch(tools, 1.0);
        Ok(hierarchy)
    }

    /// Sees to the solve on the coarsest level, whose matrix the host reads.
    pub fn invert_coarsest(&self, gpu: &Gpu) -> Result<(), EngineError> {
        match self.levels.last() {
            Some(coarsest) if self.exact => coarse::invert(gpu, coarsest, &self.memory),
            _ => Ok(()),
        }
    }

    /// All spectra are taken for so much wider than they were found.
    pub fn set_stretch(&self, tools: Tools, stretch: f32) {
        self.memory.write(tools.gpu, "stretch", 0, &[stretch]);
    }
}

/// Levels with their tables, coarse ones without room for nodes yet.
fn tables(tools: Tools, system: &System, count: u32, spare: Vec<Level>) -> Result<Vec<Level>, EngineError> {
    let grids = if system.kernel == setup::Kernel::Quadratic { 1 } else { 2 };
    let mut lattice = Lattice::of(system, grids);
    let mut spare = spare.into_iter();
    let mut next = |lattice| spare.next().unwrap_or_else(|| Level::empty(lattice, system.kernel));
    let mut finest = next(lattice);
    finest.be_finest(tools.gpu, system, lattice)?;
    let mut levels = vec![finest];
    for _ in 1..count {
        lattice = lattice.coarser();
        let mut level = next(lattice);
        level.be_coarse(tools.gpu, lattice)?;
        levels.push(level);
    }
    Ok(levels)
}

/// Marks the coarse nodes and counts them. Gives the rows of every level, and the blocks of the
/// finest matrix.
fn count(tools: Tools, system: &System, levels: &[Level]) -> Result<(Vec<u32>, u32), EngineError> {
    let gpu = tools.gpu;
    let words = SLOT as usize / 4 * levels.len();
    let memory = Memory::new(gpu, &sizes(vec![storage("totals", 4 * words)], 1))?;
    let totals = memory.get("totals");
    let mut list = Dispatches::default();
    levels[0].upload(gpu);
    let scope = levels[0].scope(0, &[]).with_part("total", slot(totals, 0));
    append(&mut list, tools, NONZEROS, &levels[0], &scope);
    for (l, pair) in (1..).zip(levels.windows(2)) {
        let pair = [&pair[0], &pair[1]];
        pair[1].upload(gpu);
        let scope = between(system, pair, [0, 0]).with_part("total", slot(totals, l));
        append_between(&mut list, tools, if l == 1 { COUNT_FIRST } else { COUNT }, pair, &scope);
    }
    gpu.submit(|encoder| levels[1..].iter().for_each(|level| encoder.clear_buffer(level.get("table"), 0, None)));
    list.submit(gpu)?;
    let mut rows: Vec<u32> = gpu.read::<u32>(totals, words)?.iter().step_by(SLOT as usize / 4).copied().collect();
    let nonzeros = std::mem::replace(&mut rows[0], system.rows);
    Ok((rows, nonzeros))
}

/// Numbers the coarse nodes and ties them to each other.
fn link(tools: Tools, system: &System, levels: &[Level]) -> Result<(), EngineError> {
    let mut list = Dispatches::default();
    for pair in levels.windows(2) {
        let pair = [&pair[0], &pair[1]];
        append_between(&mut list, tools, LINK, pair, &between(system, pair, [0, 0]));
    }
    tools.gpu.submit(|encoder| {
        levels[1..].iter().for_each(|level| encoder.clear_buffer(level.get("children"), 0, None));
    });
    list.submit(tools.gpu)
}

/// Galerkin products first, so that they see no directions that a coarse block was completed by.
fn matrices(tools: Tools, system: &System, levels: &[Level], memory: &Memory) -> Dispatches {
    let mut list = Dispatches::default();
    for pair in levels.windows(2) {
        let pair = [&pair[0], &pair[1]];
        append_between(&mut list, tools, GALERKIN, pair, &between(system, pair, [0, 0]));
    }
    for level in levels {
        append(&mut list, tools, DIAGONAL, level, &level.scope(0, &[]));
        smoother::spectrum(&mut list, tools, level);
        smoother::polynomial(&mut list, tools, level, memory);
    }
    list
}

/// Down and up (HOT algorithm 2): smooth, restrict the residual, correct, smooth. `exact` has the
/// inverse of the coarsest matrix, if there is one. Gives the dispatches, and where the answer lies.
fn v_cycle(
    tools: Tools,
    system: &System,
    levels: &[Level],
    smoothing: Smoothing,
    exact: Option<&Memory>,
) -> Result<(Dispatches, usize), EngineError> {
    let mut list = Dispatches::default();
    let depth = levels.len();
    let mut at = vec![0; depth];
    smoother::first(&mut list, tools, &levels[0]);
    for l in 0..depth - 1 {
        let (fine, coarse) = (&levels[l], &levels[l + 1]);
        at[l] = smoothing.smooth(&mut list, tools, fine, 0, true)?;
        residual(&mut list, tools, fine, at[l]);
        restrict(&mut list, tools, system, [fine, coarse]);
    }
    let coarsest = &levels[depth - 1];
    match exact {
        Some(memory) => coarse::solve(&mut list, tools, coarsest, memory),
        None => at[depth - 1] = smoother::chebyshev(&mut list, tools, coarsest, 0, 1..coarsest.shape.degree),
    }
    for l in (0..depth - 1).rev() {
        let pair = [&levels[l], &levels[l + 1]];
        prolong(&mut list, tools, system, pair, [at[l], at[l + 1]]);
        at[l] = smoothing.smooth(&mut list, tools, pair[0], at[l], false)?;
    }
    Ok((list, at[0]))
}

/// r of x number `at`.
pub fn residual(list: &mut Dispatches, tools: Tools, level: &Level, at: usize) {
    append(list, tools, RESIDUAL, level, &level.scope(at, &[]));
}

/// The finer level's residual to the right-hand side of the coarser, and the first step there.
pub fn restrict(list: &mut Dispatches, tools: Tools, system: &System, pair: [&Level; 2]) {
    let coefficient = slot(pair[1].get("coefficients"), 0);
    let scope = between(system, pair, [0, 0]).with_part("coefficient", coefficient);
    append_between(list, tools, RESTRICT, pair, &scope);
}

/// The coarse level's x to the finer one's; `at`: which of their x.
pub fn prolong(list: &mut Dispatches, tools: Tools, system: &System, pair: [&Level; 2], at: [usize; 2]) {
    append_between(list, tools, PROLONG, pair, &between(system, pair, at));
}
