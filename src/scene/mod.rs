//! Scenes: the versioned JSON that users write, its faults, and its way to a [`crate::sim::problem::Problem`].

pub mod schema;
