//! Scenes: documents, all their faults at once, bounds of plausibility, shapes, bodies, layers,
//! meshes and what is mended in them, particles from files; and commands that read scenes or make them.

mod bench;
mod bodies;
mod cases;
mod conforming;
mod documents;
mod faults;
mod laboratory;
mod leniency;
mod meeting;
mod mended;
mod meshes;
mod plausible;
mod points;
mod schema;
mod shapes;
mod sheets;
