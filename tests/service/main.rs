//! The service as its users meet it: real server processes over HTTP, jobs that meet every fate, recordings in the official reader.

mod http;
mod jobs;
mod recording;
