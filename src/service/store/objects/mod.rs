//! Object storage (S3) behind the data directories: where the outputs of jobs and the uploads lie for all machines.
//!
//! Below the prefix the objects are named as files are in a data directory. What a machine has of them is a copy, which
//! may be removed at any time, but for what its own attempts have not published yet.

mod attempt;
mod bucket;
mod lists;
mod local;

use std::path::Path;
use std::sync::Arc;

// Its features choose what TLS is spoken by.
use reqwest as _;
use tokio::runtime::Handle;
use tokio_rustls::rustls;

pub use attempt::{Publisher, Remote, Saver};
pub use bucket::ObjectsError;
pub use local::make_room;

use bucket::Bucket;
use local::Turns;

type Result<T, E = ObjectsError> = std::result::Result<T, E>;

/// A bucket, or what is below a prefix in one. Cheap to clone.
#[derive(Clone, Debug)]
pub struct Objects {
    bucket: Bucket,
    turns: Arc<Turns>,
    runtime: Handle,
}

impl Objects {
    /// Of a URL, `s3://BUCKET` or `s3://BUCKET/PREFIX`; the endpoint, the region and the credentials come from the
    /// environment (`AWS_…`). Fails if it cannot be reached, or does not keep two writers apart. Call inside a tokio
    /// runtime.
    pub async fn open(url: &str) -> Result<Self> {
        // The client takes the process's; where there is one already, it is the same.
        let _ = rustls::crypto::ring::default_provider().install_default();
        let bucket = Bucket::of(url)?;
        bucket.try_out().await?;
        Ok(Self { bucket, turns: Arc::default(), runtime: Handle::current() })
    }

    /// Waits for an answer. For threads that are not the runtime's.
    pub fn wait<T>(&self, answer: impl Future<Output = T>) -> T {
        self.runtime.block_on(answer)
    }

    /// Makes sure that what is below the prefix is of the job database with this identity, and of no other.
    pub async fn belong_to(&self, identity: &str) -> Result<()> {
        const KEY: &str = "database";
        if self.bucket.create(KEY, identity.as_bytes().to_vec()).await? {
            return Ok(());
        }
        let there = self.bucket.get(KEY).await?.unwrap_or_default();
        if there == identity.as_bytes() { Ok(()) } else { Err(ObjectsError::Foreign(self.bucket.place().to_owned())) }
    }

    /// Keeps an upload for all machines, unless it is there already.
    pub(super) async fn put_asset(&self, name: &str, file: &Path) -> Result<()> {
        let key = format!("assets/{name}");
        if self.bucket.has(&key).await? {
            return Ok(());
        }
        let bytes = file.metadata().map_err(ObjectsError::io(file))?.len();
        self.bucket.put_file(&key, file, 0..bytes).await
    }

    /// The names and sizes of all uploads.
    pub(super) async fn assets(&self) -> Result<Vec<(String, u64)>> {
        self.bucket.list("assets").await
    }

    /// Brings an upload here.
    pub(super) async fn fetch_asset(&self, name: &str, bytes: u64, to: &Path) -> Result<()> {
        self.bucket.append(&format!("assets/{name}"), 0..bytes, to).await
    }
}
