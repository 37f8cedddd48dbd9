//! Recordings are valid, complete and true to the particles, and survive crashes. They are read
//! back with the official Python library.

mod chunks;
mod content;
mod driver;
mod exports;
mod far;
mod fixture;
mod frames;
mod pictures;
mod recovery;
mod resuming;
mod states;
mod surfaces;
