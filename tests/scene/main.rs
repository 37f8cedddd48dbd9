//! Scenes: documents, all their faults at once, shapes, bodies, meshes, and particles from files.

mod bodies;
mod cases;
mod documents;
mod faults;
mod meshes;
mod points;
mod shapes;
