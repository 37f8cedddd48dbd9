//! The requests to the object storage.

use std::io;
use std::ops::Range;
use std::path::{Path as FilePath, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use bytes::Bytes;
use futures_util::{StreamExt, TryStreamExt};
use http::Method;
use object_store::aws::{AmazonS3, AmazonS3Builder, AmazonS3ConfigKey, S3ConditionalPut};
use object_store::path::Path;
use object_store::signer::Signer;
use object_store::{
    BackoffConfig, ClientOptions, ObjectStore, ObjectStoreExt, PutMode, PutOptions, PutPayload, RetryConfig,
    WriteMultipart,
};
use tokio::io::{AsyncReadExt, AsyncSeekExt, AsyncWriteExt};
use uuid::Uuid;

use super::Result;

/// What is sent or asked for at a time (bytes). S3 wants parts of at least 5 MiB.
const PART_BYTES: u64 = 8 << 20;
/// Parts of one object. S3 takes 10,000.
const MOST_PARTS: u64 = 9000;
/// Parts that are on their way at a time.
const PARTS_ON_THE_WAY: usize = 4;
/// How long one request is repeated. Who must not fail begins anew.
const PATIENCE: Duration = Duration::from_secs(10);
/// How long one request may take.
const TIMEOUT: Duration = Duration::from_secs(60);

#[derive(Debug, thiserror::Error)]
pub enum ObjectsError {
    #[error(
        "--files: {fault}; give s3://BUCKET or s3://BUCKET/PREFIX, and AWS_ENDPOINT_URL for a server other than \
        Amazon's"
    )]
    Url { fault: String },
    #[error(
        "--files: {place} cannot be used: {reason}; check the address, the bucket, AWS_REGION, \
        AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY"
    )]
    Unusable { place: String, reason: String },
    #[error(
        "--files: {place} ignores If-None-Match: two processes could publish different recordings as the same one; \
        use storage that supports conditional writes"
    )]
    Unconditional { place: String },
    #[error("--files: {0} has the files of another job database; give each database a prefix of its own")]
    Foreign(String),
    #[error("the object storage failed: {0}")]
    Failed(#[from] object_store::Error),
    #[error("{path}: {error}")]
    Io { path: PathBuf, error: io::Error },
    #[error("the object storage holds another {0}: it was published by another process")]
    Taken(String),
    #[error("another process is about to write {0}")]
    Busy(String),
    #[error("the object storage holds no sound {0}")]
    Damaged(String),
    #[error("{path} has no room for {bytes} bytes of the object storage; remove files, or lower --cache-bytes")]
    Full { path: PathBuf, bytes: u64 },
}

impl ObjectsError {
    /// Whether an object is not there.
    pub fn is_missing(&self) -> bool {
        matches!(self, Self::Failed(object_store::Error::NotFound { .. }))
    }

    /// What users of jobs are told. The rest, with addresses and what the storage said, is for the server's log.
    pub fn brief(&self) -> String {
        match self {
            Self::Failed(object_store::Error::NotFound { .. }) => "the object storage lacks an object".into(),
            Self::Failed(_) => {
                "the object storage does not answer, or refuses; the server's log has what it says".into()
            }
            other => other.to_string(),
        }
    }

    pub fn io(path: &FilePath) -> impl FnOnce(io::Error) -> Self {
        move |error| Self::Io { path: path.to_owned(), error }
    }
}

#[derive(Clone)]
pub(super) struct Bucket {
    store: Arc<AmazonS3>,
    prefix: String,
    place: String,
}

impl std::fmt::Debug for Bucket {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.place)
    }
}

impl Bucket {
    pub fn of(url: &str) -> Result<Self> {
        let fault = |fault: &str| ObjectsError::Url { fault: format!("{url:?} {fault}") };
        let rest = url.strip_prefix("s3://").ok_or_else(|| fault("is no address of S3"))?;
        let (bucket, prefix) = rest.split_once('/').unwrap_or((rest, ""));
        if bucket.is_empty() {
            return Err(fault("names no bucket"));
        }
        if bucket.contains(['@', ':', '?']) {
            // It may have a password, which is not for logs.
            let fault = "the address has more than a bucket; credentials and the endpoint come from the environment";
            return Err(ObjectsError::Url { fault: fault.into() });
        }
        let prefix = prefix.trim_matches('/').to_owned();
        Path::parse(&prefix).map_err(|error| fault(&format!("has no sound prefix ({error})")))?;
        let backoff = BackoffConfig { max_backoff: Duration::from_secs(2), ..BackoffConfig::default() };
        let retry = RetryConfig { backoff, max_retries: 10, retry_timeout: PATIENCE };
        let client = ClientOptions::new().with_timeout(TIMEOUT).with_connect_timeout(Duration::from_secs(5));
        let mut builder = AmazonS3Builder::from_env()
            .with_bucket_name(bucket)
            .with_retry(retry)
            .with_client_options(client)
            .with_conditional_put(S3ConditionalPut::ETagMatch);
        // Whoever gives an address without TLS means it.
        let endpoint = builder.get_config_value(&AmazonS3ConfigKey::Endpoint);
        if endpoint.is_some_and(|endpoint| endpoint.starts_with("http://")) {
            builder = builder.with_allow_http(true);
        }
        let store = builder.build().map_err(|error| fault(&format!("cannot be used: {error}")))?;
        Ok(Self { store: Arc::new(store), prefix, place: url.to_owned() })
    }

    fn path(&self, key: &str) -> Path {
        Path::from(format!("{}/{key}", self.prefix))
    }

    /// Writes an object twice, of which the second must fail.
    pub async fn try_out(&self) -> Result<()> {
        let key = format!("probe/{}", Uuid::now_v7());
        let unusable = |error: ObjectsError| ObjectsError::Unusable { place: self.place.clone(), reason: root(&error) };
        self.create(&key, b"gridfall".to_vec()).await.map_err(unusable)?;
        let again = self.create(&key, b"gridfall".to_vec()).await.map_err(unusable)?;
        if again {
            return Err(ObjectsError::Unconditional { place: self.place.clone() });
        }
        self.delete(vec![key]).await.map_err(unusable)
    }

    pub fn place(&self) -> &str {
        &self.place
    }

    pub async fn has(&self, key: &str) -> Result<bool> {
        match self.store.head(&self.path(key)).await {
            Ok(_) => Ok(true),
            Err(object_store::Error::NotFound { .. }) => Ok(false),
            Err(error) => Err(error.into()),
        }
    }

    pub async fn put(&self, key: &str, bytes: Vec<u8>) -> Result<()> {
        self.store.put(&self.path(key), PutPayload::from(bytes)).await?;
        Ok(())
    }

    /// Writes what must not be there yet. Returns false if it was.
    pub async fn create(&self, key: &str, bytes: Vec<u8>) -> Result<bool> {
        let options = PutOptions { mode: PutMode::Create, ..PutOptions::default() };
        match self.store.put_opts(&self.path(key), PutPayload::from(bytes), options).await {
            Ok(_) => Ok(true),
            Err(object_store::Error::AlreadyExists { .. }) => Ok(false),
            Err(error) => Err(error.into()),
        }
    }

    /// A part of a file. An object is there as a whole or not at all.
    pub async fn put_file(&self, key: &str, file: &FilePath, part: Range<u64>) -> Result<()> {
        let io = ObjectsError::io;
        let mut from = tokio::fs::File::open(file).await.map_err(io(file))?;
        from.seek(io::SeekFrom::Start(part.start)).await.map_err(io(file))?;
        let mut left = part.end - part.start;
        let size = PART_BYTES.max(left.div_ceil(MOST_PARTS));
        let mut next = async move || {
            let mut bytes = vec![0; left.min(size) as usize];
            left -= bytes.len() as u64;
            from.read_exact(&mut bytes).await.map_err(io(file)).map(|_| bytes)
        };
        if part.end - part.start <= PART_BYTES {
            return self.put(key, next().await?).await;
        }
        let upload = self.store.put_multipart(&self.path(key)).await?;
        let mut upload = WriteMultipart::new_with_chunk_size(upload, size as usize);
        let mut sent = part.start;
        while sent < part.end {
            let step = async {
                let bytes = next().await?;
                upload.wait_for_capacity(PARTS_ON_THE_WAY).await?;
                Ok(bytes)
            };
            match step.await {
                Ok(bytes) => {
                    sent += bytes.len() as u64;
                    upload.put(Bytes::from(bytes));
                }
                Err(error) => {
                    // What is not completed is nothing that anyone sees; where it cannot be removed, the bucket's
                    // rules for unfinished uploads do.
                    let _ = upload.abort().await;
                    return Err(error);
                }
            }
        }
        upload.finish().await?;
        Ok(())
    }

    /// `None` where there is no such object.
    pub async fn get(&self, key: &str) -> Result<Option<Vec<u8>>> {
        match self.store.get(&self.path(key)).await {
            Ok(found) => Ok(Some(found.bytes().await?.to_vec())),
            Err(object_store::Error::NotFound { .. }) => Ok(None),
            Err(error) => Err(error.into()),
        }
    }

    /// Bytes of an object, at most [`PART_BYTES`] of them.
    pub async fn range(&self, key: &str, range: Range<u64>) -> Result<Bytes> {
        let end = range.end.min(range.start + PART_BYTES);
        Ok(self.store.get_range(&self.path(key), range.start..end).await?)
    }

    /// Writes a part of an object behind what a file has.
    pub async fn append(&self, key: &str, mut part: Range<u64>, file: &FilePath) -> Result<()> {
        let io = ObjectsError::io;
        let mut to = tokio::fs::OpenOptions::new().create(true).append(true).open(file).await.map_err(io(file))?;
        while !part.is_empty() {
            let bytes = self.range(key, part.clone()).await?;
            if bytes.is_empty() {
                return Err(ObjectsError::Damaged(key.to_owned()));
            }
            part.start += bytes.len() as u64;
            to.write_all(&bytes).await.map_err(io(file))?;
        }
        to.flush().await.map_err(io(file))
    }

    /// What is below a key: names behind it, and sizes (bytes).
    pub async fn list(&self, key: &str) -> Result<Vec<(String, u64)>> {
        let below = self.path(key);
        let found: Vec<_> = self.store.list(Some(&below)).try_collect().await?;
        let name = |path: &Path| path.as_ref()[below.as_ref().len()..].trim_start_matches('/').to_owned();
        Ok(found.iter().map(|object| (name(&object.location), object.size)).collect())
    }

    /// The folders right below a key.
    pub async fn folders(&self, key: &str) -> Result<Vec<String>> {
        let found = self.store.list_with_delimiter(Some(&self.path(key))).await?;
        Ok(found.common_prefixes.iter().filter_map(|path| path.filename().map(str::to_owned)).collect())
    }

    pub async fn delete(&self, keys: Vec<String>) -> Result<()> {
        let paths: Vec<_> = keys.iter().map(|key| Ok(self.path(key))).collect();
        let mut deleted = self.store.delete_stream(futures_util::stream::iter(paths).boxed());
        while let Some(one) = deleted.next().await {
            match one {
                Ok(_) | Err(object_store::Error::NotFound { .. }) => {}
                Err(error) => return Err(error.into()),
            }
        }
        Ok(())
    }

    /// Deletes all that is below a key.
    pub async fn delete_below(&self, key: &str) -> Result<()> {
        let keys = self.list(key).await?.into_iter().map(|(name, _)| format!("{key}/{name}")).collect();
        self.delete(keys).await
    }

    /// An address by which anyone can read an object for a while.
    pub async fn signed(&self, key: &str, time: Duration) -> Result<String> {
        Ok(self.store.signed_url(Method::GET, &self.path(key), time).await?.to_string())
    }
}

/// What an error comes down to.
fn root(error: &dyn std::error::Error) -> String {
    let mut error = error;
    while let Some(source) = error.source() {
        error = source;
    }
    error.to_string()
}
