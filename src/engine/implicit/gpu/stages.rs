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
    /// A lane a particle and face near it.
    Links,
    /// As `Grids` and `Rows`, if there is any of those.
    LinkedGrids,
    LinkedRows,
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
    /// Parts of which there are none in scenes where no collider acts on particles.
    Contact(&'static [Stage]),
}

use Stage::{Contact, Run, Sums};

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
pub const BOUND: &[Stage] = &[
    Run("implicit/boundary", Room),
    Sums { of: "row_of", before: "prefix" },
    Run("implicit/rows", Room),
    Contact(&[
        Run("implicit/contact/near", Particles),
        Sums { of: "faces", before: "link_starts" },
        Run("implicit/contact/link", Particles),
    ]),
];

/// What a solve needs beside: deformations without Δv, and rows of neighbours.
pub const BEGIN: &[Stage] = &[
    Run("implicit/predict", Blocks),
    Run("implicit/columns", Neighbours),
    Contact(&[Run("implicit/contact/mass", Grids)]),
];

/// Another start than free fall.
pub const REST: &[Stage] = &[Run("implicit/rest", Grids)];

/// E and ∇E at a trial.
pub const EVALUATE: &[Stage] = &[
    Run("implicit/strain", Blocks),
    Run("implicit/gradient", Grids),
    Contact(&[Run("implicit/contact/respond", Links), Run("implicit/contact/gradient", LinkedGrids)]),
    Run("implicit/energy", One),
];

/// The matrix there, for what the evaluation has left of contact.
pub const HESSIAN: &[Stage] = &[
    Run("implicit/tensor", Blocks),
    Run("implicit/assemble", Rows),
    Contact(&[Run("implicit/contact/matrix", LinkedRows)]),
];

/// Limits of friction, with `dv` in the place of the trial.
pub const RENEW: &[Stage] = &[Contact(&[Run("implicit/contact/renew", Links)])];

/// How much a direction strains what flows.
pub const REACH: &[Stage] = &[Run("implicit/reach", Blocks)];

/// Surfaces that pull let go, friction joins.
pub const REVISE: &[Stage] = &[
    Run("implicit/strain", Blocks),
    Contact(&[Run("implicit/contact/respond", Links)]),
    Run("implicit/impulses", Grids),
    Run("implicit/weigh", One),
    Run("implicit/release", Grids),
];

/// Velocities, reactions, particles.
pub const FINISH: &[Stage] = &[
    Run("implicit/strain", Blocks),
    Contact(&[Run("implicit/contact/respond", Links)]),
    Run("implicit/impulses", Grids),
    Run("implicit/finish", Grids),
    Run("implicit/g2p", Blocks),
    Contact(&[Run("implicit/contact/settle", Links)]),
    Run("implicit/reactions", Blocks),
];

const LISTS: [&[Stage]; 9] = [SORT, BOUND, BEGIN, REST, EVALUATE, HESSIAN, REACH, REVISE, FINISH];

/// The passes of a prefix sum.
fn sums(of: &'static str) -> [(&'static str, Extent); 3] {
    [("implicit/scan", Parts(of)), ("implicit/scan_totals", One), ("implicit/scan_add", Entries(of))]
}

/// Names of all programs.
pub fn programs() -> Vec<&'static str> {
    LISTS.concat().iter().chain(RENEW).flat_map(names).collect()
}

fn names(stage: &Stage) -> Vec<&'static str> {
    match *stage {
        Run(name, _) => vec![name],
        Sums { of, .. } => sums(of).map(|(name, _)| name).to_vec(),
        Contact(stages) => stages.iter().flat_map(names).collect(),
    }
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
    pub renew: Dispatches<Extent>,
    pub revise: Dispatches<Extent>,
    pub finish: Dispatches<Extent>,
}

impl Stages {
    /// `touches`: whether colliders act on particles.
    pub fn new(tools: Tools, memory: &Memory, system: &System, touches: bool) -> Self {
        let [sort, bound, begin, rest, evaluate, hessian, reach, revise, finish] = LISTS.map(|list| {
            let scope = Scope::of(memory).and(&system.memory);
            Lists { tools, memory, scope, touches }.dispatches(list)
        });
        let at_dv = Scope::default().with("trial", system.get("dv")).and(memory).and(&system.memory);
        let renew = Lists { tools, memory, scope: at_dv, touches }.dispatches(RENEW);
        Self { sort, bound, begin, rest, evaluate, hessian, reach, renew, revise, finish }
    }
}

/// What lists are made with.
struct Lists<'a> {
    tools: Tools<'a>,
    memory: &'a Memory,
    scope: Scope<'a>,
    touches: bool,
}

impl Lists<'_> {
    fn dispatches(&self, list: &[Stage]) -> Dispatches<Extent> {
        let mut dispatches = Dispatches::default();
        self.add(list, &mut dispatches);
        dispatches
    }

    fn add(&self, list: &[Stage], to: &mut Dispatches<Extent>) {
        for stage in list {
            match *stage {
                Run(name, extent) => to.push(Dispatch::new(self.tools, (name, extent), &self.scope)),
                Sums { of, before } => {
                    let (entries, before) = (self.memory.get(of), self.memory.get(before));
                    let scope = Scope::of(self.memory).with("entries", entries).with("before", before);
                    sums(of).into_iter().for_each(|stage| to.push(Dispatch::new(self.tools, stage, &scope)));
                }
                Contact(stages) if self.touches => self.add(stages, to),
                Contact(_) => {}
            }
        }
    }
}
