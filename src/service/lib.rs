//! The service: jobs that are stored, run and served over HTTP.

pub mod http;
pub mod jobs;
pub mod store;
