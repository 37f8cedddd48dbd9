//! A cluster's scheduler in the place of the server's own workers.
//!
//! The job's row stays the truth. What the scheduler gets is an offer of one attempt; the process that it starts claims
//! the job, renews the lease and ends the job, as a worker of the server does. The dispatcher makes offers, and looks
//! what became of those that the scheduler had done with while the job had not.

mod dispatch;
mod kubernetes;
mod slurm;

use std::collections::HashMap;
use std::pin::Pin;

pub use dispatch::Dispatcher;
pub use kubernetes::{Kubernetes, KubernetesOptions};
pub use slurm::{Slurm, SlurmOptions};

use uuid::Uuid;

use crate::store::Candidate;

/// The time of an attempt (min): at least so much, and so many times what was foretold. It is doubled for each death
/// without a newer checkpoint, up to so often.
const LEAST_MINUTES: f64 = 10.0;
const TIMES_FORETOLD: f64 = 4.0;
const DOUBLED: i64 = 6;

/// A request that was not met.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ClusterError {
    /// The scheduler does not want it; what it said.
    #[error("{0}")]
    Refused(String),
    /// The scheduler does not answer, or has no time. It would say the same to all requests.
    #[error("{0}")]
    Away(String),
}

/// What became of an offer.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum State {
    /// It waits to be started, perhaps once more after the scheduler has taken back its place; the scheduler's word for
    /// what it waits for.
    Waiting(String),
    /// It has a place and is about to run, or runs already; the scheduler's word for what it waits for.
    Starting(String),
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

impl Batch {
    /// The time of an attempt (min).
    fn minutes(&self) -> u64 {
        let foretold = LEAST_MINUTES.max(TIMES_FORETOLD * self.estimate_s / 60.0);
        let doubled = self.deaths.clamp(0, DOUBLED);
        // About a year, where the foretold time makes no sense.
        (foretold * f64::from(1 << doubled)).ceil().min(500_000.0) as u64
    }
}

/// A name without what would disturb lists.
fn printable(name: &str) -> String {
    name.chars().filter(|c| !c.is_control() && *c != '|').take(80).collect()
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

    /// The last words of an offer's process, as far as they are known.
    fn last_words(&self, job: &str) -> String;

    /// Nobody will want to read what the process of an offer wrote.
    fn forget(&self, job: &str);
}
