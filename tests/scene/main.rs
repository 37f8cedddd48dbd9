//! Scenes: documents, all their faults at once, shapes, meshes, and particles from files.

mod cases;
mod documents;
mod faults;
mod meshes;
mod points;
mod shapes;
