//! WGSL composition: an entry point is one file of `wgsl/` and the shared files that it uses, joined.

use gridfall_core::sim::setup::Kernel;

macro_rules! wgsl {
    ($path:literal) => {
        include_str!(concat!("../../../../wgsl/", $path))
    };
}

/// Compute entry points by file name, in the order of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Stage {
    Mark,
    Rank,
    Launch,
    P2g,
    Prepare,
    Reset,
    Activate,
    Commit,
    Clear,
    GridUpdate,
    G2p2g,
    Offsets,
    Bin,
    G2p,
}

impl Stage {
    pub const ALL: [Stage; 14] = [
        Stage::Mark,
        Stage::Rank,
        Stage::Launch,
        Stage::P2g,
        Stage::Prepare,
        Stage::Reset,
        Stage::Activate,
        Stage::Commit,
        Stage::Clear,
        Stage::GridUpdate,
        Stage::G2p2g,
        Stage::Offsets,
        Stage::Bin,
        Stage::G2p,
    ];

    pub fn name(self) -> &'static str {
        match self {
            Stage::Mark => "mark",
            Stage::Rank => "rank",
            Stage::Launch => "launch",
            Stage::P2g => "p2g",
            Stage::Prepare => "prepare",
            Stage::Reset => "reset",
            Stage::Activate => "activate",
            Stage::Commit => "commit",
            Stage::Clear => "clear",
            Stage::GridUpdate => "grid_update",
            Stage::G2p2g => "g2p2g",
            Stage::Offsets => "offsets",
            Stage::Bin => "bin",
            Stage::G2p => "g2p",
        }
    }

    /// Whether the stage writes the arguments of indirect dispatches.
    pub fn writes_dispatches(self) -> bool {
        matches!(self, Stage::Launch | Stage::Prepare | Stage::Commit)
    }

    /// Source of the entry point alone.
    pub fn entry(self) -> &'static str {
        match self {
            Stage::Mark => wgsl!("mark.wgsl"),
            Stage::Rank => wgsl!("rank.wgsl"),
            Stage::Launch => wgsl!("launch.wgsl"),
            Stage::P2g => wgsl!("p2g.wgsl"),
            Stage::Prepare => wgsl!("prepare.wgsl"),
            Stage::Reset => wgsl!("reset.wgsl"),
            Stage::Activate => wgsl!("activate.wgsl"),
            Stage::Commit => wgsl!("commit.wgsl"),
            Stage::Clear => wgsl!("clear.wgsl"),
            Stage::GridUpdate => wgsl!("grid_update.wgsl"),
            Stage::G2p2g => wgsl!("g2p2g.wgsl"),
            Stage::Offsets => wgsl!("offsets.wgsl"),
            Stage::Bin => wgsl!("bin.wgsl"),
            Stage::G2p => wgsl!("g2p.wgsl"),
        }
    }
}

const TRANSFER: [&str; 14] = [
    wgsl!("shared/tile.wgsl"),
    wgsl!("shared/transfer.wgsl"),
    wgsl!("shared/state.wgsl"),
    wgsl!("shared/state_io.wgsl"),
    wgsl!("shared/polar.wgsl"),
    wgsl!("shared/materials/fixed_corotated.wgsl"),
    wgsl!("shared/materials/neo_hookean.wgsl"),
    wgsl!("shared/materials/weakly_compressible_fluid.wgsl"),
    wgsl!("shared/materials/stvk_hencky.wgsl"),
    wgsl!("shared/materials/von_mises.wgsl"),
    wgsl!("shared/materials/drucker_prager.wgsl"),
    wgsl!("shared/materials/nacc.wgsl"),
    wgsl!("shared/materials/snow.wgsl"),
    wgsl!("shared/advance.wgsl"),
];

/// Energy, stress and projected stiffness of the laws for the implicit step, after the shared files of a transfer.
pub const DERIVATIVES: &str = wgsl!("implicit/derivatives.wgsl");

/// The complete source of a stage for a kernel; only compact and quadratic have shaders.
pub fn source(stage: Stage, kernel: Kernel) -> String {
    let mut parts = vec![wgsl!("shared/structs.wgsl"), wgsl!("shared/layout.wgsl"), wgsl!("shared/blocks.wgsl")];
    parts.push(match kernel {
        Kernel::Quadratic => wgsl!("shared/kernel_quadratic.wgsl"),
        _ => wgsl!("shared/kernel_compact.wgsl"),
    });
    match stage {
        Stage::Launch | Stage::Prepare | Stage::Commit => parts.push(wgsl!("shared/dispatch.wgsl")),
        Stage::GridUpdate => {
            parts.extend([wgsl!("shared/reactions.wgsl"), wgsl!("shared/distance.wgsl"), wgsl!("shared/collide.wgsl")]);
        }
        Stage::P2g | Stage::G2p2g | Stage::G2p => parts.extend(TRANSFER),
        _ => {}
    }
    parts.push(stage.entry());
    parts.join("\n")
}
