//! Which build of Gridfall this is.

/// Version of the package.
pub const VERSION: &str = env!("CARGO_PKG_VERSION");
/// Commit that a release was built from; `unknown` in development builds.
pub const COMMIT: &str = env!("GRIDFALL_COMMIT");
/// Target triple.
pub const TARGET: &str = env!("GRIDFALL_TARGET");
