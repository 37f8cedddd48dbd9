//! The service as its users see it: real server processes over HTTP, jobs that meet every fate, and
//! recordings read with the official reader.

mod http;
mod jobs;
mod recording;
