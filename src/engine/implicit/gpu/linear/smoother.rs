//! The smoothers of the V-cycle as dispatches; twin of `crate::implicit::solver::smoother`.

use std::ops::Range;

use super::kernels::{Kernel, Program, Tools};
use super::layout::Colour;
use super::level::{Level, MAX_DEGREE, SLOT, buffer, slot};
use crate::implicit::solver::smoother::{DEGREE, RANGE};
use gridfall_core::sim::settings::Smoother;

/// Degree of the polynomial that solves on the coarsest level, and the part of the spectrum that it damps, [λ / range, λ].
const COARSE_DEGREE: u32 = 30;
const COARSE_RANGE: f32 = 400.0;
const _: () = assert!(COARSE_DEGREE <= MAX_DEGREE && DEGREE as u32 <= MAX_DEGREE);
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

    /// Smooths the level's x number `at`, after [`first`] or a restriction if `fresh`. Gives the number of the result.
    pub fn smooth(self, program: &mut Program, tools: Tools, level: &Level, at: usize, fresh: bool) -> usize {
        match self.kind {
            Smoother::Chebyshev => chebyshev(program, tools, level, at, u32::from(fresh)..level.shape.degree),
            Smoother::GaussSeidel => {
                symmetric_sweep(program, tools, level, at);
                at
            }
        }
    }
}

/// The first step of the finest level from x = 0.
pub fn first(program: &mut Program, tools: Tools, level: &Level) {
    let [shape, inverse, b, d, x] =
        [&level.uniform, &level.inverse, &level.b, &level.d, &level.x[0]].map(|b| b.as_entire_binding());
    let bound = [shape, inverse, slot(&level.coefficients, 0), b, d, x];
    program.push(tools, Kernel::ChebyshevFirst, &bound, level.by_row());
}

/// Some steps of the level's polynomial from x number `at`. Gives the number of the result.
pub fn chebyshev(program: &mut Program, tools: Tools, level: &Level, mut at: usize, steps: Range<u32>) -> usize {
    for step in steps {
        let [shape, columns, values, inverse, b, x, d, next] = [
            &level.uniform,
            &level.columns,
            &level.values,
            &level.inverse,
            &level.b,
            &level.x[at],
            &level.d,
            &level.x[1 - at],
        ]
        .map(|b| b.as_entire_binding());
        let coefficient = slot(&level.coefficients, step);
        let bound = [shape, columns, values, inverse, coefficient, b, x, d, next];
        program.push(tools, Kernel::Chebyshev, &bound, level.by_product());
        at = 1 - at;
    }
    at
}

/// Colours forwards and back.
fn symmetric_sweep(program: &mut Program, tools: Tools, level: &Level, at: usize) {
    let turns = colours(level);
    let queue = buffer(tools.gpu, "colours", SLOT * turns.len() as u64);
    for (k, turn) in turns.iter().enumerate() {
        tools.gpu.queue.write_buffer(&queue, SLOT * k as u64, bytemuck::bytes_of(turn));
    }
    let turns = turns.len() as u32;
    for k in (0..turns).chain((0..turns).rev()) {
        let [shape, columns, values, inverse, ids, b, x] =
            [&level.uniform, &level.columns, &level.values, &level.inverse, &level.ids, &level.b, &level.x[at]]
                .map(|b| b.as_entire_binding());
        let bound = [shape, columns, values, inverse, ids, b, x, slot(&queue, k)];
        program.push(tools, Kernel::GaussSeidel, &bound, level.by_product());
    }
}

/// Nodes of one colour are no neighbours: 27 colours of the quadratic kernel's nodes, 16 of the compact pair's in half cells. Around a periodic
/// axis there may have to be more.
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
pub fn spectrum(program: &mut Program, tools: Tools, level: &Level) {
    if level.shape.degree == 0 {
        return;
    }
    // These vectors are not in use yet.
    let (r, z, ap, mut p) = (&level.b, &level.d, &level.r, 0);
    let partials = &level.partials[0];
    let bound = [&level.uniform, &level.ids, &level.inverse, r, z, &level.x[p], partials, &level.lanczos];
    program.push_whole(tools, Kernel::LanczosStart, &bound, level.by_sum());
    for _ in 0..LANCZOS_STEPS {
        program.push_whole(tools, Kernel::LanczosRatio, &[&level.uniform, partials, &level.lanczos], [1, 1]);
        let bound = [
            &level.uniform,
            &level.columns,
            &level.values,
            z,
            &level.x[p],
            &level.lanczos,
            &level.x[1 - p],
            ap,
            &level.products,
        ];
        program.push_whole(tools, Kernel::LanczosProduct, &bound, level.by_product());
        let bound = [&level.uniform, &level.inverse, &level.products, ap, r, z, partials, &level.lanczos];
        program.push_whole(tools, Kernel::LanczosUpdate, &bound, level.by_sum());
        p = 1 - p;
    }
}

/// The level's polynomial from what Lanczos found.
pub fn polynomial(program: &mut Program, tools: Tools, level: &Level, stretch: &wgpu::Buffer) {
    program.push_whole(tools, Kernel::Ritz, &[&level.uniform, &level.lanczos, &level.coefficients, stretch], [1, 1]);
}
