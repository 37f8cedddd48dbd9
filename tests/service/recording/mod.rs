//! Recordings are valid, complete, true to the particles, and survive crashes: read back with the official Python library.

mod content;
mod driver;
mod fixture;
mod recovery;
