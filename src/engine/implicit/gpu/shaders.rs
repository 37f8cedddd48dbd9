//! WGSL of the implicit step: an entry point is one file of `wgsl/implicit/` and the shared files that it uses, joined.

use gridfall_core::sim::setup::Kernel;

macro_rules! wgsl {
    ($path:literal) => {
        include_str!(concat!("../../../../wgsl/", $path))
    };
}

/// Entry points by file name, in the order of a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Stage {
    Mark,
    Number,
    Count,
    Place,
    Order,
    Reorder,
    P2g,
    Boundary,
    Rows,
    Rest,
    Columns,
    Predict,
    Tensor,
    Assemble,
    Strain,
    Gradient,
    Energy,
    Impulses,
    Weigh,
    Release,
    Finish,
    Reactions,
    G2p,
}

impl Stage {
    pub const ALL: [Stage; 23] = [
        Stage::Mark,
        Stage::Number,
        Stage::Count,
        Stage::Place,
        Stage::Order,
        Stage::Reorder,
        Stage::P2g,
        Stage::Boundary,
        Stage::Rows,
        Stage::Rest,
        Stage::Columns,
        Stage::Predict,
        Stage::Tensor,
        Stage::Assemble,
        Stage::Strain,
        Stage::Gradient,
        Stage::Energy,
        Stage::Impulses,
        Stage::Weigh,
        Stage::Release,
        Stage::Finish,
        Stage::Reactions,
        Stage::G2p,
    ];

    /// Name, source of the entry point alone, and the files that it uses beside the common ones.
    fn parts(self) -> (&'static str, &'static str, Vec<&'static str>) {
        let gather = || vec![wgsl!("implicit/shape.wgsl"), wgsl!("implicit/particle.wgsl")];
        match self {
            Stage::Mark => ("mark", wgsl!("implicit/mark.wgsl"), vec![]),
            Stage::Number => ("number", wgsl!("implicit/number.wgsl"), vec![]),
            Stage::Count => ("count", wgsl!("implicit/count.wgsl"), vec![]),
            Stage::Place => ("place", wgsl!("implicit/place.wgsl"), vec![]),
            Stage::Order => ("order", wgsl!("implicit/order.wgsl"), vec![]),
            Stage::Reorder => ("reorder", wgsl!("implicit/reorder.wgsl"), vec![wgsl!("implicit/particle.wgsl")]),
            Stage::P2g => ("p2g", wgsl!("implicit/p2g.wgsl"), gather()),
            Stage::Boundary => ("boundary", wgsl!("implicit/boundary.wgsl"), vec![wgsl!("shared/distance.wgsl")]),
            Stage::Rows => ("rows", wgsl!("implicit/rows.wgsl"), vec![]),
            Stage::Rest => ("rest", wgsl!("implicit/rest.wgsl"), vec![wgsl!("implicit/freedom.wgsl")]),
            Stage::Columns => ("columns", wgsl!("implicit/columns.wgsl"), vec![wgsl!("implicit/neighbour.wgsl")]),
            Stage::Predict => {
                let parts = vec![wgsl!("implicit/tile.wgsl"), wgsl!("implicit/particle.wgsl")];
                ("predict", wgsl!("implicit/predict.wgsl"), parts)
            }
            Stage::Tensor => {
                let mut parts = laws();
                parts.extend([wgsl!("implicit/trial.wgsl"), wgsl!("implicit/upper.wgsl")]);
                ("tensor", wgsl!("implicit/tensor.wgsl"), parts)
            }
            Stage::Assemble => {
                let mut parts = vec![wgsl!("implicit/particle.wgsl"), wgsl!("implicit/freedom.wgsl")];
                parts.extend([
                    wgsl!("implicit/neighbour.wgsl"),
                    wgsl!("implicit/upper.wgsl"),
                    wgsl!("implicit/friction.wgsl"),
                ]);
                ("assemble", wgsl!("implicit/assemble.wgsl"), parts)
            }
            Stage::Strain => {
                let mut parts = laws();
                parts.extend([wgsl!("implicit/trial.wgsl"), wgsl!("implicit/pair.wgsl")]);
                ("strain", wgsl!("implicit/strain.wgsl"), parts)
            }
            Stage::Gradient => {
                let mut parts = gather();
                parts.extend([
                    wgsl!("implicit/freedom.wgsl"),
                    wgsl!("implicit/friction.wgsl"),
                    wgsl!("implicit/pair.wgsl"),
                ]);
                ("gradient", wgsl!("implicit/gradient.wgsl"), parts)
            }
            Stage::Energy => ("energy", wgsl!("implicit/energy.wgsl"), vec![wgsl!("implicit/pair.wgsl")]),
            Stage::Finish => ("finish", wgsl!("implicit/finish.wgsl"), vec![]),
            Stage::Impulses => {
                let mut parts = gather();
                parts.push(wgsl!("implicit/pressure.wgsl"));
                ("impulses", wgsl!("implicit/impulses.wgsl"), parts)
            }
            Stage::Weigh => ("weigh", wgsl!("implicit/weigh.wgsl"), vec![]),
            Stage::Release => ("release", wgsl!("implicit/release.wgsl"), vec![wgsl!("implicit/pressure.wgsl")]),
            Stage::Reactions => ("reactions", wgsl!("implicit/reactions.wgsl"), vec![]),
            Stage::G2p => ("g2p", wgsl!("implicit/g2p.wgsl"), laws()),
        }
    }

    pub fn name(self) -> &'static str {
        self.parts().0
    }
}

/// The complete source of a stage for a kernel; only compact and quadratic have shaders.
pub fn source(stage: Stage, kernel: Kernel) -> String {
    let (_, entry, own) = stage.parts();
    let mut parts = vec![
        wgsl!("shared/structs.wgsl"),
        LAYOUT,
        match kernel {
            Kernel::Quadratic => wgsl!("shared/kernel_quadratic.wgsl"),
            _ => wgsl!("shared/kernel_compact.wgsl"),
        },
        wgsl!("shared/blocks.wgsl"),
        wgsl!("implicit/cells.wgsl"),
    ];
    parts.extend(own);
    parts.push(entry);
    parts.join("\n")
}

const LAYOUT: &str = wgsl!("implicit/layout.wgsl");

/// Storage buffers declared in the layout: binding and name.
pub fn declared() -> impl Iterator<Item = (u32, &'static str)> {
    LAYOUT.lines().filter_map(|line| {
        let (number, rest) = line.strip_prefix("@group(0) @binding(")?.split_once(')')?;
        let name = rest.split_once("read_write> ")?.1.split_once(':')?.0;
        Some((number.parse().ok()?, name))
    })
}

/// The storage buffers that a source names outside their declarations.
pub fn used(source: &str) -> Vec<(u32, &'static str)> {
    let code = source
        .lines()
        .filter(|line| !line.starts_with("@group"))
        .map(|line| line.split("//").next().unwrap_or_default());
    let words: std::collections::HashSet<&str> =
        code.flat_map(|line| line.split(|c: char| !c.is_alphanumeric() && c != '_')).collect();
    let mut found: Vec<_> = declared()
        .filter(|(_, name)| words.contains(name))
        .map(|(b, name)| (b, if name == "marks" { "table" } else { name }))
        .collect();
    found.dedup();
    found
}

/// The three passes of a prefix sum, which have bindings of their own.
pub const SCAN: [(&str, &str); 3] = [
    ("scan", wgsl!("implicit/scan.wgsl")),
    ("scan_totals", wgsl!("implicit/scan_totals.wgsl")),
    ("scan_add", wgsl!("implicit/scan_add.wgsl")),
];

fn laws() -> Vec<&'static str> {
    vec![
        wgsl!("implicit/tile.wgsl"),
        wgsl!("implicit/particle.wgsl"),
        wgsl!("implicit/plastic.wgsl"),
        wgsl!("shared/state.wgsl"),
        wgsl!("shared/polar.wgsl"),
        wgsl!("shared/materials/fixed_corotated.wgsl"),
        wgsl!("shared/materials/neo_hookean.wgsl"),
        wgsl!("shared/materials/weakly_compressible_fluid.wgsl"),
        wgsl!("shared/materials/stvk_hencky.wgsl"),
        wgsl!("shared/materials/von_mises.wgsl"),
        wgsl!("shared/materials/drucker_prager.wgsl"),
        wgsl!("shared/materials/nacc.wgsl"),
        wgsl!("shared/materials/snow.wgsl"),
        wgsl!("implicit/derivatives.wgsl"),
    ]
}
