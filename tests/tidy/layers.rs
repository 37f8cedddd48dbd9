//! The layers from the lowest up: which module may use which, and which folders may name a crate.
//!
//! Cargo enforces the boundaries between crates; these lists enforce those inside them. A module
//! may use those before it in its list, and only those that it names. A permission that nobody uses
//! is a fault.

/// A module and what it may use of its crate besides itself.
pub type Layer = (&'static str, &'static [&'static str]);

/// Crates of the workspace with what each may use of the others, from the lowest up.
pub const CRATES: &[(&str, &[&str])] = &[
    ("core", &[]),
    ("scene", &["core"]),
    ("engine", &["core"]),
    ("recording", &["core", "engine"]),
    ("service", &["core", "scene", "engine", "recording"]),
];

pub const CORE: &[Layer] = &[("maths", &[]), ("material", &["maths"]), ("sim", &["maths", "material"])];

pub const ENGINE: &[Layer] = &[
    ("contract", &[]),
    ("gpu", &["contract"]),
    ("explicit::cpu", &["contract"]),
    ("explicit::gpu", &["contract", "gpu"]),
    ("implicit::step", &[]),
    ("implicit::solver", &["contract"]),
    ("implicit::physics", &["contract", "implicit::solver"]),
    ("implicit::cpu", &["contract", "implicit::step", "implicit::solver", "implicit::physics"]),
    ("implicit::gpu", &["contract", "gpu", "explicit::gpu", "implicit::step", "implicit::solver"]),
    ("choice", &["contract", "gpu", "explicit::cpu", "explicit::gpu", "implicit::cpu", "implicit::gpu"]),
];

pub const SERVICE: &[Layer] = &[("store", &[]), ("jobs", &["store"]), ("http", &["store", "jobs"])];

pub const ROOT: &[Layer] = &[("bench", &[]), ("verify", &[]), ("cli", &["bench", "verify"])];

/// Crates that only some folders may name.
pub const OWNED: &[(&str, &[&str])] = &[
    ("wgpu", &["src/engine/gpu/", "src/engine/explicit/gpu/", "src/engine/implicit/gpu/"]),
    ("axum", &["src/service/http/"]),
    ("sqlx", &["src/service/store/"]),
    ("mcap", &["src/recording/"]),
    ("foxglove", &["src/recording/"]),
];
