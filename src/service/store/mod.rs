//! Jobs in SQLite or PostgreSQL, their outputs and the uploads in a directory, and in an object storage if there is
//! one.
//!
//! A worker holds the job that it has claimed by a lease, which its heartbeats renew. Every write of
//! an attempt names the attempt (its fencing token) and does nothing once the job has moved on. So
//! a wrong clock can cost work, by a lease that ends early, but loses no job and doubles none.

mod assets;
mod attempts;
mod clock;
mod database;
mod deliveries;
mod files;
mod filter;
mod gathered;
mod groups;
mod hashed;
mod insertion;
mod job;
mod keys;
mod objects;
mod offers;
mod requests;
mod row;
mod scenes;
mod submissions;
mod turns;
mod usage;
mod webhooks;

use std::path::{Path, PathBuf};
use std::time::Duration;

use uuid::Uuid;

pub use assets::{Asset, AssetFiles};
pub use deliveries::{Delivery, DeliveryStatus, Reply, Verdict};
pub use files::{AttemptFiles, DataDir, JobFiles};
pub use filter::Filter;
pub use groups::Sweep;
pub use job::{Failure, Job, NewJob, NewSweep, Owner, Progress, Status};
pub use keys::{Key, MAX_KEY_NAME, NewKey, Quotas, Scope, Secret, Standing};
pub use objects::{Objects, ObjectsError, Publisher, Remote, Saver};
pub use offers::{Candidate, Leftover, Offer, OfferEnd, Taken, owner};
pub use scenes::SceneFiles;
pub use usage::{USAGE_DAYS, Upload, Usage};
pub use webhooks::{EventType, NewWebhook, Subject, Webhook};

use clock::Clock;
use database::{CONNECTIONS, Database};
use gathered::Gathered;
use gridfall_recording::provenance;
use submissions::NewSubmission;

/// A job whose attempts end by the death of their process or device this often in a row, without a
/// newer checkpoint between them, is given up.
pub const MAX_DEATHS: i64 = 5;

/// How long a worker holds a job without a heartbeat.
pub const LEASE: Duration = Duration::from_secs(15);

#[derive(Debug, thiserror::Error)]
pub enum StoreError {
    #[error("{path}: another gridfall server uses this data directory; stop it or give --data-dir another one")]
    Locked { path: PathBuf },
    #[error("{path}: {error}")]
    Io { path: PathBuf, error: std::io::Error },
    #[error("{path}: cannot be opened as the job database: {error}; check that the file and its folder can be written")]
    Unopened { path: PathBuf, error: sqlx::Error },
    #[error(
        "--database: {fault}; give postgres://USER:PASSWORD@HOST/NAME, with %XX for characters that mean something in \
         addresses, or sqlite:PATH, or leave it out: jobs are then kept in the data directory"
    )]
    Url { fault: String },
    #[error(
        "--database: cannot connect to {place}: {reason}; start that database, or correct the address, the user or the \
         password"
    )]
    Unreachable { place: String, reason: String },
    #[error(transparent)]
    Objects(#[from] ObjectsError),
    #[error("the job database failed: {0}")]
    Database(#[from] sqlx::Error),
    #[error("the job database cannot be brought up to date: {0}")]
    Migrate(#[from] sqlx::migrate::MigrateError),
}

type Result<T, E = StoreError> = std::result::Result<T, E>;

/// Result of a submission of a job, or of a sweep by its id.
#[derive(Debug)]
pub enum Submission<T = Job> {
    Accepted(T),
    /// The same request under the same idempotency key was accepted before, as this one.
    Repeated(T),
    /// Another request was accepted under this idempotency key.
    KeyReused,
    QueueFull,
    /// So many jobs of its owner wait, and no more may.
    OwnerFull(i64),
}

/// Result of a deletion.
#[derive(Debug, PartialEq, Eq)]
pub enum Deletion {
    Deleted,
    /// Queued or running: must be canceled first.
    NotFinished(Status),
    NotFound,
}

/// How an attempt ended.
#[derive(Clone, Debug, PartialEq)]
pub enum Outcome {
    Succeeded,
    Failed(Failure),
    Canceled,
}

/// A job that a worker has claimed.
#[derive(Clone, Debug)]
pub struct Claim {
    pub id: Uuid,
    /// The fencing token of every write of this attempt.
    pub attempt: i64,
    pub scene: String,
    /// Attempts before this one that died, without a newer checkpoint between them.
    pub deaths: i64,
}

/// A job whose worker is gone, and what was done about it.
#[derive(Clone, Debug, PartialEq)]
pub struct Recovered {
    pub id: Uuid,
    /// `Queued`, `Failed` or `Canceled`.
    pub status: Status,
}

/// The table of jobs.
#[derive(Clone, Debug)]
pub struct JobStore {
    database: Database,
    clock: Clock,
    submissions: Gathered<NewSubmission, Submission>,
    reads: Gathered<Uuid, Option<Job>>,
}

impl JobStore {
    /// Opens or creates an SQLite database and migrates its schema.
    pub async fn open(path: &Path) -> Result<Self> {
        Ok(Self::on(Database::file(path).await?))
    }

    /// Opens the database of a URL, `postgres://…` or `sqlite:PATH`, and migrates its schema.
    pub async fn connect(url: &str) -> Result<Self> {
        Ok(Self::on(Database::url(url, CONNECTIONS).await?))
    }

    /// The same for one job, of many that run on a cluster: with as few connections as possible.
    pub async fn connect_sparingly(url: &str) -> Result<Self> {
        Ok(Self::on(Database::url(url, 1).await?))
    }

    fn on(database: Database) -> Self {
        Self { database, clock: Clock::default(), submissions: Gathered::default(), reads: Gathered::default() }
    }

    /// The same store with another clock (microseconds since the Unix epoch), for tests.
    pub fn with_clock(self, clock: impl Fn() -> i64 + Send + Sync + 'static) -> Self {
        // Its requests are not those of the other, which would be answered at the time of the other.
        Self { clock: Clock::new(clock), ..Self::on(self.database) }
    }

    pub async fn close(&self) {
        self.database.close().await;
    }

    /// Whether an error tells of a database that cannot be reached now, and may be soon.
    pub fn is_away(error: &StoreError) -> bool {
        matches!(error, StoreError::Database(error) if database::is_away(error))
    }

    /// Who this database is, among all.
    pub async fn identity(&self) -> Result<String> {
        Ok(sqlx::query_scalar("SELECT id FROM identity").fetch_one(&self.database.reader).await?)
    }

    /// Runs a trivial query, as proof of life.
    pub async fn ping(&self) -> Result<()> {
        sqlx::query("SELECT 1").execute(&self.database.reader).await?;
        Ok(())
    }
}

/// What writes recordings: another build may write other bytes.
fn build() -> String {
    format!("{} {}", provenance::VERSION, provenance::COMMIT)
}

fn known(status: String) -> Status {
    status.parse().expect("the table's check allows no other status")
}

#[cfg(test)]
mod tests;
