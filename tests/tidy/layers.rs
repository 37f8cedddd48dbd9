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

pub const SCENE: &[Layer] = &[
    ("names", &[]),
    ("schema", &[]),
    ("fault", &["names"]),
    ("limits", &[]),
    ("suggest", &[]),
    ("vectors", &[]),
    ("memory", &[]),
    ("document", &["fault"]),
    ("overrides", &["fault"]),
    ("size", &["fault"]),
    ("spelling", &[]),
    ("structure", &["schema", "fault", "suggest", "spelling"]),
    ("prose", &[]),
    ("presets", &["schema", "fault", "suggest", "spelling", "structure", "prose"]),
    ("mesh", &["schema"]),
    ("npz", &["vectors"]),
    ("points", &["mesh", "npz"]),
    ("state", &["npz"]),
    ("assets", &["mesh", "npz", "points"]),
    ("sampling", &["schema"]),
    ("grid", &["schema", "vectors", "sampling"]),
    ("shape", &["schema", "fault", "vectors"]),
    ("fit", &["schema", "fault", "grid"]),
    ("resolve", &["schema", "fault", "limits", "mesh", "points", "state", "assets", "shape"]),
    (
        "validate",
        &["names", "schema", "fault", "limits", "suggest", "vectors", "memory", "sampling", "grid", "shape", "resolve"],
    ),
    ("build", &["schema", "vectors", "grid", "shape", "resolve"]),
    ("contract", &["structure", "prose", "presets", "validate"]),
    ("estimate", &["memory"]),
];

pub const ENGINE: &[Layer] = &[
    ("contract", &[]),
    ("keys", &[]),
    ("state", &[]),
    ("gpu", &["contract"]),
    ("explicit::cpu", &["contract", "keys", "state"]),
    ("explicit::gpu", &["contract", "state", "gpu"]),
    ("implicit::step", &[]),
    ("implicit::engine", &["contract", "state", "implicit::step"]),
    ("implicit::solver", &["contract", "keys"]),
    ("implicit::physics", &["contract", "keys", "implicit::solver"]),
    (
        "implicit::cpu",
        &["contract", "state", "implicit::step", "implicit::engine", "implicit::solver", "implicit::physics"],
    ),
    (
        "implicit::gpu",
        &["contract", "state", "gpu", "explicit::gpu", "implicit::step", "implicit::engine", "implicit::solver"],
    ),
    ("programs", &["gpu", "explicit::gpu", "implicit::gpu"]),
    ("choice", &["contract", "gpu", "explicit::cpu", "explicit::gpu", "implicit::engine", "implicit::gpu"]),
];

pub const RECORDING: &[Layer] = &[
    ("provenance", &[]),
    ("embedded", &[]),
    ("files", &[]),
    ("arrays", &[]),
    ("state", &["files", "arrays"]),
    ("surface", &[]),
    ("excerpt", &[]),
    ("diagnostics", &[]),
    ("colliders", &["surface"]),
    ("appearance", &["colliders"]),
    ("palette", &["appearance"]),
    ("channels", &["diagnostics", "colliders"]),
    ("points", &["colliders", "appearance", "palette"]),
    ("picture", &["excerpt", "colliders", "appearance", "palette"]),
    (
        "writer",
        &[
            "provenance",
            "embedded",
            "files",
            "excerpt",
            "diagnostics",
            "colliders",
            "appearance",
            "channels",
            "points",
            "picture",
        ],
    ),
    ("cloud", &[]),
    ("index", &[]),
    ("solids", &["surface"]),
    ("frames", &["embedded", "files", "cloud", "index", "solids"]),
    ("export", &["arrays", "cloud", "files", "frames"]),
    ("scenery", &["excerpt", "appearance", "cloud"]),
    ("render", &["files", "excerpt", "appearance", "palette", "picture", "cloud", "export", "scenery"]),
    (
        "reconstruction",
        &["provenance", "files", "excerpt", "appearance", "palette", "cloud", "frames", "export", "scenery"],
    ),
    ("recovery", &["files", "index"]),
    ("growing", &["files", "index"]),
    ("checkpoint", &["provenance", "files"]),
    ("run", &["files", "appearance", "picture", "writer", "checkpoint", "state"]),
];

pub const SERVICE: &[Layer] = &[("store", &[]), ("jobs", &["store"]), ("http", &["store", "jobs"])];

pub const ROOT: &[Layer] =
    &[("bench", &[]), ("laboratory", &[]), ("verify", &[]), ("cli", &["bench", "laboratory", "verify"])];

/// Crates that only some folders may name.
pub const OWNED: &[(&str, &[&str])] = &[
    ("wgpu", &["src/engine/gpu/", "src/engine/explicit/gpu/", "src/engine/implicit/gpu/"]),
    ("axum", &["src/service/http/"]),
    ("sqlx", &["src/service/store/"]),
    ("kube", &["src/service/jobs/cluster/"]),
    ("k8s_openapi", &["src/service/jobs/cluster/"]),
    ("mcap", &["src/recording/"]),
    ("foxglove", &["src/recording/"]),
];
