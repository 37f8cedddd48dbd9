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
    /// One thread.
    One,
    /// One thread a particle, known to the host.
    Particles,
    /// Decided on the device.
    Device(Groups),
}

use Extent::{Device, One, Particles};

/// A program in `wgsl/`, and its extent.
type Stage = (&'static str, Extent);

/// Full particle states → grid.
pub const FRAME_START: &[Stage] = &[
    SIDES,
    ("explicit/mark", Particles),
    ("explicit/commit", One),
    ("explicit/clear", Device(Groups::BlocksOut)),
    ("explicit/rank", Device(Groups::Particles)),
    ("explicit/offsets", Device(Groups::SlotsOut)),
    ("explicit/bin", Device(Groups::Particles)),
    ("explicit/launch", One),
    ("explicit/touch_start", Device(Groups::Work)),
    ("explicit/p2g", Device(Groups::Work)),
];

/// Only in scenes with thin colliders.
const SIDES: Stage = ("explicit/sides", Particles);
const JOIN: Stage = ("explicit/join", Device(Groups::BlocksIn));

/// Only in scenes with several fields of nodes.
const PAIRS: Stage = ("explicit/pairs", Device(Groups::BlocksIn));

/// Grid n → grid n + 1. Activation comes first, so that a step that lacks room leaves everything
/// as it was.
pub const STEP: &[Stage] = &[
    ("explicit/prepare", One),
    ("explicit/reset", Device(Groups::Stale)),
    ("explicit/activate", Device(Groups::Work)),
    ("explicit/commit", One),
    JOIN,
    PAIRS,
    ("explicit/grid_update", Device(Groups::BlocksIn)),
    ("explicit/clear", Device(Groups::BlocksOut)),
    ("explicit/touch", Device(Groups::Work)),
    ("explicit/g2p2g", Device(Groups::Work)),
    ("explicit/offsets", Device(Groups::SlotsOut)),
    ("explicit/bin", Device(Groups::Particles)),
];

/// The last step: grid → full particle states.
pub const FRAME_END: &[Stage] = &[
    ("explicit/prepare", One),
    JOIN,
    PAIRS,
    ("explicit/grid_update", Device(Groups::BlocksIn)),
    ("explicit/touch_end", Device(Groups::Work)),
    ("explicit/g2p", Device(Groups::Work)),
];

/// Names of all programs.
pub fn programs() -> Vec<&'static str> {
    [FRAME_START, STEP, FRAME_END].concat().into_iter().map(|(name, _)| name).collect()
}

/// The lists with a simulation's buffers.
pub struct Stages {
    /// Fills side 0.
    pub frame_start: Dispatches<Extent>,
    /// By the side that is `_in`.
    pub step: [Dispatches<Extent>; 2],
    pub frame_end: [Dispatches<Extent>; 2],
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
            let used: Vec<Stage> = list.iter().copied().filter(|(name, _)| has_use(name)).collect();
            Dispatches::new(tools, &used, &Scope::default().and_side(memory, side))
        };
        Self {
            frame_start: on(1, FRAME_START),
            step: [0, 1].map(|side| on(side, STEP)),
            frame_end: [0, 1].map(|side| on(side, FRAME_END)),
        }
    }
}
