//! The service as its users see it: real server processes over HTTP, jobs that meet every fate,
//! a store that keeps them on two databases, and recordings read with the official reader and in viewers.

mod containers;
mod guide;
mod http;
mod jobs;
#[path = "../common/postgres.rs"]
mod postgres;
mod recording;
mod reference;
mod store;
mod viewers;
