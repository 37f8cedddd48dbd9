//! The dispatches of the linear algebra as lists.

use super::level::Level;
use crate::gpu::memory::Scope;
use crate::gpu::program::{Dispatch, Dispatches, Tools, Workgroups};

/// How many workgroups a dispatch of a level has.
#[derive(Clone, Copy, Debug)]
pub enum Extent {
    One,
    /// A thread a row.
    Rows,
    /// A thread a row and slot for a neighbour.
    Neighbours,
    /// A thread a component of a row's vector.
    Components,
    /// 32 rows a workgroup.
    Products,
    /// What a reduction has.
    Sums,
    /// 1024 entries of the table a workgroup.
    Parts,
    /// A thread a row of the finer level.
    FineRows,
    /// A thread an entry of the finer level's table.
    FineTable,
}

use Extent::*;

/// A program in `wgsl/`, and its extent.
pub type Stage = (&'static str, Extent);

/// Counts the blocks of the finest matrix.
pub const NONZEROS: &[Stage] = &[("implicit/linear/nonzeros", Rows)];
/// Marks and counts the nodes of the first coarse level.
pub const COUNT_FIRST: &[Stage] =
    &[("implicit/linear/mark_fine", FineRows), ("implicit/linear/count", Parts), ("implicit/linear/offsets", One)];
/// The same of the other coarse levels.
pub const COUNT: &[Stage] =
    &[("implicit/linear/mark", FineTable), ("implicit/linear/count", Parts), ("implicit/linear/offsets", One)];
/// Numbers the nodes of a coarse level and ties them to each other and to the finer level.
pub const LINK: &[Stage] =
    &[("implicit/linear/number", Parts), ("implicit/linear/link", FineRows), ("implicit/linear/columns", Neighbours)];

/// The matrix of a coarse level.
pub const GALERKIN: &[Stage] = &[("implicit/linear/galerkin", Neighbours)];
/// The inverses of a level's diagonal blocks.
pub const DIAGONAL: &[Stage] = &[("implicit/linear/diagonal", Rows)];
pub const LANCZOS_START: &[Stage] = &[("implicit/linear/lanczos_start", Sums)];
/// A Lanczos step.
pub const LANCZOS: &[Stage] = &[
    ("implicit/linear/lanczos_ratio", One),
    ("implicit/linear/lanczos_product", Products),
    ("implicit/linear/lanczos_update", Sums),
];
/// Coefficients of the smoother from what Lanczos found.
pub const RITZ: &[Stage] = &[("implicit/linear/ritz", One)];

/// A step of the smoother from zero.
pub const CHEBYSHEV_FIRST: &[Stage] = &[("implicit/linear/chebyshev_first", Rows)];
pub const CHEBYSHEV: &[Stage] = &[("implicit/linear/chebyshev", Products)];
/// The solve on the coarsest level, a thread a component.
pub const COARSE: &[Stage] = &[("implicit/linear/coarse", Components)];
/// A colour of a sweep.
pub const GAUSS_SEIDEL: &[Stage] = &[("implicit/linear/gauss_seidel", Products)];
pub const RESIDUAL: &[Stage] = &[("implicit/linear/residual", Products)];
/// From the finer level down, and up to it.
pub const RESTRICT: &[Stage] = &[("implicit/linear/restrict", Rows)];
pub const PROLONG: &[Stage] = &[("implicit/linear/prolong", FineRows)];

/// The first loop of L-BFGS: its start, and a pair.
pub const BEGIN: &[Stage] = &[("implicit/linear/begin", Sums)];
pub const BACKWARD: &[Stage] = &[("implicit/linear/backward", Sums)];
/// The second loop.
pub const PROJECT: &[Stage] = &[("implicit/linear/project", Sums)];
pub const FORWARD: &[Stage] = &[("implicit/linear/forward", Sums)];
/// Start and trial of a line search, and what is to be said of the trial.
pub const SEARCH: &[Stage] = &[("implicit/linear/search", One)];
pub const ATTEMPT: &[Stage] = &[("implicit/linear/attempt", Rows)];
pub const JUDGE: &[Stage] = &[("implicit/linear/measure", Sums), ("implicit/linear/decide", One)];
/// Takes energy and residual of the start.
pub const ADOPT: &[Stage] = &[("implicit/linear/measure", Sums), ("implicit/linear/adopt", One)];
/// To the accepted trial.
pub const STEP: &[Stage] = &[("implicit/linear/accept", Sums), ("implicit/linear/finish", One)];

/// Start of conjugate gradients.
pub const CG_START: &[Stage] = &[("implicit/linear/cg_start", Sums)];
/// After a V-cycle: its answer's products.
pub const CG_MEASURE: &[Stage] = &[("implicit/linear/cg_measure", Sums), ("implicit/linear/cg_turn", One)];
/// A direction, and the step along it.
pub const CG_STEP: &[Stage] = &[
    ("implicit/linear/cg_product", Products),
    ("implicit/linear/cg_length", One),
    ("implicit/linear/cg_advance", Rows),
];

/// Names of all programs.
pub fn programs() -> Vec<&'static str> {
    let setup = [NONZEROS, COUNT_FIRST, COUNT, LINK, GALERKIN, DIAGONAL, LANCZOS_START, LANCZOS, RITZ];
    let cycle = [CHEBYSHEV_FIRST, CHEBYSHEV, COARSE, GAUSS_SEIDEL, RESIDUAL, RESTRICT, PROLONG];
    let descent = [BEGIN, BACKWARD, PROJECT, FORWARD, SEARCH, ATTEMPT, JUDGE, ADOPT, STEP];
    let newton = [CG_START, CG_MEASURE, CG_STEP];
    [setup.concat(), cycle.concat(), descent.concat(), newton.concat()]
        .concat()
        .into_iter()
        .map(|(name, _)| name)
        .collect()
}

/// Appends stages of a level.
pub fn append(list: &mut Dispatches, tools: Tools, stages: &[Stage], level: &Level, scope: &Scope) {
    append_between(list, tools, stages, [level, level], scope);
}

/// Appends stages between a finer level and a coarse one.
pub fn append_between(
    list: &mut Dispatches,
    tools: Tools,
    stages: &[Stage],
    [fine, coarse]: [&Level; 2],
    scope: &Scope,
) {
    for &(name, extent) in stages {
        let grid = |x: u32| Workgroups::Grid([x, 1]);
        let groups = match extent {
            One => grid(1),
            Rows => grid(coarse.shape.rows.div_ceil(64)),
            Neighbours => Workgroups::Grid([coarse.shape.rows.div_ceil(64), coarse.slots]),
            Components => grid((3 * coarse.shape.rows).div_ceil(64)),
            Products => grid(coarse.shape.rows.div_ceil(32)),
            Sums => grid(coarse.shape.groups),
            Parts => grid(coarse.lattice.parts() as u32),
            FineRows => grid(fine.shape.rows.div_ceil(64)),
            FineTable => Workgroups::Folded(fine.lattice.entries().div_ceil(256) as usize),
        };
        list.push(Dispatch::new(tools, (name, groups), scope));
    }
}
