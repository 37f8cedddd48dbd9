//! Scenes: documents, all their faults at once, shapes, bodies, layers, meshes, and particles from files.

mod bodies;
mod cases;
mod conforming;
mod documents;
mod faults;
mod meshes;
mod points;
mod shapes;
