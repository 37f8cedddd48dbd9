//! The steps of a frame as lists of dispatches.

use super::layout::Groups;
use crate::gpu::memory::{Memory, Scope};
use crate::gpu::program::{Dispatches, Tools};
use gridfall_core::sim::pair;
use gridfall_core::sim::setup::Setup;
use gridfall_core::sim::side;
use gridfall_core::sim::touch;

/// How many workgroups a dispatch has.
#[derive(Clone, Copy, Debug)]
pub enum Extent {
    /// One thread a particle, known to the host.
    Particles,
    /// One workgroup a slot for blocks, known to the host.
    Slots,
    /// Decided on the device, in the step before.
    Device(Groups),
    /// Decided on the device, in the list that the dispatch is in.
    Late(Groups),
}

/// An extent, and the side that is `_in`.
pub type Placed = (Extent, usize);

use Extent::{Device, Late, Particles, Slots};

/// A program in `wgsl/`, and its extent.
type Stage = (&'static str, Extent);

/// Full particle states → grid.
pub const FRAME_START: &[Stage] = &[
    SIDES,
    ("explicit/mark", Particles),
    ("explicit/rank", Particles),
    ("explicit/sweep", Slots),
    ("explicit/bin", Particles),
    ("explicit/touch_start", Late(Groups::Work)),
    ("explicit/p2g", Late(Groups::Work)),
];

/// Only in scenes with thin colliders.
const SIDES: Stage = ("explicit/sides", Particles);
const JOIN: Stage = ("explicit/join", Device(Groups::Blocks));

/// Only in scenes with several fields of nodes.
const PAIRS: Stage = ("explicit/pairs", Device(Groups::Blocks));

/// Grid n → grid n + 1. Activation comes first, so that a step that lacks room leaves everything
/// as it was.
pub const STEP: &[Stage] = &[
    ("explicit/activate", Device(Groups::Work)),
    JOIN,
    PAIRS,
    ("explicit/grid_update", Device(Groups::Blocks)),
    ("explicit/touch", Device(Groups::Work)),
    ("explicit/g2p2g", Device(Groups::Work)),
    ("explicit/sweep", Slots),
    ("explicit/bin", Particles),
];

/// The last step: grid → full particle states.
pub const FRAME_END: &[Stage] = &[
    JOIN,
    PAIRS,
    ("explicit/grid_update", Device(Groups::Blocks)),
    ("explicit/touch_end", Device(Groups::Work)),
    ("explicit/g2p", Device(Groups::Work)),
];

/// The lists with a simulation's buffers.
pub struct Stages {
    /// Fills side 0.
    pub frame_start: Dispatches<Placed>,
    /// By the side that is `_in`.
    pub step: [Dispatches<Placed>; 2],
    pub frame_end: [Dispatches<Placed>; 2],
}

impl Stages {
    /// Stages that a scene has no use for are left out: contact at particles without colliders that act there,
    /// pairs of fields with only one field, sides without thin colliders.
    pub fn new(tools: Tools, memory: &Memory, setup: &Setup) -> Self {
        let (touches, parted, sided) = (touch::acts(setup), pair::is_parted(setup), side::acts(setup));
        let has_use = |name: &str| match name {
            _ if name == SIDES.0 || name == JOIN.0 => sided,
            _ if name == PAIRS.0 => parted,
            _ => touches || !name.starts_with("explicit/touch"),
        };
        let on = |side, list: &[Stage]| {
            let used = list.iter().filter(|(name, _)| has_use(name));
            let used: Vec<_> = used.map(|&(name, extent)| (name, (extent, side))).collect();
            Dispatches::new(tools, &used, &Scope::default().and_side(memory, side))
        };
        Self {
            frame_start: on(1, FRAME_START),
            step: [0, 1].map(|side| on(side, STEP)),
            frame_end: [0, 1].map(|side| on(side, FRAME_END)),
        }
    }
}
