//! Small fixed-size linear algebra in any scalar, decompositions, and compilation for wide vector
//! units.

pub mod linalg;
pub mod real;
mod single;
pub mod svd;
pub mod widest;
