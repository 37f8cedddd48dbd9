//! Scenes: documents, all their faults at once, bounds of plausibility, shapes, bodies, meshes and what is
//! mended in them, and particles from files.

mod bodies;
mod cases;
mod documents;
mod faults;
mod mended;
mod meshes;
mod plausible;
mod points;
mod shapes;
