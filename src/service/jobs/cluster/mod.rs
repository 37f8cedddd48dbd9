//! A cluster's scheduler in the place of the server's own workers.
//!
//! The job's row stays the truth. What the scheduler gets is an offer of one attempt; the process that it starts claims
//! the job, renews the lease and ends the job, as a worker of the server does. The dispatcher makes offers, and looks
//! what became of those that the scheduler had done with while the job had not.

mod dispatch;
mod slurm;

use std::collections::HashMap;
use std::path::PathBuf;
use std::pin::Pin;

pub use dispatch::Dispatcher;
pub use slurm::{Slurm, SlurmOptions};

use uuid::Uuid;

use crate::store::Candidate;

/// A request that was not met, with what the scheduler said.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct ClusterError(pub String);

/// What became of an offer.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum State {
    /// It waits to be started, perhaps once more after the scheduler has taken back its place; the scheduler's word for
    /// what it waits for.
    Waiting(String),
    /// It runs, or is about to end.
    Alive,
    /// Its process ended without an error.
    Completed,
    /// Its process ended with one, or was killed; the scheduler's word for it.
    Failed(String),
    /// Somebody canceled it there.
    Canceled,
    TimedOut,
    /// It lost its place to another, or its node; the scheduler's word for it.
    Displaced(String),
}

/// What the scheduler shows of one of its jobs.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Seen {
    pub state: State,
    /// That of its [`Batch`]; empty where the scheduler has forgotten it. A name alone tells little: a controller that
    /// crashes may give it out again.
    pub comment: String,
}

impl Seen {
    /// Whether this is of the job, or of its sweep.
    pub fn is_of(&self, job: Uuid, sweep: Option<Uuid>) -> bool {
        let comment = &self.comment;
        comment.is_empty() || *comment == job.to_string() || sweep.is_some_and(|sweep| *comment == sweep.to_string())
    }
}

/// Attempts that are offered together. They differ in nothing that the scheduler sees.
#[derive(Clone, Debug)]
pub struct Batch {
    /// By the number of the task. There is at least one.
    pub jobs: Vec<Candidate>,
    /// For people who look at the scheduler's list: the job's name, or that of the sweep.
    pub name: String,
    /// The id of the job, or of the sweep.
    pub comment: String,
    /// The longest wall time that was foretold for one of them (s).
    pub estimate_s: f64,
    /// The number of the attempt.
    pub attempt: i64,
    /// The most deaths that one of them has had without a newer checkpoint: it gets more time.
    pub deaths: i64,
}

/// The answer to a question to the scheduler.
pub type Answer<'a, T> = Pin<Box<dyn Future<Output = Result<T, ClusterError>> + Send + 'a>>;

/// A scheduler. All verbs may be repeated.
pub trait Cluster: Send + Sync {
    /// Its name, for people.
    fn name(&self) -> &'static str;

    /// Most jobs of one batch.
    fn largest_batch(&self) -> usize;

    /// Offers attempts. Returns the scheduler's name of each, in their order.
    fn submit<'a>(&'a self, batch: &'a Batch) -> Answer<'a, Vec<String>>;

    /// Ends what there is of these, running or not.
    fn cancel<'a>(&'a self, jobs: &'a [String]) -> Answer<'a, ()>;

    /// What became of these. Those that the scheduler does not know, or no longer, are left out. Asked for none, it
    /// tells whether there is a scheduler.
    fn observe<'a>(&'a self, jobs: &'a [String]) -> Answer<'a, HashMap<String, Seen>>;

    /// The file with what the process of an offer wrote.
    fn output(&self, job: &str) -> PathBuf;
}
