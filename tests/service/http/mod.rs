//! The server as its users see it: a process, a port and HTTP.

mod assets;
mod errors;
mod groups;
mod lifecycle;
mod manners;
mod openapi;
mod outputs;
mod support;
mod watching;
