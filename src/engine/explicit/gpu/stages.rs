//! The steps of a frame as lists of dispatches, and their recording.

use super::buffers::Buffers;
use super::layout::Groups;
use super::shaders::Stage;
use crate::gpu::device::Pipelines;

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

pub type Dispatch = (Stage, Extent);

/// Full particle states → grid.
pub const FRAME_START: [Dispatch; 8] = [
    (Stage::Mark, Extent::Particles),
    (Stage::Commit, Extent::One),
    (Stage::Clear, Extent::Device(Groups::BlocksOut)),
    (Stage::Rank, Extent::Device(Groups::Particles)),
    (Stage::Offsets, Extent::Device(Groups::SlotsOut)),
    (Stage::Bin, Extent::Device(Groups::Particles)),
    (Stage::Launch, Extent::One),
    (Stage::P2g, Extent::Device(Groups::Work)),
];

/// Grid n → grid n + 1. Activation comes first, so that a step that lacks room leaves everything as it was.
pub const STEP: [Dispatch; 9] = [
    (Stage::Prepare, Extent::One),
    (Stage::Reset, Extent::Device(Groups::Stale)),
    (Stage::Activate, Extent::Device(Groups::Work)),
    (Stage::Commit, Extent::One),
    (Stage::GridUpdate, Extent::Device(Groups::BlocksIn)),
    (Stage::Clear, Extent::Device(Groups::BlocksOut)),
    (Stage::G2p2g, Extent::Device(Groups::Work)),
    (Stage::Offsets, Extent::Device(Groups::SlotsOut)),
    (Stage::Bin, Extent::Device(Groups::Particles)),
];

/// The last step: grid → full particle states.
pub const FRAME_END: [Dispatch; 3] = [
    (Stage::Prepare, Extent::One),
    (Stage::GridUpdate, Extent::Device(Groups::BlocksIn)),
    (Stage::G2p, Extent::Device(Groups::Work)),
];

/// Records one dispatch with side `side` as `_in`.
pub fn record(
    pass: &mut wgpu::ComputePass,
    dispatch: Dispatch,
    pipelines: &Pipelines,
    b: &Buffers,
    side: usize,
    workgroup: u32,
) {
    let (stage, extent) = dispatch;
    pass.set_pipeline(&pipelines.stages[&stage]);
    pass.set_bind_group(0, &b.bind[side], &[]);
    if stage.writes_dispatches() {
        pass.set_bind_group(1, &b.dispatch_bind, &[]);
    }
    match extent {
        Extent::One => pass.dispatch_workgroups(1, 1, 1),
        Extent::Particles => {
            let groups = (b.live as u32).div_ceil(workgroup);
            pass.dispatch_workgroups(groups.min(32768), groups.div_ceil(32768), 1);
        }
        Extent::Device(which) => pass.dispatch_workgroups_indirect(&b.dispatches, 16 * which as u64),
    }
}
