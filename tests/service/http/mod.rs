//! The server as its users see it: a process, a port and HTTP.

mod assets;
mod clients;
mod dashboard;
mod docs;
mod errors;
mod exports;
mod frames;
mod groups;
mod hostile;
mod keys;
mod lifecycle;
mod manners;
mod materials;
mod openapi;
mod outputs;
mod pictures;
mod receiver;
pub mod support;
mod tls;
mod watching;
mod webhooks;
