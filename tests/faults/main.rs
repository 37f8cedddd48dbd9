//! Whatever dies, every accepted job ends as promised, and nobody sees in its outputs that something died.
//!
//! `GRIDFALL_KILLS` sets how often a server is killed on each database (12 by default).

#[path = "../common/postgres.rs"]
mod postgres;
#[path = "../service/http/support.rs"]
mod support;

mod kills;
mod outages;
mod races;
mod shutdown;
mod work;
