//! Recordings are valid, complete and true to the particles, and survive crashes. They are read
//! back with the official Python library.

mod content;
mod driver;
mod fixture;
mod frames;
mod recovery;
mod resuming;
mod states;
