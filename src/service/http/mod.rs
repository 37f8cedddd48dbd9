//! The HTTP API. `router` lists all of it on one page.

mod assets;
mod colliders;
mod conditional;
mod connections;
mod cors;
mod dashboard;
mod devices;
mod docs;
mod dto;
mod encoding;
mod estimate;
mod events;
mod exports;
mod extract;
mod file;
mod filters;
mod follow;
mod frames;
mod groups;
mod guard;
mod health;
mod index;
mod jobs;
mod laboratory;
mod layers;
mod library;
mod live;
mod load;
mod materials;
mod metrics;
mod openapi;
mod outputs;
mod pages;
mod pictures;
mod problem;
mod range;
mod router;
mod sceneries;
mod scenes;
mod server;
mod state;
mod submission;
mod surfaces;
mod sweeps;
mod tables;
mod viewer;
mod watch;

pub use docs::markdown as error_codes;
pub use openapi::{document, document_json};
pub use router::router;
pub use server::{Options, ServeError, serve};
pub use state::{Api, Config};

#[cfg(test)]
mod tests;
