//! Every pipeline that the engines can make, as source and constants. The one file here that knows the engines.

/// What a compute pipeline is made of; its entry point is `main`.
pub struct Program {
    /// File in `wgsl/`, then what it is specialised for: `explicit/g2p2g compact mls closed`.
    pub name: String,
    pub wgsl: String,
    /// Values of override constants.
    pub constants: Vec<(&'static str, f64)>,
    /// Whether indices into arrays are kept in range.
    pub checked: bool,
}

/// All pipelines of all variants.
pub fn programs() -> Vec<Program> {
    let all = gridfall_engine::programs::programs().unwrap_or_else(|e| panic!("{e}"));
    all.into_iter()
        .map(|s| Program { name: s.name, wgsl: s.wgsl, constants: s.constants, checked: s.checked })
        .collect()
}
