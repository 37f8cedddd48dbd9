//! The stages of a step as lists of dispatches.

use super::interface::System;
use crate::gpu::memory::{Memory, Scope};
use crate::gpu::program::{Dispatch, Dispatches, Tools};

/// How many workgroups a dispatch has.
#[derive(Clone, Copy, Debug)]
pub enum Extent {
    One,
    /// A lane a particle.
    Particles,
    /// A lane a block of the dense table.
    Table,
    /// A lane a cell of every block that there is room for.
    Cells,
    /// A workgroup a grid of every block that there is room for.
    Room,
    /// A workgroup a block.
    Blocks,
    /// A workgroup a block and grid, a lane a node.
    Grids,
    /// A workgroup a row of the system.
    Rows,
    /// A lane a row and slot for a neighbour.
    Neighbours,
    /// A workgroup a part of a buffer whose entries are added up.
    Parts(&'static str),
    /// A lane an entry of a buffer, and one more.
    Entries(&'static str),
}

use Extent::*;

/// A part of a list.
#[derive(Clone, Copy)]
pub enum Stage {
    /// A program in `wgsl/`.
    Run(&'static str, Extent),
    /// The sums before each entry of a buffer, and of all, into another.
    Sums { of: &'static str, before: &'static str },
}

use Stage::{Run, Sums};

/// Sorts the particles by block and cell, and gathers them on the nodes.
pub const SORT: &[Stage] = &[
    Run("implicit/mark", Particles),
    Sums { of: "table", before: "prefix" },
    Run("implicit/number", Table),
    Run("implicit/count", Particles),
    Sums { of: "counts", before: "starts" },
    Run("implicit/place", Particles),
    Run("implicit/order", Cells),
    Run("implicit/reorder", Particles),
    Run("implicit/p2g", Room),
];

/// Decides what surfaces do, and numbers the nodes of the system.
pub const BOUND: &[Stage] =
    &[Run("implicit/boundary", Room), Sums { of: "row_of", before: "prefix" }, Run("implicit/rows", Room)];

/// What a solve needs beside: deformations without Δv, and rows of neighbours.
pub const BEGIN: &[Stage] = &[Run("implicit/predict", Blocks), Run("implicit/columns", Neighbours)];

/// Another start than free fall.
pub const REST: &[Stage] = &[Run("implicit/rest", Grids)];

/// E and ∇E at a trial.
pub const EVALUATE: &[Stage] =
    &[Run("implicit/strain", Blocks), Run("implicit/gradient", Grids), Run("implicit/energy", One)];

/// The matrix there.
pub const HESSIAN: &[Stage] = &[Run("implicit/tensor", Blocks), Run("implicit/assemble", Rows)];

/// How much a direction strains what flows.
pub const REACH: &[Stage] = &[Run("implicit/reach", Blocks)];

/// Surfaces that pull let go, friction joins.
pub const REVISE: &[Stage] = &[
    Run("implicit/strain", Blocks),
    Run("implicit/impulses", Grids),
    Run("implicit/weigh", One),
    Run("implicit/release", Grids),
];

/// Velocities, reactions, particles.
pub const FINISH: &[Stage] = &[
    Run("implicit/strain", Blocks),
    Run("implicit/impulses", Grids),
    Run("implicit/finish", Grids),
    Run("implicit/reactions", Blocks),
    Run("implicit/g2p", Blocks),
];

const LISTS: [&[Stage]; 9] = [SORT, BOUND, BEGIN, REST, EVALUATE, HESSIAN, REACH, REVISE, FINISH];

/// The passes of a prefix sum.
fn sums(of: &'static str) -> [(&'static str, Extent); 3] {
    [("implicit/scan", Parts(of)), ("implicit/scan_totals", One), ("implicit/scan_add", Entries(of))]
}

/// Names of all programs.
pub fn programs() -> Vec<&'static str> {
    let names = |stage: &Stage| match *stage {
        Run(name, _) => vec![name],
        Sums { of, .. } => sums(of).map(|(name, _)| name).to_vec(),
    };
    LISTS.concat().iter().flat_map(names).collect()
}

/// The lists with a simulation's buffers.
pub struct Stages {
    pub sort: Dispatches<Extent>,
    pub bound: Dispatches<Extent>,
    pub begin: Dispatches<Extent>,
    pub rest: Dispatches<Extent>,
    pub evaluate: Dispatches<Extent>,
    pub hessian: Dispatches<Extent>,
    pub reach: Dispatches<Extent>,
    pub revise: Dispatches<Extent>,
    pub finish: Dispatches<Extent>,
}

impl Stages {
    pub fn new(tools: Tools, memory: &Memory, system: &System) -> Self {
        let [sort, bound, begin, rest, evaluate, hessian, reach, revise, finish] =
            LISTS.map(|list| dispatches(tools, list, memory, system));
        Self { sort, bound, begin, rest, evaluate, hessian, reach, revise, finish }
    }
}

fn dispatches(tools: Tools, list: &[Stage], memory: &Memory, system: &System) -> Dispatches<Extent> {
    let all = Scope::of(memory).and(&system.memory);
    let mut dispatches = Dispatches::default();
    for stage in list {
        match *stage {
            Run(name, extent) => dispatches.push(Dispatch::new(tools, (name, extent), &all)),
            Sums { of, before } => {
                let scope = Scope::of(memory).with("entries", memory.get(of)).with("before", memory.get(before));
                sums(of).into_iter().for_each(|stage| dispatches.push(Dispatch::new(tools, stage, &scope)));
            }
        }
    }
    dispatches
}
