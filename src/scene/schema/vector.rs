//! Vectors and matrices as a document writes them.

/// A vector of the scene's dimension (2 or 3 components).
pub type Vector = Vec<f64>;
/// A square matrix of the scene's dimension, rows first.
pub type Matrix = Vec<Vec<f64>>;
