//! Sources of material.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::body::Sampling;
use super::shape::Shape;
use super::vector::Vector;

/// A shape that emits material: a regular stream that moves with `velocity` appears where it enters the shape.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Source {
    /// Its own among bodies and sources.
    pub name: String,
    /// Name of an entry of `materials`, or a material as it would be there.
    pub material: String,
    /// Bounded; the way of the stream within a frame upstream of it must be inside the domain.
    pub shape: Shape,
    /// Of the stream (m/s); not zero.
    pub velocity: Vector,
    /// Time from which it emits (s); from the start by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub from: Option<f64>,
    /// Time at which it stops (s); at the end by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub until: Option<f64>,
    /// Particles per cell, a d-th power of a whole number; 8 by default (2D: 4).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub particles_per_cell: Option<u32>,
    /// `regular`, the only one for streams.
    #[serde(default)]
    pub sampling: Sampling,
}
