//! The smoothers of the V-cycle as dispatches; twin of `crate::implicit::solver::smoother`.

use std::ops::Range;

use super::layout::Colour;
use super::level::{Level, MAX_DEGREE};
use super::stages::{CHEBYSHEV, CHEBYSHEV_FIRST, GAUSS_SEIDEL, LANCZOS, LANCZOS_START, RITZ, append};
use crate::contract::EngineError;
use crate::gpu::memory::{Memory, SLOT, slot, storage};
use crate::gpu::program::{Dispatches, Tools};
use crate::implicit::gpu::interface::sizes;
use crate::implicit::solver::smoother::{DEGREE, RANGE};
use gridfall_core::sim::settings::Smoother;

/// Degree of the polynomial that solves on the coarsest level, and the part of the spectrum that it
/// damps, [λ / range, λ].
const COARSE_DEGREE: u32 = 30;
const COARSE_RANGE: f32 = 400.0;
const _: () = assert!(COARSE_DEGREE as usize <= MAX_DEGREE && DEGREE <= MAX_DEGREE);
/// Lanczos steps towards the largest eigenvalue.
const LANCZOS_STEPS: usize = 12;

/// Which smoother it is.
#[derive(Clone, Copy)]
pub struct Smoothing {
    pub kind: Smoother,
}

impl Smoothing {
    /// Degree and range of a level's polynomial; degree 0 starts from zero and has no polynomial.
    pub fn polynomial(self, coarsest: bool) -> (u32, f32) {
        match self.kind {
            _ if coarsest => (COARSE_DEGREE, COARSE_RANGE),
            Smoother::Chebyshev => (DEGREE as u32, RANGE as f32),
            Smoother::GaussSeidel => (0, 1.0),
        }
    }

    /// Smooths the level's x number `at`, after [`first`] or a restriction if `fresh`. Gives the
    /// number of the result.
    pub fn smooth(
        self,
        list: &mut Dispatches,
        tools: Tools,
        level: &Level,
        at: usize,
        fresh: bool,
    ) -> Result<usize, EngineError> {
        match self.kind {
            Smoother::Chebyshev => Ok(chebyshev(list, tools, level, at, u32::from(fresh)..level.shape.degree)),
            Smoother::GaussSeidel => symmetric_sweep(list, tools, level, at),
        }
    }
}

/// The first step of the finest level from x = 0.
pub fn first(list: &mut Dispatches, tools: Tools, level: &Level) {
    let scope = level.scope(0, &[]).with_part("coefficient", slot(level.get("coefficients"), 0));
    append(list, tools, CHEBYSHEV_FIRST, level, &scope);
}

/// Some steps of the level's polynomial from x number `at`. Gives the number of the result.
pub fn chebyshev(list: &mut Dispatches, tools: Tools, level: &Level, mut at: usize, steps: Range<u32>) -> usize {
    for step in steps {
        let coefficient = slot(level.get("coefficients"), step as usize);
        append(list, tools, CHEBYSHEV, level, &level.scope(at, &[]).with_part("coefficient", coefficient));
        at = 1 - at;
    }
    at
}

/// Colours forwards and back, in place.
fn symmetric_sweep(list: &mut Dispatches, tools: Tools, level: &Level, at: usize) -> Result<usize, EngineError> {
    let turns = colours(level);
    let memory = Memory::new(tools.gpu, &sizes(vec![storage("turns", SLOT as usize * turns.len())], level.shape.rows))?;
    turns.iter().enumerate().for_each(|(k, turn)| memory.write_slot(tools.gpu, "turns", k, turn));
    for k in (0..turns.len()).chain((0..turns.len()).rev()) {
        let scope = level.scope(at, &[]).with_part("turn", slot(memory.get("turns"), k));
        append(list, tools, GAUSS_SEIDEL, level, &scope);
    }
    Ok(at)
}

/// Nodes of one colour are no neighbours: 27 colours of the quadratic kernel's nodes, 16 of the
/// compact pair's in half cells. Around a periodic axis there may have to be more.
fn colours(level: &Level) -> Vec<Colour> {
    let half = level.shape.grids == 2;
    let apart = if half { 4 } else { 3 };
    let counts = level.shape.period.map(|cells| {
        let period = if half { 2 * cells } else { cells };
        if period == 0 { apart } else { (apart..period).find(|n| period % n == 0).unwrap_or(period) }
    });
    let all = (0..counts[0]).flat_map(|x| (0..counts[1]).flat_map(move |y| (0..counts[2]).map(move |z| [x, y, z])));
    // In half cells all coordinates of a node are even, or all odd; around an odd count they mix.
    let occurs = |c: &[i32; 3]| !half || counts.iter().any(|n| n % 2 == 1) || c.iter().all(|x| (x - c[0]) % 2 == 0);
    all.filter(occurs).map(|colour| Colour { colour, half: u32::from(half), counts, spare: 0 }).collect()
}

/// Lanczos steps towards the level's spectrum, if it has a polynomial.
pub fn spectrum(list: &mut Dispatches, tools: Tools, level: &Level) {
    if level.shape.degree == 0 {
        return;
    }
    // Vectors that are not in use yet.
    let scope = |step: usize| {
        let p = [("p", level.x(step % 2)), ("p_next", level.x(1 - step % 2))];
        let rest = [("r", level.get("b")), ("z", level.get("d")), ("ap", level.get("r"))];
        level.scope(0, &[&p[..], &rest].concat())
    };
    append(list, tools, LANCZOS_START, level, &scope(0));
    for step in 0..LANCZOS_STEPS {
        append(list, tools, LANCZOS, level, &scope(step));
    }
}

/// The level's polynomial from what Lanczos found; `memory` has the `stretch`.
pub fn polynomial(list: &mut Dispatches, tools: Tools, level: &Level, memory: &Memory) {
    append(list, tools, RITZ, level, &level.scope(0, &[]).and(memory));
}
